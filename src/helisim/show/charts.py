"""Charts of criteria with ratings or loops on them, and the Bode plots of broken loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from helisim.base.errors import InputError
from helisim.base.units import decibel
from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.criteria import Criterion, Rating
from helisim.handling.loop import Curve
from helisim.handling.measured.margins import MeasuredCurve
from helisim.show.figure import Area, Array, Drawing, Ground, Ink, Mark, Panel, Scale
from helisim.show.plots import DEGREES, beside, decibels, phase_degrees, spread_out

if TYPE_CHECKING:
    from helisim.design.design import Judged

Loops = Mapping[str, Curve | MeasuredCurve]
Ratings = Rating | Sequence[Rating]

_HEIGHT, _ROW = 250.0, 17.0
"""Units of the frame of a chart; of each row of a strip."""
_MARGIN = 0.05
"""Share of an axis that is left beyond a point that lies outside of the chart's own ends."""
_FAR = 1e4
"""Frames that a corner at infinity is away: far enough that no edge to it is seen to be slanted."""
_ENDS = (2.5, 97.5)
"""Percent of the samples below each end of an interval."""
_GROUNDS: dict[int, Ground] = {1: "level1", 2: "level2", 3: "level3"}
_GRID, _WIDE, _FREE = 60, 3.0, 1.5
"""Cells along each side of a chart in which free space for a word is looked for; half a word's
width over half its height; cells that a word needs above and below its middle."""
_PIECES, _BESIDE = 120, 1e-4
"""Pieces of each edge of a region, each with a level on either side; share of the frame from the
edge to where that level is looked up."""


@dataclass(frozen=True)
class Look:
    """Kind, ink and width of a mark, the same wherever its subject is drawn."""

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
"""Subject -> its look, the last on top. Each has a shape besides its colour."""
_OTHERS = (
    *(Look("dots", ink, 1.5) for ink in ("identified", "data", "third", "fourth")),
    Look("squares", "grey", 2.2),
)


@dataclass(frozen=True)
class Shown:
    """One rating on a chart.

    Attributes:
        label: of the rating, such as "predicted".
        figures: name -> value, of the axes of the chart at least; infinity lies at the end.
        draws: the same of each of the models that the data allow: a cloud.
        intervals: name -> lowest and highest value, of some figures.
    """

    label: str
    figures: Mapping[str, float]
    draws: Sequence[Mapping[str, float]] = ()
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class _Axis:
    """An axis as it is drawn: values are `factor` times those in SI."""

    figure: str
    factor: float
    scale: Scale

    def share(self, values: Array) -> Array:
        """Return the places of values of the chart, infinity too, along the axis; (n_value,)."""
        with np.errstate(divide="ignore"):
            shown = self.factor * np.asarray(values, dtype=np.float64)
            return self.scale.share(np.maximum(shown, 0.0) if self.scale.logarithmic else shown)

    def shown(self, values: Array) -> Array:
        """Return values as drawn, those beyond the axis at its end; (n_value,) each."""
        return self.scale.at(np.clip(self.share(values), 0.0, 1.0))


def look_of(label: str, place: int) -> Look:
    """Return the look of a subject by its name, or by its place among others."""
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
        curves: label -> curves, for a chart of gain over phase; after the first they are samples.
        caption: of the drawing; the chart's source by default.
    """
    placed = [one for one in shown if _is_placed(chart, one)]
    across = _drawn_axis(chart.across, placed)
    up = _Axis("", 1.0, Scale(0.0, 1.0)) if chart.up is None else _drawn_axis(chart.up, placed)
    polygons = _polygons(chart, across, up)
    marks = [*_borders(polygons, across, up), *_lines(chart, across, up)]
    rows = len(placed) + 1  # the lowest is left to the names of levels
    points: list[Mark] = []
    for k, one in enumerate(placed):
        points += _points(one, look_of(one.label, k), (across, up), (rows - k - 0.5) / rows)
    points.sort(key=_precedence)
    if not chart.across.figure:
        for k, (label, some) in enumerate((curves or {}).items()):
            points += _traces(some, label, look_of(label, k), (across, up))
    panel = Panel(
        "" if chart.up is None else _labelled(chart.up),
        (*marks, *points),
        _HEIGHT if chart.up is not None else _ROW * rows,
        limits=(up.scale.low, up.scale.high),
        areas=_areas(polygons, across, up, points, None if chart.up else 1.0 / rows),
        logarithmic=up.scale.logarithmic,
        bare=chart.up is None,
    )
    return Drawing(
        name,
        chart.title,
        caption or (f"Source: {chart.source}" if chart.source else ""),
        (panel,),
        _labelled(chart.across),
        logarithmic=across.scale.logarithmic,
        limits=(across.scale.low, across.scale.high),
    )


def draw_ratings(criterion: Criterion, ratings: Ratings | Mapping[str, Ratings | None]) -> Drawing:
    """Return the chart of a criterion with ratings.

    Args:
        criterion: whose chart it is.
        ratings: one, or several (a cloud of samples), or a mapping from a label to either, of
            several the first the nominal one; None where there is none.

    Raises:
        InputError: something is no rating, or not of that kind of criterion.
    """
    labelled = ratings if isinstance(ratings, Mapping) else {"": ratings}
    shown = []
    for label, given in labelled.items():
        some: list[Any] = [given] if isinstance(given, Rating) else list(given or ())
        for one in some:
            if not (isinstance(one, Rating) and isinstance(one.criterion, type(criterion))):
                raise InputError(f"expected ratings by {criterion.name}, got {one!r:.60}")
        if some:
            shown.append(Shown(label, some[0].figures, [one.figures for one in some[1:]]))
        elif given is not None:
            raise InputError(f"no rating under {label!r}: leave the label out")
    return draw_chart(criterion.name, criterion.chart(), shown)


def draw_judged(one: Judged, more: Sequence[Shown] = (), caption: str = "") -> Drawing:
    """Return the chart of one specification with laws before and after, and more if given."""
    before = [Shown("before", one.before.figures)] if one.before else []
    after = Shown("predicted", one.nominal.figures, [each.figures for each in one.cloud])
    criterion = one.nominal.criterion
    shown = [*before, after, *more]
    return draw_chart(chart_name(criterion), criterion.chart(), shown, caption=caption)


def chart_name(criterion: Criterion) -> str:
    """Return a name for the drawing of a criterion of one axis."""
    more = (getattr(criterion, name, None) for name in ("at", "by"))
    return "_".join(filter(None, (criterion.name, criterion.axis, *more)))


def draw_loops(name: str, title: str, curves: Loops, *, caption: str = "") -> Drawing:
    """Draw magnitude and phase of one response, as several sources know it.

    Args:
        name: of the drawing.
        title: for people.
        curves: label -> curve, "before", "predicted", "exact" and "flown" as on charts. One that
            was measured has bars from its samples, of 95 %.
        caption: of the drawing.
    """
    gains: list[Mark] = []
    phases: list[Mark] = []
    other, reference = np.zeros(0), np.zeros(0)
    order = sorted(curves, key=lambda label: not isinstance(curves[label], MeasuredCurve))
    for k, label in enumerate(order):
        curve, ink = curves[label], look_of(label, k).ink
        omega, line = curve.frequency, curve.response
        own = other.size == 0
        phase = phase_degrees(line) if own else beside(omega, line, other, reference)
        if own:
            other, reference = omega, phase
        if isinstance(curve, MeasuredCurve):
            at, ratio = spread_out(omega), curve.samples / curve.response
            for marks, values, off, word in (
                (gains, decibels(line), decibel(np.abs(ratio)), label),
                (phases, phase, np.rad2deg(np.angle(ratio)), ""),
            ):
                low, high = np.percentile(off, _ENDS, axis=0)
                marks.append(Mark("bars", ink, omega[at], (values + low)[at], (values + high)[at]))
                marks.append(Mark("dots", ink, omega[at], values[at], label=word))
        else:
            kind = "dashes" if label == "exact" else "line"
            gains.append(Mark(kind, ink, omega, decibels(line), label=label))
            phases.append(Mark(kind, ink, omega, phase))
    panels = (
        Panel("magnitude, dB", tuple(gains), 130.0, threshold=0.0),
        Panel("phase, deg", tuple(phases), 110.0, steps=DEGREES, threshold=-180.0),
    )
    return Drawing(name, title, caption, panels, "frequency, rad/s", logarithmic=True)


def clipped_polygon(corners: Array) -> Array:
    """Return a polygon within the unit square, by the method of Sutherland and Hodgman.

    Args:
        corners: (n_corner, 2), infinity included.

    Returns:
        (m_corner, 2), none where all of it is outside.
    """
    kept = np.clip(corners, -_FAR, _FAR)
    for axis, bound, sign in ((0, 0.0, 1.0), (0, 1.0, -1.0), (1, 0.0, 1.0), (1, 1.0, -1.0)):
        depth = sign * (kept[:, axis] - bound)
        inner: list[Array] = []
        for k, corner in enumerate(kept):
            before = k - 1
            if (depth[before] >= 0.0) != (depth[k] >= 0.0):
                share = depth[before] / (depth[before] - depth[k])
                inner.append(kept[before] + share * (corner - kept[before]))
            if depth[k] >= 0.0:
                inner.append(corner)
        kept = np.array(inner).reshape(-1, 2)
    return kept


def clipped_line(points: Array) -> Array:
    """Return the pieces of a line within the unit square, with a NaN between two that lie apart.

    Args:
        points: (n_point, 2), infinity included.

    Returns:
        (m_point, 2).
    """
    pieces: list[Array] = []
    for start, end in pairwise(np.clip(points, -_FAR, _FAR)):
        inner = _clipped_piece(start, end)
        if inner is None:
            continue
        if pieces and not np.array_equal(pieces[-1][-1], inner[0]):
            pieces.append(np.full((1, 2), np.nan))
        pieces.append(inner)
    return np.concatenate(pieces) if pieces else np.zeros((0, 2))


def _clipped_piece(start: Array, end: Array) -> Array | None:
    """Return both ends of a piece in the unit square, (2, 2), by Liang and Barsky; None outside."""
    low, high = 0.0, 1.0
    for origin, step in zip(start, end - start):
        if step == 0.0:
            if not 0.0 <= origin <= 1.0:
                return None
            continue
        first, last = sorted((-origin / step, (1.0 - origin) / step))
        low, high = max(low, first), min(high, last)
    if low >= high:
        return None
    ends = np.array([low, high])[:, None]
    exact = np.array([start, end])
    return np.where(ends == np.array([[0.0], [1.0]]), exact, start + ends * (end - start))


def inside(polygon: Array, places: Array) -> NDArray[np.bool_]:
    """Return which places are in a polygon: a ray from them crosses its border oddly.

    Args:
        polygon: corners, (n_corner, 2).
        places: (n_place, 2).
    """
    crossed = np.zeros(len(places), dtype=np.int64)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0)):
        if a[1] != b[1]:
            spans = (a[1] > places[:, 1]) != (b[1] > places[:, 1])
            slope = (b[0] - a[0]) / (b[1] - a[1])
            crossed += spans & (places[:, 0] < a[0] + (places[:, 1] - a[1]) * slope)
    return crossed % 2 == 1


def _drawn_axis(axis: ChartAxis, shown: Sequence[Shown]) -> _Axis:
    """Return an axis that is long enough for ratings; their intervals may leave it."""
    factor = float(np.rad2deg(1.0)) if axis.unit == "rad" else 1.0
    values = [one.figures[axis.figure] for one in shown]
    known = [one for one in values if np.isfinite(one) and (one > 0.0 or not axis.logarithmic)]
    own = Scale(axis.low, axis.high, logarithmic=axis.logarithmic)
    shares = own.share(np.array([axis.low, axis.high, *known]))
    low, high = float(shares.min()), float(shares.max())
    margin = _MARGIN * (high - low)
    low, high = low - margin * (low < 0.0), high + margin * (high > 1.0)
    first, last = factor * own.at(np.array([low, high]))
    scale = Scale(float(first), float(last), logarithmic=axis.logarithmic)
    return _Axis(axis.figure, factor, scale)


def _labelled(axis: ChartAxis) -> str:
    unit = "deg" if axis.unit == "rad" else axis.unit
    return axis.label if unit in ("", "1") else f"{axis.label}, {unit}"


def _is_placed(chart: Chart, one: Shown) -> bool:
    names = [axis.figure for axis in (chart.across, chart.up) if axis is not None]
    return all(names) and all(
        name in one.figures and not np.isnan(one.figures[name]) for name in names
    )


def _lines(chart: Chart, across: _Axis, up: _Axis) -> list[Mark]:
    marks = []
    for line in chart.lines:
        x, y = clipped_line(np.stack([across.share(line.across), up.share(line.up)], axis=-1)).T
        kind, ink = ("line", "truth") if line.boundary else ("dashes", "grey")
        if x.size and (line.label or not line.boundary):
            places = across.scale.at(x), up.scale.at(y)
            marks.append(Mark(kind, ink, *places, label=line.label, width=0.8))
    return marks


def _points(one: Shown, look: Look, axes: tuple[_Axis, _Axis], row: float) -> list[Mark]:
    """Return the cloud of a rating, its intervals and itself on top."""

    def at(axis: _Axis, figures: Mapping[str, float]) -> float:
        return float(axis.shown(np.array([figures[axis.figure]]))[0]) if axis.figure else row

    marks: list[Mark] = []
    if one.draws:
        x, y = (np.array([at(axis, each) for each in one.draws]) for axis in axes)
        marks.append(Mark("dots", look.ink, x, y, width=0.5))
    x, y = (at(axis, one.figures) for axis in axes)
    for k, axis in enumerate(axes):
        if axis.figure in one.intervals:
            ends = axis.shown(np.array(one.intervals[axis.figure]))
            pair = (ends, np.full(2, y)) if k == 0 else (np.full(2, x), ends)
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
    curves: Sequence[Curve], label: str, look: Look, axes: tuple[_Axis, _Axis]
) -> list[Mark]:
    """Return curves of gain over phase, samples first and thin."""
    marks = []
    across, up = axes
    for k, curve in reversed(list(enumerate(curves))):
        phase, gain = curve.phase, decibels(curve.response)
        at = int(np.argmin(np.abs(gain)))
        phase = phase - 2.0 * np.pi * np.ceil(phase[at] / (2.0 * np.pi))
        x, y = clipped_line(np.stack([across.share(phase), up.share(gain)], axis=-1)).T
        kind = "dashes" if look.kind == "crosses" else "line"
        word, width = (label, 1.2) if k == 0 else ("", 0.35)
        if x.size:
            places = across.scale.at(x), up.scale.at(y)
            marks.append(Mark(kind, look.ink, *places, label=word, width=width))
    return marks


Polygons = list[tuple[int, Array]]
"""Level and corners, (n_corner, 2) shares of the frame, of each region in sight."""


def _polygons(chart: Chart, across: _Axis, up: _Axis) -> Polygons:
    found = []
    for region in sorted(chart.regions, key=lambda one: one.level):
        shares = np.stack([across.share(region.across), up.share(region.up)], axis=-1)
        corners = clipped_polygon(shares)
        if len(corners) > 2:
            found.append((region.level, corners))
    return found


def _levels(polygons: Polygons, places: Array) -> NDArray[np.int64]:
    """Return the level of places, (n_place, 2); 0 outside of all regions."""
    found = np.zeros(len(places), dtype=np.int64)
    for level, corners in polygons:
        found[inside(corners, places)] = level
    return found


def _areas(
    polygons: Polygons, across: _Axis, up: _Axis, marks: Sequence[Mark], low: float | None
) -> tuple[Area, ...]:
    """Return the regions, the worse levels on top, each level named once where it has most room.

    Words leave `marks` free; on a strip they are in the share `low` of its height, from below.
    """
    found = [
        Area(_GROUNDS[level], across.scale.at(corners[:, 0]), up.scale.at(corners[:, 1]))
        for level, corners in polygons
    ]
    centres = (np.arange(_GRID) + 0.5) / _GRID
    places = np.stack(np.meshgrid(centres, centres), axis=-1).reshape(-1, 2)
    level = _levels(polygons, places).reshape(_GRID, _GRID)
    if low is None:
        taken = [np.stack([up.scale.share(m.y), across.scale.share(m.x)]) for m in marks]
        there = np.floor(np.concatenate([np.zeros((2, 0)), *taken], axis=1) * _GRID)
        row, column = there[:, np.isfinite(there).all(axis=0)].astype(np.int64).clip(0, _GRID - 1)
        level[row, column] = 0
    for one in np.unique(level[level > 0]):
        around = np.pad(level == one, 1)
        free = np.asarray(distance_transform_edt(around, sampling=(1.0, 1.0 / _WIDE)))[1:-1, 1:-1]
        row, column = np.unravel_index(int(np.argmax(free)), free.shape)
        if free[row, column] >= _FREE:
            x = float(across.scale.at(centres[column]))
            y = float(up.scale.at(centres[row] if low is None else np.array(0.5 * low)))
            found.append(Area(_GROUNDS[int(one)], np.zeros(0), np.zeros(0), f"Level {one}", (x, y)))
    return tuple(found)


def _borders(polygons: Polygons, across: _Axis, up: _Axis) -> list[Mark]:
    """Return the edges of regions that have another level on their other side."""
    marks = []
    shares = np.linspace(0.0, 1.0, _PIECES + 1)
    for _, corners in polygons:
        for a, b in zip(corners, np.roll(corners, -1, axis=0)):
            along = b - a
            length = float(np.hypot(*along))
            if length == 0.0:
                continue
            centres = a + (0.5 * (shares[1:] + shares[:-1]))[:, None] * along
            off = _BESIDE * np.array([-along[1], along[0]]) / length
            left, right = (_levels(polygons, centres + sign * off) for sign in (1.0, -1.0))
            differs = (left != right) & (left > 0) & (right > 0)
            edge = a + shares[:, None] * along
            ends = np.flatnonzero(np.diff(np.r_[False, differs, False].astype(np.int8)))
            for start, stop in zip(ends[::2], ends[1::2]):
                x, y = edge[[start, stop]].T
                marks.append(Mark("line", "truth", across.scale.at(x), up.scale.at(y), width=0.7))
    return marks
