"""Compares measured channels with what other channels say that they must be.

In the band in which both are coherent, by windows whose median counts, so that a bump or a lost
second doesn't.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.trend import without_trend

COHERENT = 0.8
"""Coherence of a frequency that is compared: noise moves a ratio by a tenth at most there."""
_WINDOWS = 16
"""Half-overlapping windows of a record."""
_FEWEST_SAMPLES = 256
_LOWEST = 3
"""Periods in a window, at least: below, drift and trends count."""
_HIGHEST = 0.08
"""Of the sampling rate: up to here central differences are derivatives within 5 %."""
_FEWEST = 5
"""Coherent frequencies from which something is claimed."""
_EXPLAINED = 0.05
"""Of a channel's power in the band, that the coherent frequencies must hold at least."""
_STRONG = 0.1
"""Of the median window's power, from which a window counts."""


class Likeness(NamedTuple):
    """How a measured channel goes with a predicted one.

    Attributes:
        coherence: mean over the compared frequencies, weighted by power; 0 without any.
        ratio: measured over predicted, with its sign.
        phase: of measured over predicted, rad, in the middle of the compared frequencies.
    """

    coherence: float
    ratio: float
    phase: float

    @property
    def sure(self) -> bool:
        """Whether the two go together at all, in phase or against each other."""
        return self.coherence >= COHERENT and abs(np.sin(self.phase)) < 0.5


NONE = Likeness(0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Transforms:
    """Transforms of channels in windows of a uniform record.

    Attributes:
        values: (n_window, n_freq, n_channel), detrended and windowed before.
        frequency: (n_freq,) Hz, of the record's own clock.
    """

    values: NDArray[np.complex128]
    frequency: NDArray[np.float64]


def transforms(columns: NDArray[np.float64], step: float) -> Transforms | None:
    """Return the transforms of columns, (n_time, n_channel); None if there is too little.

    Args:
        columns: uniform samples.
        step: between them, s.
    """
    count = columns.shape[0]
    if count < _FEWEST_SAMPLES or not np.all(np.isfinite(columns)):
        return None
    length = 2 * (count // (_WINDOWS + 1))
    starts = np.arange(_WINDOWS) * (length // 2)
    window = (0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length))[:, None]
    found = [np.fft.rfft(without_trend(columns[s : s + length]) * window, axis=0) for s in starts]
    frequency = np.fft.rfftfreq(length, step)
    inside = (np.arange(frequency.size) >= _LOWEST) & (frequency * step <= _HIGHEST)
    if np.count_nonzero(inside) < _FEWEST:
        return None
    return Transforms(np.stack(found)[:, inside], frequency[inside].astype(np.float64))


def likeness(measured: NDArray[np.complex128], predicted: NDArray[np.complex128]) -> Likeness:
    """Compare two channels' transforms, (n_window, n_freq) each."""
    own, other = np.abs(measured) ** 2, np.abs(predicted) ** 2
    cross = np.sum(measured * predicted.conj(), axis=0)
    powers = np.sum(own, axis=0) * np.sum(other, axis=0)
    if not np.all(np.isfinite(powers)) or not np.any(powers > 0.0):
        return NONE
    coherence = np.abs(cross) ** 2 / np.where(powers > 0.0, powers, np.inf)
    keep = coherence >= COHERENT
    share = np.sum(other[:, keep]) / np.sum(other)
    if np.count_nonzero(keep) < _FEWEST or share < _EXPLAINED:
        return NONE
    weight = np.sqrt(powers[keep])
    each_own, each_other = np.sum(own[:, keep], axis=1), np.sum(other[:, keep], axis=1)
    strong = each_other > _STRONG * np.median(each_other)
    ratio = float(np.sqrt(np.median(each_own[strong] / each_other[strong])))
    if not 0.0 < ratio < np.inf:
        return NONE
    total = np.sum(cross[keep] / np.abs(cross[keep]) * weight)
    return Likeness(
        float(np.sum(coherence[keep] * weight) / np.sum(weight)),
        ratio if total.real >= 0.0 else -ratio,
        float(np.angle(total)),
    )
