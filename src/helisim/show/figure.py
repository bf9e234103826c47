"""A figure as values: panels one below the other, what is marked in each, and their scales."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Ink = Literal["data", "identified", "truth", "third", "fourth", "grey"]
"""What a mark stands for; light and dark pages have a colour for each."""
Ground = Literal["level1", "level2", "level3"]
"""What an area stands for, likewise."""

_PRETTY = (1.0, 2.0, 5.0)
"""Steps between ticks, times a power of ten."""
_ROUNDING = 1e-9
"""A range below this share of its values is what rounding left of a constant."""


@dataclass(frozen=True, eq=False)
class Mark:
    """One line, band or set of points in a panel.

    Attributes:
        kind: "dots" are filled, "rings" and "squares" are hollow, "crosses" are diagonal, "bars"
            stand between y and top.
        ink: what it stands for.
        x: (n,), in the unit of the figure's axis.
        y: (n,), in the unit of the panel; not finite where there is nothing to mark.
        top: (n,), the upper ends of bars; None for all else.
        label: in the legend; "" for none.
        width: of a line or a point, as a share of the usual.
        halo: whether paper is left around it, so that it is seen on areas and on other marks.
    """

    kind: Literal["line", "dashes", "dots", "rings", "squares", "crosses", "bars"]
    ink: Ink
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    top: NDArray[np.float64] | None = None
    label: str = ""
    width: float = 1.0
    halo: bool = False


@dataclass(frozen=True, eq=False)
class Area:
    """A ground behind the marks of a panel.

    Attributes:
        ground: what it stands for.
        x: (n_corner,) within the figure's axis; none for a label alone.
        y: (n_corner,) within the panel's.
        label: written on it; "" for nothing.
        place: where the middle of the label is, x and y.
    """

    ground: Ground
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    label: str = ""
    place: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes.

    Attributes:
        label: of the vertical axis, with its unit.
        marks: drawn in this order, so that the last ones are on top.
        height: of its frame, in units of the drawing.
        steps: that ticks may have, from small to large; () for 1, 2 and 5 times a power of ten.
        limits: lowest and highest value; None for those of the marks.
        threshold: drawn as a line across; None for none.
        areas: behind the marks.
        logarithmic: whether the vertical axis is; it has limits then.
        bare: True for a vertical axis without ticks.
    """

    label: str
    marks: tuple[Mark, ...]
    height: float
    steps: tuple[float, ...] = ()
    limits: tuple[float, float] | None = None
    threshold: float | None = None
    areas: tuple[Area, ...] = ()
    logarithmic: bool = False
    bare: bool = False

    @property
    def scale(self) -> "Scale":
        """The vertical axis."""
        if self.bare:
            return Scale(*(self.limits or (0.0, 1.0)), ticks=(), texts=())
        if self.logarithmic and self.limits is not None:
            return Scale.decades(*self.limits)
        most = 3 if self.height < 50.0 else 4 if self.height < 80.0 else 6
        if self.limits is not None:
            return Scale.of(*self.limits, most=most, steps=self.steps)
        edges = [edge for m in self.marks for edge in (m.y, m.top) if edge is not None]
        low, high = extent(edges)
        room = 0.06 * (high - low)
        return Scale.of(low - room, high + room, most=most, steps=self.steps)


@dataclass(frozen=True, eq=False)
class Scale:
    """An axis: its ends and its ticks.

    Attributes:
        low: the value at its start.
        high: the value at its end, larger.
        ticks: values with a number.
        texts: the numbers of the ticks, never a negative zero nor what rounding left of one.
        logarithmic: True for equal steps a decade.
    """

    low: float
    high: float
    ticks: tuple[float, ...]
    texts: tuple[str, ...]
    logarithmic: bool = False

    @classmethod
    def of(cls, low: float, high: float, *, most: int, steps: Sequence[float] = ()) -> "Scale":
        """Return a linear axis with 2 to `most` ticks, of the given steps where they fit.

        Where no step gives so few, there are as few as can be.
        """
        decade = 10.0 ** math.floor(math.log10((high - low) / (most + 1)))
        step, counts = decade, range(0)
        for size in (*steps, *(decade * size for size in (*_PRETTY, 10.0, 20.0, 4.0, 40.0))):
            found = range(math.ceil(low / size - 1e-9), math.floor(high / size + 1e-9) + 1)
            if len(found) > 1 and (not counts or len(found) < len(counts)):
                step, counts = size, found
            if 1 < len(counts) <= most:
                break
        ticks = tuple(count * step for count in counts)
        return cls(low, high, ticks, _texts(ticks, step))

    @classmethod
    def decades(cls, low: float, high: float) -> "Scale":
        """Return a logarithmic axis with ticks at 1, 2, 5, 10 and so on."""
        powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        marks = (size * 10.0**power for power in powers for size in _PRETTY)
        ticks = tuple(mark for mark in marks if low * 0.999 <= mark <= high * 1.001)
        return cls(low, high, ticks, tuple(f"{tick:g}" for tick in ticks), logarithmic=True)

    def share(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where values are along the axis, 0 at its start, 1 at its end; (n_value,) each."""
        if self.logarithmic:
            return np.log(values / self.low) / math.log(self.high / self.low)
        return (values - self.low) / (self.high - self.low)

    def at(self, share: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values at shares of the axis, the inverse of `share`; (n_value,) each."""
        if self.logarithmic:
            return self.low * (self.high / self.low) ** share
        return self.low + share * (self.high - self.low)


def extent(values: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """Return lowest and highest of all finite values, (n_value,) each, apart even if constant."""
    whole = np.concatenate([np.ravel(one) for one in values]) if values else np.zeros(1)
    finite = whole[np.isfinite(whole)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    largest = max(abs(low), abs(high))
    if high - low > _ROUNDING * largest:
        return low, high
    room = 0.1 * largest or 1.0
    return low - room, high + room


def outline(
    x: NDArray[np.float64], y: NDArray[np.float64], columns: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a history (n,) by its lowest and highest sample in each of some columns.

    What is drawn is the same as far as a column is narrower than the eye, or a pixel, tells
    apart. A history without many samples for a column is returned as it is.
    """
    if len(x) <= 4 * columns or not np.all(np.isfinite(y)):
        return x, y
    ends = np.linspace(0, len(x), columns + 1).astype(int)
    starts = ends[:-1]
    column = np.repeat(np.arange(columns), np.diff(ends))
    order = np.lexsort((y, column))  # by column, then by value
    kept = np.unique(np.concatenate([order[starts], order[ends[1:] - 1], [0, len(x) - 1]]))
    return x[kept], y[kept]


def less(values: NDArray[np.float64], base: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values less a base, 0 where they differ by rounding alone; (n_value,) each."""
    apart = values - base
    finite = np.abs(values[np.isfinite(values)])
    return np.where(np.abs(apart) <= _ROUNDING * np.max(finite, initial=0.0), 0.0, apart)


def _texts(ticks: Sequence[float], step: float) -> tuple[str, ...]:
    """Return ticks with as many digits as tell them apart."""
    largest = max(map(abs, ticks))
    if (step >= 1e-4 and largest < 1e5) or 0.1 <= largest < 1e3:
        form = f".{max(0, -math.floor(math.log10(step) + 1e-9))}f"
    else:
        form = f".{math.ceil(math.log10(largest / step) + 1e-9) + 1}g"
    return tuple(format(tick, form).replace("-", "\u2212") for tick in ticks)
