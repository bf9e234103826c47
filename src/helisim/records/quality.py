"""The quality of sampled channels: spikes, frozen runs, stops, rates beside attitudes' slopes."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Complex, Real
from helisim.records.record import ATTITUDES, RATES, FlightRecord

_BLOCK = 50  # samples over which the usual step of a channel is taken
_STICKS_OUT = 8.0
"""Usual steps: 7.6 deviations of white noise, whose median step is 0.95 of one."""
_COMES_BACK = 0.5  # share of its height by which the channel may have moved on after a spike
_LEAST_STEP = 0.02
"""Share of the channel's median step that a quiet place is taken to have at least."""
_WIDTHS = (1, 2)  # samples of a spike: a longer one is a signal
_FROZEN = 10.0  # times the number of equal samples in a row that the channel usually has at most
_NO_MOVE = 1e-6  # share of its range by which a channel that rests at its start may move
_SHORTEST = 10  # samples in a row that must be equal to count as frozen
_USUAL = 0.95  # quantile of the runs of equal samples that counts as their usual most
_STOP = 0.5  # of a unitised input, either way
_ROUNDING, _OVERSHOOT = 1e-6, 0.06  # by which an input at its stop may be short of it, or beyond
"""Overshoot of a recorder's filter: 11 % of the jump in a Butterworth filter of fourth order."""


class Run(NamedTuple):
    """Samples from `first` to `last`, inclusive."""

    first: int
    last: int


def stretches(mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return where a mask, (n_time,), is true in a row: first, and after the last, (n_row, 2)."""
    return np.flatnonzero(np.diff(np.pad(mask.astype(np.int8), 1))).reshape(-1, 2)


@np.errstate(over="ignore", invalid="ignore")
def spikes(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which samples of a finite channel, (n_time,), are spikes, (n_time,).

    One or two samples beyond both their neighbours, on the same side, by more than eight usual
    steps thereabouts; the neighbours agree to half of that.
    """
    found = np.zeros(values.size, dtype=np.bool_)
    if values.size < 2 * _BLOCK:
        return found
    usual = _usual_step(values)
    for width in _WIDTHS:
        before, after = values[: -width - 1], values[width + 1 :]
        inside = np.stack([values[k : values.size - width - 1 + k] for k in range(1, width + 1)])
        up = inside.min(axis=0) - np.maximum(before, after)
        height = np.maximum(up, np.minimum(before, after) - inside.max(axis=0))
        out = (height > _STICKS_OUT * usual[1 : height.size + 1]) & (
            np.abs(after - before) < _COMES_BACK * height
        )
        found[np.add.outer(np.flatnonzero(out) + 1, range(width))] = True
    return found


def _usual_step(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the median of the steps around each sample, (n_time,)."""
    steps = np.abs(np.diff(values, prepend=values[0]))
    moved = steps > 1e-9 * np.max(np.abs(values))
    if not moved.any():
        return np.full(values.size, np.inf)
    blocks = -(-values.size // _BLOCK)
    padded = np.full(blocks * _BLOCK, np.nan)
    padded[: values.size] = np.where(moved, steps, np.nan)
    rows = np.sort(padded.reshape(blocks, _BLOCK), axis=1)  # NaN comes last
    count = np.count_nonzero(np.isfinite(rows), axis=1)
    middle = rows[np.arange(blocks), count // 2]
    everywhere = np.median(steps[moved])
    middle[count < _BLOCK // 10] = everywhere
    middle = np.maximum(middle, _LEAST_STEP * everywhere)
    around = np.pad(middle, 1, mode="edge")
    return np.repeat(np.maximum.reduce([around[:-2], middle, around[2:]]), _BLOCK)[: values.size]


@np.errstate(over="ignore", invalid="ignore")
def frozen_runs(values: NDArray[np.float64]) -> tuple[Run, ...]:
    """Return the runs of equal samples in which a finite channel of motion, (n_time,), is frozen.

    At least ten, and ten times as many as usual; the rest before the first motion is none.
    """
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0.0) + 1])
    lengths = np.diff(np.concatenate([starts, [values.size]]))
    if lengths.size < 2:
        return ()
    usual = float(np.quantile(lengths, _USUAL))
    moves = int(np.argmax(np.abs(values - values[0]) > _NO_MOVE * np.ptp(values)))
    long = (lengths >= max(_SHORTEST, _FROZEN * usual)) & (starts >= moves)
    return tuple(
        Run(int(start), int(start + length - 1))
        for start, length in zip(starts[long], lengths[long])
    )


def at_stop(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return at which samples a unitised input, (n_time,), is at its stop, (n_time,).

    Far beyond the stop it isn't unitised, and no sample is.
    """
    size = np.abs(values)
    return (
        np.zeros(values.size, dtype=np.bool_)
        if np.max(size) > _STOP + _OVERSHOOT
        else np.abs(size - _STOP) <= _ROUNDING
    )


ANGLES: dict[str, str] = dict(zip(RATES, ATTITUDES))


def slope_matrix(
    flights: Sequence[tuple[Mapping[str, Real] | FlightRecord, float]],
    rates: Sequence[str],
    band: tuple[float, float],
) -> tuple[Real, Real, Real]:
    """Return rates over those of the attitude's slopes, their errors, and shares, (n, n) each.

    `flights` are channels and the step between their samples, s, `band` is in rad/s. A share is how
    much of a rate's size such a slope makes, 1 if all.
    """
    measured, predicted = [], []
    for one, step in flights:
        own = np.column_stack([one[name] for name in rates])
        # both through the same filter: central differences of what the trapezoidal rule integrates
        smooth = own.copy()
        smooth[1:-1] = 0.25 * (own[:-2] + 2.0 * own[1:-1] + own[2:])
        made = _turning({name: one[name] for name in ATTITUDES if name in one}, step)
        both = np.column_stack([smooth, *(made[name] for name in rates)])[1:-1]
        omega = 2.0 * np.pi * np.fft.rfftfreq(len(both), step)
        inside = (omega >= band[0]) & (omega <= band[1])
        lines = np.column_stack(
            [np.fft.rfft(one - one.mean())[inside] / omega[inside] for one in both.T]
        )
        measured.append(lines[:, : len(rates)])
        predicted.append(lines[:, len(rates) :])
    b, a = np.concatenate(measured), np.concatenate(predicted)
    forward, error = _regressed(b, a)
    back, _ = _regressed(a, b)
    # noise in either makes its own regression too flat: the truth is between the two
    inverse = np.linalg.pinv(back)
    slope, between = 0.5 * (forward + inverse), 0.5 * np.abs(forward - inverse)
    sizes = np.linalg.norm(a, axis=0) / np.maximum(np.linalg.norm(b, axis=0), 1e-300)[:, None]
    return slope, np.hypot(error, between), np.abs(slope) * sizes


def _regressed(b: Complex, a: Complex) -> tuple[Real, Real]:
    normal = np.linalg.pinv(np.real(a.conj().T @ a))
    slope = (normal @ np.real(a.conj().T @ b)).T
    left = np.abs(b - a @ slope.T) ** 2  # larger at some lines than at others, so no common level
    weight = np.abs(a @ normal) ** 2
    return slope, np.sqrt(0.5 * left.T @ weight * len(a) / max(len(a) - a.shape[1], 1))


def _turning(angles: Mapping[str, Real], step: float) -> dict[str, Real]:
    """Return body rates by the slopes of the attitude angles; of single angles their slopes."""
    slope = {name: np.gradient(angle, step) for name, angle in angles.items()}
    if len(angles) < len(ATTITUDES):
        return {rate: slope[angle] for rate, angle in ANGLES.items() if angle in slope}
    phi, theta = angles["phi"], angles["theta"]
    return {
        "p": slope["phi"] - slope["psi"] * np.sin(theta),
        "q": slope["theta"] * np.cos(phi) + slope["psi"] * np.sin(phi) * np.cos(theta),
        "r": slope["psi"] * np.cos(phi) * np.cos(theta) - slope["theta"] * np.sin(phi),
    }
