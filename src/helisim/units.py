"""Conversions between SI, used everywhere inside, and what people type and read."""

import math

RAD_PER_DEG = math.pi / 180.0
RAD_S_PER_RPM = 2.0 * math.pi / 60.0
STANDARD_GRAVITY = 9.80665
"""m/s^2, exact, by the 3rd General Conference on Weights and Measures, 1901."""
METRE_S_PER_KNOT = 1852.0 / 3600.0
"""Exact: the nautical mile of the International Hydrographic Conference of 1929, an hour."""
METRE_PER_FOOT = 0.3048
"""Exact, by the international yard and pound agreement of 1959."""


def decibel(magnitude: float) -> float:
    """Return 20 log10 of a magnitude ratio, in dB."""
    return 20.0 * math.log10(magnitude)
