"""Where a curve passes a value, and where it peaks, between its points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Crossings:
    """Where a function of frequency passes zero, between the points k and k + 1.

    Attributes:
        index: (n_crossing,) k.
        share: (n_crossing,) of the way in the logarithm of frequency, 0 to 1.
        frequency: (n_crossing,) rad/s.
        rising: (n_crossing,) whether it rises there with frequency.
    """

    index: NDArray[np.intp]
    share: Real
    frequency: Real
    rising: NDArray[np.bool_]

    def of(self, values: Real) -> Real:
        """Return another function, (n_freq,), at the crossings, (n_crossing,)."""
        low = values[self.index]
        return low + self.share * (values[self.index + 1] - low)


def crossings(frequency: Real, values: Real, *, most: float = np.inf) -> Crossings:
    """Return where values pass zero, by straight lines over the logarithm of frequency.

    Args:
        frequency: (n_freq,) rad/s.
        values: (n_freq,).
        most: a step between neighbours beyond it is no crossing but a turn of an angle.
    """
    positive = values > 0.0
    index = np.flatnonzero(positive[1:] != positive[:-1])
    if index.size:
        step = values[index + 1] - values[index]
        kept = np.abs(step) < most
        index, step = index[kept], step[kept]
        share = -values[index] / step
    else:
        share = np.empty(0)
    low = frequency[index]
    where = low * (frequency[index + 1] / low) ** share
    return Crossings(index, share, where, positive[index + 1])


def peak(frequency: Real, values: Real) -> tuple[float, float]:
    """Return the highest of values, (n_freq,), between the points, and its frequency in rad/s.

    A parabola over the logarithm of `frequency`, (n_freq,), through the highest point and its
    neighbours; at an end the point itself.
    """
    top = int(np.argmax(values))
    if top in (0, values.size - 1):
        return float(values[top]), float(frequency[top])
    x0, x1, x2 = np.log(frequency[top - 1 : top + 2]).tolist()
    y0, y1, y2 = values[top - 1 : top + 2].tolist()
    left, right = (y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1)
    bend = (right - left) / (x2 - x0)
    if bend >= 0.0:
        return y1, float(frequency[top])
    here = 0.5 * (x0 + x1) - 0.5 * left / bend
    return y0 + (here - x0) * (left + bend * (here - x1)), float(np.exp(here))


def wrapped(angle: Real) -> Real:
    """Return angles, (n_freq,) rad, turned into [-pi, pi)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
