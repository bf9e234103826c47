"""Where the levels of a figure end: at a value, or along a line that depends on another figure."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError


@dataclass(frozen=True)
class Limit:
    """The borders of a figure's levels: more is better if `level1` is more than `level2`.

    Attributes:
        level1: border of Level 1, in the figure's unit.
        level2: border between Levels 2 and 3.

    Raises:
        InputError: the borders are the same, or not finite.
    """

    level1: float
    level2: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.level1) and math.isfinite(self.level2)):
            raise InputError(f"borders of levels must be finite, got {self.level1}, {self.level2}")
        if self.level1 == self.level2:
            raise InputError(
                f"Level 1 and Level 2 can't end at the same value, {self.level1:g}: between them "
                "lies the unit of distance"
            )

    @property
    def more_is_better(self) -> bool:
        """Whether Level 1 lies above its border."""
        return self.level1 > self.level2

    def check_direction(self, name: str, *, more: bool) -> None:
        """Raise InputError where Level 1 lies on the wrong side of a figure's border."""
        if self.more_is_better != more:
            better, side = ("more", "above") if more else ("less", "below")
            raise InputError(
                f"{name}: {better} is better, so Level 1 must end {side} where Level 2 does"
            )

    def distance(self, value: float) -> float:
        """Return 0 at the border of Level 1, -1 at that of Level 2, positive in Level 1."""
        return (value - self.level1) / (self.level1 - self.level2)

    def scaled(self, factor: float) -> "Limit":
        """Return it with both borders multiplied."""
        return Limit(self.level1 * factor, self.level2 * factor)


@dataclass(frozen=True)
class Border:
    """The borders of a figure's levels along another figure, by straight lines; more is better.

    Attributes:
        along: (n_corner,) the other figure, increasing; beyond its ends the borders stay.
        level1: (n_corner,) border of Level 1.
        level2: (n_corner,) border between Levels 2 and 3, below it everywhere.

    Raises:
        InputError: lengths differ, `along` doesn't increase, or the borders touch.
    """

    along: tuple[float, ...]
    level1: tuple[float, ...]
    level2: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("along", "level1", "level2"):
            object.__setattr__(self, name, tuple(float(one) for one in getattr(self, name)))
        if not len(self.along) == len(self.level1) == len(self.level2) >= 2:
            raise InputError(
                "a border has as many corners along it as in Levels 1 and 2, two or more; got "
                f"{len(self.along)}, {len(self.level1)} and {len(self.level2)}"
            )
        if any(a >= b for a, b in zip(self.along, self.along[1:])):
            raise InputError("the corners of a border must be in increasing order along it")
        if any(one <= two for one, two in zip(self.level1, self.level2)):
            raise InputError("the border of Level 1 must lie above that of Level 2 everywhere")

    def distance(self, value: float, along: float) -> float:
        """Return 0 at the border of Level 1, -1 at that of Level 2, positive in Level 1."""
        one = float(np.interp(along, self.along, self.level1))
        two = float(np.interp(along, self.along, self.level2))
        return (value - one) / (one - two)

    def scaled(self, *, along: float = 1.0, value: float = 1.0) -> "Border":
        """Return it with both figures multiplied."""
        return Border(
            tuple(one * along for one in self.along),
            tuple(one * value for one in self.level1),
            tuple(one * value for one in self.level2),
        )

    def line(self, level: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the border of a level, 1 or 2, as (n_point,) along and (n_point,) values.

        It goes on to infinity at both ends.
        """
        values = self.level1 if level == 1 else self.level2
        along = (-np.inf, *self.along, np.inf)
        return np.array(along), np.array((values[0], *values, values[-1]))
