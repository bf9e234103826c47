"""Distances as a search takes them: continuous, also where a figure jumps.

The bandwidth of disturbance rejection is the lowest frequency at which |S| rises through
1 / sqrt 2. Where |S| has a hump just below that, the least change of the aircraft moves the
bandwidth to the hump. That |S| stays below 1 / sqrt 2 up to the border asks for the same, and
knows how far the hump is.

The crossover is the highest frequency at which the gain falls through one. Where the gain dips
below one on its way it jumps from one side of the dip to the other. That the gain is one somewhere
above the border asks for the same, and knows how far it is from that.
"""

import numpy as np

from helisim.handling.criteria import Criterion, Crossover, DisturbanceRejection
from helisim.handling.figures import HALF_POWER
from helisim.handling.loop import Loop

_HUMP = 15.0
"""dB of |S| below 1 / sqrt 2 that count as one unit of distance. A design margin of 0.1 is 1.5 dB:
more than |S| is off in another model, or as measured in flight."""


def distance(criterion: Criterion, loop: Loop) -> float:
    """Return a rating's distance; of figures that jump, one that goes there steadily."""
    own = criterion.rate(loop).distance
    if isinstance(criterion, DisturbanceRejection):
        return min(own, _below_hump(criterion, loop))
    if isinstance(criterion, Crossover) and own < 0.0:
        return max(own, _below_one(criterion, loop))
    return own


def _below_hump(criterion: DisturbanceRejection, loop: Loop) -> float:
    """Return how far |S| stays below 1 / sqrt 2 up to the border of its bandwidth."""
    border = criterion.limits["drb"]
    seen = loop.disturbance(criterion.axis)
    # a hump is lower than where |S| crosses, so just below the border the bandwidth itself speaks
    below = seen.frequency < 0.7 * border.level1
    if not np.any(below):
        return np.inf
    return (HALF_POWER - float(np.max(seen.decibel[below]))) / _HUMP


def _below_one(criterion: Crossover, loop: Loop) -> float:
    """Return how far the gain stays below one above the border of the crossover, at most 0.

    -inf of one that is to be slow, which doesn't jump where it is short.
    """
    border = criterion.limits["crossover"]
    seen = loop.broken(criterion.axis, criterion.at)
    above = seen.frequency >= border.level1
    if not (border.more_is_better and np.any(above)):
        return -np.inf
    return min(0.0, float(np.max(seen.decibel[above])) / _HUMP)
