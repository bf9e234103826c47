"""Chooses how large a transfer function a response asks for, by rational fits of it."""

import numpy as np
from numpy.typing import NDArray

from helisim.ident.fitting.rational import delay_grid, rational_fits

ORDERS = ((0, 1), (0, 2), (1, 2), (1, 3), (2, 3), (2, 4), (3, 4))
"""Zeros and poles that are tried, the smallest first."""
_BETTER = 0.5
"""Of the error of fewer coefficients, that more must leave at most."""
_ENOUGH = 0.03
"""Relative error, rms, at which fewer coefficients are enough for a start."""
_INSIDE = (0.3, 2.0)
"""Of the band's edges, between which all poles must be: others can't be told from the data."""
FAST = 0.4
"""Of the band's top, from which an unstable pole is no aircraft's that anyone flew: with a delay
that is too long it stands for a lag that the order has no room for."""
_POINTS = 3
"""Frequencies a coefficient, at least."""


def order(
    omega: NDArray[np.float64],
    response: NDArray[np.complex128],
    *,
    begun: tuple[int, int] = ORDERS[0],
    enough: float = _ENOUGH,
) -> tuple[int, int]:
    """Return the zeros and poles of the first transfer function that follows a response.

    One with more of them must halve the error, with poles that the band shows, and none both
    unstable and fast. Where none does, it is what was begun with.

    Args:
        omega: (n_freq,) rad/s, increasing.
        response: (n_freq,) output over input, where it is coherent.
        begun: zeros and poles, from which to go on to larger ones.
        enough: relative error, rms, at which no larger one is tried.
    """
    chosen, (best, roots) = begun, _tried(omega, response, *begun)
    if np.any((roots.real > 0.0) & (np.abs(roots) > FAST * omega[-1])):
        best = max(2.0 * best, 1.01 * enough)  # any that needs no such pole is better
    for zeros, poles in ORDERS:
        if (zeros, poles) == begun or zeros < begun[0] or poles < begun[1]:
            continue
        if best < enough or omega.size < _POINTS * (zeros + poles + 1):
            break
        error, roots = _tried(omega, response, zeros, poles)
        size = np.abs(roots)
        fast = bool(np.any((roots.real > 0.0) & (size > FAST * omega[-1])))
        inside = bool(np.all((size > _INSIDE[0] * omega[0]) & (size < _INSIDE[1] * omega[-1])))
        if error < _BETTER * best and not fast and inside:
            chosen, best = (zeros, poles), error
    return chosen


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
