"""The spaces of observations and actions."""

import numpy as np
from gymnasium.spaces import Box

from helisim.gym.task import BOUND, Task


def observation_space(task: Task) -> Box:
    """Return what one agent may see, (n_observation,)."""
    shape = (len(task.observations),)
    return Box(-BOUND, BOUND, shape, np.float32)


def action_space() -> Box:
    """Return what one agent may do, (4,)."""
    return Box(-1.0, 1.0, (4,), np.float32)
