"""What a print says of a helicopter beside what the model does: which differences matter."""

from collections.abc import Mapping
from typing import Any

import numpy as np

KNOT = 1852.0 / 3600.0  # m/s
CLOSE = 0.15  # Relative difference up to which a prediction counts as the print.
SMALL = 0.05  # Share of an axis's largest effect below which a difference is nobody's matter.
HALF_A_DEGREE = np.radians(0.5)  # Of an angle: what a protractor on a blade tells.
PUSH = {**dict.fromkeys("uvw", 1.0), **dict.fromkeys("pqr", 0.1)}
PUSH |= dict.fromkeys(("theta_0", "theta_1s", "theta_1c", "A_1", "B_1", "theta_0T"), 0.01)
"""m/s, rad/s and rad whose effects on an axis are compared with each other."""
_ANGLES = ("th", "ph", "a_", "b_", "B_", "al")


def small(name: str, printed: Mapping[str, float], push: Mapping[str, float]) -> float:
    """Return the difference of a printed figure that is nobody's matter."""
    axis, _, cause = name.partition("_")
    if cause not in push:
        return float(HALF_A_DEGREE) if name[:2] in _ANGLES else 0.0
    same = [row for row in printed if row[0] == axis and row[2:] in push]
    return SMALL * max(abs(printed[row]) * push[row[2:]] for row in same) / push[cause]


def within(found: float, printed: float, least: float) -> bool:
    return abs(found - printed) <= max(least, CLOSE * abs(printed))


def weighed(weights: Mapping[str, Any], figures: Mapping[str, float], k: int = 0) -> float:
    """Return a sum of figures, each with its weight, or the k-th of its weights; "one" is 1."""
    figures = {"one": 1.0, **figures}
    by = {name: one[k] if isinstance(one, list) else one for name, one in weights.items()}
    return sum(weight * figures[name] for name, weight in by.items())
