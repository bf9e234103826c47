"""Distances as a search takes them: continuous, also where a figure jumps.

The bandwidth of disturbance rejection is the lowest frequency at which |S| rises through
1 / sqrt 2. Where |S| has a hump just below that, the least change of the aircraft moves the
bandwidth to the hump. That |S| stays below 1 / sqrt 2 up to the border asks for the same, and
knows how far the hump is.
"""

import numpy as np

from helisim.handling.criteria import Criterion, DisturbanceRejection, Limit
from helisim.handling.figures.rejection import HALF_POWER
from helisim.handling.loop import Loop

_HUMP = 15.0
"""dB of |S| below 1 / sqrt 2 that count as one unit of distance. A design margin of 0.1 is 1.5 dB:
more than |S| is off in another model, or as measured in flight."""


def distance(criterion: Criterion, loop: Loop) -> float:
    """Return a rating's distance, of rejection not more than the highest hump leaves."""
    own = criterion.rate(loop).distance
    border = criterion.limits.get("drb")
    if not (isinstance(criterion, DisturbanceRejection) and isinstance(border, Limit)):
        return own
    seen = loop.disturbance(criterion.axis)
    # a hump is lower than where |S| crosses, so just below the border the bandwidth itself speaks
    below = seen.frequency < 0.7 * border.level1
    if not np.any(below):
        return own
    return min(own, (HALF_POWER - float(np.max(seen.decibel[below]))) / _HUMP)
