"""Chooses between widths of the band by their mean-square errors, and says what bias is left.

A polynomial's bias grows with the width of its band to the power ORDER + 2, so each width's bias
follows from how far it is from the next narrower one: squared, less the variance of that
difference, averaged over neighbouring frequencies. It doesn't fall where the band gets wider. The
narrowest's own follows from the next one's by the same law. Of a single band that is wider than its
middle frequency nothing is known: its bias is stated as the whole response.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.ident.responses.local_fit import ORDER

_SHARPNESS = 2.0
"""Power by which smaller mean-square errors count more in the average."""

_LEAST = 0.05
"""A width with a smaller share is left out."""


_ASYMPTOTIC = 0.5
"""A band wider than this has no law for its bias: the next wider one's counts in full."""

_DOUBT = 0.5
"""Shares of a difference's variance that its square must exceed it by to be stated as a bias: the
mean over neighbours is of two or three independent ones."""

_FLOOR = 0.005**2
"""Squared relative differences with a smaller variance are equally well known."""


@dataclass(frozen=True, eq=False)
class Choice:
    """Shares of the widths in the estimate, (n_width, n_out, n_in, n_freq).

    `bias` and `spread`, (n_out, n_in, n_freq) each, are the systematic error that is left, and
    the standard deviation of the widths' responses around their mean.
    """

    share: NDArray[np.float64]
    bias: NDArray[np.float64]
    spread: NDArray[np.float64]


def choose(
    gain: NDArray[np.complex128],
    shared: NDArray[np.float64],
    power: NDArray[np.float64],
    valid: NDArray[np.bool_],
    widths: NDArray[np.float64],
    frequency: NDArray[np.float64],
    *,
    widest: float = np.inf,
) -> Choice:
    """Weigh the widths at every frequency.

    Args:
        gain: (n_width, n_out, n_in, n_freq) response by each width.
        shared: (n_width, n_width, n_in, n_freq) covariance between widths for a unit disturbance.
        power: (n_out, n_freq) spectra of the outputs' disturbances.
        valid: (n_width, n_freq) where a width could be used, at least one a frequency.
        widths: (n_width,) relative half widths, increasing.
        frequency: (n_freq,) rad/s.
        widest: a width beyond it only tells the bias of the narrowest, which may be wider itself.
    """
    n_width = widths.size
    narrowest = np.argmax(valid, axis=0)
    at = np.arange(frequency.size)
    size = np.abs(gain[narrowest, :, :, at].transpose(1, 2, 0))
    size = np.maximum(size, 1e-300)
    own = np.einsum("ccif->cif", shared)
    squared, sure = np.zeros(gain.shape), np.zeros(gain.shape)
    for width in range(n_width):
        before = _before(valid, width)
        gap = np.abs(gain[width] - gain[before, :, :, at].transpose(1, 2, 0)) ** 2
        between = own[width] + own[before, :, at].T - 2.0 * shared[width, before, :, at].T
        chance = np.maximum(between, 0.0) * power[:, None, :] / size**2
        counted = valid[width] & (narrowest < width)
        known = np.where(counted, 1.0 / (chance + _FLOOR) ** 2, 0.0)
        mean = smoothed(gap / size**2 - chance, frequency, known, 0.5 * widths[width])
        law = np.where(counted, 1.0 - (widths[before] / widths[width]) ** (ORDER + 2), 1.0)
        doubt = _DOUBT * smoothed(chance, frequency, known, 0.5 * widths[width])
        for found, value in ((squared, mean), (sure, mean - doubt)):
            found[width] = np.where(counted, np.maximum(value, 0.0) / law**2, 0.0) * size**2
    following = np.minimum(narrowest + 1, n_width - 1)
    law = (widths[narrowest] / widths[following]) ** (2 * (ORDER + 2))
    law = np.where(widths[narrowest] > _ASYMPTOTIC, 1.0, law)
    for found in (squared, sure):
        np.maximum.accumulate(found, axis=0, out=found)
        found += law * found[following, :, :, at].transpose(1, 2, 0)
    error = own[:, None] * power[:, None, :] + squared
    offered = valid & ((widths[:, None] <= widest) | (np.arange(n_width)[:, None] == narrowest))
    error = np.where(offered[:, None, None, :], np.maximum(error, 1e-300), np.inf)
    share = (np.min(error, axis=0) / error) ** _SHARPNESS
    share /= np.sum(share, axis=0)
    share = np.where(share < _LEAST, 0.0, share)
    share /= np.sum(share, axis=0)
    mean = np.sum(share * gain, axis=0)
    spread = np.sum(share * np.abs(gain - mean) ** 2, axis=0)
    bias = np.sqrt(np.sum(share * sure, axis=0))
    alone = (np.sum(valid, axis=0) == 1) & (widths[narrowest] > widest)
    bias[..., alone] = np.maximum(bias, np.abs(mean))[..., alone]
    return Choice(share, bias, np.sqrt(spread))


def _before(valid: NDArray[np.bool_], width: int) -> NDArray[np.intp]:
    """Return the next narrower width that is valid, (n_freq,); the width itself if none is."""
    numbers = np.where(valid[:width], np.arange(width)[:, None], -1)
    found = np.max(numbers, axis=0, initial=-1)
    return np.where(found < 0, width, found)


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
