"""The quality of a sampled channel: spikes, frozen runs, inputs at their stops."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
_ROUNDING = 1e-6  # by which an input at its stop may be short of it, or beyond
_OVERSHOOT = 0.06
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
    if np.max(size) > _STOP + _OVERSHOOT:
        return np.zeros(values.size, dtype=np.bool_)
    return np.abs(size - _STOP) <= _ROUNDING
