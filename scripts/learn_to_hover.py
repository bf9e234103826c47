"""Learn to hover without a gyro: PPO moves the four servos of the bare helicopter, in minutes.

    python scripts/learn_to_hover.py [MILLIONS] [FOLDER]

It trains for so many millions of frames (1.5 if left out, some two minutes) on 64 helicopters at
once, prints the learning curve, and writes it as `curve.png` and the policy as `policy.zip` into
FOLDER (hover, if left out). Then the policy hovers helicopters that it has not met, without noise
on its actions. It needs stable-baselines3: pip install helisim[learn].
"""

import sys
from pathlib import Path
from typing import Any

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

import helisim.gym

HELICOPTERS = 64
SERVOS = {"action": "servos", "authority": 0.25}
"""A quarter of the servos' unit range is enough to stabilise, and kinder to a beginner."""


class Fleet(VecEnv):
    """The native vector environment as stable-baselines3 wants one."""

    def __init__(self, count: int, **settings: Any) -> None:
        self.env = vector(count, autoreset_mode="SameStep", **settings)
        super().__init__(count, self.env.single_observation_space, self.env.single_action_space)
        self._actions = np.zeros((count, 4))

    def reset(self) -> np.ndarray:
        """Return what is seen at the start of all episodes."""
        return self.env.reset(seed=self._seeds[0])[0]

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions of the next frame."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Fly it; where an episode ended, what is seen is the next one's start."""
        seen, rewards, terminated, truncated, infos = self.env.step(self._actions)
        done = terminated | truncated
        each: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(done):
            each[row]["terminal_observation"] = infos["final_obs"][row]
            each[row]["TimeLimit.truncated"] = bool(truncated[row] and not terminated[row])
        return seen, rewards.astype(np.float32), done, each

    def close(self) -> None:
        """Stop the threads."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return what all helicopters share."""
        return [getattr(self.env, attr_name)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that none is wrapped."""
        return [False] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: settings are given when the environment is made."""
        raise NotImplementedError(f"{attr_name!r} is given when the environment is made")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **words: Any) -> None:
        """Refuse: there is no environment of one helicopter to call."""
        raise NotImplementedError(f"no environment of one helicopter has {method_name!r}")


def vector(count: int, **settings: Any) -> gymnasium.vector.VectorEnv:
    """Return helicopters whose four servos are to be moved."""
    mode = {"vectorization_mode": "vector_entry_point"}
    return gymnasium.make_vec("helisim/Hover-v0", count, **mode, **SERVOS, **settings)


class Curve(BaseCallback):
    """Notes how the last episodes went."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[tuple[int, float, float]] = []
        self._return, self._length = np.zeros(HELICOPTERS), np.zeros(HELICOPTERS)
        self._ended: list[tuple[float, float]] = []

    def _on_step(self) -> bool:
        self._return += self.locals["rewards"]
        self._length += 1
        for row in np.flatnonzero(self.locals["dones"]):
            self._ended.append((self._return[row], 0.02 * self._length[row]))
            self._return[row] = self._length[row] = 0.0
        return True

    def _on_rollout_end(self) -> None:
        if len(self._ended) >= HELICOPTERS:
            score, length = np.mean(self._ended, axis=0)
            self.rows.append((self.num_timesteps, score, length))
            self._ended.clear()
            if len(self.rows) % 5 == 1:
                print(f"{self.num_timesteps:>10,} frames: return {score:6.1f}, {length:5.2f} s")


def train(frames: int) -> tuple[PPO, Curve]:
    """Return the policy that so many frames of training make, and how it learned."""
    torch.set_num_threads(1)
    fleet = Fleet(HELICOPTERS)
    fleet.seed(1)
    policy = PPO(
        "MlpPolicy", fleet, n_steps=64, batch_size=1024, n_epochs=10, learning_rate=5e-4,
        gamma=0.99, gae_lambda=0.95, seed=1, device="cpu",
        policy_kwargs={"net_arch": [64, 64], "log_std_init": -1.5},
    )  # fmt: skip
    curve = Curve()
    policy.learn(frames, callback=curve)
    fleet.close()
    return policy, curve


def examine(policy: PPO) -> None:
    """Print how the policy hovers helicopters, and how helicopters do without any."""
    for name, settings in (
        ("as it learned", {}),
        ("in weather, others", {
            "spread": helisim.gym.USUAL,
            "weather": helisim.gym.WeatherRange(wind=4.0, turbulence=6.0),
        }),
    ):  # fmt: skip
        for flies in (True, False):
            score, length, off = flown(policy if flies else None, settings)
            print(f"{name}, {'policy' if flies else 'servos held'}: return {score:.1f} of 500, "
                  f"{length:.2f} s of 10, {off:.2f} m off at the end")  # fmt: skip


def flown(policy: PPO | None, settings: dict[str, Any]) -> tuple[float, float, float]:
    """Return the means of return, seconds, and metres off at the end, over one episode each."""
    env = vector(HELICOPTERS, max_episode_steps=None, **settings)
    seen, _ = env.reset(seed=1000)
    score, length = np.zeros(HELICOPTERS), np.zeros(HELICOPTERS)
    off, flying = np.zeros(HELICOPTERS), np.ones(HELICOPTERS, dtype=bool)
    for _ in range(500):
        off[flying] = np.linalg.norm(seen[flying, :3], axis=1)
        action = np.zeros((HELICOPTERS, 4))
        if policy is not None:
            action, _ = policy.predict(seen, deterministic=True)
        seen, reward, terminated, _, _ = env.step(action)
        score += reward * flying
        length += 0.02 * flying
        flying &= ~terminated
    env.close()
    return float(score.mean()), float(length.mean()), float(off.mean())


def draw(curve: Curve, path: Path) -> None:
    """Write the learning curve."""
    frames, score, length = np.array(curve.rows).T
    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    axes.plot(frames / 1e6, score, label="return, of 500")
    axes.plot(frames / 1e6, 50.0 * length, label="length, frames of 20 ms, of 500", alpha=0.6)
    axes.set(xlabel="million frames", ylabel="mean of the episodes", ylim=(0, 520))
    axes.set_title("Hovering by the servos, without a gyro: PPO")
    axes.legend()
    figure.savefig(path, dpi=120)


def main(millions: float = 1.5, folder: str = "hover") -> None:
    """Train, print, write, examine."""
    path = Path(folder)
    path.mkdir(parents=True, exist_ok=True)
    policy, curve = train(round(1e6 * millions))
    policy.save(path / "policy.zip")
    if curve.rows:
        draw(curve, path / "curve.png")
        print(f"Written: {path / 'curve.png'}, {path / 'policy.zip'}")
    examine(policy)


if __name__ == "__main__":
    main(*(kind(word) for kind, word in zip((float, str), sys.argv[1:])))
