"""Froude's law: what a full-scale figure becomes on a smaller vehicle.

Two vehicles of one shape whose lengths differ by N are dynamically alike in gravity if their
Froude numbers, speed squared over length and g, are the same: times are then sqrt N shorter on the
smaller one and frequencies sqrt N higher. Handling qualities of uncrewed vehicles are scaled so
in Ivler and Geyer, "Outer Loop Requirements for Vertical Lift Unmanned Aerial System Automated
Flying Qualities", VFS 80th Annual Forum, 2024, from MIL-DTL-32742, which supersedes ADS-33E-PRF.
"""

import math
from dataclasses import dataclass

from helisim.base.errors import InputError

UH60_ROTOR = 16.36
"""m, rotor diameter of the UH-60A, 53 ft 8 in: the helicopter that criteria of rotorcraft are
mostly drawn from."""


@dataclass(frozen=True)
class Froude:
    """By what figures of a vehicle are multiplied for one that is `ratio` times smaller.

    Attributes:
        ratio: N, length of the vehicle that figures are known of over that of the other.

    Raises:
        InputError: the ratio is not above 0.
    """

    ratio: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.ratio) and self.ratio > 0.0):
            raise InputError(f"a ratio of lengths must be above 0, got {self.ratio!r}")

    @classmethod
    def of(cls, length: float, *, reference: float = UH60_ROTOR) -> "Froude":
        """Return the law for a vehicle by its length and that of the reference.

        Args:
            length: m, of the smaller vehicle; of a helicopter its rotor's diameter.
            reference: m, the same length of the vehicle that figures are known of.

        Raises:
            InputError: a length is not above 0.
        """
        if not (length > 0.0 and reference > 0.0):
            raise InputError(f"lengths must be above 0, got {length!r} and {reference!r}")
        return cls(reference / length)

    @property
    def frequency(self) -> float:
        """Of frequencies, and of angular rates."""
        return math.sqrt(self.ratio)

    @property
    def time(self) -> float:
        """Of times and delays."""
        return 1.0 / math.sqrt(self.ratio)

    @property
    def length(self) -> float:
        """Of lengths and positions."""
        return 1.0 / self.ratio

    @property
    def speed(self) -> float:
        """Of speeds."""
        return 1.0 / math.sqrt(self.ratio)

    @property
    def acceleration(self) -> float:
        """Of accelerations: none, as gravity is the same."""
        return 1.0

    @property
    def angular_acceleration(self) -> float:
        """Of angular accelerations."""
        return self.ratio

    @property
    def mass(self) -> float:
        """Of masses, at the same density."""
        return self.ratio**-3

    @property
    def inertia(self) -> float:
        """Of moments of inertia, at the same density."""
        return self.ratio**-5
