"""Rational fits of measured responses at many delays, from no start at all.

    H(s) = e^(-tau s) (b_m s^m + ... + b0) / (s^n + a_(n-1) s^(n-1) + ... + a0)

With the delay given, the relative error times the denominator is linear in the coefficients;
weighed by the denominator of the step before, the solutions tend to the smallest relative error
(Sanathanan and Koerner, IEEE Trans. Automatic Control 8, 1963). Every delay of a grid is solved
at once. Several responses may share the denominator. Frequencies are scaled by the band's
geometric mean, so that the powers stay of one order. From there all of them descend together to
the smallest relative error, delays free.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

_STEPS, _SETTLED = 20, 1e-6
"""Sanathanan-Koerner steps: most are done in five, lightly damped poles in noise take more; and the
fraction by which a denominator that has settled changes."""
_DESCENT, _ARRIVED = 60, 1e-6
"""Levenberg-Marquardt steps, and the fraction by which the squared error falls at the end."""
STEP = 0.5
"""rad: how far two delays of a grid turn the phase at the top of the band from each other."""
_LONGEST, _CYCLES, _LEAD = 0.5, 2.0, 0.3
"""Delays are looked for up to so many s in any band, and so many cycles of the band's top; and down
to such a lead, s: recorders skew their channels against each other."""

ORDERS = ((0, 1), (0, 2), (1, 2), (1, 3), (2, 3), (2, 4), (3, 4))
"""Zeros and poles that are tried, the smallest first."""
_BETTER, _ENOUGH = 0.5, 0.03
"""Of the error of fewer coefficients, that more must leave at most; and the relative error, rms, at
which fewer are enough for a start."""
_INSIDE = (0.3, 2.0)
"""Of the band's edges, between which all poles must be: others can't be told from the data."""
FAST = 0.4
"""Of the band's top, from which an unstable pole is no aircraft's that anyone flew: with a delay
that is too long it stands for a lag that the order has no room for."""
_POINTS = 3
"""Frequencies a coefficient, at least."""


class Rationals(NamedTuple):
    """Rational fits that began at each of several delays.

    Attributes:
        begun: (n_delay,) s, where each began.
        delays: (n_delay,) s, where each ended.
        numerators: (n_delay, zeros + 1), from s^0 up.
        denominators: (n_delay, poles + 1), from s^0 up; the last is 1.
        errors: (n_delay,) root of the weighted mean square of the relative errors.
    """

    begun: Real
    delays: Real
    numerators: Real
    denominators: Real
    errors: Real


def delay_grid(frequency: Real, low: float = -_LEAD, high: float = np.inf) -> Real:
    """Return the delays to look at, s, for a band, (n_freq,) rad/s, and bounds of the delay.

    They reach from a lead of 0.3 s to 0.5 s or two cycles of the band's top, whichever is longer,
    as far as the bounds allow.
    """
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
    """Fit a response from each delay.

    Args:
        frequency: (n_freq,) rad/s.
        measured: (n_freq,) response.
        weight: (n_freq,) of the squared relative errors.
        zeros: order of the numerator.
        poles: order of the denominator.
        delays: (n_delay,) s, increasing.
        fixed: keep the delays where they begin.
        known: (zeros + 1 + poles,) coefficients that are given, the numerator's first, from s^0
            up; nan where they are sought. By default all are.
    """
    unit = float(np.sqrt(np.min(frequency) * np.max(frequency)))
    scaled = (1j * frequency / unit).astype(np.complex128)
    powers = scaled[:, None] ** np.arange(max(zeros, poles, 1) + 1)
    root = np.sqrt(weight / np.sum(weight))
    scale = unit ** (poles - np.arange(max(zeros, poles) + 1.0))
    given = np.full(zeros + 1 + poles, np.nan)
    if known is not None:
        given = known / np.concatenate([scale[: zeros + 1], scale[:poles]])
    top, bottom = _sanathanan_koerner(powers, measured, root, (zeros, poles), unit * delays, given)
    sought = np.append(np.isnan(given), not fixed)
    top, bottom, ended, errors = _descend(
        powers, measured, root, top, bottom, unit * delays, sought
    )
    return Rationals(
        begun=delays,
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
    """Return the best numerator and denominator at each delay, frequencies scaled."""
    zeros, poles = orders
    sought = np.isnan(given)
    target = measured * np.exp(powers[:, 1] * delays[:, None])
    # The denominator of the first step has its poles in the middle of the band, well damped.
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
    """Go from each start to a smallest relative error, by Levenberg and Marquardt, all at once.

    Returns:
        Numerators, denominators, delays and errors.
    """
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
    """Solve stacks of least-squares problems, columns scaled to one; damped if asked.

    Args:
        rows: (n_stack, n_row, n_unknown + 1), the last column the right-hand side.
        damping: (n_stack,) of the scaled unknowns' squares.
    """
    size = np.sqrt(np.sum(rows**2, axis=-2, keepdims=True))
    size[size == 0.0] = 1.0
    unknowns = rows.shape[-1] - 1
    held = np.full(len(rows), 1e-14) if damping is None else damping
    below = np.zeros((len(rows), unknowns, unknowns + 1))
    below[:, np.arange(unknowns), np.arange(unknowns)] = np.sqrt(held)[:, None]
    upright = np.concatenate([rows / size, below], axis=-2)
    triangle = np.asarray(np.linalg.qr(upright, mode="r"))
    solved = np.linalg.solve(triangle[:, :-1, :-1], triangle[:, :-1, -1:])[..., 0]
    return solved * size[:, 0, -1:] / size[:, 0, :-1]


def order(
    omega: Real,
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
    omega: Real, response: NDArray[np.complex128], zeros: int, poles: int
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
