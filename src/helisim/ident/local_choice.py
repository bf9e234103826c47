"""Chooses between widths of the band by their mean-square errors, and says what bias is left.

The narrowest width is the least biased. A wider one's squared bias is how far it is from the
narrowest, squared, less the variance of that difference, averaged over neighbouring
frequencies; it doesn't fall where the band gets wider. The narrowest's own is what the next
one's becomes by the law of a polynomial's bias, the width to the power ORDER + 2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.ident.local_fit import ORDER

_SHARPNESS = 2.0
"""Power by which smaller mean-square errors count more in the average."""

_LEAST = 0.05
"""A width with a smaller share is left out."""


_FLOOR = 0.005**2
"""Squared relative differences with a smaller variance are equally well known."""


@dataclass(frozen=True, eq=False)
class Choice:
    """Shares of the widths in the estimate, (n_width, n_out, n_in, n_freq), and its bias.

    `bias` is (n_out, n_in, n_freq).
    """

    share: NDArray[np.float64]
    bias: NDArray[np.float64]


def choose(
    gain: NDArray[np.complex128],
    shared: NDArray[np.float64],
    power: NDArray[np.float64],
    valid: NDArray[np.bool_],
    widths: NDArray[np.float64],
    frequency: NDArray[np.float64],
) -> Choice:
    """Weigh the widths at every frequency.

    Args:
        gain: (n_width, n_out, n_in, n_freq) response by each width.
        shared: (n_width, n_width, n_in, n_freq) covariance between widths for a unit disturbance.
        power: (n_out, n_freq) spectra of the outputs' disturbances.
        valid: (n_width, n_freq) where a width could be used, at least one a frequency.
        widths: (n_width,) relative half widths, increasing.
        frequency: (n_freq,) rad/s.
    """
    n_width = widths.size
    narrowest = np.argmax(valid, axis=0)
    at = np.arange(frequency.size)
    size = np.abs(gain[narrowest, :, :, at].transpose(1, 2, 0))
    size = np.maximum(size, 1e-300)
    own = np.einsum("ccif->cif", shared)
    base = own[narrowest, :, at].T
    squared = np.zeros(gain.shape)
    for width in range(n_width):
        gap = np.abs(gain[width] - gain[narrowest, :, :, at].transpose(1, 2, 0)) ** 2
        between = own[width] + base - 2.0 * shared[width, narrowest, :, at].T
        chance = np.maximum(between, 0.0) * power[:, None, :] / size**2
        counted = valid[width] & (narrowest < width)
        known = np.where(counted, 1.0 / (chance + _FLOOR) ** 2, 0.0)
        mean = smoothed(gap / size**2 - chance, frequency, known, 0.5 * widths[width])
        squared[width] = np.where(counted, np.maximum(mean, 0.0), 0.0) * size**2
    squared = np.maximum.accumulate(squared, axis=0)
    following = np.minimum(narrowest + 1, n_width - 1)
    law = (widths[narrowest] / widths[following]) ** (2 * (ORDER + 2))
    squared += law * squared[following, :, :, at].transpose(1, 2, 0)
    error = own[:, None] * power[:, None, :] + squared
    error = np.where(valid[:, None, None, :], np.maximum(error, 1e-300), np.inf)
    share = (np.min(error, axis=0) / error) ** _SHARPNESS
    share /= np.sum(share, axis=0)
    share = np.where(share < _LEAST, 0.0, share)
    share /= np.sum(share, axis=0)
    mean = np.sum(share * gain, axis=0)
    spread = np.sum(share * np.abs(gain - mean) ** 2, axis=0)
    return Choice(share, np.sqrt(np.sum(share * squared, axis=0) + spread))


def smoothed(
    values: NDArray,
    frequency: NDArray[np.float64],
    weight: NDArray[np.float64],
    width: float,
) -> NDArray:
    """Return the mean over neighbouring frequencies, by a Gaussian of the frequency's logarithm.

    Args:
        values: (..., n_freq).
        frequency: (n_freq,) rad/s.
        weight: (..., n_freq) what each counts; all zero gives zeros.
        width: standard deviation of the Gaussian.
    """
    apart = np.subtract.outer(np.log(frequency), np.log(frequency)) / width
    kernel = np.exp(-0.5 * apart**2)
    total = np.maximum(weight @ kernel, 1e-300)
    return np.where(weight > 0.0, values * weight, 0.0) @ kernel / total
