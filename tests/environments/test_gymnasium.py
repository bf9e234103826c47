"""The environments keep to Gymnasium's rules, alone and many at once."""

import copy
import pickle
import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import helisim.gym
from helisim.base.errors import DisplayError, InputError, UnknownNameError
from helisim.gym.picture import render_modes

ROUGH = {
    "spread": helisim.gym.USUAL,
    "weather": helisim.gym.WeatherRange(wind=4.0, turbulence=6.0, gust=3.0),
}


def vector(task="Hover", count=5, mode="vector_entry_point", **settings):
    return gymnasium.make_vec(f"helisim/{task}-v0", count, vectorization_mode=mode, **settings)


def same(left, right):
    """Assert that two answers of environments are the same to the bit, infos too."""
    for one, other in zip(left[:-1], right[:-1]):
        assert one.dtype == other.dtype
        assert np.array_equal(one, other)
    assert left[-1].keys() == right[-1].keys()
    for name, value in left[-1].items():
        assert np.array_equal(value, right[-1][name]), name


@pytest.mark.parametrize(
    ("task", "settings"),
    [("Hover", {}), ("Track", {"action": "servos", **ROUGH})],
    ids=["hover", "rough track"],
)
def test_gymnasium_finds_nothing_to_say(task, settings):
    """Its checker neither fails nor warns, pictures included."""
    small = {"render_mode": "rgb_array", "width": 64, "height": 48}
    env = gymnasium.make(f"helisim/{task}-v0", **small, **settings).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env)
    env.close()


@pytest.mark.parametrize(
    ("task", "settings"),
    [("Hover", {}), ("Track", {}), ("Hover", {"action": "servos", **ROUGH})],
    ids=["hover", "track", "rough"],
)
def test_one_of_many_is_the_one_alone(task, settings):
    """Observations, rewards, ends and infos over several episodes, to the bit."""
    modes = ("vector_entry_point", "sync")
    many, alone = (vector(task, 3, mode, **settings) for mode in modes)
    same(many.reset(seed=3), alone.reset(seed=3))
    random, ended, late = np.random.default_rng(0), 0, 0
    for _ in range(530):
        actions = random.normal(0.0, 0.3, (3, 4)).astype(np.float32)
        answer = many.step(actions)
        same(answer, alone.step(actions))
        ended, late = ended + answer[2].sum(), late + answer[3].sum()
    assert ended > 0
    assert late > 0 or task == "Hover"


def flown(**settings):
    """Return all that a vector environment says in 60 steps."""
    env = vector(count=7, **settings)
    said = [env.reset(seed=11)[0]]
    random = np.random.default_rng(4)
    for _ in range(60):
        seen, reward, *_ = env.step(random.uniform(-0.5, 0.5, (7, 4)))
        said += [seen, reward]
    env.close()
    return b"".join(one.tobytes() for one in said)


def test_threads_change_nothing():
    """One thread, two or three: the same bytes, and another seed's are others."""
    assert len({flown(threads=threads, **ROUGH) for threads in (1, 2, 3)}) == 1


def test_seeds_count_on_or_are_given():
    """A seed is that of the first; a list is one each; none goes on drawing."""
    env = vector(count=3)
    counted, _ = env.reset(seed=7)
    listed, _ = env.reset(seed=[9, 8, 7])
    assert np.array_equal(counted, listed[::-1])
    assert env.np_random_seed == (9, 8, 7)
    assert not np.array_equal(env.reset()[0], listed)
    with pytest.raises(InputError, match="seed must be an integer, or 3, one each"):
        env.reset(seed=[1, 2])


def test_an_episode_starts_anew_as_the_mode_says():
    """In the next step, in the same one with what was seen last, or when it is told to."""
    crash = np.zeros((2, 4))
    far = {"motion": {"north": 10.5}}
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

    env = vector(count=2, autoreset_mode="SameStep")
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    env.reset(seed=0, options=far)
    answer = env.step(crash)
    assert answer[2].all()
    assert np.array_equal(answer[0], second[0])
    assert np.array_equal(np.stack(answer[4]["final_obs"]), first[0])
    assert list(answer[4]["final_info"]["ended"]) == ["distance", "distance"]

    env = vector(count=2, autoreset_mode=AutoresetMode.DISABLED)
    env.reset(seed=0, options=far)
    env.reset(options={"reset_mask": np.array([False, True]), "motion": {}})
    assert env.step(crash)[2].tolist() == [True, False]
    with pytest.raises(InputError, match=r"rows \[0\] have ended"):
        env.step(crash)
    env.reset(options={"reset_mask": np.array([True, False])})
    assert not env.step(crash)[2].any()
    with pytest.raises(InputError, match="reset_mask must be"):
        env.reset(options={"reset_mask": np.zeros(2, dtype=bool)})


def test_an_episode_is_out_of_time():
    """After as many steps as were asked for, the sum of the parts of a hover."""
    env = vector(count=2, max_episode_steps=7)
    env.reset(seed=0)
    late = [env.step(np.zeros((2, 4)))[3].tolist() for _ in range(16)]
    assert [k for k, one in enumerate(late) if one == [True, True]] == [6, 14]


def test_pictures_show_the_helicopter_move():
    """Pixels of the size that was asked for; another state, another picture."""
    env = gymnasium.make("helisim/Hover-v0", render_mode="rgb_array", width=160, height=120)
    env.reset(seed=0)
    first = env.render()
    assert first.shape == (120, 160, 3)
    assert first.std() > 10.0
    for _ in range(3):
        env.step(np.zeros(4, dtype=np.float32))
    assert not np.array_equal(env.render(), first)
    env.close()
    many = vector(count=2, render_mode="rgb_array", width=80, height=60)
    many.reset(seed=0)
    pictures = many.render()
    assert [picture.shape for picture in pictures] == [(60, 80, 3)] * 2
    many.close()


def test_no_window_without_a_display(monkeypatch):
    """One line, and the mode isn't listed."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    assert render_modes() == ["rgb_array"]
    with pytest.raises(DisplayError, match="no display"):
        gymnasium.make("helisim/Hover-v0", render_mode="human")


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"vehicle": "jr7000"}, "unknown vehicle 'jr7000'; .*did you mean jr700"),
        ({"action": "stick"}, "unknown setting.action 'stick'; available: sticks, servos"),
        ({"frameskip": 5}, "unknown setting of the environment 'frameskip'.*frame_skip"),
        ({"frame_skip": 0}, "frame_skip must be an integer 1 or more, got 0"),
        ({"timestep": 0.0005, "frame_skip": 6}, "a multiple of 4, got 6"),
        ({"integrator": "rk4"}, "RK4"),
        ({"authority": 0.0}, "authority must be a number above 0 and at most 1, got 0.0"),
        ({"task": "land"}, "unknown task 'land'; available: hover, track"),
        ({"weather": "windy"}, "weather must be .*Weather, WeatherRange, got 'windy'"),
        ({"spread": {"airframe.mas": 0.1}}, "unknown parameter 'airframe.mas'.*airframe.mass"),
        ({"spread": {"air.density": 1.0}}, "relative, from 0 to below 1, got 1.0"),
        ({"spread": {"air.ground_effect": 0.1}}, "is 0, which no relative spread changes"),
        ({"spread": {"gyro.period": 0.1}}, "can't be spread"),
        ({"spread": {"pilot.k_heave": 0.1}}, "can't be spread"),
        ({"spread": {"gyro.flight_mode": 0.1}}, "can't be spread"),
        ({"render_mode": "ansi"}, "unknown render_mode 'ansi'"),
        ({"threads": 0}, "threads must be an integer of 1 or more"),
    ],
)
def test_a_wrong_setting_is_one_clear_line(settings, says):
    """Received, expected, available."""
    with pytest.raises(InputError, match=says) as caught:
        helisim.gym.HelicopterEnv(**settings)
    assert "\n" not in str(caught.value)


def test_a_wrong_action_or_option_is_one_clear_line():
    """Shape, numbers, names."""
    env = helisim.gym.HelicopterEnv()
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"actions must be \(1, 4\), got \(1, 3\)"):
        env.step(np.zeros(3))
    with pytest.raises(InputError, match="got nan in rows"):
        env.step(np.array([0.0, np.nan, 0.0, 0.0]))
    with pytest.raises(UnknownNameError, match="unknown option of reset 'state'"):
        env.reset(options={"state": 1})
    with pytest.raises(UnknownNameError, match="unknown field of a motion 'x'"):
        env.reset(options={"motion": {"x": 1.0}})
    with pytest.raises(InputError, match="a command needs four finite numbers"):
        env.reset(options={"command": (1.0, 2.0)})
    with pytest.raises(InputError, match="a command needs four finite numbers, got 'hover'"):
        env.reset(options={"command": "hover"})
    with pytest.raises(InputError, match="motion must be a dict"):
        env.reset(options={"motion": 3})
    with pytest.raises(InputError, match="north must be a finite number, got 'far'"):
        env.reset(options={"motion": {"north": "far"}})
    with pytest.raises(InputError, match="actions must be numbers from -1 to 1, got <U1"):
        env.step(np.full(4, "a"))
    with pytest.raises(InputError, match="threads must be an integer"):
        vector(threads=0)
    with pytest.raises(InputError, match="position must be a number 0 or more m, got '1'"):
        helisim.gym.Start(position="1")
    with pytest.raises(InputError, match="wind must be a number 0 or more m/s, got 'light'"):
        helisim.gym.WeatherRange(wind="light")
    with pytest.raises(InputError, match="distance must be a number above 0, got '1'"):
        helisim.gym.Hover(distance="1")
    with pytest.raises(InputError, match="autoreset_mode 'later'"):
        vector(autoreset_mode="later")
    with pytest.raises(InputError, match="num_envs must be an integer"):
        helisim.gym.HelicopterVectorEnv(0)
    with pytest.raises(InputError, match="no window"):
        vector(render_mode="human")


@pytest.mark.parametrize(
    ("imports", "name"),
    [
        ("gymnasium", "helisim.gym:helisim/Hover-v0"),
        ("gymnasium, helisim", "helisim/Hover-v0"),
        ("helisim, gymnasium, helisim.gym", "helisim/Hover-v0"),
    ],
)
def test_an_import_registers(imports, name):
    """In a fresh process; behind gymnasium's, that of helisim is enough."""
    code = (
        f"import {imports}\n"
        f"env = gymnasium.make({name!r})\n"
        "print(env.reset(seed=1)[0].shape, env.spec.max_episode_steps)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "(17,) 500\n"), done.stderr


def test_registering_loads_nothing():
    """`import helisim` stays light behind gymnasium's, and neither needs the other."""
    code = (
        "import sys, gymnasium\n"
        "before = set(sys.modules)\n"
        "import helisim\n"
        "gymnasium.register_envs(helisim)\n"
        "print(*sorted({'mujoco', 'scipy', 'helisim.gym'} & (set(sys.modules) - before)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "\n"), done.stderr


def test_a_step_needs_a_reset_and_an_open_environment():
    """No helicopter flies from nowhere."""
    for env, action in ((helisim.gym.HelicopterEnv(), 4), (vector(count=2), (2, 4))):
        with pytest.raises(ResetNeeded, match="call reset"):
            env.step(np.zeros(action))
        env.reset(seed=1)
        env.step(np.zeros(action))
        env.close()
        env.close()
        with pytest.raises(ClosedEnvironmentError, match="make another"):
            env.step(np.zeros(action))
    some = vector(count=2)
    some.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ResetNeeded):
        some.step(np.zeros((2, 4)))


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
@pytest.mark.parametrize("count", [None, 3])
def test_a_copy_flies_on_as_the_original(copied, count):
    """In the midst of an episode of its own weather and parameters, and into the next one."""
    settings = {"action": "servos", "task": "track", **ROUGH}
    env = (
        helisim.gym.HelicopterEnv(**settings)
        if count is None
        else helisim.gym.HelicopterVectorEnv(count, max_episode_steps=25, **settings)
    )
    env.reset(seed=4)
    shape = (4,) if count is None else (count, 4)
    for _ in range(10):
        env.step(np.full(shape, 0.05))
    other = copied(env)
    for k in range(20):
        left, right = (one.step(np.full(shape, 0.02 * (k % 3))) for one in (env, other))
        assert np.array_equal(left[0], right[0])
        assert np.array_equal(left[1], right[1])
    assert np.array_equal(env.reset()[0], other.reset()[0])
    env.close()
    other.close()


def test_seeds_are_any_integers():
    """Of NumPy too, as an array."""
    one, other = vector(count=3), vector(count=3)
    left, right = one.reset(seed=np.arange(5, 8))[0], other.reset(seed=np.int64(5))[0]
    assert np.array_equal(left, right)
    with pytest.raises(InputError, match=r"seed must be an integer, or 3, one each, got 1\.5"):
        one.reset(seed=1.5)


def test_a_task_of_ones_own_is_flown():
    """A subclass sees and rewards; the engine stays as it is."""

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
    """Scalars and other shapes would be spread over all helicopters."""

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
    with pytest.raises(InputError, match=r"Three.command needs four finite numbers"):
        helisim.gym.HelicopterVectorEnv(5, task=Three()).reset()
    with pytest.raises(InputError, match="Blind needs observations"):
        helisim.gym.HelicopterVectorEnv(5, task=Blind())
