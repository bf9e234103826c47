"""How a reference moves: smoothly, so that neither attitude nor collective has to jump."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from helisim.base.errors import InputError


class Moved(NamedTuple):
    """How far along one is, how fast, and how hard it is pushed: m, m/s, m/s^2, or in rad."""

    distance: float
    speed: float
    acceleration: float


@dataclass(frozen=True)
class Ramp:
    """A change of speed along half a cosine.

    Attributes:
        start: speed before, m/s or rad/s.
        end: speed after.
        acceleration: the most there is on the way, above 0.

    Raises:
        InputError: it can't be flown so.
    """

    start: float
    end: float
    acceleration: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.end) and self.acceleration > 0.0):
            raise InputError(
                "a change of speed needs a finite speed and an acceleration above 0, got "
                f"{self.end:g} and {self.acceleration:g}"
            )

    @property
    def lasts(self) -> float:
        """How long it takes, s."""
        return 0.5 * math.pi * abs(self.end - self.start) / self.acceleration

    def at(self, time: float) -> Moved:
        """Return the motion at a time since its beginning, s."""
        if time >= self.lasts:
            mean = 0.5 * (self.start + self.end)
            return Moved(mean * self.lasts + self.end * (time - self.lasts), self.end, 0.0)
        half, change = math.pi * time / self.lasts, self.end - self.start
        return Moved(
            self.start * time + 0.5 * change * (time - self.lasts / math.pi * math.sin(half)),
            self.start + 0.5 * change * (1.0 - math.cos(half)),
            0.5 * math.pi / self.lasts * change * math.sin(half),
        )


@dataclass(frozen=True)
class Glide:
    """A way from rest to rest: faster, on, slower.

    Attributes:
        distance: m, or an angle in rad; 0 or more.
        speed: the most there is on the way, above 0; a short way is flown slower.
        acceleration: the most there is on the way, above 0.

    Raises:
        InputError: it can't be flown so.
    """

    distance: float
    speed: float
    acceleration: float

    def __post_init__(self) -> None:
        if not (0.0 <= self.distance < math.inf and self.speed > 0.0 and self.acceleration > 0.0):
            raise InputError(
                "a way needs a finite distance, and a speed and an acceleration above 0, got "
                f"{self.distance:g}, {self.speed:g} and {self.acceleration:g}"
            )

    @property
    def top(self) -> float:
        """The highest speed that is reached."""
        return min(self.speed, math.sqrt(2.0 / math.pi * self.acceleration * self.distance))

    @property
    def lasts(self) -> float:
        """How long it takes, s."""
        if self.distance == 0.0:
            return 0.0
        return self.distance / self.top + Ramp(0.0, self.top, self.acceleration).lasts

    def at(self, time: float) -> Moved:
        """Return the motion at a time since its beginning, s."""
        left = self.lasts - time
        if left <= 0.0:
            return Moved(self.distance, 0.0, 0.0)
        up = Ramp(0.0, self.top, self.acceleration)
        if left >= 0.5 * self.lasts:
            return up.at(time)
        distance, speed, acceleration = up.at(left)
        return Moved(self.distance - distance, speed, -acceleration)
