"""Which mismatch between a model and its vehicle a pilot does not notice.

The envelopes of maximum unnoticeable added dynamics (MUAD) are four transfer functions that were
drawn around what evaluation pilots of fighters did not notice (J. Hodgkinson and others; in
MIL-STD-1797 for lower-order equivalent systems). They are narrowest near 2 to 4 rad/s, where
pilots close their loops. Tischler and Remple judge identified models by them. Coefficients as
`LoesBound.m` (C. Regan, 2006) quotes them. Of a small helicopter, which is flown faster, they say
less: its frequencies go with the square root of its size.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.units import decibel

Quadratic = tuple[float, float, float]

_GAIN_LOW: tuple[Quadratic, Quadratic] = ((0.095, 9.92, 2.15), (1.0, 11.6, 4.95))
_GAIN_HIGH: tuple[Quadratic, Quadratic] = ((3.16, 31.61, 22.79), (1.0, 27.14, 1.84))
_PHASE_LOW: tuple[Quadratic, Quadratic] = ((475.32, 184100.0, 29460.0), (1.0, 11.66, 0.039))
_PHASE_HIGH: tuple[Quadratic, Quadratic] = ((68.89, 1100.12, -275.22), (1.0, 39.94, 9.99))
"""Numerator and denominator, highest power of s first."""


class Mismatch(NamedTuple):
    """The envelopes, (n_freq,) each: what vehicle over model may be without being noticed."""

    low_db: NDArray[np.float64]
    high_db: NDArray[np.float64]
    low_deg: NDArray[np.float64]
    high_deg: NDArray[np.float64]


def unnoticeable(frequency: NDArray[np.float64]) -> Mismatch:
    """Return the envelopes at (n_freq,) rad/s."""
    s = 1j * np.asarray(frequency, dtype=np.float64)
    low, high, behind, ahead = (
        np.polyval(top, s) / np.polyval(bottom, s)
        for top, bottom in (_GAIN_LOW, _GAIN_HIGH, _PHASE_LOW, _PHASE_HIGH)
    )
    return Mismatch(
        decibel(np.abs(low)),
        decibel(np.abs(high)),
        np.rad2deg(np.angle(behind)),
        np.rad2deg(np.angle(ahead)),
    )
