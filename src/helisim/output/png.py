"""Drawings as PNG, for what takes no SVG: by matplotlib, with the panels and colours of the SVG."""

import io
from typing import Any

import numpy as np

from helisim.output.figure import Mark, Scale
from helisim.output.svg import LIGHT, WIDTH, Drawing

_DPI = 200
_INCHES = 4.2 / WIDTH
"""Of a unit of a drawing: text of 9 points stays readable in a column."""
_ABOVE, _BELOW = 26.0, 14.0
"""Units of a drawing around each panel: its legend; what is between it and the next."""


def to_png(drawing: Drawing) -> bytes:
    """Return a drawing as a PNG of 200 dots an inch, on white."""
    import matplotlib  # here alone: it takes longer to import than the SVG of a report to draw
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    heights = [panel.height + _ABOVE + _BELOW for panel in drawing.panels]
    style: dict[Any, Any] = {
        "font.size": 8.0,
        "axes.axisbelow": True,
        "axes.edgecolor": LIGHT["frame"],
    }
    across = drawing.across
    with matplotlib.rc_context(style):
        figure = Figure(
            (WIDTH * _INCHES, (sum(heights) + 50.0) * _INCHES), _DPI, layout="constrained"
        )
        axes = figure.subplots(len(heights), sharex=True, squeeze=False, height_ratios=heights)[
            :, 0
        ]
        for ax, panel in zip(axes, drawing.panels):
            for mark in panel.marks:
                _mark(ax, mark)
            ax.set_title(panel.label, loc="left", fontsize=8.0)
            ax.grid(color=LIGHT["grid"], linewidth=0.6)
            _ticks(ax.yaxis, panel.scale)
            ax.set_ylim(panel.scale.low, panel.scale.high)
            if panel.threshold is not None:
                ax.axhline(panel.threshold, color=LIGHT["frame"], linewidth=0.7, linestyle=":")
            if any(mark.label for mark in panel.marks):
                place = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0)}
                ax.legend(ncols=2, frameon=False, fontsize=7.0, borderaxespad=0.0, **place)
            low, high = drawing.used or (across.low, across.high)
            for start, stop in ((across.low, low), (high, across.high)):
                ax.axvspan(start, stop, color=LIGHT["unused"], linewidth=0.0, zorder=0)
        axes[-1].set_xscale("log" if drawing.logarithmic else "linear")
        axes[-1].set_xlim(across.low, across.high)
        _ticks(axes[-1].xaxis, across)
        axes[-1].set_xlabel(drawing.axis)
        figure.suptitle(drawing.title, fontsize=9.5)
        picture = io.BytesIO()
        FigureCanvasAgg(figure).print_png(picture, metadata={"Software": None})
    return picture.getvalue()


def _mark(ax: Any, mark: Mark) -> None:
    look = {"color": LIGHT[mark.ink], "label": mark.label or None}
    if mark.kind == "band":
        top = mark.y if mark.top is None else mark.top
        ax.fill_between(mark.x, mark.y, top, alpha=0.25, linewidth=0.0, **look)
    elif mark.kind in ("line", "dashes"):
        dashes = (4.0, 2.8) if mark.kind == "dashes" else ()
        ax.plot(mark.x, mark.y, linewidth=mark.width, dashes=dashes, **look)
    else:
        face = "none" if mark.kind == "rings" else LIGHT[mark.ink]
        dots = {"linestyle": "none", "marker": "o", "markersize": 3.2, "markeredgewidth": 0.5}
        ax.plot(mark.x, mark.y, markerfacecolor=face, **dots, **look)


def _ticks(axis: Any, scale: Scale) -> None:
    axis.set_ticks(np.array(scale.ticks), scale.texts)
    axis.set_ticks([], minor=True)
