"""The figure of what phase margin costs in disturbance rejection."""

import numpy as np

from helisim.design.tradeoff import TradeOff
from helisim.handling.axis import axis_of
from helisim.show.figure import Mark, Panel, extent
from helisim.show.svg import Drawing

_MARGIN, _PEAK = 3.0, 0.5
"""Degrees and dB that are shown beside the curve."""


def draw_trade_off(found: TradeOff) -> Drawing:
    """Draw disturbance rejection, bandwidth and peak, over the phase margin, and the design."""
    margin = np.rad2deg(found.phase_margin)
    phase, bandwidth = found.design
    at = (np.array([np.rad2deg(phase)]), np.array([bandwidth]))
    panels = (
        Panel(
            "disturbance rejection bandwidth, rad/s",
            (
                Mark("line", "identified", margin, found.bandwidth, label="most there is"),
                Mark("dots", "identified", margin, found.bandwidth),
                Mark("rings", "data", *at, label="designed law", width=2.4, halo=True),
            ),
            130.0,
        ),
        Panel(
            "its peak, dB",
            (
                Mark("line", "identified", margin, found.peak),
                Mark("dots", "identified", margin, found.peak),
            ),
            64.0,
            limits=(float(found.peak.min()) - _PEAK, float(found.peak.max()) + _PEAK),
        ),
    )
    ends = extent([np.append(margin, at[0])])
    word = axis_of(found.axis).word
    caption = (
        "Each point is the most bandwidth at a phase margin, with 6 dB of gain margin; other axes "
        "as designed."
    )
    title = f"Disturbance rejection against phase margin, {word}"
    return Drawing(
        f"trade_off_{found.axis}",
        title,
        caption,
        panels,
        "phase margin, deg",
        limits=(ends[0] - _MARGIN, ends[1] + _MARGIN),
    )
