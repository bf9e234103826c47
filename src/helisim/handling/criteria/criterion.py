"""A criterion, and the rating that it gives a loop."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from helisim.errors import InputError
from helisim.handling.axis import axis_of
from helisim.handling.chart import Chart, Level
from helisim.handling.loop import Loop
from helisim.records.value import FrozenMap

MOST = 10.0
"""Distances end here to either side: an optimiser needs no more, and none may be infinite."""


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

    def distance(self, value: float) -> float:
        """Return 0 at the border of Level 1, -1 at that of Level 2, positive in Level 1."""
        return (value - self.level1) / abs(self.level1 - self.level2) * self._better

    def scaled(self, factor: float) -> "Limit":
        """Return it with both borders multiplied."""
        return Limit(self.level1 * factor, self.level2 * factor)

    @property
    def _better(self) -> float:
        return 1.0 if self.level1 > self.level2 else -1.0


@dataclass(frozen=True)
class Rating:
    """What a criterion says of a loop.

    Attributes:
        criterion: that says it.
        figures: name -> value, in the units of `criterion.units`.
        level: 1 (satisfactory), 2 (tolerable) or 3.
        distance: from the border of Level 1: positive inside, 0 there, -1 at the border between
            Levels 2 and 3. Finite, and continuous where the loop's response is.
        remark: what a reader of the figures should know; "" for nothing.
    """

    criterion: "Criterion"
    figures: Mapping[str, float]
    level: Level
    distance: float
    remark: str = ""


@dataclass(frozen=True, kw_only=True)
class Criterion(ABC):
    """What is asked of one axis of a loop. Derive, declare the class variables, write `rate`.

    Attributes:
        axis: of control, by its command or word; `Loop.axes` has those of a loop.
        scale: N, length of the vehicle that the source speaks of over that of the one that is
            rated: by Froude's law frequencies of its borders are multiplied by sqrt N and times
            divided by it; 1: as printed. See `froude`.
    """

    axis: str
    scale: float = field(default=1.0)

    name: ClassVar[str]
    """By which files call it."""
    source: ClassVar[str]
    """Document, paragraph and figure."""
    units: ClassVar[Mapping[str, str]]
    """Figure -> unit: SI, or dB."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", axis_of(self.axis).name)
        if not (math.isfinite(self.scale) and self.scale > 0.0):
            raise InputError(f"scale is a ratio of lengths above 0, got {self.scale!r}")

    @abstractmethod
    def rate(self, loop: Loop) -> Rating:
        """Return figures, level and distance of a loop.

        Raises:
            NoResponse: the loop doesn't know what this criterion asks for.
        """

    @abstractmethod
    def chart(self) -> Chart:
        """Return its standard chart, borders scaled."""

    @property
    def faster(self) -> float:
        """By what frequencies of its source are multiplied: sqrt N."""
        return math.sqrt(self.scale)

    def rated(
        self, figures: Mapping[str, float], distances: Iterable[float], remark: str = ""
    ) -> Rating:
        """Return a rating: the worst of its parts' distances, and the level that this is."""
        distance = min(max(min(distances), -MOST), MOST)
        return Rating(self, FrozenMap(figures), level_of(distance), distance, remark)


def level_of(distance: float) -> Level:
    """Return the level that a distance from the border of Level 1 is."""
    if distance >= 0.0:
        return 1
    return 2 if distance >= -1.0 else 3


def values_of(criterion: Criterion) -> dict[str, Any]:
    """Return a criterion's own numbers by name, the axis and the scale left out."""
    own = vars(criterion)
    return {name: own[name] for name in own if name not in ("axis", "scale")}
