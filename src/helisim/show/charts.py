"""Charts of criteria with ratings, and Bode plots of broken loops."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from helisim.base.arrays import Real
from helisim.base.errors import InputError
from helisim.base.units import decibel
from helisim.handling.criteria import Criterion, Rating
from helisim.handling.limit import Span
from helisim.handling.loop import Curve
from helisim.handling.measured.margins import MeasuredCurve
from helisim.show.figure import Drawing, Ink, Mark, Panel
from helisim.show.plots import DEGREES, beside, decibels, labelled, spread_out

if TYPE_CHECKING:
    from helisim.design.design import Judged

Ratings = Rating | Sequence[Rating]
Look = tuple[Literal["dots", "rings", "squares", "crosses"], Ink, float]
"""Kind, ink and width of a mark."""

_HEIGHT, _ROW = 250.0, 17.0  # units: height of a chart's frame, and of each row of a strip
_ENDS = (2.5, 97.5)  # percentiles that end an interval of 95 %
_LABELS = {"drb": "disturbance rejection bandwidth", "drp": "disturbance rejection peak"}
_GROUNDS: dict[int, Ink] = {1: "level1", 2: "level2", 3: "level3"}

LOOKS: dict[str, Look] = {  # look by subject
    "before": ("squares", "grey", 2.2),
    "flown": ("dots", "data", 1.5),
    "today": ("dots", "data", 1.5),
    "predicted": ("rings", "identified", 2.4),
    "exact": ("crosses", "truth", 2.2),
}
_OTHERS: tuple[Look, ...] = (
    ("dots", "identified", 1.5),
    ("dots", "data", 1.5),
    ("dots", "third", 1.5),
    ("dots", "fourth", 1.5),
)


@dataclass(frozen=True)
class Shown:
    """One rating on a chart: figures, those of each model in a cloud, and intervals, by name."""

    label: str
    figures: Mapping[str, float]
    draws: Sequence[Mapping[str, float]] = ()
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class _Axis:
    """Axis of a figure with a border, from `low` to `high`, in SI (radians drawn as degrees)."""

    figure: str
    unit: str
    spans: tuple[Span, Span, Span]
    low: float
    high: float

    @property
    def factor(self) -> float:
        return float(np.rad2deg(1.0)) if self.unit == "rad" else 1.0

    @property
    def ends(self) -> Span:
        return self.factor * self.low, self.factor * self.high

    @property
    def label(self) -> str:
        said = _LABELS.get(self.figure, self.figure.replace("_", " "))
        return labelled(said, "deg" if self.unit == "rad" else self.unit)

    def clipped(self, value: float) -> float:
        return self.factor * min(max(value, self.low), self.high)

    def inside(self, span: Span) -> Span:
        low, high = sorted(map(self.clipped, span))
        return low, high


def _axis(criterion: Criterion, figure: str, shown: Sequence[Shown]) -> _Axis:
    """Return an axis that shows all three levels of a figure, and the ratings' values."""
    limit = criterion.limits[figure]
    low, high = sorted((limit.level1, limit.level2))
    reach = 2.0 * (high - low)
    start = max(low - reach, 0.0) if low >= 0.0 else low - reach
    known = [x for x in (one.figures[figure] for one in shown) if np.isfinite(x)]
    # beyond the levels by a little more, so that no marker lies on the frame
    ends = (
        min([start, *(x - 0.1 * reach for x in known if x < start)]),
        max([high + reach, *(x + 0.1 * reach for x in known if x > high + reach)]),
    )
    return _Axis(figure, criterion.units[figure], limit.spans(), *ends)


def draw_chart(
    name: str, criterion: Criterion, shown: Sequence[Shown] = (), *, caption: str = ""
) -> Drawing:
    """Draw levels of a criterion's first one or two figures with borders, and ratings with those.

    Where levels overlap the worse holds. Raises InputError of a criterion without borders.
    """
    used = list(criterion.limits)[:2]
    if not used:
        raise InputError(f"{criterion.name} has no borders of levels to draw")
    placed = [one for one in shown if not any(np.isnan(one.figures.get(x, np.nan)) for x in used)]
    axes = [_axis(criterion, figure, placed) for figure in used]
    areas: list[Mark] = []
    across_levels, *up_levels = (list(enumerate(axis.spans, start=1)) for axis in axes)
    regions = product(across_levels, *up_levels)
    for region in sorted(regions, key=lambda one: max(level for level, _ in one)):
        level = max(level for level, _ in region)
        across, *up = (axis.inside(span) for axis, (_, span) in zip(axes, region))
        low, high = np.repeat(up[0] if up else (0.0, 1.0), 2).reshape(2, 2)
        ink, known = _GROUNDS[level], {one.ink for one in areas}
        label = "" if ink in known else f"Level {level}"
        areas.append(Mark("area", ink, np.array(across), low, high, label))
    drawn = [
        point
        for k, one in enumerate(placed)
        for point in _points(one, k, axes, 1.0 - (k + 0.5) / len(placed))
    ]
    strip = len(axes) == 1
    panel = Panel(
        "" if strip else axes[1].label,
        (*areas, *(mark for _, mark in sorted(drawn, key=lambda one: one[0]))),
        _ROW * max(1, len(placed)) if strip else _HEIGHT,
        limits=axes[-1].ends,
        bare=strip,
    )
    cut = getattr(criterion, "at", "")
    return Drawing(
        name,
        f"{criterion.name.replace('_', ' ').capitalize()}, {criterion.word}"
        + (f", cut at {cut}" if cut else ""),
        caption or f"Source: {criterion.source}",
        (panel,),
        axes[0].label,
        limits=axes[0].ends,
    )


def draw_ratings(criterion: Criterion, ratings: Ratings | Mapping[str, Ratings | None]) -> Drawing:
    """Return the chart of a criterion with ratings, by label if given as a mapping.

    Of several the first is nominal. Raises InputError of what is no rating of that criterion.
    """
    given = ratings if isinstance(ratings, Mapping) else {"": ratings}
    shown = []
    for label, one in given.items():
        some: list[Any] = [one] if isinstance(one, Rating) else list(one or ())
        for rating in some:
            if not (isinstance(rating, Rating) and isinstance(rating.criterion, type(criterion))):
                raise InputError(f"expected ratings by {criterion.name}, got {rating!r:.60}")
        if some:
            shown.append(Shown(label, some[0].figures, [each.figures for each in some[1:]]))
    return draw_chart(criterion.name, criterion, shown)


def draw_judged(one: Judged, more: Sequence[Shown] = (), caption: str = "") -> Drawing:
    """Return the chart of one specification with laws before and after."""
    before = [Shown("before", one.before.figures)] if one.before else []
    after = Shown("predicted", one.nominal.figures, [each.figures for each in one.cloud])
    name, criterion = chart_name(one.nominal.criterion), one.nominal.criterion
    return draw_chart(name, criterion, [*before, after, *more], caption=caption)


def chart_name(criterion: Criterion) -> str:
    """Return the name of a criterion's drawing."""
    more = (getattr(criterion, name, None) for name in ("at", "by"))
    return "_".join(filter(None, (criterion.name, criterion.axis, *more)))


def draw_loops(name: str, title: str, curves: Mapping[str, Curve]) -> Drawing:
    """Draw magnitude and phase of curves by label; measured ones have bars of 95 %."""
    gains: list[Mark] = []
    phases: list[Mark] = []
    other: tuple[Real, Real] | None = None
    for k, (label, curve) in enumerate(curves.items()):
        omega, ink = curve.frequency, LOOKS.get(label, _OTHERS[k % len(_OTHERS)])[1]
        gain, phase = decibels(curve.response), beside(omega, curve.response, other)
        other = other or (omega, phase)
        if isinstance(curve, MeasuredCurve):
            at, ratio = spread_out(omega), curve.samples / curve.response
            for marks, values, off in (
                (gains, gain, decibel(np.abs(ratio))),
                (phases, phase, np.rad2deg(np.angle(ratio))),
            ):
                low, high = np.percentile(off, _ENDS, axis=0)
                marks.append(Mark("bars", ink, omega[at], (values + low)[at], (values + high)[at]))
                marks.append(Mark("dots", ink, omega[at], values[at]))
            gains[-1] = replace(gains[-1], label=label)
        else:
            kind = "dashes" if label == "exact" else "line"
            gains.append(Mark(kind, ink, omega, gain, label=label))
            phases.append(Mark(kind, ink, omega, phase))
    panels = (
        Panel("magnitude, dB", tuple(gains), 130.0, threshold=0.0),
        Panel("phase, deg", tuple(phases), 110.0, steps=DEGREES, threshold=-180.0),
    )
    return Drawing(name, title, "", panels, "frequency, rad/s", logarithmic=True)


def _points(
    one: Shown, place: int, axes: Sequence[_Axis], row: float
) -> Iterator[tuple[int, Mark]]:
    """Yield layer and mark: a cloud, intervals on it, and the rating on top."""
    kind, ink, width = LOOKS.get(one.label, _OTHERS[place % len(_OTHERS)])

    def at(figures: Mapping[str, float]) -> list[float]:
        return [*(axis.clipped(figures[axis.figure]) for axis in axes), row][:2]

    cloud = np.array([at(each) for each in one.draws]).reshape(-1, 2).T
    x, y = at(one.figures)
    yield 0, Mark("dots", ink, x=cloud[0], y=cloud[1], width=0.5)
    for k, axis in enumerate(axes):
        if axis.figure in one.intervals:
            ends = np.array([axis.clipped(end) for end in one.intervals[axis.figure]])
            pair = (ends, np.full(2, y)) if k == 0 else (np.full(2, x), ends)
            yield 1, Mark("line", ink, x=pair[0], y=pair[1], width=1.4)
    yield 2, Mark(kind, ink, np.array([x]), np.array([y]), label=one.label, width=width)
