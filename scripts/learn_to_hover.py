"""Learn to hover: PPO of Stable-Baselines3 beside an agent of a few lines, and sticks held still.

    python scripts/learn_to_hover.py [MINUTES [FOLDER]]

PPO flies 64 helicopters at once for so many minutes (default: 5), by the four servos of the bare
helicopter without a gyro, and by the sticks with it. Its learning curves are printed and drawn
(`curve.png`), and its policies kept (`servos.zip`, `sticks.zip`), in FOLDER (default: hover). Then
all hover from 64 starts that none has met, and the policy by the servos is filmed as it comes back
from 2.5 m (`servos.webp`). It needs `pip install stable-baselines3`; without a screen set
`MUJOCO_GL=egl`.
"""

import sys
import time
from functools import partial
from pathlib import Path

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
import torch
from fly_in_gymnasium import agent, flown
from PIL import Image
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor

from helisim.gym.stable_baselines import Helicopters

HELICOPTERS = 64
SETTINGS = {
    "servos": {"action": "servos", "authority": 0.25},  # enough to stabilise
    "sticks": {"action": "sticks"},
}


class Curve(BaseCallback):
    """Keeps frames, mean return and mean length, and ends the training when its time is over."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self.until, self.rows = time.monotonic() + seconds, []

    def _on_step(self) -> bool:
        return time.monotonic() < self.until

    def _on_rollout_end(self) -> None:
        ended = self.model.ep_info_buffer
        if ended:
            means = (np.mean([one[key] for one in ended]) for key in ("r", "l"))
            self.rows.append((self.num_timesteps, *means))


def trained(minutes: float, settings: dict) -> tuple[PPO, Curve]:
    """Return the policy that so many minutes of training make, and how it learned."""
    envs = VecMonitor(Helicopters("helisim/Hover-v0", HELICOPTERS, **settings))
    policy = PPO(
        "MlpPolicy", envs, n_steps=64, batch_size=1024, learning_rate=5e-4, seed=1, device="cpu",
        policy_kwargs={"net_arch": [64, 64], "log_std_init": -1.5},
    )  # fmt: skip
    curve = Curve(60.0 * minutes)
    policy.learn(10**9, callback=curve)
    envs.close()
    return policy, curve


def filmed(policy: PPO, path: Path) -> None:
    """Draw nine seconds of a policy by the servos, from a start 2.5 m off."""
    shown = {"render_mode": "rgb_array", "width": 400, "height": 260}
    env = gymnasium.make("helisim/Hover-v0", **shown, **SETTINGS["servos"])
    seen, _ = env.reset(seed=2, options={"motion": {"north": -2.0, "east": 1.5}})
    pictures = []
    for frame in range(450):
        seen, *_ = env.step(policy.predict(seen, deterministic=True)[0])
        if frame % 3 == 0:
            pictures.append(Image.fromarray(env.render()))
    env.close()
    first, *rest = pictures
    first.save(path, save_all=True, append_images=rest, duration=60, loop=0, quality=50)


def main(minutes: float = 5.0, folder: str = "hover") -> None:
    """Train, print, draw, keep, compare."""
    torch.set_num_threads(1)
    path = Path(folder)
    path.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    agents = {"sticks, held still": ("sticks", lambda seen: np.zeros((len(seen), 4)))}
    agents |= {"sticks, an agent of a few lines": ("sticks", agent)}
    for action, settings in SETTINGS.items():
        policy, curve = trained(minutes, settings)
        policy.save(path / f"{action}.zip")
        frames, score, length = np.reshape(curve.rows, (-1, 3)).T  # none: no episode has ended
        print(f"PPO by the {action}:\n{'frames':>12}{'return':>10}{'length, s':>12}")
        for k in np.linspace(0, len(frames) - 1, min(8, len(frames)), dtype=int):
            print(f"{frames[k]:12,.0f}{score[k]:10.1f}{0.02 * length[k]:12.2f}")
        axes.plot(frames / 1e6, score, label=f"by the {action}")
        act = partial(policy.predict, deterministic=True)
        agents[f"{action}, PPO"] = (action, lambda seen, act=act: act(seen)[0])
    axes.set(xlabel="million frames of 20 ms", ylabel="return of an episode, of 500", ylim=(0, 500))
    axes.legend()
    figure.savefig(path / "curve.png", dpi=120)
    print(f"{'':34}{'return':>8}{'s of 10':>10}{'m off':>10}")
    for name, (action, act) in agents.items():
        way = {"vectorization_mode": "vector_entry_point", **SETTINGS[action]}
        env = gymnasium.make_vec("helisim/Hover-v0", HELICOPTERS, **way)
        score, frames, off, _ = (one.mean() for one in flown(env, act, 1000))
        print(f"{name:34}{score:8.1f}{0.02 * frames:10.2f}{off:10.2f}")
    filmed(PPO.load(path / "servos.zip", device="cpu"), path / "servos.webp")


if __name__ == "__main__":
    main(*(kind(word) for kind, word in zip((float, str), sys.argv[1:])))
