"""The pilot of a flight: the hover that is held, and the remnant level of the stick."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.physics.layout import PARAM
from helisim.vehicle import Vehicle
from helisim.vehicle.trim import collective_stick

_ROOM = 0.9
"""m of air under a helicopter that hovers to be watched: a sweep sinks by up to 0.8 m."""


def hover_height(model: mujoco.MjModel) -> float:
    """Return how high a helicopter hovers to be seen with its pad, m; half its extent hangs below.

    Args:
        model: with every part to be seen.
    """
    return _ROOM + 0.5 * model.stat.extent


@dataclass(frozen=True, kw_only=True)
class Pilot:
    """A pilot who holds the hover at the place where the flight starts.

    Attributes:
        remnant: its level: rms of the stick movement that no purpose explains, unitised, each
            axis.
        remnant_interval: s between its knots; it is flat up to about 1/interval rad/s.
    """

    remnant: float = 0.003
    remnant_interval: float = 0.1

    def __post_init__(self) -> None:
        if not 0.0 <= self.remnant <= 0.5:
            raise InputError(f"remnant must be in [0, 0.5] of unitised stick, got {self.remnant}")
        if not 0.0 < self.remnant_interval < np.inf:
            raise InputError(f"remnant_interval must be positive, got {self.remnant_interval}")

    def write(
        self, par: NDArray[np.float64], vehicle: Vehicle, *, seed: int, height: float
    ) -> None:
        """Put the pilot into a vehicle's parameters (n_param,) for the force laws."""
        par[PARAM.pilot_on] = 1.0
        par[PARAM.pilot_north : PARAM.pilot_psi + 1] = [0.0, 0.0, -height, 0.0]
        par[PARAM.pilot_phi], par[PARAM.pilot_theta] = vehicle.trim.phi, vehicle.trim.theta
        par[PARAM.pilot_col] = collective_stick(vehicle.model, vehicle.trim)
        par[PARAM.pilot_lon : PARAM.pilot_ped + 1] = 0.0
        par[PARAM.pilot_seed] = seed
        par[PARAM.remnant_col : PARAM.remnant_ped + 1] = self.remnant
        par[PARAM.remnant_interval] = self.remnant_interval
