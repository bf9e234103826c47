"""Figures as values: panels of marks on scales, and their SVG."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Literal

import numpy as np

from helisim.base.arrays import Real
from helisim.base.files import write_text

Ink = Literal[  # meaning of a mark; levels are of areas
    "data", "identified", "truth", "third", "fourth", "grey", "level1", "level2", "level3"
]

_INKS = {  # orange, blue and black are told apart by every eye, and in grey
    "data": "#cf7a00",
    "identified": "#1769c4",
    "truth": "#111111",
    "third": "#8a4fa3",
    "fourth": "#0c8268",
    "grey": "#767676",
}
_GROUNDS = {"level1": "#d9f0df", "level2": "#fbeab2", "level3": "#ffdcd5"}
COLOURS = {
    "paper": "#ffffff",
    "ink": "#1b1b1b",
    "soft": "#575757",
    "grid": "#e4e4e4",
    "frame": "#8c8c8c",
    "unused": "#efefef",
    **_INKS,
    **_GROUNDS,
}
# _PRETTY: steps between ticks, times a power of ten
# _ROUNDING: relative range below which values count as constant
_PRETTY, _ROUNDING = (1.0, 2.0, 5.0), 1e-9

WIDTH = 400.0  # width of a drawing in its own units
# units around the panels: tick labels, title, the horizontal axis
_LEFT, _RIGHT, _TITLE, _BELOW = 42.0, 12.0, 22.0, 38.0
_ROW, _GAP = 17.0, 5.0
"""Units of a row of words above a panel, and of the gap below the panel before."""
_LETTER, _SWATCH = 5.7, 20.0  # units of an average letter, and of a legend's sample
_DOT = 2.3  # radius of a dot in units


@dataclass(frozen=True, eq=False)
class Mark:
    """A line, bars from y to `top` or points, (n,) each; `width` is a share of the usual.

    x is in the unit of the figure's axis, y of the panel's, not finite where nothing is marked. An
    area from y to `top`, (2,) each, between the two x lies behind all others.
    """

    kind: Literal["area", "line", "dashes", "dots", "rings", "squares", "crosses", "bars"]
    ink: Ink
    x: Real
    y: Real
    top: Real | None = None
    label: str = ""
    width: float = 1.0


@dataclass(frozen=True, eq=False)
class Scale:
    """An axis with its ends and ticks."""

    low: float
    high: float
    ticks: tuple[float, ...] = ()
    logarithmic: bool = False

    @classmethod
    def of(cls, low: float, high: float, *, most: int, steps: Sequence[float] = ()) -> "Scale":
        """Return a linear axis with about `most` ticks, of the given steps where they fit."""
        decade = 10.0 ** math.floor(math.log10((high - low) / (most + 1)))
        for sizes in (steps, [decade * size for size in (*_PRETTY, 10.0, 20.0)]):
            counts = {
                size: range(math.ceil(low / size - 1e-9), math.floor(high / size + 1e-9) + 1)
                for size in sizes
            }
            apart = {size: abs(len(count) - most) for size, count in counts.items() if count[1:]}
            if apart:
                size = min(apart, key=apart.__getitem__)
                return cls(low, high, tuple(count * size for count in counts[size]))
        return cls(low, high, (low, high))

    @classmethod
    def decades(cls, low: float, high: float) -> "Scale":
        """Return a logarithmic axis with ticks at 1, 2, 5, 10 and so on."""
        powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        marks = (size * 10.0**power for power in powers for size in _PRETTY)
        ticks = tuple(mark for mark in marks if low * 0.999 <= mark <= high * 1.001)
        return cls(low, high, ticks, logarithmic=True)

    @property
    def texts(self) -> list[str]:
        """Ticks as text."""
        return [f"{tick:.10g}" for tick in self.ticks]

    def share(self, values: Real | Sequence[float]) -> Real:
        """Return places of values along the axis, 0 at its start, 1 at its end; (n_value,)."""
        values = np.asarray(values, dtype=np.float64)
        return (
            np.log(values / self.low) / math.log(self.high / self.low)
            if self.logarithmic
            else (values - self.low) / (self.high - self.low)
        )


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes: label with unit, height in units of the drawing, and a line at `threshold`.

    Without `steps` ticks are 1, 2 and 5 times a power of ten; without `limits` its range is that of
    the marks; `bare` is from 0 to 1 without ticks.
    """

    label: str
    marks: tuple[Mark, ...]
    height: float
    steps: tuple[float, ...] = ()
    limits: tuple[float, float] | None = None
    threshold: float | None = None
    bare: bool = False

    @property
    def scale(self) -> Scale:
        """The vertical axis."""
        if self.bare:
            return Scale(0.0, 1.0)
        edges = [edge for m in self.marks for edge in (m.y, m.top) if edge is not None]
        low, high = self.limits or extent(edges, 0.06)
        most = 3 if self.height < 50.0 else 4 if self.height < 80.0 else 6
        return Scale.of(low, high, most=most, steps=self.steps)


@dataclass(frozen=True, eq=False)
class Drawing:
    """Panels above a common axis, labelled `axis`, with its unit; `name` is that of its file.

    Outside of `used`, a fit's range, the ground is grey; `limits` None are those of the marks.
    """

    name: str
    title: str
    caption: str
    panels: tuple[Panel, ...]
    axis: str
    logarithmic: bool = False
    used: tuple[float, float] | None = None
    limits: tuple[float, float] | None = None

    @property
    def across(self) -> Scale:
        """The horizontal axis."""
        low, high = self.limits or extent([mark.x for panel in self.panels for mark in panel.marks])
        return Scale.decades(low, high) if self.logarithmic else Scale.of(low, high, most=8)

    @cached_property
    def inline(self) -> str:
        """SVG for a page that has `drawing_style`."""
        across, top = self.across, _TITLE
        texts = [text for panel in self.panels for text in panel.scale.texts]
        left = max(_LEFT, _LETTER * max(map(len, texts), default=0) + 8.0)
        parts = [text_at(left, 14.0, self.title, "title")]
        for panel in self.panels:
            above, top = _heading(panel, left, top)
            parts += [*above, *_panel(panel, across, left, top, self.used)]
            top += panel.height + _GAP
        width, bottom = WIDTH - left - _RIGHT, top - _GAP
        parts += [
            text_at(left + share * width, bottom + 13.0, text, "middle")
            for share, text in zip(across.share(across.ticks), across.texts)
        ]
        parts.append(text_at(left + 0.5 * width, bottom + 28.0, self.axis, "middle ink"))
        shapes, height = "\n".join(parts), bottom + _BELOW
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" class="drawing" role="img" '
            f'width="{WIDTH:g}" height="{height:g}" viewBox="0 0 {WIDTH:g} {height:g}">'
            f"<title>{escape(f'{self.title}. {self.caption}')}</title>\n"
            f'<rect class="f-paper" width="{WIDTH:g}" height="{height:g}"/>{shapes}</svg>'
        )

    @property
    def svg(self) -> str:
        """SVG as a file of its own."""
        style = f"</title><style>\n{drawing_style(COLOURS)}</style>"
        head = '<?xml version="1.0" encoding="utf-8"?>\n'
        return head + self.inline.replace("</title>", style, 1) + "\n"

    def write(self, folder: Path) -> None:
        """Write NAME.svg into a folder that exists. Raises StorageError."""
        write_text(folder / f"{self.name}.svg", self.svg)


def extent(values: Sequence[Real], margin: float = 0.0) -> tuple[float, float]:
    """Return lowest and highest finite value, (n_value,) each, `margin` of their distance added."""
    whole = np.concatenate([np.zeros(0), *map(np.ravel, values)])
    finite = whole[np.isfinite(whole)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    largest = max(abs(low), abs(high))
    apart = margin * (high - low) if high - low > _ROUNDING * largest else 0.1 * largest or 1.0
    return low - apart, high + apart


def outline(x: Real, y: Real, columns: int) -> tuple[Real, Real]:
    """Return a history (n,) by lowest and highest sample in each column, or as it is if short."""
    if len(x) <= 4 * columns or not np.all(np.isfinite(y)):
        return x, y
    ends = np.linspace(0, len(x), columns + 1).astype(int)
    order = np.lexsort((y, np.repeat(np.arange(columns), np.diff(ends))))  # by column, then value
    kept = np.unique(np.concatenate([order[ends[:-1]], order[ends[1:] - 1], [0, len(x) - 1]]))
    return x[kept], y[kept]


def drawing_style(colours: Mapping[str, str]) -> str:
    """Return the CSS of drawings in colours by name."""
    return "\n".join(
        [
            ".drawing { font: 11px system-ui, 'DejaVu Sans', Helvetica, Arial, sans-serif; "
            f"fill: {colours['soft']} }}",
            ".drawing .title { font-size: 12.5px; font-weight: 600 }",
            f".drawing .title, .drawing .ink {{ fill: {colours['ink']} }}",
            ".drawing .middle { text-anchor: middle }",
            ".drawing .end { text-anchor: end }",
            ".drawing path { fill: none; stroke-linejoin: round }",
            ".drawing .dots { stroke-linecap: round }",
            f".drawing .grid {{ stroke: {colours['grid']}; stroke-width: .7 }}",
            f".drawing .frame {{ stroke: {colours['frame']}; stroke-width: .8; fill: none }}",
            *(f".drawing .f-{name} {{ fill: {colours[name]} }}" for name in ("paper", "unused")),
            *(f".drawing .{name} {{ fill: {colours[name]} }}" for name in _GROUNDS),
            ".drawing .dashes { stroke-dasharray: 4 4.5 }",
            *(f".drawing .{name} {{ stroke: {colours[name]} }}" for name in _INKS),
        ]
    )


def text_at(x: float, y: float, text: str, style: str = "") -> str:
    """Return an SVG text."""
    return f'<text x="{x:.1f}" y="{y:.1f}" class="{style}">{escape(text)}</text>'


def _heading(panel: Panel, left: float, base: float) -> tuple[list[str], float]:
    base += 12.0
    parts = [text_at(left, base, panel.label, "ink")]
    at = left + _LETTER * len(panel.label) + 12.0 * bool(panel.label)
    for one in panel.marks:
        if one.label:
            width = _SWATCH + _LETTER * len(one.label) + 8.0
            if at + width > WIDTH:
                at, base = left, base + _ROW
            parts += [_sample(one, at, base - 4.0), text_at(at + _SWATCH, base, one.label)]
            at += width
    return parts, base + _ROW - 12.0


def _sample(one: Mark, x: float, y: float) -> str:
    if one.kind == "area":
        return _rectangle(one.ink, x, y - 5.0, 15.0, 10.0)
    if one.kind == "bars":
        return _shape(one, np.array([x + 8.0]), np.array([y + 4.0]), np.array([y - 4.0]))
    ends = np.array([x, x + 15.0] if one.kind in ("line", "dashes") else [x + 8.0])
    return _shape(one, ends, np.full(len(ends), y))


def _panel(
    panel: Panel, across: Scale, left: float, top: float, used: tuple[float, float] | None
) -> Iterator[str]:
    scale, width, height = panel.scale, WIDTH - left - _RIGHT, panel.height
    # inner drawings, in units from the corner of the frame, of which lines are cut off at its edge
    frame = f'<svg x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}"'
    yield f"{frame}>"
    start, stop = np.clip(across.share(used or (across.low, across.high)), 0.0, 1.0) * width
    for x, end in ((0.0, start), (stop, width)):
        if end - x > 0.5:
            yield _rectangle("f-unused", x, 0.0, end - x, height)
    areas = [mark for mark in panel.marks if mark.kind == "area"]
    for area in areas:
        x, end = across.share(area.x) * width
        low, high = (scale.share(one)[0] for one in (area.y, area.top) if one is not None)
        yield _rectangle(area.ink, x, (1.0 - high) * height, end - x, (high - low) * height)
    rows = (1.0 - scale.share(scale.ticks)) * height
    lines = [f"M{x:.1f} 0V{height:g}" for x in across.share(across.ticks) * width]
    lines += [f"M0 {y:.1f}H{width:.1f}" for y in rows]
    yield f'<path class="grid" d="{"".join(lines)}"/>'
    if panel.threshold is not None:
        y = (1.0 - scale.share([panel.threshold])[0]) * height
        yield f'<path class="frame dashes" d="M0 {y:.1f}H{width:.1f}"/>'
    yield "</svg>"
    for mark in panel.marks[len(areas) :]:
        line = mark.kind in ("line", "dashes")
        x, y = outline(mark.x, mark.y, 2 * round(width)) if line else (mark.x, mark.y)
        x, y = across.share(x) * width, (1.0 - scale.share(y)) * height
        ends = None if mark.top is None else (1.0 - scale.share(mark.top)) * height
        cut = "hidden" if line or ends is not None else "visible"
        yield f'{frame} overflow="{cut}">{_shape(mark, x, y, ends)}</svg>'
    for y, text in zip(rows, scale.texts):
        yield text_at(left - 5.0, top + y + 4.0, text, "end")
    yield _rectangle("frame", left, top, width, height)


def _shape(mark: Mark, x: Real, y: Real, top: Real | None = None) -> str:
    seen = np.isfinite(y)
    if mark.kind == "bars":
        width, ends = 1.1 * mark.width, y if top is None else top
        path = "".join(f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in zip(x[seen], y[seen], ends[seen]))
    elif mark.kind in ("line", "dashes"):
        width = 1.3 * mark.width
        edges = np.flatnonzero(np.diff(np.r_[False, seen, False].astype(np.int8)))
        points = [f"{one:.1f} {other:.1f}" for one, other in zip(x.tolist(), y.tolist())]
        path = "".join(f"M{'L'.join(points[a:b])}" for a, b in zip(edges[::2], edges[1::2]))
    else:
        r = (_DOT - 0.4) * mark.width
        d, arc = 2.0 * r, f"a{r:.3g} {r:.3g} 0 1 0"
        width, dx, dy, sign = {
            "dots": (2.0 * _DOT * mark.width, 0.0, 0.0, "h0"),  # of no length, with round ends
            "rings": (0.8 * mark.width, -r, 0.0, f"{arc} {d:.3g} 0{arc} {-d:.3g} 0"),
            "squares": (0.8 * mark.width, -r, -r, f"h{d:.3g}v{d:.3g}h{-d:.3g}z"),
            "crosses": (0.8 * mark.width, -r, -r, f"l{d:.3g} {d:.3g}m{-d:.3g} 0l{d:.3g} {-d:.3g}"),
        }[mark.kind]
        path = "".join(f"M{a + dx:.1f} {b + dy:.1f}{sign}" for a, b in zip(x[seen], y[seen]))
    return f'<path class="{mark.kind} {mark.ink}" stroke-width="{width:.3g}" d="{path}"/>'


def _rectangle(style: str, x: float, y: float, width: float, height: float) -> str:
    return (
        f'<rect class="{style}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"/>'
    )
