"""Drawings by matplotlib, with the panels and colours of the SVG: figures, and PNG.

No pyplot: a figure belongs to its caller, and is gone with the last name for it.
"""

import io
import math
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, withStroke

from helisim.base.errors import InputError
from helisim.show.figure import LIGHT, WIDTH, Drawing, Mark, Scale

_DPI, _SHOWN_DPI = 200, 100
"""Dots per inch of a PNG; pixels of a page per inch of a figure on a screen."""
_INCHES = 4.2 / WIDTH
"""Inches per unit of a drawing: text of 9 points stays readable in a column."""
_ABOVE, _BELOW, _AROUND = 26.0, 14.0, 50.0
"""Units for a panel's legend, between panels, and for title and horizontal axis together."""
_LETTER, _SAMPLE, _BESIDE = 5.6, 36.0, 330.0
"""Units of an average letter, of a line before a word of the legend, and of both beside the
panel's label."""
_ROW = 17.0
"""Points that the label is above a panel, to leave the row below it to the legend."""
_LEGEND: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "frameon": False,
    "fontsize": 7.0,
    "borderaxespad": 0.0,
    "handlelength": 1.6,
    "columnspacing": 1.2,
    "handletextpad": 0.5,
}
_STYLE: dict[Any, Any] = {
    "font.size": 8.0,
    "axes.axisbelow": True,
    "axes.edgecolor": LIGHT["frame"],
}
_SYMBOLS = {"rings": "o", "squares": "s", "crosses": "x"}


class ShownFigure(Figure):
    """A figure that a notebook shows by itself, whether or not pyplot is loaded."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        """Return the picture, and the size on a page: half of its own, for sharp screens."""
        width, height = (round(_SHOWN_DPI * inches) for inches in self.get_size_inches())
        return _png(self, 2 * _SHOWN_DPI), {"width": width, "height": height}


def to_figure(rows: Sequence[Sequence[Drawing]]) -> Figure:
    """Return drawings in rows and columns as one figure."""
    columns = max(map(len, rows))
    heights = [max(sum(_heights(one)) + _AROUND for one in row) for row in rows]
    size = (columns * WIDTH * _INCHES, sum(heights) * _INCHES)
    with matplotlib.rc_context(_STYLE):
        figure = ShownFigure(size, _SHOWN_DPI, layout="constrained")
        parts = figure.subfigures(len(rows), columns, squeeze=False, height_ratios=heights)
        for row, places in zip(rows, parts):
            for drawing, place in zip(row, places):
                below = _heights(drawing)
                grid = place.subplots(len(below), sharex=True, squeeze=False, height_ratios=below)
                axes = list(grid[:, 0])
                _draw(axes, drawing)
                for ax in axes[:-1]:
                    ax.set_xlabel("")
                    ax.tick_params(labelbottom=False)
                place.suptitle(_literal(drawing.title), fontsize=9.5)
    return figure


def draw_on(axes: Sequence[Axes], drawings: Sequence[Drawing]) -> Figure:
    """Draw on existing axes, a panel on each, in order; return the first one's figure.

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


def _heights(drawing: Drawing) -> list[float]:
    return [panel.height + _ABOVE + _BELOW for panel in drawing.panels]


def _draw(axes: Sequence[Axes], drawing: Drawing) -> None:
    """Draw each panel on one of as many axes."""
    across = drawing.across
    low, high = drawing.used or (across.low, across.high)
    for ax, panel in zip(axes, drawing.panels):
        for area in panel.areas:
            ax.fill(area.x, area.y, color=LIGHT[area.ground], linewidth=0.0, zorder=0)
            middle: dict[str, Any] = {"ha": "center", "va": "center", "zorder": 1}
            ax.text(*area.place, area.label, color=LIGHT["soft"], fontsize=7.0, **middle)
        for mark in panel.marks:
            _mark(ax, mark)
        ax.grid(color=LIGHT["grid"], linewidth=0.6)
        ax.set_yscale("log" if panel.logarithmic else "linear")
        _ticks(ax.yaxis, panel.scale)
        ax.set_ylim(panel.scale.low, panel.scale.high)
        if panel.threshold is not None:
            ax.axhline(panel.threshold, color=LIGHT["frame"], linewidth=0.7, linestyle=":")
        labels = [mark.label for mark in panel.marks if mark.label]
        wide = sum(_SAMPLE + _LETTER * len(one) for one in labels)
        rows = math.ceil(wide / WIDTH)
        if labels:
            ax.legend(ncols=math.ceil(len(labels) / rows), **_LEGEND)
        crowded = labels and _LETTER * len(panel.label) + wide > _BESIDE
        pad = _ROW * rows if crowded else None
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
        drawn: Any = ax.vlines(mark.x, mark.y, top, linewidth=0.9 * mark.width, **look)
    elif mark.kind in ("line", "dashes"):
        dashes = (4.0, 2.8) if mark.kind == "dashes" else ()
        (drawn,) = ax.plot(mark.x, mark.y, linewidth=mark.width, dashes=dashes, **look)
    else:
        (drawn,) = ax.plot(
            mark.x,
            mark.y,
            linestyle="none",
            marker=_SYMBOLS.get(mark.kind, "o"),
            markersize=3.2 * mark.width,
            markerfacecolor=LIGHT[mark.ink] if mark.kind == "dots" else "none",
            markeredgewidth=0.5 if mark.kind == "dots" else 0.5 * mark.width,
            **look,
        )
    if mark.halo:
        drawn.set_path_effects([withStroke(linewidth=2.5, foreground=LIGHT["paper"]), Normal()])


def _literal(text: str) -> str:
    """Return a text that matplotlib shows as it is: a dollar begins no formula."""
    return text.replace("$", r"\$")


def _ticks(axis: Any, scale: Scale) -> None:
    axis.set_ticks(np.array(scale.ticks), scale.texts)
    axis.set_ticks([], minor=True)
