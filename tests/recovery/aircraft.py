"""An aircraft whose truth is known, flown in sweeps: what recovery is measured on."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from closed_loop import Rig
from numpy.typing import NDArray

from helisim.ident import Structure
from helisim.ident.evaluate import response
from helisim.records.record import FlightRecord


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """One flight: which stick is swept and how.

    Attributes:
        axis: the swept stick.
        band: lowest and highest frequency, rad/s.
        amplitude: of the sweep, in the input's unit.
        duration: s.
        off_axis: rms of the remnant on the other sticks.
    """

    axis: str
    band: tuple[float, float]
    amplitude: float
    duration: float
    off_axis: float


@dataclass(frozen=True, eq=False)
class Aircraft:
    """A plant in its rig, and the sweeps that are flown with it.

    Attributes:
        name: short, for tables.
        rig: the plant under feedback, its noise and its gusts.
        sweeps: the flights of one replicate.
    """

    name: str
    rig: Rig
    sweeps: tuple[Sweep, ...]

    @property
    def structure(self) -> Structure:
        return self.rig.structure

    @property
    def truth(self) -> Mapping[str, float]:
        return self.rig.values

    @property
    def closed(self) -> bool:
        """Whether there is any feedback: then the sticks are references."""
        return bool(np.any(self.rig.gain))

    def fly(self, seed: int) -> list[FlightRecord]:
        """Return the records of one replicate."""
        return [
            self.rig.fly(seed=100 * seed + number, **asdict(one))
            for number, one in enumerate(self.sweeps)
        ]

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the true response at frequencies in rad/s, (n_out, n_in, n_freq)."""
        return response(self.structure, self.truth, frequency)
