"""Drawings as matplotlib figures and PNG, without pyplot."""

import io
import math
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from helisim.show.figure import COLOURS, WIDTH, Drawing, Mark, Panel, Scale

_DPI = 200
_INCHES = 4.2 / WIDTH  # inches per unit of a drawing
_BETWEEN, _AROUND = 40.0, 50.0  # units between panels, and for title and horizontal axis
_BESIDE, _ROW = 4, 16.0  # labels in a row of a legend, and units of each further row
_STYLE: dict[Any, Any] = {
    "font.size": 8.0,
    "axes.axisbelow": True,
    "axes.edgecolor": COLOURS["frame"],
    "axes.titlesize": 8.0,
    "axes.titlelocation": "left",
    "text.parse_math": False,
}
_SYMBOLS = {"squares": "s", "crosses": "x"}


class ShownFigure(Figure):
    """A figure that a notebook shows without pyplot, as a PNG of 200 dots an inch."""

    def _repr_png_(self) -> bytes:
        picture, style = io.BytesIO(), {"dpi": _DPI, "metadata": {"Software": None}}
        FigureCanvasAgg(self).print_figure(picture, format="png", **style)
        return picture.getvalue()


def to_figure(rows: Sequence[Sequence[Drawing]]) -> ShownFigure:
    """Return rows of drawings as one figure."""
    columns = max(map(len, rows))
    heights = [max(sum(_heights(one)) + _AROUND for one in row) for row in rows]
    size = (columns * WIDTH * _INCHES, sum(heights) * _INCHES)
    with matplotlib.rc_context(_STYLE):
        figure = ShownFigure(size, layout="constrained")
        parts = figure.subfigures(len(rows), columns, squeeze=False, height_ratios=heights)
        for row, places in zip(rows, parts):
            for drawing, place in zip(row, places):
                below = _heights(drawing)
                axes = place.subplots(len(below), sharex=True, squeeze=False, height_ratios=below)
                _draw(axes[:, 0], drawing)
                place.suptitle(drawing.title, fontsize=9.5)
    return figure


def _heights(drawing: Drawing) -> list[float]:
    return [one.height + _BETWEEN + _ROW * max(0, _rows(one) - 1) for one in drawing.panels]


def _rows(panel: Panel) -> int:
    return math.ceil(sum(bool(one.label) for one in panel.marks) / _BESIDE)


def _draw(axes: Sequence[Any], drawing: Drawing) -> None:
    across = drawing.across
    low, high = drawing.used or (across.low, across.high)
    for ax, panel in zip(axes, drawing.panels):
        for mark in panel.marks:
            _mark(ax, mark)
        ax.grid(color=COLOURS["grid"], linewidth=0.6)
        _ticks(ax.yaxis, panel.scale)
        ax.set_ylim(panel.scale.low, panel.scale.high)
        if panel.threshold is not None:
            ax.axhline(panel.threshold, color=COLOURS["frame"], linewidth=0.7, linestyle=":")
        labels = sum(bool(one.label) for one in panel.marks)
        if labels:
            ax.legend(
                ncols=min(labels, _BESIDE),
                loc="lower right",
                bbox_to_anchor=(1.0, 1.0),
                borderaxespad=0.0,
                fontsize=7.0,
                frameon=False,
            )
        ax.set_title(panel.label, pad=6.0 + 11.0 * _rows(panel) if labels > 2 else None)
        for start, stop in ((across.low, low), (high, across.high)):
            if start < stop:
                ax.axvspan(start, stop, color=COLOURS["unused"], linewidth=0.0, zorder=0)
        ax.set_xscale("log" if drawing.logarithmic else "linear")
        ax.set_xlim(across.low, across.high)
        _ticks(ax.xaxis, across)
    axes[-1].set_xlabel(drawing.axis)


def _mark(ax: Any, mark: Mark) -> None:
    look = {"color": COLOURS[mark.ink], "label": mark.label or None}
    if mark.kind == "area":
        ax.fill_between(mark.x, mark.y, mark.top, linewidth=0.0, zorder=0, **look)
    elif mark.kind == "bars":
        ax.vlines(mark.x, mark.y, mark.top, linewidth=0.9 * mark.width, **look)
    elif mark.kind in ("line", "dashes"):
        ax.plot(
            mark.x,
            mark.y,
            linewidth=mark.width,
            dashes=(4.0, 2.8) if mark.kind == "dashes" else (),
            **look,
        )
    else:
        face = COLOURS[mark.ink] if mark.kind == "dots" else "none"
        look |= {"markersize": 3.2 * mark.width, "markerfacecolor": face, "clip_on": False}
        ax.plot(mark.x, mark.y, linestyle="none", marker=_SYMBOLS.get(mark.kind, "o"), **look)


def _ticks(axis: Any, scale: Scale) -> None:
    axis.set_ticks(np.array(scale.ticks), scale.texts)
    axis.set_ticks([], minor=True)
