"""Levels of figures."""

import math
from dataclasses import dataclass
from typing import Literal

from helisim.base.errors import InputError
from helisim.base.settings import check

Level = Literal[1, 2, 3]
Span = tuple[float, float]


@dataclass(frozen=True)
class Limit:
    """Borders of Levels 1 and 2, in the figure's unit; more is better if `level1` is the larger.

    Raises InputError if they are equal or not finite.
    """

    level1: float
    level2: float

    def __post_init__(self) -> None:
        check(self, "limit")
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
        """Raise InputError where Level 1 lies on the wrong side of its border."""
        if self.more_is_better != more:
            better, side = ("more", "above") if more else ("less", "below")
            raise InputError(
                f"{name}: {better} is better, so Level 1 must end {side} where Level 2 does"
            )

    def distance(self, value: float) -> float:
        """Return 0 at the border of Level 1, -1 at that of Level 2, positive in Level 1."""
        return (value - self.level1) / (self.level1 - self.level2)

    def scaled(self, factor: float) -> "Limit":
        """Return both borders multiplied."""
        return Limit(self.level1 * factor, self.level2 * factor)

    def spans(self) -> tuple[Span, Span, Span]:
        """Return the ends of Levels 1, 2 and 3; infinite where open."""
        far = math.inf if self.more_is_better else -math.inf
        return (self.level1, far), (self.level2, self.level1), (-far, self.level2)
