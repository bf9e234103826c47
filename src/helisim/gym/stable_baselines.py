"""The native vector environment as Stable-Baselines3 takes one; needs `stable-baselines3`."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv  # pyright: ignore[reportMissingImports]

from helisim.base.errors import InputError
from helisim.gym.environments import HelicopterVectorEnv


class Helicopters(VecEnv):
    """Helicopters for a learner: `PPO("MlpPolicy", Helicopters("helisim/Hover-v0", 64))`.

    `settings` are the environment's. Episodes start as those of `reset(seed=...)`, by `seed()`.
    """

    def __init__(self, name: str, num_envs: int, **settings: Any) -> None:
        made: Any = gymnasium.make_vec(
            name, num_envs, vectorization_mode="vector_entry_point", **settings
        )
        self.envs: HelicopterVectorEnv = made
        self.render_mode = made.render_mode
        super().__init__(num_envs, made.single_observation_space, made.single_action_space)

    def reset(self) -> NDArray[np.float32]:
        """Start all episodes."""
        seen, infos = self.envs.reset(seed=self._seeds)
        self._reset_seeds()
        self.reset_infos = self._by_row(infos)
        return seen

    def step_async(self, actions: NDArray[np.floating]) -> None:
        """Keep the actions, (num_envs, 4)."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Fly a frame; an episode that ended starts anew at once."""
        seen, rewards, terminated, truncated, given = self.envs.step(self._actions)
        ended, infos = terminated | truncated, self._by_row(given)
        if ended.any():
            begun, given = self.envs.reset(options={"reset_mask": ended})
            for row, info in enumerate(self._by_row(given)):
                if ended[row]:
                    infos[row]["terminal_observation"] = seen[row]
                    infos[row]["TimeLimit.truncated"] = bool(truncated[row] & ~terminated[row])
                    self.reset_infos[row] = info
            seen = begun
        return seen, rewards.astype(np.float32), ended, infos

    def close(self) -> None:
        """Let go of threads and pictures."""
        self.envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return a picture of each."""
        return self.envs.render()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return the environment's attribute for each helicopter."""
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: settings are given when the environment is made."""
        raise InputError("settings are given when the environment is made, not later")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Refuse: one environment flies all."""
        raise InputError(f"one environment flies all: call {method_name} of `envs`")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Say that none is wrapped."""
        return [False for _ in self._get_indices(indices)]

    def _by_row(self, infos: dict[str, Any]) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for name, values in infos.items():
            if isinstance(values, dict):
                values = self._by_row(values)
            for row in np.flatnonzero(infos.get(f"_{name}", np.zeros(self.num_envs))).tolist():
                rows[row][name] = values[row]
        return rows
