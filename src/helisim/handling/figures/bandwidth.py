"""Bandwidth and phase delay of an answer to the stick, as ADS-33 defines them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.handling.curve import Curve
from helisim.handling.figures.crossings import crossings

Real = NDArray[np.float64]

_MARGIN_PHASE = np.pi / 4.0
_MARGIN_GAIN = 20.0 * np.log10(2.0)
_SHORT = 1.5
"""Least ratio of the frequencies between which a slope of phase is taken."""


@dataclass(frozen=True)
class Bandwidth:
    """How quickly an attitude follows the stick.

    Attributes:
        phase: rad/s, where the phase is -135 deg.
        gain: rad/s, below `neutral`, where the gain is twice that at `neutral`.
        neutral: rad/s, where the phase is -180 deg.
        delay: s, phase delay: how fast the phase goes on falling from there to twice that
            frequency, (-180 deg - phase) over twice the frequency there.
        complete: whether the curve reaches from `phase` and `gain` to twice `neutral`; otherwise
            what is missing was continued.
    """

    phase: float
    gain: float
    neutral: float
    delay: float
    complete: bool

    @property
    def rate(self) -> float:
        """Bandwidth of a rate response, rad/s: the lesser of both."""
        return min(self.phase, self.gain)

    @property
    def attitude(self) -> float:
        """Bandwidth of an attitude response, rad/s: that of phase alone."""
        return self.phase

    @property
    def gain_limited(self) -> bool:
        """Whether gain limits it: pilots may then excite oscillations of an attitude response."""
        return self.gain < self.phase


def bandwidth(command: Curve, *, fit: bool = False, sign: int = 1) -> Bandwidth:
    """Return bandwidths and phase delay of attitude over stick.

    ADS-33E-PRF, 3.3.2.1. Phase counts modulo a turn: -180 deg is met where the curve
    first passes it downwards, whatever slow modes did to the phase below.

    Args:
        command: angle over stick.
        fit: take the slope of phase beyond -180 deg from a straight line over frequency, by least
            squares, as the standard asks if phase is not straight; otherwise from its two ends.
        sign: -1 if the angle answers a positive stick by falling.
    """
    own, size = command.frequency, command.decibel
    turned = np.angle(-sign * command.response)  # from -180 deg
    neutral, index, inside = _neutral(own, turned)
    unrolled = np.unwrap(turned)
    unrolled -= 2.0 * np.pi * np.round((unrolled[index] - turned[index]) / (2.0 * np.pi))
    lag, has_lag = _last_above(own, unrolled - _MARGIN_PHASE, neutral, index, slope=1.0)
    least = float(np.interp(np.log(neutral), np.log(own), size)) + _MARGIN_GAIN
    gain, has_gain = _last_above(
        own, size - least, neutral, index, slope=_DECIBEL_PER_NEPER_OF_FREQUENCY
    )
    delay, has_delay = _delay(own, unrolled, neutral, fit=fit)
    return Bandwidth(lag, gain, neutral, delay, inside and has_lag and has_gain and has_delay)


_DECIBEL_PER_NEPER_OF_FREQUENCY = 20.0 / np.log(10.0)


def _neutral(own: Real, turned: Real) -> tuple[float, int, bool]:
    """Return where -180 deg is passed, the point before it, and whether it is at all."""
    found = crossings(own, turned, most=np.pi)
    down = np.flatnonzero(~found.rising)
    if down.size:
        first = down[0]
        return float(found.frequency[first]), int(found.index[first]), True
    above = max(float(turned[-1]), 0.0)
    return float(own[-1] * np.exp(above)), own.size - 1, False


def _last_above(
    own: Real, values: Real, below: float, index: int, *, slope: float
) -> tuple[float, bool]:
    """Return where values last fall through zero before a frequency, and whether they do.

    Where they don't, the nearest to zero is continued by a slope per unit of log frequency.
    """
    part = slice(0, index + 2)
    frequency, before = own[part], values[part]
    found = crossings(frequency, before)
    falls = found.frequency[~found.rising & (found.frequency <= below)]
    if falls.size:
        return float(falls[-1]), True
    nearest = before.size - 1 if before[-1] > 0.0 else int(np.argmax(before))
    return float(frequency[nearest] * np.exp(before[nearest] / slope)), False


def _delay(own: Real, phase: Real, neutral: float, *, fit: bool) -> tuple[float, bool]:
    """Return the phase delay, and whether the curve reaches twice the neutral frequency."""
    high = min(2.0 * neutral, float(own[-1]))
    low = min(neutral, high / _SHORT)
    if fit:
        between = own[(own > low) & (own < high)]
        x = np.concatenate([[low], between, [high]])
        y = np.interp(np.log(x), np.log(own), phase)
        x = x - x.mean()
        fall = float(-(x @ y) / (x @ x))
    else:
        ends = np.interp(np.log([low, high]), np.log(own), phase)
        fall = float((ends[0] - ends[1]) / (high - low))
    return 0.5 * fall, high >= 2.0 * neutral
