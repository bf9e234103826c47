"""Drawings as SVG: in a page, whose colours they take, and as files for a paper."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.files import atomic_write
from helisim.show.figure import Area, Mark, Panel, Scale, extent, outline

LIGHT = {
    "paper": "#ffffff",
    "ink": "#1b1b1b",
    "soft": "#575757",
    "grid": "#e4e4e4",
    "frame": "#8c8c8c",
    "unused": "#efefef",
    "data": "#cf7a00",
    "identified": "#1769c4",
    "truth": "#111111",
    "third": "#8a4fa3",
    "fourth": "#0c8268",
    "grey": "#767676",
    "level1": "#e6f6ea",
    "level2": "#fdf3d0",
    "level3": "#ffe9e5",
}
"""Colours on paper. Orange, blue and black are told apart by every eye, and in grey."""
DARK = {
    "paper": "#15181c",
    "ink": "#e6e6e6",
    "soft": "#a8adb4",
    "grid": "#2a2f36",
    "frame": "#69717c",
    "unused": "#20252b",
    "data": "#f0a03a",
    "identified": "#6ab4ff",
    "truth": "#f5f5f5",
    "third": "#c99bea",
    "fourth": "#4fcdb0",
    "grey": "#959ca6",
    "level1": "#172a1c",
    "level2": "#2c250f",
    "level3": "#361c1c",
}
_INKS = ("data", "identified", "truth", "third", "fourth", "grey")
_GROUNDS = ("level1", "level2", "level3")

WIDTH = 400.0
"""Of a drawing, in its own units: about the pixels of a phone, and of a quarter of a screen."""
_LEFT, _RIGHT, _TITLE, _BELOW, _END = 42.0, 8.0, 22.0, 34.0, 4.0
"""Units around the panels: tick labels, title, the horizontal axis."""
_ROW, _GAP = 17.0, 5.0
"""Units of a row of words above a panel, and below the panel before."""
_LETTER, _SWATCH = 6.1, 20.0
"""Units of an average letter, and of the sample before a word of a legend."""
_DOT = 2.3
"""Units of radius: wider than the lines above, so that data are seen on both sides of them."""
_HALO = 2.4
"""Units of paper around a mark on areas, both sides together."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """One figure of panels above a common axis.

    Attributes:
        name: for its file, such as "bode_yaw_base_r_ped".
        title: for people.
        caption: what to see in it.
        panels: from top to bottom.
        axis: what is along the horizontal axis, with its unit.
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
            f'<svg class="drawing" role="img" viewBox="0 0 {WIDTH:g} {self._drawn[1]:g}">'
            f"<title>{escape(f'{self.title}. {self.caption}')}</title>{self._drawn[0]}</svg>"
        )

    @property
    def svg(self) -> str:
        """The figure as a file of its own, on white paper, without anything but plain shapes."""
        height = self._drawn[1]
        return (
            '<?xml version="1.0" encoding="utf-8"?>\n'
            f'<svg xmlns="http://www.w3.org/2000/svg" class="drawing" width="{WIDTH:g}" '
            f'height="{height:g}" viewBox="0 0 {WIDTH:g} {height:g}">\n'
            f"<title>{escape(self.title)}</title>\n<desc>{escape(self.caption)}</desc>\n"
            f"<style>\n{_rules(LIGHT.__getitem__)}</style>\n"
            f'<rect class="f-paper" width="{WIDTH:g}" height="{height:g}"/>\n'
            f"{self._drawn[0]}\n</svg>\n"
        )

    def write(self, folder: Path) -> None:
        """Write NAME.svg into a folder that exists. Raises StorageError."""
        with atomic_write(folder / f"{self.name}.svg") as path:
            path.write_text(self.svg, encoding="utf-8")

    @cached_property
    def _drawn(self) -> tuple[str, float]:
        """The shapes, and the height of all of them."""
        across, top = self.across, _TITLE
        texts = [text for panel in self.panels for text in panel.scale.texts]
        longest = max(map(len, texts), default=0)
        left = max(_LEFT, _LETTER * longest + 8.0)
        parts = [_words(left, 14.0, self.title, "title")]
        for panel in self.panels:
            above, top = _heading(panel, left, top)
            parts += [above, *_panel(panel, across, left, top, self.used)]
            top += panel.height + _GAP
        bottom = top - _GAP
        for share, text in zip(across.share(np.array(across.ticks)), across.texts):
            parts.append(_words(_x(share, left), bottom + 13.0, text, "middle"))
        parts.append(_words(_x(0.5, left), bottom + 28.0, self.axis, "middle ink"))
        return "\n".join(parts), bottom + _BELOW + _END


def page_style() -> str:
    """Return the CSS of drawings in a page, and the page's colours: light on paper, or dark."""
    dark = colour_variables(DARK)
    return (
        f":root {{ color-scheme: light dark; {colour_variables(LIGHT)} }}\n"
        f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}\n"
        f"{drawing_style()}"
    )


def drawing_style() -> str:
    """Return the CSS of drawings, in the colours of whatever they stand in."""
    return _rules(lambda name: f"var(--{name})")


def colour_variables(colours: dict[str, str]) -> str:
    """Return colours by name as the CSS variables that drawings and tables take them from."""
    return " ".join(f"--{name}: {colour};" for name, colour in colours.items())


def _rules(colour: Callable[[str], str]) -> str:
    """Return the CSS of a drawing, with colours by name."""
    lines = [
        f".drawing {{ font: 11px system-ui, 'DejaVu Sans', Helvetica, Arial, sans-serif; "
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
    ]
    for name in _INKS:
        lines.append(f".drawing .{name} {{ stroke: {colour(name)} }}")
    return "\n".join(lines) + "\n"


def _heading(panel: Panel, left: float, top: float) -> tuple[str, float]:
    """Return the words above a panel, and where the panel begins: data have no legend on them."""
    labelled = [mark for mark in panel.marks if mark.label]
    rows = list(_rows(labelled))
    parts = []
    free = left + _LETTER * len(panel.label) + 12.0
    beside = len(rows) == 1 and WIDTH - _RIGHT - _wide(rows[0]) > free
    base = top + 12.0
    for row in rows:
        at = WIDTH - _RIGHT - _wide(row)
        at = at if beside else max(min(at, left), 4.0)
        for mark in row:
            parts += [_sample(mark, at, base - 4.0), _words(at + _SWATCH, base, mark.label)]
            at += _width(mark)
        if not beside:
            base += _ROW
    parts.append(_words(left, base, panel.label, "ink"))
    return "\n".join(parts), base + _ROW - 12.0


def _rows(marks: Iterable[Mark]) -> Iterable[list[Mark]]:
    """Yield the marks of a legend in rows that a drawing is wide enough for."""
    row: list[Mark] = []
    for mark in marks:
        if row and _wide([*row, mark]) > WIDTH - _RIGHT - 4.0:
            yield row
            row = []
        row.append(mark)
    if row:
        yield row


def _wide(row: Iterable[Mark]) -> float:
    """Return the width of a row of a legend."""
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
) -> Iterable[str]:
    scale, bottom = panel.scale, top + panel.height
    right = WIDTH - _RIGHT

    def heights(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return bottom - np.clip(scale.share(values), 0.0, 1.0) * panel.height

    if used is not None:
        start, stop = np.clip(_x(across.share(np.array(used)), left), left, right)
        for x, end in ((left, start), (stop, right)):
            if end - x > 0.5:
                yield _rectangle("f-unused", x, top, end - x, panel.height)
    for area in (one for one in panel.areas if len(one.x)):
        yield _area(area, _x(across.share(area.x), left), heights(area.y))
    columns = _x(across.share(np.array(across.ticks)), left)
    rows = heights(np.array(scale.ticks))
    lines = [f"M{x:.1f} {top:.1f}V{bottom:.1f}" for x in columns]
    lines += [f"M{left:.1f} {y:.1f}H{right:.1f}" for y in rows]
    yield f'<path class="grid" d="{"".join(lines)}"/>'
    for y, text in zip(rows, scale.texts):
        yield _words(left - 5.0, y + 4.0, text, "end")
    if panel.threshold is not None:
        y = heights(np.array([panel.threshold]))[0]
        yield f'<path class="frame dashes" d="M{left:.1f} {y:.1f}H{right:.1f}"/>'
    for area in panel.areas:
        (x,), (y,) = across.share(np.array([area.place[0]])), heights(np.array([area.place[1]]))
        if area.label:
            yield _words(_x(x, left), y + 4.0, area.label, "middle")
    for mark in panel.marks:
        if len(mark.x):
            x, y = mark.x, mark.y
            if mark.kind in ("line", "dashes"):
                x, y = outline(x, y, 2 * round(right - left))
            edge = None if mark.top is None else heights(mark.top)
            yield _shape(mark, _x(across.share(x), left), heights(y), edge)
    yield _rectangle("frame", left, top, right - left, panel.height)


def _shape(
    mark: Mark,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    top: NDArray[np.float64] | None = None,
) -> str:
    """Return a mark at places (n,) of the drawing."""
    seen = np.isfinite(y)
    if mark.kind == "bars":
        width, ends = 1.1 * mark.width, y if top is None else top
        path = "".join(f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in zip(x[seen], y[seen], ends[seen]))
    elif mark.kind in ("line", "dashes"):
        width = 1.3 * mark.width
        path = "".join(_line(x[k], y[k]) for k in _runs(seen))
    else:
        (dx, dy, sign), width = _symbol(mark)
        path = "".join(f"M{a + dx:.1f} {b + dy:.1f}{sign}" for a, b in zip(x[seen], y[seen]))
    drawn = f'<path class="{mark.kind} {mark.ink}" stroke-width="{width:.3g}" d="{path}"/>'
    if not mark.halo:
        return drawn
    return f'<path class="{mark.kind} halo" stroke-width="{width + _HALO:.3g}" d="{path}"/>{drawn}'


def _symbol(mark: Mark) -> tuple[tuple[float, float, str], float]:
    """Return where the path of a point begins beside it, the path, and its width."""
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


def _area(area: Area, x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
    """Return an area of corners (n,) in the drawing."""
    return f'<path class="{area.ground}" d="{_line(x, y)}Z"/>'


def _runs(there: NDArray[np.bool_]) -> list[slice]:
    """Return the stretches without a gap of (n,) flags."""
    edges = np.flatnonzero(np.diff(np.r_[False, there, False].astype(np.int8)))
    return [slice(start, stop) for start, stop in zip(edges[::2], edges[1::2])]


def _line(x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
    return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x.tolist(), y.tolist()))


def _x(share: NDArray[np.float64] | float, left: float) -> Any:
    """Return where shares of the horizontal axis are in a drawing."""
    return left + share * (WIDTH - left - _RIGHT)


def _rectangle(style: str, x: float, y: float, width: float, height: float) -> str:
    return (
        f'<rect class="{style}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"/>'
    )


def _words(x: float, y: float, text: str, style: str = "") -> str:
    mark = f' class="{style}"' if style else ""
    return f'<text x="{x:.1f}" y="{y:.1f}"{mark}>{escape(text)}</text>'
