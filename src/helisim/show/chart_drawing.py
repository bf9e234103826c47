"""The standard chart of a criterion with ratings, or loops, on it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.curve import Curve
from helisim.show.bode import decibels
from helisim.show.chart_ground import Drawn, areas, borders
from helisim.show.clipping import clipped_line
from helisim.show.figure import Ink, Mark, Panel, Scale
from helisim.show.svg import Drawing

_HEIGHT, _ROW = 250.0, 17.0
"""Units of the frame of a chart; of each row of a strip."""
_ROOM = 0.05
"""Share of an axis that is left beyond a point that lies outside of the chart's own ends."""
_STRIP = Drawn("", 1.0, 0.0, 1.0, logarithmic=False)


@dataclass(frozen=True)
class Look:
    """How something is drawn wherever it is.

    Attributes:
        kind: of the mark at its value.
        ink: of the mark.
        width: of the mark.
    """

    kind: Literal["dots", "rings", "squares", "crosses"]
    ink: Ink
    width: float = 1.0


LOOKS = {
    "before": Look("squares", "grey", 2.2),
    "shipped": Look("squares", "grey", 2.2),
    "flown": Look("dots", "data", 1.5),
    "predicted": Look("rings", "identified", 2.4),
    "exact": Look("crosses", "truth", 2.2),
}
"""What is compared -> how it is drawn, the last on top. Each has a shape besides its colour."""
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
    name: str,
    chart: Chart,
    shown: Sequence[Shown] = (),
    *,
    curves: Mapping[str, Sequence[Curve]] | None = None,
    caption: str = "",
) -> Drawing:
    """Draw a chart's regions and boundaries, and ratings where their figures are.

    Args:
        name: of the drawing.
        chart: of the criterion.
        shown: the ratings. One that lacks a figure of an axis is left out.
        curves: label -> curves, for a chart of gain over phase; after the first they are draws.
        caption: of the drawing; the chart's source by default.
    """
    placed = [one for one in shown if _placed(chart, one)]
    loops = curves or {}
    across = _across(chart.across, placed)
    up = _STRIP if chart.up is None else _across(chart.up, placed)
    marks = [*borders(chart, across, up), *_lines(chart, across, up)]
    rows = len(placed) + 1  # the lowest is left to the names of levels
    ground = len(marks)
    for k, one in enumerate(placed):
        row = (rows - k - 0.5) / rows
        marks += _points(one, look_of(one.label, k), (across, up), row)
    marks[ground:] = sorted(marks[ground:], key=_precedence)
    if not chart.across.figure:
        for k, (label, some) in enumerate(loops.items()):
            marks += _traces(some, label, look_of(label, k), (across, up))
    label = "" if chart.up is None else _labelled(chart.up)
    height = _HEIGHT if chart.up is not None else _ROW * rows
    panel = Panel(
        label,
        tuple(marks),
        height,
        limits=up.ends,
        areas=areas(chart, across, up, marks[ground:], low=1.0 / rows),
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


def _across(axis: ChartAxis, shown: Sequence[Shown]) -> Drawn:
    """Return an axis that is long enough for ratings; their intervals may leave it."""
    factor = _factor(axis)
    values = [one.figures[axis.figure] for one in shown]
    inside = [one for one in values if np.isfinite(one) and (one > 0.0 or not axis.logarithmic)]
    own = Scale(axis.low, axis.high, (), (), axis.logarithmic)
    shares = own.share(np.array([axis.low, axis.high, *inside]))
    low, high = float(shares.min()), float(shares.max())
    room = _ROOM * (high - low)
    low, high = low - room * (low < 0.0), high + room * (high > 1.0)
    first, last = factor * own.at(np.array([low, high]))
    return Drawn(axis.figure, factor, float(first), float(last), axis.logarithmic)


def _factor(axis: ChartAxis) -> float:
    return float(np.rad2deg(1.0)) if axis.unit == "rad" else 1.0


def _labelled(axis: ChartAxis) -> str:
    unit = "deg" if axis.unit == "rad" else axis.unit
    return axis.label if unit in ("", "1") else f"{axis.label}, {unit}"


def _placed(chart: Chart, one: Shown) -> bool:
    names = [axis.figure for axis in (chart.across, chart.up) if axis is not None]
    return all(names) and all(
        name in one.figures and not np.isnan(one.figures[name]) for name in names
    )


def _lines(chart: Chart, across: Drawn, up: Drawn) -> list[Mark]:
    marks = []
    for line in chart.lines:
        points = np.stack([across.share(line.across), up.share(line.up)], axis=-1)
        x, y = clipped_line(points).T
        look = ("line", "truth") if line.boundary else ("dashes", "grey")
        if x.size and (line.label or not line.boundary):
            marks.append(Mark(*look, across.at(x), up.at(y), label=line.label, width=0.8))
    return marks


def _points(one: Shown, look: Look, axes: tuple[Drawn, Drawn], row: float) -> list[Mark]:
    """Return the cloud of a rating, its intervals and itself on top."""

    def at(axis: Drawn, figures: Mapping[str, float]) -> float:
        return float(axis.shown(np.array([figures[axis.figure]]))[0]) if axis.figure else row

    marks: list[Mark] = []
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


def _precedence(mark: Mark) -> int:
    """Return how far on top a mark is: clouds below intervals, and these below points."""
    inks = [look.ink for look in LOOKS.values()]
    place = inks.index(mark.ink) if mark.ink in inks else 0
    return place + 100 * (mark.kind == "line") + 200 * bool(mark.halo and mark.kind != "line")


def _traces(
    curves: Sequence[Curve], label: str, look: Look, axes: tuple[Drawn, Drawn]
) -> list[Mark]:
    """Return curves of gain over phase, draws first and thin."""
    marks = []
    for k, curve in reversed(list(enumerate(curves))):
        phase = curve.phase
        at = int(np.argmin(np.abs(decibels(curve.response))))
        phase = phase - 2.0 * np.pi * np.ceil(phase[at] / (2.0 * np.pi))
        across, up = axes
        gain = decibels(curve.response)
        x, y = clipped_line(np.stack([across.share(phase), up.share(gain)], axis=-1)).T
        kind = "dashes" if look.kind == "crosses" else "line"
        word, width = (label, 1.2) if k == 0 else ("", 0.35)
        if x.size:
            marks.append(Mark(kind, look.ink, across.at(x), up.at(y), label=word, width=width))
    return marks
