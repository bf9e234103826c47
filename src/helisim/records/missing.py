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

from helisim.records.record import FlightRecord

Real = NDArray[np.float64]
Bools = NDArray[np.bool_]

# usual steps between two samples from which one is missing; from a sample, where it is known by it
_MISSED, _NEAR = 1.6, 0.25
_MEMORY = 0.1  # s: shorter than a rotor's or a servo's answer, so that the order shows it
# samples of a window for each coefficient of a row of the model, rows without a gap at least (else
# all count), and s at least: a sweep changes little in it
_FULL, _LEAST, _SLOW = 8, 3, 4.0
_TURNS = 4  # of a model that all rows make, filled ones too: each is nearer by what isn't lost
# of variances, which keep sums of channels apart, and of a diagonal, near what rounding leaves
_RIDGE, _FLOOR, _SINGULAR = 1e-6, 1e-9, 1e-12
_HUGE = 1e100  # values whose squares can be summed


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
    n, found = len(values), values.copy()
    live = np.flatnonzero(np.any(values != values[0], axis=0))
    order = min(max(round(_MEMORY * rate), 2), n // (4 * max(live.size, 1)))
    if not missing.any() or order < 2 or not np.all(np.abs(values) < _HUGE):
        return found
    width = min(max(_FULL * order * live.size, round(_SLOW * rate)), n)
    edge = min(4 * order, width // 4)
    for start in np.unique(np.minimum(np.arange(0, n, width - 2 * edge), n - width)).tolist():
        part, lost = values[start : start + width, live], missing[start : start + width, live]
        middle, size = part.mean(axis=0), np.maximum(part.std(axis=0), 1e-300)
        try:
            made = _expected((part - middle) / size, lost, order) * size + middle
        except np.linalg.LinAlgError:  # it stays as it was, and counts as missing all the same
            continue
        inner = slice(edge * (start > 0), width - edge * (start + width < n))
        rows = np.arange(start, start + width)[inner]
        found[np.ix_(rows, live)] = np.where(lost[inner], made[inner], found[np.ix_(rows, live)])
    return found


def _expected(part: Real, lost: Bools, order: int) -> Real:
    """Return a window, (n_time, n_channel) of variance 1 at most, with expectations of the lost."""
    if not lost.any():
        return part
    full = np.convolve(lost.any(axis=1), np.ones(order + 1))[order : len(part)] < 0.5
    enough = np.count_nonzero(full) >= _LEAST * order * part.shape[1]
    for _ in range(1 if enough else _TURNS):
        part = _smoothed(part, lost, _model(part, full if enough else full | True, order))
    return part


def _model(part: Real, rows: Bools, order: int) -> Real:
    """Return the filter to white noise of variance 1, (order + 1, n_channel, n_channel)."""
    n, channels = part.shape
    past = np.concatenate([part[order - k - 1 : n - k - 1] for k in range(order)], axis=1)[rows]
    normal = past.T @ past + _RIDGE * len(past) * np.eye(past.shape[1])
    ahead = np.linalg.solve(normal, past.T @ part[order:][rows])
    left = part[order:][rows] - past @ ahead
    spread = left.T @ left / len(left)
    spread += (_FLOOR * np.trace(spread) / channels + 1e-15) * np.eye(channels)
    white = np.linalg.cholesky(np.linalg.inv(spread)).T
    taps = ahead.reshape(order, channels, channels).swapaxes(1, 2)
    return np.concatenate([white[None], -white @ taps])


def _smoothed(part: Real, lost: Bools, taps: Real) -> Real:
    """Return the window whose lost samples make the least of the filter's squares."""
    from scipy.linalg import solveh_banded  # slow to import

    order = len(taps) - 1
    around = ((order, order), (0, 0))  # so that samples at the ends have all their equations
    part = np.pad(np.where(lost, 0.0, part), around)
    lost = np.pad(lost, around, constant_values=True)
    n = len(part)
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
    band[below, column] = value
    band[0] *= 1.0 + _SINGULAR
    part[lost] = solveh_banded(band, -pull[lost], lower=True)
    return part[order:-order]


def told(time: Real, names: Sequence[str], missing: Bools) -> dict[str, list[list[float]]]:
    """Return channel -> first and last instants, s, of spans that are missing, of those with any.

    `missing` is (n_time, n_channel).
    """
    found = {}
    for name, lost in zip(names, missing.T):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], lost.astype(np.int8), [0]])))
        found[name] = np.stack([time[edges[::2]], time[edges[1::2] - 1]], axis=1).tolist()
    return {name: spans for name, spans in found.items() if spans}


def missing_of(record: FlightRecord) -> Bools:
    """Return which samples of a record are missing, (n_time, n_channel)."""
    found, near = np.zeros(record.values.shape, np.bool_), _NEAR * record.sample_time
    for name, spans in record.provenance.get("missing", {}).items():
        if name in record:
            first, last = np.sort(np.array(spans), axis=0).T
            begun = np.searchsorted(first - near, record.time)
            found[:, record.names.index(name)] = begun > np.searchsorted(last + near, record.time)
    return found


def with_more_missing(record: FlightRecord) -> FlightRecord:
    """Return a record with as many samples again hidden, elsewhere, and expected likewise."""
    lost = missing_of(record)
    more = lost | np.roll(lost, len(record) // 2, axis=0)
    values = completed(record.values, more, 1.0 / record.sample_time)
    return replace(record, values=values)
