"""Chooses how large a transfer function a coherent response asks for, to begin with."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_ORDERS = ((0, 1), (0, 2), (1, 2))
_ROUNDS = 4
"""Of Sanathanan and Koerner's: each weighs by the denominator of the one before."""
_DELAYS = np.linspace(0.0, 0.3, 31)
_BETTER = 0.5
"""Of the error of fewer coefficients, that more must leave at most."""
_ENOUGH = 0.03
"""Relative error, rms, at which fewer coefficients are enough for a start."""
_INSIDE = (0.3, 2.0)
"""Of the band's edges, between which all poles must be: others can't be told from the data."""


class _Tried(NamedTuple):
    error: float
    poles: NDArray[np.complex128]


def simplest(omega: NDArray[np.float64], response: NDArray[np.complex128]) -> str:
    """Return tf:0/1, tf:0/2 or tf:1/2: the first that follows a response.

    Args:
        omega: (n_freq,) rad/s.
        response: (n_freq,) output over input, where it is coherent.
    """
    chosen, best = _ORDERS[0], _tried(omega, response, *_ORDERS[0]).error
    for zeros, poles in _ORDERS[1:]:
        if best < _ENOUGH or omega.size < 3 * (zeros + poles + 1):
            break
        tried = _tried(omega, response, zeros, poles)
        size = np.abs(tried.poles)
        stable = bool(np.all(tried.poles.real < 0.0))
        inside = bool(np.all((size > _INSIDE[0] * omega[0]) & (size < _INSIDE[1] * omega[-1])))
        if tried.error < _BETTER * best and stable and inside:
            chosen, best = (zeros, poles), tried.error
    return f"tf:{chosen[0]}/{chosen[1]}"


def _tried(
    omega: NDArray[np.float64], response: NDArray[np.complex128], zeros: int, poles: int
) -> _Tried:
    """Return the error, rms and relative, and the poles of the best delay."""
    scale = float(np.sqrt(omega[0] * omega[-1]))
    s = np.asarray(1j * omega / scale, dtype=np.complex128)
    fits = [
        _with_delay(s, response * np.exp(1j * omega * delay), zeros, poles) for delay in _DELAYS
    ]
    best = min(fits, key=lambda one: one.error)
    return _Tried(best.error, best.poles * scale)


def _with_delay(
    s: NDArray[np.complex128], response: NDArray[np.complex128], zeros: int, poles: int
) -> _Tried:
    """Solve the coefficients linearly, the denominator's highest being 1."""
    powers = np.stack([s**k for k in range(max(zeros, poles) + 1)])
    weight = np.abs(response)
    below, x = np.ones_like(response), np.zeros(zeros + 1 + poles)
    for _ in range(_ROUNDS):
        columns = np.vstack([powers[: zeros + 1], -response * powers[:poles]])
        rows = (columns / (weight * np.abs(below))).T
        right = response * powers[poles] / (weight * np.abs(below))
        x, *_ = np.linalg.lstsq(
            np.vstack([rows.real, rows.imag]), np.concatenate([right.real, right.imag]), rcond=None
        )
        below = powers[poles] + x[zeros + 1 :] @ powers[:poles]
        if np.any(np.abs(below) < 1e-12):
            return _Tried(np.inf, np.zeros(poles, dtype=np.complex128))
    error = (x[: zeros + 1] @ powers[: zeros + 1]) / below / response - 1.0
    roots = np.roots(np.concatenate([[1.0], x[zeros + 1 :][::-1]]))
    return _Tried(float(np.sqrt(np.mean(np.abs(error) ** 2))), roots.astype(np.complex128))
