"""Where an episode is terminated: the flight envelope, for many helicopters at one instant."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from helisim.gym.motions import Columns, Motions
from helisim.sim import limits
from helisim.sim.limits import FlightEnvelope
from helisim.vehicle import Vehicle


class Limits:
    """A `FlightEnvelope` held against `Motions`; saturation is not watched."""

    def __init__(self, envelope: FlightEnvelope, vehicle: Vehicle) -> None:
        self._limits = limits.Limits(envelope, vehicle, of_origin=True)

    def beyond(self, motions: Motions, air: Columns) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        """Yield the name of each limit and which helicopters are beyond it, (n,).

        Args:
            motions: of n helicopters.
            air: (3, n) velocity of the air itself, body axes, m/s.
        """
        through = motions.body_velocity - air
        for name, _, rows in self._limits.beyond(
            motions.attitude.T, motions.rates.T, motions.position.T, motions.flapping.T, through.T
        ):
            yield name, rows
