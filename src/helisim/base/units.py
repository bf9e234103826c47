"""Conversions between SI, used everywhere inside, and what people type and read."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

RAD_PER_DEG = math.pi / 180.0
RAD_S_PER_RPM = 2.0 * math.pi / 60.0
STANDARD_GRAVITY = 9.80665
"""m/s^2, exact, by the 3rd General Conference on Weights and Measures, 1901."""
METRE_S_PER_KNOT = 1852.0 / 3600.0
"""Exact: the nautical mile of the International Hydrographic Conference of 1929, an hour."""
METRE_PER_FOOT = 0.3048
"""Exact, by the international yard and pound agreement of 1959."""


DB_PER_NEPER = 20.0 / math.log(10.0)
"""dB per unit of natural logarithm of a magnitude ratio."""


def decibel(magnitude: ArrayLike) -> NDArray[np.float64]:
    """Return magnitude ratios in dB, in the same shape each; -inf of zero."""
    with np.errstate(divide="ignore"):
        return np.asarray(20.0 * np.log10(magnitude), dtype=np.float64)
