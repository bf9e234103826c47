"""The environments keep to Gymnasium's rules, alone and many at once."""

from unittest.mock import Mock

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

import helisim.gym
from command import python
from helisim.base.errors import DisplayError, InputError, UnknownNameError
from off_screen import draws
from tabled import tabled

WINDY = helisim.gym.WeatherRange(wind=4.0, turbulence=6.0, gust=3.0)
ROUGH = {"spread": helisim.gym.USUAL, "weather": WINDY}


def vector(task="Hover", count=5, mode="vector_entry_point", **settings):
    return gymnasium.make_vec(f"helisim/{task}-v0", count, vectorization_mode=mode, **settings)


def same(left, right):
    for one, other in zip(left[:-1], right[:-1]):
        assert one.dtype == other.dtype
        assert np.array_equal(one, other)
    same_infos(left[-1], right[-1])


def same_infos(left, right):
    assert left.keys() == right.keys()
    for name, value in left.items():
        if isinstance(value, dict):
            same_infos(value, right[name])
        else:
            assert np.array_equal(value, right[name]), name


DRAWN = """
import warnings
import gymnasium, helisim.gym, numpy
from gymnasium.utils.env_checker import check_env
made = dict(render_mode="rgb_array", width=160, height=120)
rough = dict(spread=helisim.gym.USUAL, action="servos")
env = gymnasium.make("helisim/Track-v0", **made, **rough).unwrapped
with warnings.catch_warnings():
    warnings.simplefilter("error")
    check_env(env)
env.close()
many = gymnasium.make_vec("helisim/Hover-v0", 2, vectorization_mode="vector_entry_point", **made)
many.reset(seed=0)
first = many.render()[0]
assert first.shape == (120, 160, 3)
assert first.std() > 10.0
for _ in range(3):
    many.step(numpy.zeros((2, 4)))
assert not numpy.array_equal(many.render()[0], first)
many.close()
"""


@pytest.mark.slow
def test_pictures_show_the_helicopter_move():
    """Gymnasium's checker finds nothing, pictures included; another state, another picture."""
    draws(DRAWN)


@pytest.mark.slow
def test_stable_baselines_standard_call_trains():
    """PPO on `make_vec_env`, whose pictures are never asked for; where that package is."""
    common = pytest.importorskip("stable_baselines3.common.env_util")
    from stable_baselines3 import PPO

    envs = common.make_vec_env("helisim/Hover-v0", n_envs=4)
    agent = PPO("MlpPolicy", envs, n_steps=64, batch_size=64)
    agent.learn(512)
    assert agent.num_timesteps == 512
    envs.close()


@pytest.mark.slow
def test_a_learner_of_stable_baselines_sees_what_the_vector_environment_gives():
    """Episodes that end start anew in the same step, the last observation in the infos."""
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
    learners.close()
    many.close()


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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "settings"),
    [("Track", {}), ("Hover", {"action": "servos", **ROUGH})],
    ids=["track", "rough"],
)
def test_one_of_many_is_the_one_alone(task, settings):
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
    env = vector(count=7, **settings)
    said = [env.reset(seed=11)[0]]
    random = np.random.default_rng(4)
    for _ in range(60):
        seen, reward, *_ = env.step(random.uniform(-0.5, 0.5, (7, 4)))
        said += [seen, reward]
    env.close()
    return b"".join(one.tobytes() for one in said)


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
    """In a fresh process, behind gymnasium's; neither needs the other."""
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
    with pytest.raises(InputError, match=r"Three.command must be a list of 4 numbers"):
        helisim.gym.HelicopterVectorEnv(5, task=Three()).reset()
    with pytest.raises(InputError, match="Blind needs observations"):
        helisim.gym.HelicopterVectorEnv(5, task=Blind())
