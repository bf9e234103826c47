"""The spaces of observations and actions, and what an environment tells of them."""

import numpy as np
from gymnasium.spaces import Box

from helisim.gym.agent import Action
from helisim.gym.flights import Flights
from helisim.gym.task import BOUND, Observation, Task


def observation_space(task: Task) -> Box:
    """Return what one agent may see, (n_observation,)."""
    shape = (len(task.observations),)
    return Box(-BOUND, BOUND, shape, np.float32)


def action_space() -> Box:
    """Return what one agent may do, (4,)."""
    return Box(-1.0, 1.0, (4,), np.float32)


class Flown:
    """What an environment tells of its flights, alone or many at once."""

    _flights: Flights

    @property
    def observations(self) -> tuple[Observation, ...]:
        """Name, unit and scale of each number that is seen."""
        return self._flights.task.observations

    @property
    def actions(self) -> tuple[Action, ...]:
        """What each number of an action moves."""
        return self._flights.agent.actions

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that each episode draws factors for."""
        return self._flights.spread.names
