"""Chooses how large a transfer function a coherent response asks for, to begin with."""

import numpy as np
from numpy.typing import NDArray

from helisim.ident.rational import delay_grid, rational_fits

_ORDERS = ((0, 1), (0, 2), (1, 2))
_BETTER = 0.5
"""Of the error of fewer coefficients, that more must leave at most."""
_ENOUGH = 0.03
"""Relative error, rms, at which fewer coefficients are enough for a start."""
_INSIDE = (0.3, 2.0)
"""Of the band's edges, between which all poles must be: others can't be told from the data."""


def simplest(omega: NDArray[np.float64], response: NDArray[np.complex128]) -> str:
    """Return tf:0/1, tf:0/2 or tf:1/2: the first that follows a response.

    Args:
        omega: (n_freq,) rad/s.
        response: (n_freq,) output over input, where it is coherent.
    """
    chosen, (best, _) = _ORDERS[0], _tried(omega, response, *_ORDERS[0])
    for zeros, poles in _ORDERS[1:]:
        if best < _ENOUGH or omega.size < 3 * (zeros + poles + 1):
            break
        error, roots = _tried(omega, response, zeros, poles)
        size = np.abs(roots)
        stable = bool(np.all(roots.real < 0.0))
        inside = bool(np.all((size > _INSIDE[0] * omega[0]) & (size < _INSIDE[1] * omega[-1])))
        if error < _BETTER * best and stable and inside:
            chosen, best = (zeros, poles), error
    return f"tf:{chosen[0]}/{chosen[1]}"


def _tried(
    omega: NDArray[np.float64], response: NDArray[np.complex128], zeros: int, poles: int
) -> tuple[float, NDArray[np.complex128]]:
    """Return the error, rms and relative, and the poles of the best delay."""
    found = rational_fits(
        omega,
        response,
        np.ones(omega.size),
        zeros=zeros,
        poles=poles,
        delays=delay_grid(omega, low=0.0),
    )
    best = int(np.argmin(found.errors))
    roots = np.roots(found.denominators[best][::-1])
    return float(found.errors[best]), roots.astype(np.complex128)
