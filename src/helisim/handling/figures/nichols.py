"""How far a broken loop stays from the critical point on a Nichols chart."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.handling.curve import Curve
from helisim.handling.figures.margins import is_stable

Real = NDArray[np.float64]
Gauge = Callable[[Real, Real], Real]

_BETWEEN = np.linspace(0.0, 1.0, 17)


@dataclass(frozen=True)
class Approach:
    """Where a loop comes nearest to the critical point.

    Attributes:
        size: 1 on the border of the zone, 0 at the critical point, negative of an unstable loop.
        frequency: rad/s.
        phase: rad from -180 deg, in [-pi, pi).
        gain: dB.
    """

    size: float
    frequency: float
    phase: float
    gain: float


def hexagon(gain: float, phase: float, *, corner: float = 0.5) -> Gauge:
    """Return a zone about the critical point: tips at +-gain, upright sides at +-phase.

    Args:
        gain: dB, of its tips at -180 deg.
        phase: rad from -180 deg, of its upright sides.
        corner: height of those sides over that of the tips, 0 (a rhomb) to 1 (a rectangle).

    Returns:
        A function of phase from -180 deg, rad, and gain, dB, each of any shape: 1 on the border.
    """

    def gauge(x: Real, y: Real) -> Real:
        side = np.abs(x) / phase
        return np.maximum(side, np.abs(y) / gain + (1.0 - corner) * side)

    return gauge


def ellipse(gain: float, phase: float) -> Gauge:
    """Return an ellipse with half axes of gain, dB, and phase, rad; see `hexagon`."""

    def gauge(x: Real, y: Real) -> Real:
        return np.hypot(x / phase, y / gain)

    return gauge


def approach(loop: Curve, gauge: Gauge) -> Approach:
    """Return where a broken loop comes nearest to -1, in the measure of a zone about it."""
    gain, phase = loop.decibel, np.angle(-loop.response)
    size = gauge(phase, gain)
    nearest = int(np.argmin(size))
    low, high = max(nearest - 1, 0), min(nearest + 1, size.size - 1)
    place = np.unique(np.concatenate([low + _BETWEEN, high - 1.0 + _BETWEEN]))
    index = np.minimum(place.astype(np.intp), size.size - 2)
    share = place - index
    turn = phase[index + 1] - phase[index]
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    x = (phase[index] + share * turn + np.pi) % (2.0 * np.pi) - np.pi
    y = gain[index] + share * (gain[index + 1] - gain[index])
    fine = gauge(x, y)
    best = int(np.argmin(fine))
    own = loop.frequency
    k = index[best]
    where = own[k] * (own[k + 1] / own[k]) ** share[best]
    sign = 1.0 if is_stable(loop) else -1.0
    return Approach(sign * float(fine[best]), float(where), float(x[best]), float(y[best]))
