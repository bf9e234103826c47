"""Rational fits of measured responses at many delays, without starts.

    H(s) = e^(-tau s) (b_m s^m + ... + b0) / (s^n + a_(n-1) s^(n-1) + ... + a0)

by Sanathanan and Koerner (IEEE Trans. Automatic Control 8, 1963) at each delay, then descents with
free delays. Frequencies are scaled by the band's geometric mean.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Real

_STEPS, _SETTLED = 20, 1e-6
_DESCENT, _ARRIVED = 60, 1e-6
STEP = 0.5  # rad: phase between delays of a grid at the band's top
_LONGEST, _CYCLES, _LEAD = 0.5, 2.0, 0.3

ORDERS = ((0, 1), (0, 2), (1, 2), (1, 3), (2, 3), (2, 4), (3, 4))
OF_FORCES = ((1, 1), (1, 2), (2, 3))  # that act before the vehicle moves
"""Zeros and poles to try, smallest first."""
# Rms errors of a response: a verdict doubts larger ones; times the stated error, within which no
# third pole is sought
_BETTER, _ENOUGH, _WITHIN = 0.5, 0.05, 1.2
# _INSIDE: of the band's top, below which all poles must be; slow ones act as integrals there
# FAST: of the band's top, above which an unstable pole stands for a missing lag
_INSIDE, FAST = 2.0, 0.4
_POINTS = 3  # least frequencies a coefficient


class Rationals(NamedTuple):
    """Rational fits from several delays, with their `delays`, (n_delay,) s, and rms `errors`.

    Coefficients are (n_delay, n_order + 1), from s^0 up.
    """

    delays: Real
    numerators: Real
    denominators: Real
    errors: Real


def delay_grid(frequency: Real, low: float = -_LEAD, high: float = np.inf) -> Real:
    """Return delays to try, s, for (n_freq,) rad/s: -0.3 s to 0.5 s or two cycles at the top."""
    top = float(np.max(frequency))
    low = max(low, -_LEAD)
    high = max(min(high, max(_LONGEST, 2.0 * np.pi * _CYCLES / top)), low)
    return np.linspace(low, high, 1 + int(np.ceil((high - low) * top / STEP)))


def rational_fits(
    frequency: Real,
    measured: NDArray[np.complex128],
    weight: Real,
    *,
    zeros: int,
    poles: int,
    delays: Real,
    fixed: bool = False,
    known: Real | None = None,
) -> Rationals:
    """Fit a response, (n_freq,) over rad/s, from each delay, (n_delay,) s, increasing.

    Weights (n_freq,) are of squared relative errors. `known` coefficients are (zeros + 1 + poles,),
    the numerator's first, from s^0 up; nan where sought.
    """
    unit = float(np.sqrt(np.min(frequency) * np.max(frequency)))
    scaled = (1j * frequency / unit).astype(np.complex128)
    powers = scaled[:, None] ** np.arange(max(zeros, poles, 1) + 1)
    root = np.sqrt(weight / np.sum(weight))
    scale = unit ** (poles - np.arange(max(zeros, poles) + 1.0))
    scales = np.concatenate([scale[: zeros + 1], scale[:poles]])
    given = (np.full(scales.size, np.nan) if known is None else known) / scales
    top, bottom = _sanathanan_koerner(powers, measured, root, (zeros, poles), unit * delays, given)
    sought = np.append(np.isnan(given), not fixed)
    top, bottom, ended, errors = _descend(
        powers, measured, root, top, bottom, unit * delays, sought
    )
    return Rationals(
        delays=ended / unit,
        numerators=top * scale[: zeros + 1],
        denominators=bottom * scale[: poles + 1],
        errors=errors,
    )


def _sanathanan_koerner(
    powers: NDArray[np.complex128],
    measured: NDArray[np.complex128],
    root: Real,
    orders: tuple[int, int],
    delays: Real,
    given: Real,
) -> tuple[Real, Real]:
    zeros, poles = orders
    sought = np.isnan(given)
    target = measured * np.exp(powers[:, 1] * delays[:, None])
    # The first denominator has its poles in the middle of the band, well damped.
    previous = np.ones((delays.size, 1)) * np.atleast_1d(np.poly(-np.ones(poles)))
    least = np.full(delays.size, np.inf)
    numerators: Real = np.zeros((delays.size, zeros + 1))
    denominators = previous.copy()
    for _ in range(_STEPS):
        share = (root / np.abs(previous @ powers[:, : poles + 1].T))[..., None]
        columns = np.concatenate(
            [share / target[..., None] * powers[:, : zeros + 1], -share * powers[:, :poles]],
            axis=-1,
        )
        side = share * powers[:, poles, None] - columns[..., ~sought] @ given[~sought, None]
        rows = np.concatenate([columns[..., sought], side], axis=-1)
        found = np.tile(given, (delays.size, 1))
        found[:, sought] = _least_squares(np.concatenate([rows.real, rows.imag], axis=1))
        top = found[:, : zeros + 1]
        bottom: Real = np.ones((delays.size, poles + 1))
        bottom[:, :poles] = found[:, zeros + 1 :]
        model = (top @ powers[:, : zeros + 1].T) / (bottom @ powers[:, : poles + 1].T)
        error = np.sqrt(np.sum((root * np.abs(model / target - 1.0)) ** 2, axis=1))
        better = error < least
        least = np.where(better, error, least)
        numerators[better], denominators[better] = top[better], bottom[better]
        if np.all(np.abs(bottom - previous) <= _SETTLED * (np.abs(bottom) + np.abs(previous))):
            break
        previous = bottom
    return numerators, denominators


def _descend(
    powers: NDArray[np.complex128],
    measured: NDArray[np.complex128],
    root: Real,
    top: Real,
    bottom: Real,
    delays: Real,
    sought: NDArray[np.bool_],
) -> tuple[Real, ...]:
    zeros, poles = top.shape[1] - 1, bottom.shape[1] - 1
    now = np.concatenate([top, bottom[:, :poles], delays[:, None]], axis=1)

    def compare(x: Real) -> tuple[NDArray, ...]:
        above = x[:, : zeros + 1] @ powers[:, : zeros + 1].T
        below = x[:, zeros + 1 : -1] @ powers[:, :poles].T + powers[:, poles]
        turn = np.exp(-x[:, -1:] * powers[:, 1]) / measured
        residual = root * (above / below * turn - 1.0)
        squares = np.sum(residual.real**2 + residual.imag**2, axis=-1)
        return above, below, turn, residual, np.where(np.isfinite(squares), squares, np.inf)

    above, below, turn, residual, cost = compare(now)
    damping = np.full(len(now), 1e-3)
    running = np.isfinite(cost)
    for _ in range(_DESCENT):
        if not running.any():
            break
        share = root * turn / below
        model = (share * above)[..., None]
        slope = np.concatenate(
            [
                share[..., None] * powers[:, : zeros + 1],
                -model / below[..., None] * powers[:, :poles],
                -model * powers[:, 1, None],
            ],
            axis=-1,
        )[..., sought]
        rows = np.concatenate([slope, -residual[..., None]], axis=-1)[running]
        step = np.zeros_like(now)
        step[np.flatnonzero(running)[:, None], np.flatnonzero(sought)] = _least_squares(
            np.concatenate([rows.real, rows.imag], axis=1), damping[running]
        )
        *tried, new = compare(now + step)
        better = new < cost
        arrived = better & (new > (1.0 - _ARRIVED) * cost)
        for old, fresh in zip((above, below, turn, residual), tried):
            old[better] = fresh[better]
        now[better], cost[better] = (now + step)[better], new[better]
        damping = np.where(better, 0.2 * damping, 5.0 * damping)
        running &= ~arrived & (damping < 1e6)
    bottom = np.concatenate([now[:, zeros + 1 : -1], np.ones((len(now), 1))], axis=1)
    return now[:, : zeros + 1], bottom, now[:, -1], np.sqrt(cost)


def _least_squares(rows: Real, damping: Real | None = None) -> Real:
    """Solve stacks (n_stack, n_row, n_unknown + 1) of least squares, damped if asked."""
    size = np.sqrt(np.sum(rows**2, axis=-2, keepdims=True))
    size[size == 0.0] = 1.0
    unknowns = rows.shape[-1] - 1
    held = np.full(len(rows), 1e-14) if damping is None else damping
    below = np.zeros((len(rows), unknowns, unknowns + 1))
    below[:, np.arange(unknowns), np.arange(unknowns)] = np.sqrt(held)[:, None]
    triangle = np.asarray(np.linalg.qr(np.concatenate([rows / size, below], axis=-2), mode="r"))
    solved = np.linalg.solve(triangle[:, :-1, :-1], triangle[:, :-1, -1:])[..., 0]
    return solved * size[:, 0, -1:] / size[:, 0, :-1]


def order(
    omega: Real,
    response: NDArray[np.complex128],
    error: Real | float = 0.0,
    orders: Sequence[tuple[int, int]] = ORDERS,
) -> tuple[int, int]:
    """Return zeros and poles of the smallest transfer function that follows a response, (n_freq,).

    Frequencies, (n_freq,) rad/s, increase; errors of magnitude are relative, as of phase in rad.
    """
    within = max(_ENOUGH, _WITHIN * np.sqrt(2.0 * np.mean(np.square(error))))
    chosen, (best, roots) = orders[0], _tried(omega, response, *orders[0])
    if np.any((roots.real > 0.0) & (np.abs(roots) > FAST * omega[-1])):
        best = max(2.0 * best, 1.01 * _ENOUGH)  # any without such a pole is better
    for zeros, poles in orders[1:]:
        if omega.size < _POINTS * (zeros + poles + 1) or best < (within if poles > 2 else _ENOUGH):
            break
        left, roots = _tried(omega, response, zeros, poles)
        highest = np.where(roots.real > 0.0, FAST, _INSIDE) * omega[-1]
        if left < _BETTER * best and np.all(np.abs(roots) < highest):
            chosen, best = (zeros, poles), left
    return chosen


def _tried(
    omega: Real, response: NDArray[np.complex128], zeros: int, poles: int
) -> tuple[float, NDArray[np.complex128]]:
    found = rational_fits(
        omega,
        response,
        np.ones(omega.size),
        zeros=zeros,
        poles=poles,
        delays=delay_grid(omega, low=0.0),
    )
    best = int(np.argmin(found.errors))
    return float(found.errors[best]), np.roots(found.denominators[best][::-1]).astype(np.complex128)
