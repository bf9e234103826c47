"""Samples of the errors of responses that belong together: to one that was injected.

The estimate's random errors are linear in the disturbance's lines, and known with all their
correlations (`LocalScatter`). What systematic error may be left has a size alone: it is taken as
random too, the same for neighbours in frequency and for both sides of a cut, which differ by what
was injected, exactly.
"""

import numpy as np
from numpy.typing import NDArray

from helisim.ident.scatter import LocalScatter

Complex = NDArray[np.complex128]

_REACH = 0.25
"""Two biases are related if their frequencies differ by less than about this, as a fraction."""

_RIDGE = 1e-5
"""Added to a correlation matrix, whose weights are in single precision: no eigenvalue is below
zero then, and draws are rough by 0.3 % of their deviation."""


def error_root(scatter: LocalScatter, place: int, alike: NDArray[np.intp]) -> Complex:
    """Return a root R of the covariance R R* between all outputs and frequencies for one input.

    Args:
        scatter: of the responses.
        place: of the input.
        alike: (n_out,) equal numbers for outputs that share their bias.

    Returns:
        (n_out n_freq, n_out n_freq), outputs before frequencies.
    """
    shared = _systematic(scatter, place)
    covariance = _random(scatter, place) + _shared(shared, scatter.frequency, alike)
    deviation = np.sqrt(np.maximum(np.real(np.diagonal(covariance)), 1e-300))[:, None]
    related = covariance / (deviation * deviation.T)
    np.fill_diagonal(related, 1.0 + _RIDGE)
    try:
        root = np.linalg.cholesky(related)
    except np.linalg.LinAlgError:
        value, vector = np.linalg.eigh(related)
        root = vector * np.sqrt(np.maximum(value, 0.0))
    return np.asarray(deviation * root, dtype=np.complex128)


def _random(scatter: LocalScatter, place: int) -> Complex:
    """Return what the disturbance gives: the lines that two points share, times its spectrum."""
    n_out, n_freq = scatter.noise.shape[1], scatter.frequency.size
    last = max(int(np.max(one.first)) + one.value.shape[3] for one in scatter.weights)
    n_flight = scatter.weights[0].value.shape[2]
    taken = np.zeros((n_out, n_freq, n_flight, last), dtype=np.complex64)
    for position, one in enumerate(scatter.weights):
        share = scatter.share[one.part, :, place, position].T.astype(np.float32)
        value = np.einsum("op,pel->oel", share, one.value[:, place])
        for flight, first in enumerate(one.first):
            taken[:, position, flight, first : first + value.shape[2]] = value[:, flight]
    flat = taken.reshape(n_out * n_freq, -1)
    root = scatter.noise_root().transpose(1, 0, 2).reshape(n_out * n_freq, -1)
    return (flat @ flat.conj().T).astype(np.complex128) * (root @ root.conj().T)


def _systematic(scatter: LocalScatter, place: int) -> NDArray[np.float64]:
    """Return the size of the bias, with what the choice of widths adds, (n_out, n_freq)."""
    spread = 0.0 if scatter.spread is None else scatter.spread
    return np.hypot(scatter.bias, spread)[:, place]


def _shared(
    size: NDArray[np.float64], frequency: NDArray[np.float64], alike: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the covariance of errors, (n_out, n_freq) large, that neighbours share.

    Each point for itself they would make curves rough, and rough curves cross what smooth don't.
    """
    at = np.log(frequency)
    near = np.exp(-0.5 * (np.subtract.outer(at, at) / _REACH) ** 2)
    same = np.equal.outer(alike, alike).astype(np.float64)
    return np.outer(size.ravel(), size.ravel()) * np.kron(same, near)
