"""Levels of figures, and the standard chart of a criterion as data, which `helisim.show` draws."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import InputError
from helisim.base.settings import Value

Level = Literal[1, 2, 3]
Array = NDArray[np.float64]
_FAR = 1e6
"""Lengths of an axis that a corner at infinity is away."""


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
        if not np.all(np.isfinite([*self.along, *self.level1, *self.level2])):
            raise InputError("the corners of a border must be finite numbers")
        if any(a >= b for a, b in zip(self.along, self.along[1:])):
            raise InputError("the corners of a border must be in increasing order along it")
        if any(one <= two for one, two in zip(self.level1, self.level2)):
            raise InputError("the border of Level 1 must lie above that of Level 2 everywhere")

    def distance(self, value: float, along: float) -> float:
        """Return 0 at the border of Level 1, -1 at that of Level 2, positive in Level 1."""
        one = float(np.interp(along, self.along, self.level1))
        two = float(np.interp(along, self.along, self.level2))
        return (value - one) / (one - two)

    def scaled(self, value: float = 1.0, *, along: float = 1.0) -> "Border":
        """Return it with the figure's borders, and the figure along them, multiplied."""
        factors = ((self.along, along), (self.level1, value), (self.level2, value))
        return Border(*(tuple(one * factor for one in ones) for ones, factor in factors))

    def line(self, level: int) -> tuple[Array, Array]:
        """Return the border of a level, 1 or 2, as (n_point,) along and (n_point,) values.

        It goes on to infinity at both ends.
        """
        values = self.level1 if level == 1 else self.level2
        return np.array((-np.inf, *self.along, np.inf)), np.array((values[0], *values, values[-1]))


@dataclass(frozen=True)
class ChartAxis:
    """One axis of a chart.

    Attributes:
        figure: the name of a rating's figure that lies along it, such as "bandwidth"; "" where
            what is on the chart is a curve, not a figure.
        label: for people, without the unit.
        unit: of figures and corners: SI, or "dB"; radians are drawn as degrees.
        low: where it is drawn from, if nothing lies below.
        high: where it is drawn to, if nothing lies above.
        logarithmic: True for equal steps a decade; both ends are positive then.

    Raises:
        InputError: the ends aren't in order, or not positive on a logarithmic axis.
    """

    figure: str
    label: str
    unit: str
    low: float
    high: float
    logarithmic: bool = False

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise InputError(
                f"axis {self.label!r} from {self.low:g} to {self.high:g}: not in order"
            )
        if self.logarithmic and self.low <= 0.0:
            raise InputError(f"logarithmic axis {self.label!r} starts at {self.low:g}, not above 0")

    def share(self, values: ArrayLike) -> Array:
        """Return where values are along the axis, 0 at its low end, 1 at its high; (n_value,) each.

        What is not positive lies at minus infinity of a logarithmic axis.
        """
        values = np.asarray(values, dtype=np.float64)
        if not self.logarithmic:
            return (values - self.low) / (self.high - self.low)
        with np.errstate(divide="ignore"):
            return np.log(np.maximum(values, 0.0) / self.low) / math.log(self.high / self.low)


@dataclass(frozen=True, eq=False)
class ChartLine(Value):
    """A line on a chart, its pieces straight as drawn. Read-only.

    Attributes:
        across: (n_point,) in the unit of the axis across; infinite where a side is open: pieces to
            such a point are parallel to the axis.
        up: (n_point,) in the unit of the axis up; 0 to 1 on a chart without one.
        label: in the legend; "" for none.
        boundary: True of a border between levels, drawn whole; False of a guide, dashed, such as
            a line of one phase delay or an M circle.

    Raises:
        InputError: too few points, not as many across as up, or a point is no number.
    """

    across: Array
    up: Array
    label: str = ""
    boundary: bool = True

    def __post_init__(self) -> None:
        _freeze(self, "line", least=2)


@dataclass(frozen=True, eq=False)
class Region(Value):
    """Where a level is: a polygon, its edges straight as drawn. Read-only.

    Attributes:
        level: 1 to 3.
        across: (n_corner,) as of a `ChartLine`.
        up: (n_corner,) likewise.

    Raises:
        InputError: fewer than three corners, not as many across as up, or a corner is no number.
    """

    level: Level
    across: Array
    up: Array

    def __post_init__(self) -> None:
        _freeze(self, "region", least=3)
        if self.level not in (1, 2, 3):
            raise InputError(f"level {self.level!r}: there are levels 1, 2 and 3")


def _freeze(one: Region | ChartLine, word: str, *, least: int) -> None:
    for name in ("across", "up"):
        array = np.array(getattr(one, name), dtype=np.float64)
        array.flags.writeable = False
        object.__setattr__(one, name, array)
    across, up = one.across, one.up
    if across.ndim != 1 or across.shape != up.shape or across.size < least:
        raise InputError(
            f"a {word} of a chart has {least} points or more, as many across as up; got shapes "
            f"{across.shape} and {up.shape}"
        )
    if np.isnan(across).any() or np.isnan(up).any():
        raise InputError(f"a {word} of a chart has a point that is not a number")


@dataclass(frozen=True)
class Chart:
    """The standard chart of a criterion.

    Attributes:
        title: of the criterion, with what it is for: "Bandwidth, roll, all other mission tasks".
        across: the horizontal axis.
        up: the vertical axis; None of a criterion of one figure, drawn as a strip.
        regions: of levels, in any order; where two overlap the worse level holds.
        lines: boundaries and guides.
        source: the document, with table, figure or page.
    """

    title: str
    across: ChartAxis
    up: ChartAxis | None
    regions: tuple[Region, ...]
    lines: tuple[ChartLine, ...] = ()
    source: str = ""

    def level_at(self, across: float, up: float = 0.5) -> int | None:
        """Return the level of a place by the regions as drawn; None outside of all.

        Args:
            across: in the unit of the axis across.
            up: in the unit of the axis up; of no matter on a strip.
        """
        held = [one.level for one in self.regions if self._inside(one, across, up)]
        return max(held, default=None)

    def places(self, across: Array, up: Array) -> tuple[Array, Array]:
        """Return where points are as shares of both axes, infinity included; (n_point,) each."""
        return self.across.share(across), up if self.up is None else self.up.share(up)

    def _inside(self, region: Region, across: float, up: float) -> bool:
        """Return whether a place is in a polygon: a ray from it crosses the border oddly."""
        (x,), (y,) = self.places(np.array([across]), np.array([up]))
        there = self.places(region.across, region.up)
        a, b = (np.clip(one, -_FAR, _FAR) for one in there)
        c, d = np.roll(a, -1), np.roll(b, -1)
        spans = (b > y) != (d > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = a + (y - b) * (c - a) / (d - b)
        return bool(np.count_nonzero(spans & (x < crossing)) % 2)


def strip(title: str, axis: ChartAxis, limit: Limit, source: str) -> Chart:
    """Return the chart of one figure."""
    worst, two, one, best = _ends(limit)
    spans: tuple[tuple[Level, float, float], ...] = ((1, one, best), (2, two, one), (3, worst, two))
    regions = tuple(box(level, low, high, 0.0, 1.0) for level, low, high in spans)
    return Chart(title, axis, None, regions, source=source)


def corner(title: str, across: ChartAxis, up: ChartAxis, x: Limit, y: Limit, source: str) -> Chart:
    """Return the chart of two figures with a limit each: both must be met."""
    xs, ys = _ends(x), _ends(y)
    regions = (
        box(1, xs[2], xs[3], ys[2], ys[3]),
        box(2, xs[1], xs[2], ys[1], ys[3]),
        box(2, xs[2], xs[3], ys[1], ys[2]),
        box(3, xs[0], xs[1], ys[0], ys[3]),
        box(3, xs[1], xs[3], ys[0], ys[1]),
    )
    return Chart(title, across, up, regions, source=source)


def above(title: str, across: ChartAxis, up: ChartAxis, border: Border, source: str) -> Chart:
    """Return the chart of a figure, up, that is limited along another, across."""
    (x1, y1), (x2, y2) = border.line(1), border.line(2)
    regions = (
        beyond(1, x1, y1, np.inf),
        Region(2, np.concatenate([x2, x1[::-1]]), np.concatenate([y2, y1[::-1]])),
        beyond(3, x2, y2, -np.inf),
    )
    return Chart(title, across, up, regions, (ChartLine(x1, y1), ChartLine(x2, y2)), source)


def box(level: Level, x0: float, x1: float, y0: float, y1: float) -> Region:
    """Return a level's rectangle from corner to corner."""
    return Region(level, np.array([x0, x1, x1, x0]), np.array([y0, y0, y1, y1]))


def beyond(level: Level, x: Array, y: Array, far: float) -> Region:
    """Return what lies between a line, (n_point,) each, and infinity, up or down."""
    across = np.concatenate([x, [x[-1], x[0]]])
    return Region(level, across, np.concatenate([y, [far, far]]))


def _ends(limit: Limit) -> tuple[float, float, float, float]:
    """Return worst, border of Level 2, border of Level 1, best."""
    far = np.inf if limit.more_is_better else -np.inf
    return -far, limit.level2, limit.level1, far
