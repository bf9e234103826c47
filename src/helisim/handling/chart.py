"""The standard chart of a criterion as data: axes, regions of levels, boundaries, its source.

A criterion says what its chart is; `output` draws it, and puts ratings on it by the figures that
its axes are named after.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.value import Value

Level = Literal[1, 2, 3]
_FAR = 1e6
"""Lengths of an axis that a corner at infinity is away."""


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

    def share(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where values are along the axis, 0 at its low end, 1 at its high; (n_value,) each.

        What is not positive lies at minus infinity of a logarithmic axis.
        """
        values = np.asarray(values, dtype=np.float64)
        if not self.logarithmic:
            return (values - self.low) / (self.high - self.low)
        with np.errstate(divide="ignore"):
            return np.log(np.maximum(values, 0.0) / self.low) / math.log(self.high / self.low)


@dataclass(frozen=True, eq=False)
class Region(Value):
    """Where a level is: a polygon, its edges straight as drawn. Read-only.

    Attributes:
        level: 1 to 3.
        across: (n_corner,) in the unit of the axis across. A side that is open has its corners at
            infinity: edges to them are parallel to the axis.
        up: (n_corner,) in the unit of the axis up; 0 and 1 on a chart without one.

    Raises:
        InputError: fewer than three corners, not as many across as up, or a corner is no number.
    """

    level: Level
    across: NDArray[np.float64]
    up: NDArray[np.float64]

    def __post_init__(self) -> None:
        _arrays(self, "region", least=3)
        if self.level not in (1, 2, 3):
            raise InputError(f"level {self.level!r}: there are levels 1, 2 and 3")


@dataclass(frozen=True, eq=False)
class ChartLine(Value):
    """A line on a chart, its pieces straight as drawn. Read-only.

    Attributes:
        across: (n_point,) as of a `Region`.
        up: (n_point,) likewise.
        label: in the legend; "" for none.
        boundary: True of a border between levels, drawn whole; False of a guide, dashed, such as
            a line of one phase delay or an M circle.

    Raises:
        InputError: fewer than two points, not as many across as up, or a point is no number.
    """

    across: NDArray[np.float64]
    up: NDArray[np.float64]
    label: str = ""
    boundary: bool = True

    def __post_init__(self) -> None:
        _arrays(self, "line", least=2)


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

    def places(
        self, across: NDArray[np.float64], up: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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


def _arrays(one: Region | ChartLine, word: str, *, least: int) -> None:
    """Make both arrays of a shape read-only. Raises InputError."""
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
