"""Samples that were lost: which ones, and what the others make of them.

A record's provenance names them. Their values are expectations given every sample that is there, by
an autoregressive model of all channels that is fitted to stretches without gaps alone (A. Janssen,
R. Veldhuis and L. Vries, IEEE Trans. ASSP 34, 1986, for one channel). They tell nothing new: what
is estimated with them has an error that `with_more_missing` shows.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Real
from helisim.records.quality import stretches
from helisim.records.record import FlightRecord

Bools = NDArray[np.bool_]

# usual steps between two samples from which one is missing; from a sample, where it is known by it
_MISSED, _NEAR = 1.6, 0.25
# s of a model's memory, in which a rotor's or a servo's answer shows, and of a window, in which a
# sweep changes little; a window's samples for each coefficient of a row of the model
_MEMORY, _SLOW, _FULL = 0.1, 4.0, 8
# rows without a gap that a coefficient needs, and of all; else turns with all rows, each nearer
_LEAST, _SHARE, _TURNS = 3, 1.0 / 3.0, 8
_ELSEWHERE = 1e-4  # weight of the whole record's rows beside a window's: they tell what it does not
# of variances, which keep sums of channels apart; of a diagonal, near what rounding leaves of it
_RIDGE, _FLOOR, _SINGULAR = 1e-6, 1e-9, 1e-11


def in_gaps(known: Real, time: Real, step: float) -> Bools:
    """Return which instants, (n_time,) s, lie in gaps of samples at `known`, (n_sample,) s.

    `step` is that of what is made of them, s. What is beyond the samples is no gap.
    """
    steps = np.diff(known, prepend=known[0])
    after = np.searchsorted(known, time).clip(max=known.size - 1)
    near = np.minimum(np.abs(time - known[after - 1]), np.abs(time - known[after]))
    usual = max(float(np.median(steps)), step)
    return (time < known[-1]) & (steps[after] > _MISSED * usual) & (near > _NEAR * usual)


def completed(values: Real, missing: Bools, rate: float) -> Real:
    """Return values, (n_time, n_channel) at `rate`, Hz, with expectations of those `missing`.

    Where samples are too few for a model they are as they were.
    """
    live = np.flatnonzero(np.any(values != values[0], axis=0))
    n, order = len(values), min(max(round(_MEMORY * rate), 2), len(values) // (4 * live.size + 1))
    if not missing.any() or order < 2 or not np.all(np.abs(values) < 1e100):  # squares have a sum
        return values
    middle, size = values[:, live].mean(axis=0), np.maximum(values[:, live].std(axis=0), 1e-300)
    part, lost = (values[:, live] - middle) / size, missing[:, live]
    full = np.convolve(lost.any(axis=1), np.ones(order + 1))[order:n] < 0.5
    enough = np.count_nonzero(full) >= max(_LEAST * order * live.size, _SHARE * n)
    width = min(max(_FULL * order * live.size, round(_SLOW * rate)), n)
    edge = min(4 * order, width // 4)
    for _ in range(1 if enough else _TURNS):
        rows = np.concatenate([part[order - k : n - k] for k in range(order + 1)], axis=1)
        rows, made = rows * (full if enough else full | True)[:, None], part.copy()
        whole = _ELSEWHERE * (rows.T @ rows)
        for start in np.unique(np.minimum(np.arange(0, n, width - 2 * edge), n - width)).tolist():
            inner = slice(start + edge * (start > 0), start + width - edge * (start + width < n))
            if lost[inner].any():
                taps = _model(rows[start : start + width - order], whole, live.size)
                got = _smoothed(part[start : start + width], lost[start : start + width], taps)
                made[inner] = got[inner.start - start : inner.stop - start]
        part = np.where(lost, made, part)
    found = values.copy()
    found[:, live] = np.where(lost, part * size + middle, values[:, live])
    return found


def _model(rows: Real, whole: Real, channels: int) -> Real:
    """Return the filter to white noise of variance 1, (order + 1, n_channel, n_channel).

    `rows`, (n_row, (order + 1) n_channel), are a window's samples with those before, and `whole`
    the squares of all.
    """
    count = max(np.count_nonzero(np.any(rows, axis=1)), 1)
    squares = (rows.T @ rows + whole) / count
    past, mixed = squares[channels:, channels:], squares[channels:, :channels]
    ahead = np.linalg.solve(past + _RIDGE * np.eye(len(past)), mixed)
    filter_ = np.concatenate([np.eye(channels), -ahead])
    left = rows @ filter_
    value, vector = np.linalg.eigh((left.T @ left + filter_.T @ whole @ filter_) / count)
    white = (vector / np.sqrt(np.maximum(value, _FLOOR * np.mean(value) + _SINGULAR))).T
    return white @ filter_.reshape(-1, channels, channels).swapaxes(1, 2)


def _smoothed(part: Real, lost: Bools, taps: Real) -> Real:
    """Return the window whose lost samples make the least of the filter's squares."""
    from scipy.linalg import solveh_banded  # slow to import

    around = ((len(taps) - 1, len(taps) - 1), (0, 0))  # so samples at the ends have all equations
    part = np.pad(np.where(lost, 0.0, part), around)
    lost = np.pad(lost, around, constant_values=True)
    n, order = len(part), len(taps) - 1
    noise = sum(part[order - k : n - k] @ tap.T for k, tap in enumerate(taps))
    pull = np.sum([np.pad(noise @ one, ((order - k, k), (0, 0))) for k, one in enumerate(taps)], 0)
    place = np.where(lost, np.cumsum(lost).reshape(lost.shape) - 1, -1)
    entries = []
    for lag in range(order + 1):
        block = np.einsum("kai,kaj->ij", taps[: order + 1 - lag], taps[lag:])
        row, column = np.broadcast_arrays(place[lag:, :, None], place[: n - lag, None, :])
        at = np.nonzero((row >= column) & (column >= 0))
        entries.append((row[at] - column[at], column[at], block[at[1], at[2]]))
    below, column, value = (np.concatenate(one) for one in zip(*entries))
    band = np.zeros((int(below.max()) + 1, int(place.max()) + 1))
    band[below, column] = value * (1.0 + _SINGULAR * (below == 0))
    part[lost] = solveh_banded(band, -pull[lost], lower=True)
    return part[order:-order]


def told(time: Real, names: Sequence[str], missing: Bools) -> dict[str, list[list[float]]]:
    """Return channel -> first and last instants, s, of spans that are missing, of those with any.

    `missing` is (n_time, n_channel).
    """
    edges = {name: stretches(lost) - [0, 1] for name, lost in zip(names, missing.T)}
    return {name: time[at].tolist() for name, at in edges.items() if at.size}


def missing_of(record: FlightRecord) -> Bools:
    """Return which samples of a record are missing, (n_time, n_channel)."""
    found, near = np.zeros(record.values.shape, np.bool_), _NEAR * record.sample_time
    for name, spans in record.provenance.get("missing", {}).items():
        if name in record:
            first, last = np.sort(np.array(spans), axis=0).T
            begun = np.searchsorted(first - near, record.time)
            found[:, record.names.index(name)] = begun > np.searchsorted(last + near, record.time)
    return found


def with_more_missing(record: FlightRecord, later: float = 0.5) -> FlightRecord:
    """Return a record with as many more samples hidden, `later` of it on, and expected as well."""
    lost = missing_of(record)
    more = lost | np.roll(lost, round(later * len(record)), axis=0)
    return replace(record, values=completed(record.values, more, 1.0 / record.sample_time))
