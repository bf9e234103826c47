"""Whether a sampled model can be stabilised, and by which mode it can't."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance

from helisim.base.errors import HelisimError

Matrix = NDArray[np.float64]
_ON_CIRCLE = 1e-9
"""By how much an eigenvalue may lie within the unit circle and still not decay."""
_BLIND = 1e-9
"""Least singular value, over the largest, of what moves or shows a mode."""


class UnstabilisableError(HelisimError):
    """A model has a mode that doesn't decay, and that no command moves or no sensor shows."""


def check_moved(
    a: Matrix, b: Matrix, period: float, states: Sequence[str], commands: Sequence[str]
) -> None:
    """Raise UnstabilisableError if no command moves a mode that doesn't decay.

    Args:
        a: (n_state, n_state), over a period.
        b: (n_state, n_command).
        period: s.
        states: names.
        commands: names.
    """
    mode = _blind(a, b, period)
    if mode is not None:
        raise UnstabilisableError(
            f"the model can't be stabilised: no command ({', '.join(commands)}) moves "
            f"{_described(mode, states, period)}"
        )


def check_shown(
    a: Matrix, c: Matrix, period: float, states: Sequence[str], sensed: Sequence[str]
) -> None:
    """Raise UnstabilisableError if nothing that is sensed shows a mode that doesn't decay.

    Args:
        a: (n_state, n_state), over a period.
        c: (n_sensed, n_state).
        period: s.
        states: names.
        sensed: names.
    """
    mode = _blind(a.T, c.T, period)
    if mode is not None:
        raise UnstabilisableError(
            f"the model can't be stabilised from {', '.join(sensed)}: they don't show "
            f"{_described(mode, states, period)}"
        )


def _blind(a: Matrix, b: Matrix, period: float) -> tuple[complex, NDArray[np.float64]] | None:
    """Return a mode that doesn't decay and b doesn't reach: eigenvalue and shares of the states.

    By the test of Popov, Belevitch and Hautus, of balanced matrices, as rates of change.
    """
    balanced, (scale, _) = matrix_balance(a, permute=False, separate=True)
    reach = b / scale[:, None] / period
    for value in np.linalg.eigvals(a):
        if abs(value) < 1.0 - _ON_CIRCLE:
            continue
        own = (balanced - value * np.eye(len(a))) / period
        _, sizes, _ = np.linalg.svd(np.hstack([own, reach]))
        if sizes[-1] < _BLIND * sizes[0]:
            left = np.linalg.svd(np.hstack([own, reach]))[0][:, -1]
            return complex(value), np.abs(left)
    return None


def _described(
    mode: tuple[complex, NDArray[np.float64]], states: Sequence[str], period: float
) -> str:
    value, shares = mode
    rate = np.log(value) / period
    main = [int(k) for k in np.argsort(-shares)[:3]]
    where = [states[k] for k in main if shares[k] > 0.3 * shares.max()]
    how = f"doubles in {math.log(2.0) / rate.real:.2g} s" if rate.real > 1e-6 else "never decays"
    turning = f" at {abs(rate.imag):.3g} rad/s" if abs(rate.imag) > 1e-6 else ""
    return f"a mode of {', '.join(where)} that {how}{turning}"
