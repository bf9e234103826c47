"""A criterion, and the rating that it gives a loop."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar

from helisim.base.display import shower
from helisim.base.errors import InputError
from helisim.base.value import FrozenMap
from helisim.handling.axis import axis_of
from helisim.handling.chart import Chart, Level
from helisim.handling.criteria.limit import Border, Limit
from helisim.handling.loop import Loop

if TYPE_CHECKING:
    from helisim.base.display import Axes, Figure

MOST = 10.0
"""Distances end here to either side: an optimiser needs no more, and none may be infinite."""


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
            rated; 1: borders as printed. By Froude's law frequencies of the borders are
            multiplied by sqrt N and times divided by it. See `froude`.
    """

    axis: str
    scale: float = 1.0

    name: ClassVar[str]
    """By which files call it."""
    source: ClassVar[str]
    """Document, paragraph and figure, and what of it is a choice of ours."""
    units: ClassVar[Mapping[str, str]]
    """Figure -> unit: SI, or dB."""
    angles: ClassVar[tuple[str, ...]] = ()
    """Fields in radians: a file may give them in degrees, `phase` as `phase_deg`."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", axis_of(self.axis).name)
        if not (math.isfinite(self.scale) and self.scale > 0.0):
            raise InputError(f"scale is a ratio of lengths above 0, got {self.scale!r}")
        for one in fields(self):
            given = getattr(self, one.name)
            if isinstance(given, Limit) and isinstance(one.default, Limit):
                given.check_direction(one.name, more=one.default.more_is_better)

    @abstractmethod
    def rate(self, loop: Loop) -> Rating:
        """Return figures, level and distance of a loop.

        Raises:
            NoResponse: the loop doesn't know what this criterion asks for.
        """

    @abstractmethod
    def chart(self) -> Chart:
        """Return its standard chart, borders scaled."""

    def plot(self, ratings: Any, *, axes: "Axes | None" = None) -> "Figure":
        """Draw ratings on the standard chart.

        Args:
            ratings: one, or several (a cloud of draws), or a mapping from a label to either, of
                several the first the nominal one.
            axes: of Matplotlib, to draw on.
        """
        return shower().plot_ratings(self, ratings, axes)

    @property
    def limits(self) -> Mapping[str, Limit | Border]:
        """Borders of levels by the figure that they are of, scaled; figures without are told."""
        return {}

    @property
    def faster(self) -> float:
        """By what frequencies of its source are multiplied: sqrt N."""
        return math.sqrt(self.scale)

    @property
    def word(self) -> str:
        """The axis as pilots call it."""
        return axis_of(self.axis).word

    def rated(
        self,
        figures: Mapping[str, float],
        distances: Iterable[float] | None = None,
        *,
        remark: str = "",
        along: float = 0.0,
    ) -> Rating:
        """Return a rating: the worst distance, and the level that this is.

        Args:
            figures: all of them.
            distances: of its parts; None: of the figures to their `limits`.
            remark: what a reader of the figures should know.
            along: where a limit that is a `Border` is asked.
        """
        parts = self._distances(figures, along) if distances is None else distances
        distance = min(max(min(parts), -MOST), MOST)
        return Rating(self, FrozenMap(figures), level_of(distance), distance, remark)

    def _distances(self, figures: Mapping[str, float], along: float) -> list[float]:
        return [
            limit.distance(figures[name], along)
            if isinstance(limit, Border)
            else limit.distance(figures[name])
            for name, limit in self.limits.items()
        ]


def level_of(distance: float) -> Level:
    """Return the level that a distance from the border of Level 1 is."""
    if distance >= 0.0:
        return 1
    return 2 if distance >= -1.0 else 3
