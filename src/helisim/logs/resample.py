"""Cuts a log at its gaps and resamples it: interpolation between samples, then a low-pass filter.

The interpolation is Akima's, modified: smoother than straight lines (a third of their error
at six samples a period), and without a spline's overshoot where two noisy samples are close
together. Every channel passes through the same filter, without phase, so frequency responses
between channels keep their values in its passband.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from helisim.base.errors import InputError, RecordError
from helisim.logs.report import Findings, Part
from helisim.logs.timing import GAP, Options, Samples, unevenness

Array = NDArray[np.float64]
PASSBAND = 0.8
"""The filter leaves frequencies unchanged up to this share of half the new rate."""
_STOP_DECIBEL = 80.0
_MAX_SAMPLES = 20_000_000  # numbers of a channel on the fine grid, at most
_MAX_EXPANSION = 1_000
"""Numbers of the fine grid for one of the log's, at most, above 100 000: more says that the rate
or the unit of time is wrong."""
_FASTER = 1.01  # A log that is faster than the grid by no more than this needs no filter
_SLOW = 1.5  # median steps: a channel that is slower than the longest step has its own
_MANY, _MOST, _SHORT = 20, 0.95, 0.1
"""Gaps, of which such a share is shorter than so many s, are those of a logger that drops samples:
a tenth of a second is a fifth of a period at the usual end of the band, 2 Hz."""


def check_rate(rate: float) -> float:
    """Return a rate in Hz as a float. Raises InputError unless it is positive and sane."""
    try:
        number = float(rate)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if isinstance(rate, bool) or not (1e-3 <= number <= 1e6):
        raise InputError(f"resample_hz is {rate!r}, expected 0.001 to 1e6 Hz")
    return number


class Cut(NamedTuple):
    """One part of a log: its grid or samples (n_time,), values (n_time, n_channel), and origin."""

    time: Array
    values: Array
    part: Part


def cut(
    stretch: tuple[Samples, ...], options: Options, findings: Findings
) -> tuple[list[Cut], float | None]:
    """Cut a stretch at its gaps, fill what is missing, and resample where asked for.

    Where something is refused, nothing is made.

    Args:
        stretch: samples of each clock.
        options: of the reading.
        findings: what is found is added.

    Returns:
        The parts, and up to which frequency the filter changes nothing, Hz; None without one.
    """
    first, rate = stretch[0], options.rate
    spans = [
        [(one.time[a], one.time[b]) for a, b in _runs(one, options, findings)] for one in stretch
    ]
    if findings.refused:
        return [], None
    lines = _lines(stretch)
    order = np.argsort([k for line in lines for k in line.columns])
    factor = 1
    if rate is not None:
        steps = [_median_step(one, k) for one in stretch for k in range(len(one.taken))]
        ratios = [1.0 / (step * rate) for step in steps]
        factor = max(1 if ratio <= _FASTER else 2 * math.ceil(ratio) for ratio in ratios)
    made, short = [], []
    for start, stop in _shared(spans):
        low, high = np.searchsorted(first.time, start), np.searchsorted(first.time, stop, "right")
        inside = first.take(slice(low, high))
        rows = (int(inside.rows[0]), int(inside.rows[-1])) if inside.rows.size else (0, 0)
        time = inside.time
        if rate is not None:
            time = _grid(start, stop, rate, factor, max(one.time.size for one in stretch))
        span = float(time[-1] - time[0])
        if time.size < 2 or span < options.min_duration:
            short.append((*rows, time.size, span))
            continue
        if rate is None:
            values = _filled(inside, lines, start, stop)
        else:
            through = [line.between(start, stop) for line in lines]
            values = _resampled(through, time, rate, factor)[:, order]
        uneven = unevenness(inside, options.max_gap) if rate is None else None
        made.append(Cut(time, values, Part(*rows, time.size, float(time[0]), span, uneven)))
    if short:
        _note_short(first.counts, short, findings)
    return made, PASSBAND * rate / 2.0 if rate is not None and factor > 1 else None


def _filled(samples: Samples, lines: "Sequence[_Line]", start: float, stop: float) -> Array:
    """Return values, (n_time, n_channel), with what is missing interpolated."""
    values = samples.values.copy()
    for line in lines:
        for k in line.columns:
            holes = np.isnan(samples.values[:, k])
            if holes.any():  # such a line is of one channel
                values[holes, k] = line.between(start, stop)(samples.time[holes])[:, 0]
    return values


def _note_short(
    counts: str, short: Sequence[tuple[int, int, int, float]], findings: Findings
) -> None:
    """Note parts that are too short: first and last row, samples, and s each."""
    first, last, samples, span = short[0]
    text = f"{counts}s {first} to {last}: {samples} samples, {span:.4g} s, left out as too short"
    if len(short) > 1:
        total = sum(one[2] for one in short)
        text += f"; so were {len(short) - 1} more parts ({total} samples in all)"
    rows = (first, last) if len(short) == 1 else tuple(one[0] for one in short)
    findings.note("short part", text, len(short), rows, repaired=True)


def _shared(spans: Sequence[Sequence[tuple[float, float]]]) -> list[tuple[float, float]]:
    """Return the intervals that all of several sorted lists of intervals share."""
    shared = list(spans[0])
    for others in spans[1:]:
        shared = sorted({*_begun(shared, others), *_begun(others, shared)})
    return shared


def _begun(
    mine: Sequence[tuple[float, float]], others: Sequence[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Return the shared intervals that begin where one of mine does."""
    starts = [start for start, _ in others]
    inside = [(a, min(b, others[k - 1][1])) for a, b in mine if (k := bisect_right(starts, a))]
    return [(start, stop) for start, stop in inside if start < stop]


def _median_step(samples: Samples, k: int) -> float:
    steps = np.diff(samples.time[np.isfinite(samples.values[:, k])])
    return float(np.median(steps)) if steps.size else np.inf


def _runs(samples: Samples, options: Options, findings: Findings) -> list[tuple[int, int]]:
    """Return the first and last sample of stretches whose channels have numbers close together."""
    time, strict = samples.time, options.rate is not None
    cuts: set[tuple[float, float]] = set()
    holed = False
    for taken, values in zip(samples.taken, samples.values.T):
        known = np.flatnonzero(np.isfinite(values))
        if not known.size:
            raise RecordError(samples.empty(taken.heading))
        steps = np.diff(time[known])
        wide = np.flatnonzero(steps > _limit(steps, options.max_gap))
        cuts |= {(float(time[known[k]]), float(time[known[k + 1]])) for k in wide}
        cuts |= {(-np.inf, float(time[known[0]]))} if known[0] > 0 else set()
        cuts |= {(float(time[known[-1]]), np.inf)} if known[-1] < time.size - 1 else set()
        ends = known[0] > 0 or known[-1] < time.size - 1
        holed = holed or bool(ends or np.any(np.diff(known)[wide] > 1))
    if strict and options.max_gap is not None:
        _note_bridged(samples, options.max_gap, findings)
    whole = [(0, time.size - 1)]
    if not cuts:
        return whole
    starts, stops = (np.array(edge) for edge in zip(*sorted(cuts)))
    _report_gaps(samples, starts, stops, options, strict or holed, findings)
    return _between(time, starts, stops) if "gaps" in options.repairs else whole


def _between(time: Array, starts: Array, stops: Array) -> list[tuple[int, int]]:
    """Return the runs of samples that no open interval (start, stop) holds or separates."""
    inside = np.zeros(time.size + 1, dtype=np.int64)
    later = np.searchsorted(time, starts, side="right")
    np.add.at(inside, later, 1)
    np.add.at(inside, np.searchsorted(time, stops, side="left"), -1)
    # A sample at both a stop and a start belongs to no interval; after a start begins a new run.
    keep = np.cumsum(inside)[: time.size] <= 0
    breaks = np.zeros(time.size, dtype=bool)
    breaks[later[later < time.size]] = True
    run = np.cumsum(breaks | ~keep)[keep]
    kept = np.flatnonzero(keep)
    edges = np.flatnonzero(np.diff(run, prepend=-1, append=-1))
    return [(int(kept[a]), int(kept[b - 1])) for a, b in pairwise(edges)]


def _limit(steps: Array, max_gap: float | None) -> float:
    """Return the longest step that is no gap, s; a slow channel isn't all gaps."""
    median = float(np.median(steps)) if steps.size else np.inf
    return GAP * median if max_gap is None or max_gap < _SLOW * median else max_gap


def _note_bridged(samples: Samples, max_gap: float, findings: Findings) -> None:
    """Note the gaps that are interpolated as the longest step allows it."""
    steps = np.diff(samples.time)
    wide = np.flatnonzero((steps > _limit(steps, None)) & (steps <= max_gap))
    if wide.size:
        lost, rows = float(np.sum(steps[wide])), tuple(samples.rows[wide + 1].tolist())
        share = 100.0 * lost / float(samples.time[-1] - samples.time[0])
        text = (
            f"{samples.counts} {rows[0]}: {wide.size} gaps of up to {steps[wide].max():.4g} s "
            f"({lost:.4g} s, {share:.2g} % of the log) are interpolated, as {max_gap:g} s are "
            "allowed"
        )
        findings.note("bridged gap", text, wide.size, rows, repaired=True)


def _report_gaps(
    samples: Samples,
    starts: Array,
    stops: Array,
    options: Options,
    strict: bool,
    findings: Findings,
) -> None:
    """Note gaps, (n_gap,) from starts to stops, or refuse the log where it is strict."""
    time = samples.time
    widths = np.clip(stops, None, time[-1]) - np.clip(starts, time[0], None)
    after = np.clip(np.searchsorted(time, starts, side="right"), 0, time.size - 1)
    lost, span = float(np.sum(widths)), float(time[-1] - time[0])
    share = f"{100.0 * lost / span:.2g} %" if span > 0.0 else "all"
    what = (
        f"a gap of {widths[0]:.4g} s from {max(starts[0], time[0]):.6g} s after the start "
        f"({starts.size} gaps, {lost:.4g} s, {share} of the log)"
    )
    advice = "split the log at its gaps with the repair 'gaps'"
    remedy = "repair=gaps"
    usual = float(np.quantile(widths, _MOST))
    if widths.size >= _MANY and usual <= _SHORT:
        allowed = float(f"{1.1 * usual:.2g}")
        advice = (
            "most are short, as of a logger that drops samples: interpolate those of up to "
            f"{allowed:g} s (max_gap), and {advice}"
        )
        remedy = f"max_gap={allowed:g},repair=gaps"
    else:
        advice += ", or allow longer ones (max_gap)"
    if strict or "gaps" in options.repairs:
        done = "split there" if "gaps" in options.repairs else None
        samples.report(findings, "gap", after, what, done, advice, remedy)
    else:
        rows = tuple(samples.rows[after].tolist())
        findings.note("gap", f"{samples.counts} {rows[0]}: {what}", starts.size, rows)


Interpolant = Callable[[Array], Array]
"""Function of time (n_time,) whose values are (n_time, n_channel)."""


@dataclass(frozen=True, eq=False)
class _Line:
    """Channels, by their numbers among all, that have values (n_known, n_channel) at instants."""

    columns: tuple[int, ...]
    time: Array
    values: Array

    def between(self, start: float, stop: float) -> Interpolant:
        """Return a function of time between two instants.

        Samples beyond are used only where it has none at the instant itself.
        """
        low = max(int(np.searchsorted(self.time, start, side="right")) - 1, 0)
        high = min(int(np.searchsorted(self.time, stop, side="left")), self.time.size - 1)
        keep = slice(low, high + 1)
        return interpolant(self.time[keep], self.values[keep])


def _lines(stretch: Sequence[Samples]) -> list[_Line]:
    """Return the lines through the columns of all clocks, those without a hole together."""
    found: list[_Line] = []
    first = 0
    for one in stretch:
        known = np.isfinite(one.values)
        full = np.flatnonzero(known.all(axis=0))
        values = one.values[:, full] if full.size < len(one.taken) else one.values
        if full.size:
            found.append(_Line(tuple((full + first).tolist()), one.time, values))
        for k in np.flatnonzero(~known.all(axis=0)).tolist():
            there = known[:, k]
            found.append(_Line((k + first,), one.time[there], one.values[there, k : k + 1]))
        first += len(one.taken)
    return found


def interpolant(time: Array, values: Array) -> Interpolant:
    """Return a function of time through samples, constant beyond the ends.

    Args:
        time: (n_time,) s, increasing.
        values: (n_time, n_channel).
    """
    if time.size < 3:
        return lambda at: np.column_stack([np.interp(at, time, column) for column in values.T])
    from scipy.interpolate import Akima1DInterpolator  # slow to import, like all of scipy here

    try:
        with np.errstate(all="ignore"):
            through = Akima1DInterpolator(time, values, method="makima")
    except ValueError:  # differences beyond any number: the reader refuses what isn't finite
        return lambda at: np.full((at.size, values.shape[1]), np.nan)
    return lambda at: through(np.clip(at, time[0], time[-1]))


def _grid(start: float, stop: float, rate: float, factor: int, samples: int) -> Array:
    """Return the instants start + k / rate, (n_time,) s, up to stop."""
    count = int(min(np.floor((stop - start) * rate + 1e-6), 1e12)) + 1
    most = min(_MAX_SAMPLES, 100_000 + _MAX_EXPANSION * samples)
    if count * factor > most:
        raise InputError(
            f"resampling {samples} samples at {rate:g} Hz makes {count * factor} a channel, and at "
            f"most {most} are made; lower the rate, cut the log, or check the unit of time"
        )
    return start + np.arange(count) / rate


def _resampled(through: Sequence[Interpolant], time: Array, rate: float, factor: int) -> Array:
    """Return channels on a grid, (n_time, n_channel), filtered from a finer one."""
    fine = time[0] + np.arange((time.size - 1) * factor + 1) / (rate * factor)
    with np.errstate(all="ignore"):
        columns = np.column_stack([line(fine) for line in through])
        if factor == 1:
            return columns
        taps = _low_pass(factor)
        padded = _mirrored(columns, taps.size // 2)
        found = np.empty((time.size, columns.shape[1]))
        for k, column in enumerate(padded.T):
            around = sliding_window_view(np.ascontiguousarray(column), taps.size)[::factor]
            found[:, k] = np.einsum("ij,j->i", around, taps)  # the taps are symmetric
    return found


def _mirrored(columns: Array, half: int) -> Array:
    """Return columns, (n_time, n_channel), with `half` more samples, mirrored, at each end."""
    if columns.shape[0] <= half:
        return np.pad(columns, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    before = 2.0 * columns[0] - columns[half:0:-1]
    after = 2.0 * columns[-1] - columns[-2 : -half - 2 : -1]
    return np.concatenate([before, columns, after])


@cache
def _low_pass(factor: int) -> Array:
    """Return a symmetric filter: 1 to PASSBAND of the new half rate, 80 dB down above it.

    A sinc in Kaiser's window; its length is so that its middle falls on a sample of the grid.
    """
    width = (1.0 - PASSBAND) / factor
    length = (_STOP_DECIBEL - 7.95) / (2.285 * math.pi * width)
    half = math.ceil(length / (2.0 * factor)) * factor
    cutoff = 0.5 * (1.0 + PASSBAND) / factor
    beta = 0.1102 * (_STOP_DECIBEL - 8.7)  # Kaiser's, above 50 dB
    taps = np.sinc(cutoff * np.arange(-half, half + 1)) * np.kaiser(2 * half + 1, beta)
    return taps / np.sum(taps)
