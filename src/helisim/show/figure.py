"""Figures as values, panels of marks on scales, and as SVG: in a page or as files."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.files import atomic_write

Array = NDArray[np.float64]
Ink = Literal["data", "identified", "truth", "third", "fourth", "grey"]
"""The meaning of a mark; light and dark pages have a colour for each."""
Ground = Literal["level1", "level2", "level3"]
"""The meaning of an area, likewise."""

# Orange, blue and black are told apart by every eye, and in grey.
_COLOURS = {
    "paper": ("#ffffff", "#15181c"),
    "ink": ("#1b1b1b", "#e6e6e6"),
    "soft": ("#575757", "#a8adb4"),
    "grid": ("#e4e4e4", "#2a2f36"),
    "frame": ("#8c8c8c", "#69717c"),
    "unused": ("#efefef", "#20252b"),
    "data": ("#cf7a00", "#f0a03a"),
    "identified": ("#1769c4", "#6ab4ff"),
    "truth": ("#111111", "#f5f5f5"),
    "third": ("#8a4fa3", "#c99bea"),
    "fourth": ("#0c8268", "#4fcdb0"),
    "grey": ("#767676", "#959ca6"),
    "level1": ("#e6f6ea", "#172a1c"),
    "level2": ("#fdf3d0", "#2c250f"),
    "level3": ("#ffe9e5", "#361c1c"),
}
LIGHT = {name: pair[0] for name, pair in _COLOURS.items()}
DARK = {name: pair[1] for name, pair in _COLOURS.items()}
_INKS = ("data", "identified", "truth", "third", "fourth", "grey")
_GROUNDS = ("level1", "level2", "level3")

_PRETTY = (1.0, 2.0, 5.0)
"""Steps between ticks, times a power of ten."""
_ROUNDING = 1e-9
"""A range below this share of its values is the rounding error of a constant."""

WIDTH = 400.0
"""Width of a drawing in its own units: about the pixels of a phone, or a quarter of a screen."""
# units around the panels: tick labels, title, the horizontal axis
_LEFT, _RIGHT, _TITLE, _BELOW, _END = 42.0, 8.0, 22.0, 34.0, 4.0
_ROW, _GAP = 17.0, 5.0
"""Units of a row of words above a panel, and below the panel before."""
_LETTER, _SWATCH = 6.1, 20.0
"""Units of an average letter, and of the sample before a word of a legend."""
_DOT, _HALO = 2.3, 2.4
"""Units of a dot's radius, and of the paper around a mark on areas, both sides together."""


@dataclass(frozen=True, eq=False)
class Mark:
    """One line, band or set of points in a panel.

    Attributes:
        kind: "dots" are filled, "rings" and "squares" are hollow, "crosses" are diagonal, "bars"
            stand between y and top.
        ink: the meaning, hence the colour.
        x: (n,), in the unit of the figure's axis.
        y: (n,), in the unit of the panel; not finite where there is nothing to mark.
        top: (n,), the upper ends of bars; None for all else.
        label: in the legend; "" for none.
        width: of a line or a point, as a share of the usual.
        halo: whether paper is left around it, so that it is seen on areas and on other marks.
    """

    kind: Literal["line", "dashes", "dots", "rings", "squares", "crosses", "bars"]
    ink: Ink
    x: Array
    y: Array
    top: Array | None = None
    label: str = ""
    width: float = 1.0
    halo: bool = False


@dataclass(frozen=True, eq=False)
class Area:
    """A ground behind the marks of a panel.

    Attributes:
        ground: the meaning, hence the colour.
        x: (n_corner,) within the figure's axis; none for a label alone.
        y: (n_corner,) within the panel's.
        label: written on it; "" for nothing.
        place: of the middle of the label, x and y.
    """

    ground: Ground
    x: Array
    y: Array
    label: str = ""
    place: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Scale:
    """An axis: its ends, low below high, and its ticks, logarithmic or not."""

    low: float
    high: float
    ticks: tuple[float, ...] = ()
    texts: tuple[str, ...] = ()
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
        return cls(low, high, ticks, _tick_texts(ticks, step))

    @classmethod
    def decades(cls, low: float, high: float) -> "Scale":
        """Return a logarithmic axis with ticks at 1, 2, 5, 10 and so on."""
        powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        marks = (size * 10.0**power for power in powers for size in _PRETTY)
        ticks = tuple(mark for mark in marks if low * 0.999 <= mark <= high * 1.001)
        return cls(low, high, ticks, tuple(f"{tick:g}" for tick in ticks), logarithmic=True)

    def share(self, values: Array) -> Array:
        """Return the places of values along the axis, 0 at its start, 1 at its end; (n_value,)."""
        if self.logarithmic:
            return np.log(values / self.low) / math.log(self.high / self.low)
        return (values - self.low) / (self.high - self.low)

    def at(self, share: Array) -> Array:
        """Return the values at shares of the axis, the inverse of `share`; (n_value,) each."""
        if self.logarithmic:
            return self.low * (self.high / self.low) ** share
        return self.low + share * (self.high - self.low)


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
    def scale(self) -> Scale:
        """The vertical axis."""
        if self.bare:
            return Scale(*(self.limits or (0.0, 1.0)))
        if self.logarithmic and self.limits is not None:
            return Scale.decades(*self.limits)
        most = 3 if self.height < 50.0 else 4 if self.height < 80.0 else 6
        if self.limits is not None:
            return Scale.of(*self.limits, most=most, steps=self.steps)
        low, high = extent([edge for m in self.marks for edge in (m.y, m.top) if edge is not None])
        margin = 0.06 * (high - low)
        return Scale.of(low - margin, high + margin, most=most, steps=self.steps)


@dataclass(frozen=True, eq=False)
class Drawing:
    """One figure of panels above a common axis.

    Attributes:
        name: for its file, such as "bode_yaw_base_r_ped".
        title: for people.
        caption: says what to see in it.
        panels: from top to bottom.
        axis: label of the horizontal axis, with its unit.
        logarithmic: whether that axis is.
        used: lowest and highest place of what a fit used, the others have a grey ground; None
            for all.
        limits: ends of the horizontal axis; None for those of the marks.
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
        if self.limits is not None:
            linear = not self.logarithmic
            return Scale.of(*self.limits, most=8) if linear else Scale.decades(*self.limits)
        low, high = extent([mark.x for panel in self.panels for mark in panel.marks])
        if self.logarithmic:
            return Scale.decades(low / 1.04, high * 1.04)
        return Scale.of(low, high, most=9)

    @property
    def inline(self) -> str:
        """The figure as a part of a page that has `page_style`."""
        return (
            f'<svg class="drawing" role="img" viewBox="0 0 {WIDTH:g} {self._shapes[1]:g}">'
            f"<title>{escape(f'{self.title}. {self.caption}')}</title>{self._shapes[0]}</svg>"
        )

    @property
    def svg(self) -> str:
        """The figure as a file of its own, on white paper, without anything but plain shapes."""
        shapes, height = self._shapes
        return (
            '<?xml version="1.0" encoding="utf-8"?>\n'
            f'<svg xmlns="http://www.w3.org/2000/svg" class="drawing" width="{WIDTH:g}" '
            f'height="{height:g}" viewBox="0 0 {WIDTH:g} {height:g}">\n'
            f"<title>{escape(self.title)}</title>\n<desc>{escape(self.caption)}</desc>\n"
            f"<style>\n{_rules(LIGHT.__getitem__)}</style>\n"
            f'<rect class="f-paper" width="{WIDTH:g}" height="{height:g}"/>\n{shapes}\n</svg>\n'
        )

    def write(self, folder: Path) -> None:
        """Write NAME.svg into a folder that exists. Raises StorageError."""
        with atomic_write(folder / f"{self.name}.svg") as path:
            path.write_text(self.svg, encoding="utf-8")

    @cached_property
    def _shapes(self) -> tuple[str, float]:
        """The shapes, and the height of all of them."""
        across, top = self.across, _TITLE
        texts = [text for panel in self.panels for text in panel.scale.texts]
        left = max(_LEFT, _LETTER * max(map(len, texts), default=0) + 8.0)
        parts = [text_at(left, 14.0, self.title, "title")]
        for panel in self.panels:
            above, top = _heading(panel, left, top)
            parts += [above, *_panel(panel, across, left, top, self.used)]
            top += panel.height + _GAP
        bottom = top - _GAP
        for share, text in zip(across.share(np.array(across.ticks)), across.texts):
            parts.append(text_at(_x(share, left), bottom + 13.0, text, "middle"))
        parts.append(text_at(_x(0.5, left), bottom + 28.0, self.axis, "middle ink"))
        return "\n".join(parts), bottom + _BELOW + _END


def page_style() -> str:
    """Return the CSS of drawings in a page, and the page's colours: light on paper, or dark."""
    return (
        f":root {{ color-scheme: light dark; {colour_variables(LIGHT)} }}\n"
        f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {colour_variables(DARK)} }} }}"
        f"\n{drawing_style()}"
    )


def drawing_style() -> str:
    """Return the CSS of drawings, in the colours of the page around them."""
    return _rules(variable)


def variable(name: str) -> str:
    """Return a colour by name as CSS takes it from a variable."""
    return f"var(--{name})"


def colour_variables(colours: dict[str, str]) -> str:
    """Return colours by name as the CSS variables that drawings and tables take them from."""
    return " ".join(f"--{name}: {colour};" for name, colour in colours.items())


def extent(values: Sequence[Array]) -> tuple[float, float]:
    """Return lowest and highest of all finite values, (n_value,) each, apart even if constant."""
    whole = np.concatenate([np.ravel(one) for one in values]) if values else np.zeros(1)
    finite = whole[np.isfinite(whole)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    largest = max(abs(low), abs(high))
    if high - low > _ROUNDING * largest:
        return low, high
    margin = 0.1 * largest or 1.0
    return low - margin, high + margin


def outline(x: Array, y: Array, columns: int) -> tuple[Array, Array]:
    """Return a history (n,) by its lowest and highest sample in each of some columns.

    The picture is the same as far as a column is narrower than the eye, or a pixel, tells apart.
    A history without many samples for a column is returned as it is.
    """
    if len(x) <= 4 * columns or not np.all(np.isfinite(y)):
        return x, y
    ends = np.linspace(0, len(x), columns + 1).astype(int)
    order = np.lexsort((y, np.repeat(np.arange(columns), np.diff(ends))))  # by column, then value
    kept = np.unique(np.concatenate([order[ends[:-1]], order[ends[1:] - 1], [0, len(x) - 1]]))
    return x[kept], y[kept]


def less(values: Array, base: Array) -> Array:
    """Return values less a base, 0 where they differ by rounding alone; (n_value,) each."""
    apart = values - base
    finite = np.abs(values[np.isfinite(values)])
    return np.where(np.abs(apart) <= _ROUNDING * np.max(finite, initial=0.0), 0.0, apart)


def text_at(x: float, y: float, text: str, style: str = "") -> str:
    """Return words at a place of an SVG."""
    mark = f' class="{style}"' if style else ""
    return f'<text x="{x:.1f}" y="{y:.1f}"{mark}>{escape(text)}</text>'


def _tick_texts(ticks: Sequence[float], step: float) -> tuple[str, ...]:
    """Return ticks with as many digits as tell them apart, never a negative zero."""
    largest = max(map(abs, ticks))
    if (step >= 1e-4 and largest < 1e5) or 0.1 <= largest < 1e3:
        form = f".{max(0, -math.floor(math.log10(step) + 1e-9))}f"
    else:
        form = f".{math.ceil(math.log10(largest / step) + 1e-9) + 1}g"
    return tuple(format(tick, form).replace("-", "\u2212") for tick in ticks)


def _rules(colour: Callable[[str], str]) -> str:
    """Return the CSS of a drawing, with colours by name."""
    lines = [
        ".drawing { font: 11px system-ui, 'DejaVu Sans', Helvetica, Arial, sans-serif; "
        f"fill: {colour('soft')} }}",
        f".drawing .title {{ font-size: 12.5px; font-weight: 600; fill: {colour('ink')} }}",
        f".drawing .ink {{ fill: {colour('ink')} }}",
        ".drawing .middle { text-anchor: middle }",
        ".drawing .end { text-anchor: end }",
        ".drawing path { fill: none; stroke-linejoin: round }",
        ".drawing .dots { stroke-linecap: round }",
        f".drawing .grid {{ stroke: {colour('grid')}; stroke-width: .7 }}",
        f".drawing .frame {{ stroke: {colour('frame')}; stroke-width: .8; fill: none }}",
        f".drawing .f-unused {{ fill: {colour('unused')} }}",
        f".drawing .f-paper {{ fill: {colour('paper')} }}",
        *(f".drawing .{name} {{ fill: {colour(name)}; stroke: none }}" for name in _GROUNDS),
        f".drawing .halo {{ stroke: {colour('paper')} }}",
        ".drawing .dashes { stroke-dasharray: 4 4.5 }",
        *(f".drawing .{name} {{ stroke: {colour(name)} }}" for name in _INKS),
    ]
    return "\n".join(lines) + "\n"


def _heading(panel: Panel, left: float, top: float) -> tuple[str, float]:
    """Return the words above a panel, and the top of the panel: no legend lies on data."""
    rows = _legend_rows([mark for mark in panel.marks if mark.label])
    parts = []
    free = left + _LETTER * len(panel.label) + 12.0
    beside = len(rows) == 1 and WIDTH - _RIGHT - _wide(rows[0]) > free
    base = top + 12.0
    for row in rows:
        at = WIDTH - _RIGHT - _wide(row)
        at = at if beside else max(min(at, left), 4.0)
        for mark in row:
            parts += [_sample(mark, at, base - 4.0), text_at(at + _SWATCH, base, mark.label)]
            at += _width(mark)
        if not beside:
            base += _ROW
    parts.append(text_at(left, base, panel.label, "ink"))
    return "\n".join(parts), base + _ROW - 12.0


def _legend_rows(marks: Iterable[Mark]) -> list[list[Mark]]:
    """Return the marks of a legend in rows that a drawing is wide enough for."""
    rows: list[list[Mark]] = []
    for mark in marks:
        if not rows or _wide([*rows[-1], mark]) > WIDTH - _RIGHT - 4.0:
            rows.append([])
        rows[-1].append(mark)
    return rows


def _wide(row: Iterable[Mark]) -> float:
    return sum(map(_width, row)) - 8.0


def _width(mark: Mark) -> float:
    return _SWATCH + _LETTER * len(mark.label) + 8.0


def _sample(mark: Mark, x: float, y: float) -> str:
    """Return a piece of a mark for the legend."""
    if mark.kind == "bars":
        return _shape(mark, np.array([x + 8.0]), np.array([y + 4.0]), np.array([y - 4.0]))
    ends = np.array([x, x + 15.0]) if mark.kind in ("line", "dashes") else np.array([x + 8.0])
    return _shape(mark, ends, np.full(len(ends), y))


def _panel(
    panel: Panel, across: Scale, left: float, top: float, used: tuple[float, float] | None
) -> Iterator[str]:
    scale, bottom = panel.scale, top + panel.height
    right = WIDTH - _RIGHT

    def heights(values: Array) -> Array:
        return bottom - np.clip(scale.share(values), 0.0, 1.0) * panel.height

    if used is not None:
        start, stop = np.clip(_x(across.share(np.array(used)), left), left, right)
        for x, end in ((left, start), (stop, right)):
            if end - x > 0.5:
                yield _rectangle("f-unused", x, top, end - x, panel.height)
    for area in panel.areas:
        if len(area.x):
            corners = _line(_x(across.share(area.x), left), heights(area.y))
            yield f'<path class="{area.ground}" d="{corners}Z"/>'
    rows = heights(np.array(scale.ticks))
    lines = [
        f"M{x:.1f} {top:.1f}V{bottom:.1f}" for x in _x(across.share(np.array(across.ticks)), left)
    ]
    lines += [f"M{left:.1f} {y:.1f}H{right:.1f}" for y in rows]
    yield f'<path class="grid" d="{"".join(lines)}"/>'
    for y, text in zip(rows, scale.texts):
        yield text_at(left - 5.0, y + 4.0, text, "end")
    if panel.threshold is not None:
        y = heights(np.array([panel.threshold]))[0]
        yield f'<path class="frame dashes" d="M{left:.1f} {y:.1f}H{right:.1f}"/>'
    for area in panel.areas:
        (x,), (y,) = across.share(np.array([area.place[0]])), heights(np.array([area.place[1]]))
        if area.label:
            yield text_at(_x(x, left), y + 4.0, area.label, "middle")
    for mark in panel.marks:
        if len(mark.x):
            x, y = mark.x, mark.y
            if mark.kind in ("line", "dashes"):
                x, y = outline(x, y, 2 * round(right - left))
            edge = None if mark.top is None else heights(mark.top)
            yield _shape(mark, _x(across.share(x), left), heights(y), edge)
    yield _rectangle("frame", left, top, right - left, panel.height)


def _shape(mark: Mark, x: Array, y: Array, top: Array | None = None) -> str:
    """Return a mark at places (n,) of the drawing."""
    seen = np.isfinite(y)
    if mark.kind == "bars":
        width, ends = 1.1 * mark.width, y if top is None else top
        path = "".join(f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in zip(x[seen], y[seen], ends[seen]))
    elif mark.kind in ("line", "dashes"):
        width = 1.3 * mark.width
        edges = np.flatnonzero(np.diff(np.r_[False, seen, False].astype(np.int8)))
        path = "".join(_line(x[a:b], y[a:b]) for a, b in zip(edges[::2], edges[1::2]))
    else:
        (dx, dy, sign), width = _symbol(mark)
        path = "".join(f"M{a + dx:.1f} {b + dy:.1f}{sign}" for a, b in zip(x[seen], y[seen]))
    shape = f'<path class="{mark.kind} {mark.ink}" stroke-width="{width:.3g}" d="{path}"/>'
    if not mark.halo:
        return shape
    return f'<path class="{mark.kind} halo" stroke-width="{width + _HALO:.3g}" d="{path}"/>{shape}'


def _symbol(mark: Mark) -> tuple[tuple[float, float, str], float]:
    """Return the start of a point's path beside its place, the path, and its width."""
    if mark.kind == "dots":
        return (0.0, 0.0, "h0"), 2.0 * _DOT * mark.width  # no length, with round ends
    r = (_DOT - 0.4) * mark.width
    side, width = 2.0 * r, 0.8 * mark.width
    if mark.kind == "rings":
        ring = f"a{r:.3g} {r:.3g} 0 1 0 {side:.3g} 0a{r:.3g} {r:.3g} 0 1 0 {-side:.3g} 0"
        return (-r, 0.0, ring), width
    if mark.kind == "squares":
        return (-r, -r, f"h{side:.3g}v{side:.3g}h{-side:.3g}z"), width
    return (-r, -r, f"l{side:.3g} {side:.3g}m{-side:.3g} 0l{side:.3g} {-side:.3g}"), width


def _line(x: Array, y: Array) -> str:
    return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x.tolist(), y.tolist()))


def _x(share: Array | float, left: float) -> Any:
    """Return the places of shares of the horizontal axis in a drawing."""
    return left + share * (WIDTH - left - _RIGHT)


def _rectangle(style: str, x: float, y: float, width: float, height: float) -> str:
    return (
        f'<rect class="{style}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"/>'
    )
