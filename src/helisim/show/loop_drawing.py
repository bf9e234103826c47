"""Bode plots of broken loops: of the law before, predicted, exact, and flown with intervals."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from helisim.base.units import decibel
from helisim.handling.curve import Curve
from helisim.handling.measured.measured_curve import MeasuredCurve
from helisim.show.bode import DEGREES, beside, decibels, phase_degrees
from helisim.show.bode_drawing import spread_out
from helisim.show.chart_drawing import look_of
from helisim.show.figure import Mark, Panel
from helisim.show.svg import Drawing

_ENDS = (2.5, 97.5)
"""Percent of the draws below each end of an interval."""

Loops = Mapping[str, Curve | MeasuredCurve]


def draw_loops(name: str, title: str, curves: Loops, *, caption: str = "") -> Drawing:
    """Draw magnitude and phase of one response, of whoever knows it.

    Args:
        name: of the drawing.
        title: for people.
        curves: label -> curve, "before", "predicted", "exact" and "flown" as on charts. One that
            was measured has bars from its draws, of 95 %.
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
            at = spread_out(omega)
            for marks, values, (low, high), word in (
                (gains, decibels(line), _spread(curve, "gain"), label),
                (phases, phase, _spread(curve, "phase"), ""),
            ):
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


def _spread(curve: MeasuredCurve, what: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return by how much less and more a curve may be, (n_freq,) each, dB or degrees."""
    ratio = curve.drawn / curve.response
    off = decibel(np.abs(ratio)) if what == "gain" else np.rad2deg(np.angle(ratio))
    low, high = np.percentile(off, _ENDS, axis=0)
    return low, high
