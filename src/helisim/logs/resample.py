"""Cuts a log at its gaps and resamples it: modified Akima interpolation, low-pass without phase.

What lies in gaps that are no cuts is missing, and has expectations of `helisim.records.missing`.
"""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from helisim.base.arrays import Real
from helisim.base.errors import InputError, RecordError
from helisim.logs.report import Findings, Part
from helisim.logs.timing import GAP, Options, Samples, unevenness
from helisim.records.missing import completed, in_gaps

PASSBAND = 0.8  # Share of half the new rate up to which the filter changes nothing
_STOP_DECIBEL = 80.0
_MAX_SAMPLES = 20_000_000  # numbers of a channel on the fine grid, at most
_MAX_EXPANSION = 1_000  # Most numbers of the fine grid for one of the log's, above 100 000
_FASTER = 1.01  # of the grid's rate: a log up to this needs no filter
_SLOW = 1.5  # median steps: a slower channel has its own longest step
# Gaps of a logger that drops samples: their least number, the share of them that is shorter than so
# many s, or so many of its steps: a slow log's gaps are longer
_MANY, _MOST, _SHORT, _SHORT_STEPS = 20, 0.95, 0.1, 10.0


class Cut(NamedTuple):
    """One part of a log: instants (n_time,) s, values (n_time, n_channel), which are missing."""

    time: Real
    values: Real
    part: Part
    missing: NDArray[np.bool_]


def cut(
    stretch: tuple[Samples, ...], options: Options, findings: Findings
) -> tuple[list[Cut], float | None]:
    """Cut a stretch at its gaps and resample it; return the parts and the passband, Hz."""
    first, rate = stretch[0], options.resample_hz
    gaps = {gap for one in stretch for gap in _gaps(one, options, findings)}
    if findings.refused:
        return [], None
    lines = [
        (one.time[known], column[known])
        for one in stretch
        for column in one.values.T
        for there in [np.isfinite(column)]
        for known in [slice(None) if there.all() else there]  # without a copy
    ]
    ratios = [
        1.0 / ((np.median(np.diff(time)) if time.size > 1 else np.inf) * (rate or np.inf))
        for time, _ in lines
    ]
    factor = max(1 if ratio <= _FASTER else 2 * math.ceil(ratio) for ratio in ratios)
    made, short = list[Cut](), list[Part]()
    for start, stop in _spans(stretch, gaps):
        low, high = np.searchsorted(first.time, start), np.searchsorted(first.time, stop, "right")
        inside = first.take(slice(low, high))
        rows = (int(inside.rows[0]), int(inside.rows[-1])) if inside.rows.size else (0, 0)
        count = max(one.time.size for one in stretch)
        time = inside.time if rate is None else _grid(start, stop, rate, factor, count)
        part = Part(*rows, time.size, float(time[0]), float(time[-1] - time[0]))
        if time.size < 2 or part.duration < options.min_duration:
            short.append(part)
        elif rate is None:
            holes = np.isnan(inside.values)
            values = inside.values.copy() if holes.any() else inside.values
            for column, empty, line in zip(values.T, holes.T, lines):
                if empty.any():
                    column[empty] = _between(*line, start, stop)(time[empty])
            part = replace(part, uneven=unevenness(inside, options.max_gap))
            values = completed(values, holes, (time.size - 1) / part.duration)
            made.append(Cut(time, values, part, holes))
        else:
            values, gone = _resampled(lines, time, stop, rate, factor)
            made.append(Cut(time, values, part, gone))
    if short:
        said = [f"{first.counts}s {one.first_row} to {one.last_row}" for one in short[:3]] + [
            f"and {len(short) - 3} more"
        ] * (len(short) > 3)
        asked = f" for {options.min_duration:g} s" * (options.min_duration > 0.0)
        text = f"left out as too short{asked}: {', '.join(said)}"
        findings.note(
            *("short part", text, len(short)),
            tuple(row for one in short for row in (one.first_row, one.last_row)),
            repaired=True,
        )
    return made, PASSBAND * rate / 2.0 if rate is not None and factor > 1 else None


def _spans(
    stretch: Sequence[Samples], gaps: Collection[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Return the intervals, s, in which all clocks have samples and no gap lies."""
    at = max(float(one.time[0]) for one in stretch)
    end = min(float(one.time[-1]) for one in stretch)
    spans = []
    for start, stop in (*sorted(gaps), (np.inf, np.inf)):
        spans += [(at, min(start, end))] if at <= min(start, end) else []
        at = max(at, stop)
    return spans


def _gaps(samples: Samples, options: Options, findings: Findings) -> list[tuple[float, float]]:
    """Return the gaps of any channel, (start, stop) s, and report them."""
    time, found = samples.time, set[tuple[float, float]]()
    for taken, values in zip(samples.taken, samples.values.T):
        known = np.flatnonzero(np.isfinite(values))
        if not known.size:
            raise RecordError(samples.empty(taken.heading))
        at, steps = time[known], np.diff(time[known])
        wide = np.flatnonzero(steps > _limit(steps, options.max_gap))
        found |= set(zip(at[wide].tolist(), at[wide + 1].tolist()))
        found |= {(-np.inf, float(at[0]))} if known[0] > 0 else set()
        found |= {(float(at[-1]), np.inf)} if known[-1] < time.size - 1 else set()
    if options.resample_hz is not None and options.max_gap is not None:
        _note_bridged(samples, options.max_gap, findings)
    if found:
        _report_gaps(samples, np.array(sorted(found)), options, findings)
    return sorted(found)


def _limit(steps: Real, max_gap: float | None) -> float:
    median = float(np.median(steps)) if steps.size else np.inf
    return GAP * median if max_gap is None or max_gap < _SLOW * median else max_gap


def _note_bridged(samples: Samples, max_gap: float, findings: Findings) -> None:
    steps = np.diff(samples.time)
    wide = np.flatnonzero((steps > _limit(steps, None)) & (steps <= max_gap))
    if wide.size:
        share = 100.0 * float(np.sum(steps[wide])) / float(samples.time[-1] - samples.time[0])
        text = f"{wide.size} gaps, {share:.2g} % of the log, count as missing"
        rows = tuple(samples.rows[wide + 1].tolist())
        findings.note("bridged gap", text, wide.size, rows, repaired=True)


def _report_gaps(samples: Samples, gaps: Real, options: Options, findings: Findings) -> None:
    """Report gaps, (n_gap, 2) s, increasing; refuse them unless the log is split there."""
    time = samples.time
    starts, stops = np.clip(gaps, time[0], time[-1]).T
    widths, lost = stops - starts, float(np.sum(stops - starts))
    after = np.minimum(np.searchsorted(time, starts, side="right"), time.size - 1)
    share = 100.0 * lost / float(time[-1] - time[0])
    what = (
        f"a gap of {widths[0]:.4g} s from {starts[0]:.6g} s after the start ({starts.size} "
        f"gap{'s' * (starts.size > 1)}, {lost:.4g} s, {share:.2g} % of the log)"
    )
    advice, remedy = "split the log at its gaps with the repair 'gaps'", "repair=gaps"
    usual = float(np.quantile(widths, _MOST))
    if widths.size >= _MANY and usual <= max(
        _SHORT, _SHORT_STEPS * float(np.median(np.diff(time)))
    ):
        allowed = float(f"{1.1 * usual:.2g}")
        advice = (
            "most are short, as of a logger that drops samples: bridge those of up to "
            f"{allowed:g} s (max_gap), and {advice}"
        )
        remedy = f"max_gap={allowed:g},repair=gaps"
    done = "split there" if "gaps" in options.repair else None
    samples.report(findings, "gap", after, what, done, advice, remedy)


Interpolant = Callable[[Real], Real]  # Function of time (n_time,) whose values are (n_time,)


def _between(time: Real, values: Real, start: float, stop: float) -> Interpolant:
    low = max(int(np.searchsorted(time, start, side="right")) - 1, 0)
    high = min(int(np.searchsorted(time, stop, side="left")), time.size - 1)
    time, values = time[low : high + 1], values[low : high + 1]
    if time.size < 3:
        return lambda at: np.interp(at, time, values)
    from scipy.interpolate import Akima1DInterpolator  # slow to import

    try:
        with np.errstate(all="ignore"):
            through = Akima1DInterpolator(time, values, method="makima")
    except ValueError:  # differences beyond any number
        return lambda at: np.full(at.size, np.nan)
    return lambda at: through(np.clip(at, time[0], time[-1]))


def _grid(start: float, stop: float, rate: float, factor: int, samples: int) -> Real:
    """Return the instants start + k / rate, (n_time,) s, up to `stop`."""
    count = int(min(np.floor((stop - start) * rate + 1e-6), 1e12)) + 1
    most = min(_MAX_SAMPLES, 100_000 + _MAX_EXPANSION * samples)
    if count * factor > most:
        raise InputError(
            f"resampling {samples} samples at {rate:g} Hz makes {count * factor} a channel, and at "
            f"most {most} are made; lower the rate, cut the log, or check the unit of time"
        )
    return start + np.arange(count) / rate


def _resampled(
    lines: Sequence[tuple[Real, Real]], time: Real, end: float, rate: float, factor: int
) -> tuple[Real, NDArray[np.bool_]]:
    """Return channels on a grid to `end`, s, filtered from a finer one, and which are missing."""
    fine = time[0] + np.arange((time.size - 1) * factor + 1) / (rate * factor)
    with np.errstate(all="ignore"):
        columns = np.column_stack([_between(*line, time[0], end)(fine) for line in lines])
        missing, gaps = (
            np.column_stack([in_gaps(known, at, 1.0 / rate) for known, _ in lines])
            for at in (time, fine)
        )
        found = completed(_filtered(columns, factor), missing, rate)
        if factor > 1 and missing.any():  # the filter spreads what was in a gap before
            made = np.column_stack([_between(time, one, time[0], end)(fine) for one in found.T])
            found = _filtered(np.where(gaps, made, columns), factor)
            found = completed(found, missing, rate)
    return found, missing


def _filtered(columns: Real, factor: int) -> Real:
    """Return every factor-th value of columns, (n_time, n_channel), through the low pass."""
    if factor == 1:
        return columns
    taps = _low_pass(factor)
    half = taps.size // 2
    padded = np.pad(columns, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    found = np.empty((1 + (len(columns) - 1) // factor, columns.shape[1]))
    for k, column in enumerate(padded.T):
        around = sliding_window_view(np.ascontiguousarray(column), taps.size)[::factor]
        found[:, k] = np.einsum("ij,j->i", around, taps)  # the taps are symmetric
    return found


@cache
def _low_pass(factor: int) -> Real:
    """Return a symmetric filter: 1 to PASSBAND of the new half rate, 80 dB down above it."""
    width = (1.0 - PASSBAND) / factor
    length = (_STOP_DECIBEL - 7.95) / (2.285 * math.pi * width)
    half = math.ceil(length / (2.0 * factor)) * factor
    cutoff = 0.5 * (1.0 + PASSBAND) / factor
    beta = 0.1102 * (_STOP_DECIBEL - 8.7)  # Kaiser's, above 50 dB
    taps = np.sinc(cutoff * np.arange(-half, half + 1)) * np.kaiser(2 * half + 1, beta)
    return taps / np.sum(taps)
