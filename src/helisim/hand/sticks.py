"""Four sticks in two hands: which stick is where, and what a deflection means to the gyro."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.records.channels import IN2


class Deflection(NamedTuple):
    """Where the four sticks are, of their whole travel: 0 in the middle, -1 and 1 at the stops.

    Attributes:
        col: collective, up to climb.
        lon: longitudinal, back to pitch the nose up.
        lat: lateral, to the right.
        ped: pedals, nose to the right.
    """

    col: float = 0.0
    lon: float = 0.0
    lat: float = 0.0
    ped: float = 0.0


class Gimbals(NamedTuple):
    """Where both thumbs are, -1 to 1: to the right and up, which is away from the pilot."""

    left_x: float = 0.0
    left_y: float = 0.0
    right_x: float = 0.0
    right_y: float = 0.0


MODES = {
    1: ("ped", "lon", "lat", "col"),
    2: ("ped", "col", "lat", "lon"),
    3: ("lat", "lon", "ped", "col"),
    4: ("lat", "col", "ped", "lon"),
}
"""Sticks of a transmitter's modes, in the order of `Gimbals`."""


def check_mode(mode: int) -> int:
    """Return a transmitter's mode. Raises UnknownNameError."""
    if mode not in MODES:
        raise UnknownNameError("transmitter mode", mode, map(str, MODES))
    return mode


def sticks_of(gimbals: Gimbals, mode: int) -> Deflection:
    """Return what both gimbals deflect in a mode. Raises UnknownNameError."""
    thumbs = dict(zip(MODES[check_mode(mode)], gimbals))
    return Deflection(**{**thumbs, "lon": -thumbs["lon"]})  # away from the pilot is nose down


def gimbals_of(deflection: Deflection, mode: int) -> Gimbals:
    """Return where both gimbals are in a mode, as `sticks_of` reads them."""
    thumbs = {**deflection._asdict(), "lon": -deflection.lon}
    return Gimbals(*(thumbs[name] for name in MODES[check_mode(mode)]))


@dataclass(frozen=True, kw_only=True)
class StickFeel:
    """How much a deflection is, as set on a transmitter for the sticks that centre.

    The collective is as it is: -1 to 1 is its whole travel.

    Attributes:
        rate: share of the travel that a full deflection of LON, LAT and PED gives, above 0, to 1.
        expo: 0 is linear; 1 leaves only the cube of the deflection, soft about the middle.
        deadband: deflection about the middle that is none, below 1; from there on it rises from 0.
    """

    rate: float = 1.0
    expo: float = 0.3
    deadband: float = 0.02

    def __post_init__(self) -> None:
        if not 0.0 < self.rate <= 1.0:
            raise InputError(f"rate must be above 0, at most 1, got {self.rate}")
        if not 0.0 <= self.expo <= 1.0:
            raise InputError(f"expo must be in [0, 1], got {self.expo}")
        if not 0.0 <= self.deadband < 1.0:
            raise InputError(f"deadband must be 0 or more, below 1, got {self.deadband}")

    def felt(self, deflection: Deflection) -> Deflection:
        """Return a deflection behind deadband, expo and rate; within the stops in any case."""
        col, *others = (min(1.0, max(-1.0, one)) for one in deflection)
        return Deflection(col, *map(self._curved, others))

    def sticks(self, deflection: Deflection) -> NDArray[np.float64]:
        """Return COL, LON, LAT, PED, unitised, (4,)."""
        return 0.5 * np.array(self.felt(deflection))

    def _curved(self, one: float) -> float:
        beyond = max(0.0, abs(one) - self.deadband) / (1.0 - self.deadband)
        return math.copysign(self.rate * ((1.0 - self.expo) * beyond + self.expo * beyond**3), one)


assert tuple(name.lower() for name in IN2) == Deflection._fields
