"""Drawings by matplotlib, with the panels and colours of the SVG: figures, and PNG.

No pyplot: a figure belongs to whoever asked for it, and is gone with the last name for it.
"""

import io
import math
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.patheffects import Normal, withStroke

from helisim.base.errors import InputError
from helisim.show.figure import Mark, Scale
from helisim.show.svg import LIGHT, WIDTH, Drawing

_DPI = 200
_SHOWN_DPI = 100
"""Of a figure on a screen, in pixels of a page; its picture has twice as many."""
_INCHES = 4.2 / WIDTH
"""Of a unit of a drawing: text of 9 points stays readable in a column."""
_ABOVE, _BELOW = 26.0, 14.0
"""Units of a drawing around each panel: its legend; what is between it and the next."""
_AROUND = 50.0
"""Units above and below all panels: title and horizontal axis."""

_LEGEND: dict[str, Any] = {"handlelength": 1.6, "columnspacing": 1.2, "handletextpad": 0.5}
_LETTER, _SAMPLE, _ROOM = 5.6, 36.0, 330.0
"""Units of an average letter, of a line before a word of the legend, and of both beside the
panel's label."""
_ROW = 17.0
"""Points that the label is above a panel, to leave the row below it to the legend."""

_MIDDLE: dict[str, Any] = {"ha": "center", "va": "center", "zorder": 1}

_STYLE: dict[Any, Any] = {
    "font.size": 8.0,
    "axes.axisbelow": True,
    "axes.edgecolor": LIGHT["frame"],
}


class ShownFigure(Figure):
    """A figure that a notebook shows by itself, whether or not pyplot is loaded."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        """Return the picture, and the size on a page: half of its own, for sharp screens."""
        width, height = (round(_SHOWN_DPI * inches) for inches in self.get_size_inches())
        return _png(self, 2 * _SHOWN_DPI), {"width": width, "height": height}


def to_figure(rows: Sequence[Sequence[Drawing]]) -> Figure:
    """Return drawings in rows and columns as one figure."""
    columns = max(map(len, rows))
    heights = [max(_height(drawing) for drawing in row) for row in rows]
    with matplotlib.rc_context(_STYLE):
        figure = ShownFigure(
            (columns * WIDTH * _INCHES, sum(heights) * _INCHES), _SHOWN_DPI, layout="constrained"
        )
        parts = figure.subfigures(len(rows), columns, squeeze=False, height_ratios=heights)
        for row, places in zip(rows, parts):
            for drawing, place in zip(row, places):
                _fill(place, drawing)
    return figure


def draw_on(axes: Sequence[Axes], drawings: Sequence[Drawing]) -> Figure:
    """Draw on axes that there are, a panel on each, in order; return the first one's figure.

    Raises:
        InputError: there are more or fewer axes than panels; the message lists the panels.
    """
    panels = [panel.label for drawing in drawings for panel in drawing.panels]
    given = list(np.ravel(np.array(axes, dtype=object)))
    if len(given) != len(panels):
        raise InputError(
            f"axes has {len(given)} axes, and there are {len(panels)} panels to draw: "
            f"{'; '.join(panels)}"
        )
    figure = given[0].get_figure(root=True)
    with matplotlib.rc_context(_STYLE):
        for drawing in drawings:
            own, given = given[: len(drawing.panels)], given[len(drawing.panels) :]
            _draw(own, drawing)
    return figure


def to_png(drawing: Drawing) -> bytes:
    """Return a drawing as a PNG of 200 dots an inch, on white."""
    return _png(to_figure([[drawing]]), _DPI)


def _png(figure: Figure, dpi: int) -> bytes:
    picture = io.BytesIO()
    canvas = FigureCanvasAgg(figure)
    canvas.print_figure(picture, dpi=dpi, format="png", metadata={"Software": None})
    return picture.getvalue()


def _height(drawing: Drawing) -> float:
    return sum(panel.height + _ABOVE + _BELOW for panel in drawing.panels) + _AROUND


def _fill(place: SubFigure, drawing: Drawing) -> None:
    heights = [panel.height + _ABOVE + _BELOW for panel in drawing.panels]
    grid = place.subplots(len(heights), sharex=True, squeeze=False, height_ratios=heights)
    axes = list(grid[:, 0])
    _draw(axes, drawing)
    for ax in axes[:-1]:
        ax.set_xlabel("")
        ax.tick_params(labelbottom=False)
    place.suptitle(_literal(drawing.title), fontsize=9.5)


def _draw(axes: Sequence[Axes], drawing: Drawing) -> None:
    """Draw each panel on one of as many axes."""
    across = drawing.across
    low, high = drawing.used or (across.low, across.high)
    for ax, panel in zip(axes, drawing.panels):
        for area in panel.areas:
            ax.fill(area.x, area.y, color=LIGHT[area.ground], linewidth=0.0, zorder=0)
            ax.text(*area.place, area.label, color=LIGHT["soft"], fontsize=7.0, **_MIDDLE)
        for mark in panel.marks:
            _mark(ax, mark)
        ax.grid(color=LIGHT["grid"], linewidth=0.6)
        ax.set_yscale("log" if panel.logarithmic else "linear")
        _ticks(ax.yaxis, panel.scale)
        ax.set_ylim(panel.scale.low, panel.scale.high)
        if panel.threshold is not None:
            ax.axhline(panel.threshold, color=LIGHT["frame"], linewidth=0.7, linestyle=":")
        labels = [mark.label for mark in panel.marks if mark.label]
        rows = math.ceil(sum(_SAMPLE + _LETTER * len(one) for one in labels) / WIDTH)
        if labels:
            columns = math.ceil(len(labels) / rows)
            place = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "ncols": columns}
            ax.legend(frameon=False, fontsize=7.0, borderaxespad=0.0, **place, **_LEGEND)
        words = _LETTER * len(panel.label) + sum(_SAMPLE + _LETTER * len(one) for one in labels)
        pad = _ROW * rows if labels and words > _ROOM else None
        ax.set_title(_literal(panel.label), loc="left", fontsize=8.0, pad=pad)
        for start, stop in ((across.low, low), (high, across.high)):
            if start < stop:
                ax.axvspan(start, stop, color=LIGHT["unused"], linewidth=0.0, zorder=0)
        ax.set_xscale("log" if drawing.logarithmic else "linear")
        ax.set_xlim(across.low, across.high)
        _ticks(ax.xaxis, across)
        ax.set_xlabel(_literal(drawing.axis))


def _mark(ax: Any, mark: Mark) -> None:
    look = {"color": LIGHT[mark.ink], "label": _literal(mark.label) or None}
    if mark.kind == "bars":
        top = mark.y if mark.top is None else mark.top
        ax.vlines(mark.x, mark.y, top, linewidth=0.9 * mark.width, **look)
    elif mark.kind in ("line", "dashes"):
        dashes = (4.0, 2.8) if mark.kind == "dashes" else ()
        ax.plot(mark.x, mark.y, linewidth=mark.width, dashes=dashes, **look)
    else:
        edge = LIGHT[mark.ink]
        symbol = {"rings": "o", "squares": "s", "crosses": "x"}.get(mark.kind, "o")
        face = edge if mark.kind == "dots" else "none"
        thick = 0.5 if mark.kind == "dots" else 0.5 * mark.width
        dots: dict[str, Any] = {"linestyle": "none", "marker": symbol, "markeredgewidth": thick}
        ax.plot(mark.x, mark.y, markerfacecolor=face, markersize=3.2 * mark.width, **dots, **look)
    if mark.halo:
        line = ax.lines[-1] if mark.kind != "bars" else ax.collections[-1]
        line.set_path_effects([withStroke(linewidth=2.5, foreground=LIGHT["paper"]), Normal()])


def _literal(text: str) -> str:
    """Return a text that matplotlib shows as it is: a dollar begins no formula."""
    return text.replace("$", r"\$")


def _ticks(axis: Any, scale: Scale) -> None:
    axis.set_ticks(np.array(scale.ticks), scale.texts)
    axis.set_ticks([], minor=True)
