"""What flies in an environment is the vehicle, and what is seen of it is true."""

import copy
import math

import gymnasium
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import helisim.gym
from helisim.gym.task import BOUND, Motions
from helisim.physics.layout import CONTROL, PARAM, STATE
from helisim.physics.native import installed
from helisim.sim import Weather
from helisim.vehicle import load
from helisim.vehicle.addresses import addresses
from helisim.vehicle.assembly import total_inertia
from helisim.vehicle.controller import set_controller
from helisim.vehicle.trim import Motion, place, write_motion
from tabled import tabled

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


def test_a_finer_time_step_flies_the_same():
    finer = load("jr700", timestep=0.001, integrator="Euler")
    coarse, fine = single(), single(vehicle=finer, frame_skip=20)
    for env in (coarse, fine):
        env.reset(seed=0, options=CALM)
        for k in range(50):
            env.step(np.array([0.05, 0.1, -0.1, 0.05]) * math.sin(0.2 * k))
    # after a second of flight; the positions are kept half a step ahead: 0.5 ms times 0.2 m/s
    np.testing.assert_allclose(qpos_and_qvel(coarse), qpos_and_qvel(fine), atol=2e-3)


def test_motions_are_read_as_they_were_written(jr700):
    random = np.random.default_rng(2)
    limits = [3.0] * 6 + [3.1, 1.5, 3.1] + [50.0] * 3
    motions = [Motion(*(random.uniform(-1, 1, 12) * limits).tolist()) for _ in range(20)]
    data, states = mujoco.MjData(jr700.model), []
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    for motion in motions:
        write_motion(jr700.model, data, motion)
        states.append(np.empty(mujoco.mj_stateSize(jr700.model, full)))
        mujoco.mj_getState(jr700.model, data, states[-1], full)
    velocity = 1 + jr700.model.nq
    flapping = velocity + jr700.model.nv + addresses(jr700.model).state + STATE.flap_a
    found = Motions.read(np.array(states), velocity, flapping)
    expected = np.array([list(vars(motion).values()) for motion in motions]).T
    for k, name in enumerate(("body_velocity", "rates", "attitude", "position")):
        np.testing.assert_allclose(getattr(found, name), expected[3 * k : 3 * k + 3], atol=1e-12)
    turns = Rotation.from_euler("ZYX", expected[8:5:-1].T)
    np.testing.assert_allclose(found.velocity.T, turns.apply(expected[0:3].T), atol=1e-12)


def test_a_hover_is_seen_as_its_table_says():
    """Each number times its scale is in its unit: north of the place is behind, heading west."""
    env = single()
    start = {"north": 3.0, "psi": math.pi / 2, "u": 0.5, "p": 0.2, "down": -1.0}
    seen, _ = env.reset(seed=0, options={"motion": start})
    values = {one.name: one.scale * value for one, value in zip(env.observations, seen)}
    trim = env._flights.vehicle.trim
    # heading east, 3 m north of the place: it is to the right
    expected = {"ahead": 0.0, "right": 3.0, "below": 1.0, "u": 0.5, "v": 0.0, "w": 0.0}
    expected |= {"heading_error_sine": -1.0, "heading_error_cosine": 0.0}
    expected |= {"phi": trim.phi, "theta": trim.theta, "p": 0.2, "q": 0.0, "r": 0.0}
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
    """A headwind that never changes is part of the trim: the helicopter stays where it is."""
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
