"""What the poles of a closed loop say: how damped it is, how stable, how fast."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]


_FADE = np.log(2.0)
"""Over an octave outside of the band a mode ceases to count."""


@dataclass(frozen=True)
class Mode:
    """The least damped mode of a loop.

    Attributes:
        damping: ratio, -1 to 1; 1 if no mode oscillates. Of a mode up to an octave outside of
            the band it is drawn towards 1, so that no mode enters it at once.
        frequency: rad/s, its natural frequency.
    """

    damping: float
    frequency: float


def least_damped(poles: Complex, *, low: float = 0.0, high: float = np.inf) -> Mode:
    """Return the least damped of the poles, (n_pole,) rad/s, with natural frequencies in a band.

    Args:
        poles: (n_pole,) rad/s; one on the real axis counts as damped by 1 or -1.
        low: rad/s.
        high: rad/s.
    """
    frequency = np.abs(poles)
    kept = frequency > 1e-9
    if not kept.any():
        return Mode(1.0, 0.0)
    frequency = frequency[kept]
    damping = -poles[kept].real / frequency
    size = np.log(frequency)
    outside = np.maximum(math.log(max(low, 1e-12)) - size, size - math.log(high))
    fade = np.clip(outside / _FADE, 0.0, 1.0)
    damping = damping + fade * (1.0 - damping)
    least = int(np.argmin(damping))
    return Mode(float(damping[least]), float(frequency[least]))


def slowest(poles: Complex, *, low: float = 0.0) -> float:
    """Return the greatest real part of poles, (n_pole,) rad/s, of natural frequencies from `low`.

    Without any it is minus the highest natural frequency.
    """
    frequency = np.abs(poles)
    inside = frequency >= low
    if not inside.any():
        return -float(frequency.max(initial=0.0))
    return float(poles[inside].real.max())


def fastest(poles: Complex) -> float:
    """Return the highest natural frequency of poles, (n_pole,) rad/s."""
    return float(np.abs(poles).max(initial=0.0))
