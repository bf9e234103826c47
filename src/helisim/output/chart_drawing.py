"""The standard chart of a criterion with ratings, or loops, on it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from helisim.handling.chart import Chart, ChartAxis
from helisim.output.clipping import clipped_line, clipped_polygon, middle
from helisim.output.figure import Area, Ground, Ink, Mark, Panel, Scale
from helisim.output.svg import Drawing

_GROUNDS: dict[int, Ground] = {1: "level1", 2: "level2", 3: "level3"}
_HEIGHT, _ROW = 250.0, 17.0
"""Units of the frame of a chart; of each row of a strip."""
_ROOM = 0.05
"""Share of an axis that is left beyond a point that lies outside of the chart's own ends."""


@dataclass(frozen=True)
class Look:
    """How something is drawn wherever it is.

    Attributes:
        kind: of the mark at its value.
        ink: of the mark.
        width: of the mark.
    """

    kind: str
    ink: Ink
    width: float = 1.0


LOOKS = {
    "predicted": Look("rings", "identified", 2.4),
    "exact": Look("crosses", "truth", 2.2),
    "flown": Look("dots", "data", 1.5),
    "shipped": Look("squares", "grey", 2.2),
}
"""What is compared -> how it is drawn. Each has a shape of its own, besides its colour."""
_OTHERS = (
    Look("dots", "identified", 1.5),
    Look("dots", "data", 1.5),
    Look("dots", "third", 1.5),
    Look("dots", "fourth", 1.5),
    Look("squares", "grey", 2.2),
)


@dataclass(frozen=True)
class Shown:
    """One rating on a chart.

    Attributes:
        label: what it is of, such as "predicted".
        figures: name -> value, of the axes of the chart at least; infinity lies at the end.
        draws: the same of each of the models that the data allow: a cloud.
        intervals: name -> lowest and highest value, of some figures.
    """

    label: str
    figures: Mapping[str, float]
    draws: Sequence[Mapping[str, float]] = ()
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def look_of(label: str, place: int) -> Look:
    """Return how something is drawn by its name, or by its place among others."""
    return LOOKS.get(label, _OTHERS[place % len(_OTHERS)])


def draw_chart(
    name: str, chart: Chart, shown: Sequence[Shown] = (), *, caption: str = ""
) -> Drawing:
    """Draw a chart's regions and boundaries, and ratings where their figures are.

    Args:
        name: of the drawing.
        chart: of the criterion.
        shown: the ratings. One that lacks a figure of an axis is left out.
        caption: of the drawing; the chart's source by default.
    """
    placed = [one for one in shown if _placed(chart, one)]
    across = _across(chart.across, placed)
    up = _strip(len(placed)) if chart.up is None else _across(chart.up, placed)
    marks = [*_lines(chart, across, up)]
    for k, one in enumerate(placed):
        row = (len(placed) - k - 0.5) / len(placed)
        marks += _points(one, look_of(one.label, k), (across, up), row)
    label = "" if chart.up is None else _labelled(chart.up)
    height = _HEIGHT if chart.up is not None else _ROW * max(len(placed), 2)
    panel = Panel(
        label,
        tuple(marks),
        height,
        limits=up.ends,
        areas=tuple(_areas(chart, across, up)),
        logarithmic=up.logarithmic,
        bare=chart.up is None,
    )
    return Drawing(
        name,
        chart.title,
        caption or (f"Source: {chart.source}" if chart.source else ""),
        (panel,),
        _labelled(chart.across),
        logarithmic=across.logarithmic,
        limits=across.ends,
    )


@dataclass(frozen=True)
class _Drawn:
    """An axis as it is drawn: the figure along it, its ends and its unit for people."""

    figure: str
    factor: float
    low: float
    high: float
    logarithmic: bool

    @property
    def ends(self) -> tuple[float, float]:
        return self.low, self.high

    @property
    def scale(self) -> Scale:
        return Scale(self.low, self.high, (), (), self.logarithmic)

    def share(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where values (n,) of the chart are along the axis, infinity included."""
        with np.errstate(divide="ignore"):
            shown = self.factor * np.asarray(values, dtype=np.float64)
            return self.scale.share(np.maximum(shown, 0.0) if self.logarithmic else shown)

    def at(self, share: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return values (n,) as drawn."""
        return self.scale.at(share)

    def shown(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return values (n,) of the chart as drawn, what lies beyond the axis at its end."""
        return self.at(np.clip(self.share(values), 0.0, 1.0))


def _across(axis: ChartAxis, shown: Sequence[Shown]) -> _Drawn:
    """Return an axis that is long enough for ratings and their intervals."""
    factor = _factor(axis)
    values = [one.figures[axis.figure] for one in shown]
    values += [edge for one in shown for edge in one.intervals.get(axis.figure, ())]
    inside = [one for one in values if np.isfinite(one) and (one > 0.0 or not axis.logarithmic)]
    own = Scale(axis.low, axis.high, (), (), axis.logarithmic)
    shares = own.share(np.array([axis.low, axis.high, *inside]))
    low, high = float(shares.min()), float(shares.max())
    room = _ROOM * (high - low)
    low, high = low - room * (low < 0.0), high + room * (high > 1.0)
    first, last = factor * own.at(np.array([low, high]))
    return _Drawn(axis.figure, factor, float(first), float(last), axis.logarithmic)


def _strip(rows: int) -> _Drawn:
    return _Drawn("", 1.0, 0.0, 1.0, logarithmic=False)


def _factor(axis: ChartAxis) -> float:
    return float(np.rad2deg(1.0)) if axis.unit == "rad" else 1.0


def _labelled(axis: ChartAxis) -> str:
    unit = "deg" if axis.unit == "rad" else axis.unit
    return axis.label if unit in ("", "1") else f"{axis.label}, {unit}"


def _placed(chart: Chart, one: Shown) -> bool:
    names = [axis.figure for axis in (chart.across, chart.up) if axis is not None]
    return all(name in one.figures and not np.isnan(one.figures[name]) for name in names)


def _areas(chart: Chart, across: _Drawn, up: _Drawn) -> list[Area]:
    """Return the regions, the worse levels last, and on top of others."""
    areas = []
    for region in sorted(chart.regions, key=lambda one: one.level):
        corners = np.stack([across.share(region.across), up.share(region.up)], axis=-1)
        corners = clipped_polygon(corners)
        if len(corners) > 2:
            at = middle(corners)
            area = Area(_GROUNDS[region.level], across.at(corners[:, 0]), up.at(corners[:, 1]))
            if at is not None:
                x, y = across.at(np.array([at[0]])), up.at(np.array([at[1]]))
                area = replace(area, label=f"Level {region.level}", place=(float(x[0]), float(y[0])))
            areas.append(area)
    return areas


def _lines(chart: Chart, across: _Drawn, up: _Drawn) -> list[Mark]:
    marks = []
    for line in chart.lines:
        points = np.stack([across.share(line.across), up.share(line.up)], axis=-1)
        x, y = clipped_line(points).T
        look = ("line", "truth") if line.boundary else ("dashes", "grey")
        if x.size:
            marks.append(Mark(*look, across.at(x), up.at(y), label=line.label, width=0.8))
    return marks


def _points(one: Shown, look: Look, axes: tuple[_Drawn, _Drawn], row: float) -> list[Mark]:
    """Return the cloud of a rating, its intervals and itself on top."""

    def at(axis: _Drawn, figures: Mapping[str, float]) -> float:
        return float(axis.shown(np.array([figures[axis.figure]]))[0]) if axis.figure else row

    marks = []
    if one.draws:
        x, y = (np.array([at(axis, each) for each in one.draws]) for axis in axes)
        marks.append(Mark("dots", look.ink, x, y, width=0.5))
    x, y = (at(axis, one.figures) for axis in axes)
    for k, axis in enumerate(axes):
        if axis.figure in one.intervals:
            ends = axis.shown(np.array(one.intervals[axis.figure]))
            other = np.full(2, y if k == 0 else x)
            pair = (ends, other) if k == 0 else (other, ends)
            marks.append(Mark("line", look.ink, *pair, width=1.4, halo=True))
    point = (np.array([x]), np.array([y]))
    marks.append(Mark(look.kind, look.ink, *point, label=one.label, width=look.width, halo=True))
    return marks
