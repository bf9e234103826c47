"""The environments keep to Gymnasium's rules, alone and many at once."""

import copy
import math
from unittest.mock import Mock

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

import helisim.gym
from command import python
from helisim.base.errors import DisplayError, InputError, UnknownNameError
from helisim.gym.task import BOUND
from helisim.physics.layout import CONTROL, PARAM
from helisim.physics.native import installed
from helisim.sim import Weather
from helisim.vehicle import load
from helisim.vehicle.addresses import addresses
from helisim.vehicle.assembly import total_inertia
from helisim.vehicle.controller import set_controller
from helisim.vehicle.trim import place
from off_screen import draws
from tabled import section, tabled

WINDY = helisim.gym.WeatherRange(wind=4.0, turbulence=6.0, gust=3.0)
ROUGH = {"spread": helisim.gym.USUAL, "weather": WINDY}


def vector(task="Hover", count=5, mode="vector_entry_point", **settings):
    return gymnasium.make_vec(f"helisim/{task}-v0", count, vectorization_mode=mode, **settings)


DRAWN = section(globals(), "DRAWN")


@pytest.mark.slow
def test_pictures_show_the_helicopter_move():
    draws(DRAWN)


@pytest.mark.slow
def test_a_learner_of_stable_baselines_sees_what_the_vector_environment_gives():
    pytest.importorskip("stable_baselines3")
    from helisim.gym.stable_baselines import Helicopters

    learners = Helicopters("helisim/Hover-v0", 3, max_episode_steps=4)
    learners.seed(5)
    many = vector(count=3, max_episode_steps=4)
    assert np.array_equal(learners.reset(), many.reset(seed=5)[0])
    for step in range(1, 6):
        seen, rewards, ended, infos = learners.step(np.zeros((3, 4)))
        if step == 5:
            many.reset(options={"reset_mask": np.ones(3, dtype=bool)})
        expected, rewarded, *_, told = many.step(np.zeros((3, 4)))
        assert np.array_equal(rewards, rewarded.astype(np.float32))
        assert infos[1]["terms"]["speed"] == told["terms"]["speed"][1]
        assert all(ended == (step == 4))
        if step == 4:
            assert np.array_equal(infos[2]["terminal_observation"], expected[2])
            assert infos[2]["TimeLimit.truncated"]
        else:
            assert np.array_equal(seen, expected)
    with pytest.raises(InputError, match="not later"):
        learners.set_attr("authority", 0.1)
    with pytest.raises(InputError, match="call render of `envs`"):
        learners.env_method("render")
    learners.close()
    many.close()


@pytest.mark.slow
def test_the_standard_call_of_stable_baselines_learns():
    baselines = pytest.importorskip("stable_baselines3")
    many = baselines.common.env_util.make_vec_env("helisim/Hover-v0", n_envs=4)
    assert baselines.PPO("MlpPolicy", many, n_steps=16, batch_size=64).learn(64).num_timesteps == 64


def test_no_graphics_before_the_first_picture(monkeypatch):
    failing = Mock(side_effect=RuntimeError("no\ndisplay"))
    monkeypatch.setattr(mujoco, "Renderer", failing)
    env = helisim.gym.HelicopterEnv(render_mode="rgb_array")
    env.reset(seed=0)
    failing.assert_not_called()
    with pytest.raises(DisplayError, match="can't draw off screen: no display; set MUJOCO_GL"):
        env.render()
    env.close()
    with pytest.raises(InputError, match="no render_mode was given"):
        helisim.gym.HelicopterEnv().render()


def flown(**settings):
    env = vector(count=7, **settings)
    said = [env.reset(seed=11)[0]]
    random = np.random.default_rng(4)
    for _ in range(60):
        seen, reward, *_ = env.step(random.uniform(-0.5, 0.5, (7, 4)))
        said += [seen, reward]
    env.close()
    return b"".join(one.tobytes() for one in said)


@pytest.mark.slow
def test_threads_change_nothing_and_seeds_count_on_or_are_given():
    assert len({flown(threads=threads, **ROUGH) for threads in (1, 2, 3)}) == 1
    env = vector(count=3)
    counted, _ = env.reset(seed=np.int64(7))
    listed, _ = env.reset(seed=[9, 8, 7])
    assert np.array_equal(counted, listed[::-1])
    assert not np.array_equal(env.reset()[0], listed)
    for wrong in ({"seed": [1, 2]}, {"options": {"reset_mask": np.ones(2, dtype=bool)}}):
        with pytest.raises(InputError, match="reset needs 3 seeds and a reset_mask of 3 bool"):
            env.reset(**wrong)


def test_an_ended_episode_starts_anew_also_when_out_of_time():
    crash, far = np.zeros((2, 4)), {"motion": {"north": 10.5}}
    env = vector(count=2)
    env.reset(seed=0, options=far)
    first = env.step(crash)
    assert first[2].all()
    assert list(first[4]["ended"]) == ["distance", "distance"]
    second = env.step(crash)
    assert not second[2].any()
    assert not second[1].any()
    assert second[4]["_wind"].all()
    assert not second[4]["time"].any()
    env.reset(seed=0, options=far)
    env.reset(options={"reset_mask": np.array([False, True]), "motion": {}})
    assert env.step(crash)[2].tolist() == [True, False]
    env.reset(options={"reset_mask": np.array([True, False])})
    assert (env.step(crash)[4]["time"] > 0.0).all()
    some = vector(count=2)
    with pytest.raises(ResetNeeded, match="call reset"):
        some.step(crash)
    some.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ResetNeeded):
        some.step(crash)
    env = vector(count=2, max_episode_steps=7)
    env.reset(seed=0)
    late = [env.step(np.zeros((2, 4)))[3].tolist() for _ in range(16)]
    assert [k for k, one in enumerate(late) if one == [True, True]] == [6, 14]


@tabled("settings", "says")
def test_a_wrong_setting_is_one_clear_line(settings, says):
    with pytest.raises(InputError, match=says) as caught:
        helisim.gym.HelicopterEnv(**settings)
    assert "\n" not in str(caught.value)


def test_a_wrong_action_or_option_is_one_clear_line():
    env = helisim.gym.HelicopterEnv()
    env.reset(seed=0)
    for action, says in (
        (np.zeros(3), r"actions must be \(1, 4\) numbers .*, got \(1, 3\)"),
        (np.array([0.0, np.nan, 0.0, 0.0]), "some of them nan"),
    ):
        with pytest.raises(InputError, match=says):
            env.step(action)
    for options, error, says in (
        ({"state": 1}, UnknownNameError, "unknown setting of reset 'state'"),
        ({"motion": {"x": 1.0}}, UnknownNameError, r"unknown setting of reset.motion 'x'"),
        ({"command": (1.0, 2.0)}, InputError, r"reset.command must be a list of 4 numbers"),
    ):
        with pytest.raises(error, match=says):
            env.reset(options=options)
    finer = helisim.load("jr700", timestep=0.0005)
    with pytest.raises(InputError, match="a multiple of 4, got 6"):
        helisim.gym.HelicopterEnv(vehicle=finer, frame_skip=6)
    with pytest.raises(InputError, match="num_envs must be an integer"):
        helisim.gym.HelicopterVectorEnv(0)


@tabled("code", "printed")
def test_an_import_registers_and_loads_nothing(code, printed):
    code = f"import sys, gymnasium\nbefore = set(sys.modules)\nimport helisim\n{code}"
    assert python(code) == printed


def test_a_task_of_ones_own_is_flown():
    class Climb(helisim.gym.Hover):
        def reward(self, situation, seen):
            del seen
            return -situation.motions.velocity[2]

    env = gymnasium.make("helisim/Hover-v0", task=Climb())
    env.reset(seed=0, options={"motion": {}})
    up = [env.step(np.array([0.2, 0.0, 0.0, 0.0], dtype=np.float32))[1] for _ in range(20)]
    assert up[-1] > 0.2
    assert np.all(np.diff(up[2:]) > 0.0)


def test_a_task_that_gives_something_else_is_one_clear_line():
    class Scalar(helisim.gym.Hover):
        def reward(self, situation, seen):
            return 0.5

    class Taller(helisim.gym.Hover):
        def observe(self, situation):
            return np.vstack([super().observe(situation), situation.motions.time])

    class Three(helisim.gym.Hover):
        def command(self, random, height):
            return (0.0, 0.0, -height)

    class Blind(helisim.gym.Hover):
        observations = ()

    envs = helisim.gym.HelicopterVectorEnv(5, task=Scalar())
    envs.reset(seed=1)
    with pytest.raises(InputError, match=r"Scalar.reward must return \(5,\), .* got \(\)"):
        envs.step(np.zeros((5, 4)))
    with pytest.raises(InputError, match=r"Taller.observe must return \(17, 5\)"):
        helisim.gym.HelicopterVectorEnv(5, task=Taller()).reset()
    with pytest.raises(InputError, match=r"Three.command must be a list of 4 numbers"):
        helisim.gym.HelicopterVectorEnv(5, task=Three()).reset()
    with pytest.raises(InputError, match="Blind needs observations"):
        helisim.gym.HelicopterVectorEnv(5, task=Blind())


# What flies in an environment is the vehicle, and what is seen of it is true.

CALM = {"motion": {}}
"""Options of a start in the trim itself."""


def single(task="Hover", **settings):
    return gymnasium.make(f"helisim/{task}-v0", **settings).unwrapped


def qpos_and_qvel(env):
    model = env._flights.vehicle.model
    return env._flights.states[0, 1 : 1 + model.nq + model.nv]


@pytest.mark.parametrize("kind", ["sticks", "servos"])
def test_actions_fly_what_controls_fly_in_mujoco(kind):
    env = single(action=kind)
    env.reset(seed=0, options=CALM)
    vehicle = load("jr700", integrator="Euler")
    model, where = copy.copy(vehicle.model), addresses(vehicle.model)
    if kind == "servos":
        set_controller(model, None)
    data = mujoco.MjData(model)
    place(model, data, vehicle.trim, height=20.0)
    first = where.control + (CONTROL.col if kind == "sticks" else CONTROL.servo_front)
    centre = data.ctrl[first : first + 4].copy()
    random = np.random.default_rng(1)
    with installed():
        for _ in range(40):
            action = random.uniform(-0.2, 0.2, 4)
            env.step(action)
            data.ctrl[first : first + 4] = centre + 0.5 * action
            mujoco.mj_step(model, data, 10)
    # the pilot who moves the sticks writes them a few roundings later than the caller does
    np.testing.assert_allclose(qpos_and_qvel(env), [*data.qpos, *data.qvel], atol=1e-12)


def test_a_hover_is_seen_as_its_table_says():
    """Each number times its scale is in its unit: north of the place is behind, heading west."""
    env = single()
    moves = {"u": 0.5, "v": -0.2, "w": 0.1, "p": 0.2, "q": -0.1, "r": 0.3}
    start = {"north": 3.0, "psi": math.pi / 2, "down": -1.0, "phi": 0.1, "theta": -0.2, **moves}
    seen, _ = env.reset(seed=0, options={"motion": start})
    values = {one.name: one.scale * value for one, value in zip(env.observations, seen)}
    # heading east, 3 m north of the place: it is to the right
    expected = {"ahead": 0.0, "right": 3.0, "below": 1.0, **moves}
    trim = env._flights.vehicle.trim  # which angles are added to
    expected |= {"phi": trim.phi + 0.1, "theta": trim.theta - 0.2}
    expected |= {"heading_error_sine": -1.0, "heading_error_cosine": 0.0}
    expected |= {f"action_{k}": 0.0 for k in range(4)}
    assert values == pytest.approx(expected, abs=1e-6)  # of single precision


def test_rewards_are_what_the_documentation_says():
    env = single()
    env.reset(seed=0, options=CALM)
    # in 20 ms from the trim nothing moves
    assert env.step(np.zeros(4))[1] == pytest.approx(1.0, abs=1e-6)
    env.reset(seed=0, options={"motion": {"north": -2.0}})
    assert env.step(np.zeros(4))[1] == pytest.approx(1.0 / (1.0 + 4.0), abs=1e-6)
    # an action of 1 on one stick changes by 1 of what counts as 2
    env.reset(seed=0, options=CALM)
    moved, resting = (np.array([one, 0.0, 0.0, 0.0]) for one in (1.0, 0.0))
    rewarded = env.step(moved)
    seen = rewarded[0] * [one.scale for one in env.observations]
    missed = np.sum(seen[:3] ** 2) + np.sum(seen[5:8] ** 2) / 4.0
    missed += 2.0 * (1.0 - seen[4]) / 0.25 + np.sum(seen[10:13] ** 2) / 4.0
    missed += np.sum((moved - resting) ** 2) / 4.0
    assert rewarded[1] == pytest.approx(1.0 / (1.0 + missed), rel=1e-5)  # of single precision
    terms = rewarded[-1]["terms"]
    assert [*terms] == ["distance", "speed", "heading", "rate", "change"]
    assert terms["change"] == pytest.approx(0.25)
    assert rewarded[1] == pytest.approx(1.0 / (1.0 + sum(terms.values())), rel=1e-12)  # rounding


def test_a_command_is_tracked_and_changes():
    env = single("Track")
    seen, _ = env.reset(seed=5, options={"motion": {}, "command": (1.0, 2.0, -0.5, 0.0)})
    np.testing.assert_allclose(seen[:3], [1.0, 2.0, -0.5], atol=1e-6)
    env.reset(seed=5)
    commands = []
    for _ in range(450):
        env.step(np.zeros(4))
        commands.append(tuple(env._flights._commands[:, 0]))
    changes = [k for k in range(1, 450) if commands[k] != commands[k - 1]]
    assert changes == [199, 399]  # the steps that end at 4 and 8 s
    assert np.all(np.abs(commands) <= [3.0, 3.0, 0.5, math.pi])


@tabled("motion", "limit")
def test_an_episode_ends_at_each_limit(motion, limit):
    env = single(weather=Weather(height=5.0))
    env.reset(seed=0, options={"motion": motion})
    _, _, terminated, _, info = env.step(np.zeros(4))
    assert terminated
    assert info["ended"] == limit
    env.reset(seed=0, options={"motion": {name: 0.4 * value for name, value in motion.items()}})
    assert not env.step(np.zeros(4))[2]


def test_a_state_that_breaks_ends_the_episode():
    env = single(envelope=helisim.sim.FlightEnvelope.off())
    env.reset(seed=0, options={"motion": {"p": 1e200}})
    seen, reward, terminated, _, info = env.step(np.zeros(4))
    assert terminated
    assert info["ended"] in ("finite state", "distance")
    assert np.all(np.abs(seen) <= BOUND)
    assert 0.0 <= reward <= 1.0


def test_parameters_are_spread_in_the_model_and_a_heavier_one_sinks(jr700):
    """With a tenth more mass and the same thrust it starts to fall at g/11."""
    names = ("airframe.mass", "airframe.ixx", "airframe.izz", "air.density")
    env = single(spread=dict.fromkeys(names, 0.3))
    assert env.parameters == names
    model = env._flights._models[0]
    rotor, seen = addresses(model).rotor, []
    for seed in range(3):
        _, info = env.reset(seed=seed)
        mass, ixx, izz, density = info["factors"]
        seen.append(mass)
        assert model.body_mass.sum() == pytest.approx(mass * jr700.model.body_mass.sum())
        assert model.body_subtreemass[0] == pytest.approx(model.body_mass.sum())
        own = jr700.parameters
        expected = [ixx * own["airframe.ixx"], own["airframe.iyy"], izz * own["airframe.izz"]]
        found = total_inertia(model, "jr700")
        np.testing.assert_allclose(found, np.diag(expected), atol=1e-12)
        assert model.actuator_user[rotor, PARAM.air_density] == pytest.approx(density * 1.225)
    assert len(set(seen)) == 3
    assert np.all(np.abs(np.array(seen) - 1.0) <= 0.3)
    env = single(spread={"airframe.mass": 0.3}, envelope=helisim.sim.FlightEnvelope.off())
    _, info = env.reset(seed=0, options=CALM)
    for _ in range(5):
        seen, *_ = env.step(np.zeros(4))
    sinks = 9.8015 * (1.0 - 1.0 / info["factors"][0])
    # heave damping (Z_w near -0.9 1/s) takes up to 5 % of it in that time
    assert seen[7] == pytest.approx(0.1 * sinks, rel=0.08)


def test_weather_is_drawn_for_each_episode_and_steady_weather_trimmed_for():
    env = single(weather=helisim.gym.WeatherRange(wind=6.0, turbulence=8.0, gust=4.0))
    winds = []
    for seed in range(20):
        _, info = env.reset(seed=seed)
        winds.append(info["wind"])
        model = env._flights._models[0]
        np.testing.assert_allclose(model.opt.wind[:2], info["wind"] * [1.0, -1.0])
        par = model.actuator_user[addresses(model).rotor]
        assert par[PARAM.turbulence_on] == 1.0
        assert 0.0 <= np.hypot(par[PARAM.gust_north], par[PARAM.gust_east]) <= 4.0
    speeds = np.hypot(*np.array(winds).T)
    assert speeds.max() <= 6.0
    assert speeds.std() > 0.5
    assert len({tuple(np.sign(wind)) for wind in winds}) == 4
    env = single(weather=Weather(wind=5.0, height=15.0), start=helisim.gym.Start(position=0.0))
    _, info = env.reset(seed=0, options=CALM)
    np.testing.assert_allclose(info["wind"], [-5.0, 0.0], atol=1e-12)
    for _ in range(25):
        seen, *_ = env.step(np.zeros(4))
    assert np.all(np.abs(seen[:3]) < 0.01)
    # 0.3 of the tips' speed is 41 m/s through the air: 38 over the ground are too fast against it
    for speed in (38.0, -38.0):
        env.reset(seed=0, options={"motion": {"u": speed}})
        assert env.step(np.zeros(4))[2] == (speed > 0.0)


class Counting:
    """A law with a memory: it turns the nose, the faster the longer it flies."""

    states = 0

    def __init__(self):
        self.ticks = 0

    def reset(self):
        self.ticks = 0

    def __call__(self, seen):
        self.ticks += 1
        if seen.LAT > 0.4:
            raise RuntimeError("too far to the right")
        return seen.COL, seen.COL, seen.COL, 1e-4 * self.ticks


def test_a_controller_of_ones_own_flies_each_helicopter():
    vehicle = load("jr700", integrator="Euler").with_controller(Counting())
    settings = {"vehicle": vehicle, "weather": Weather(), "threads": 2}
    settings |= {"vectorization_mode": "vector_entry_point"}
    env = gymnasium.make_vec("helisim/Hover-v0", 3, **settings)
    env.reset(seed=0, options=CALM)
    actions = np.zeros((3, 4))
    for _ in range(20):
        seen, _, terminated, *_ = env.step(actions)
        assert not terminated.any()
    assert abs(seen[0, 12]) > 0.01
    assert np.array_equal(seen[0], seen[1])
    actions[1, 2] = 1.0
    _, _, terminated, _, infos = env.step(actions)
    assert terminated.tolist() == [False, True, False]
    assert infos["ended"][1] == "controller 'Counting' raised RuntimeError: too far to the right"
    env.close()
