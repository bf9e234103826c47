"""Cuts a log's samples into the parts that become records, and resamples them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import RecordError
from helisim.logs.clock import common_rate, unevenness
from helisim.logs.gaps import pieces
from helisim.logs.mapping import Column
from helisim.logs.report import Findings, LogFinding, Part
from helisim.logs.resample import Line, grid, lines_through, oversampling, resample
from helisim.logs.timing import (
    Samples,
    check_missing,
    in_order,
    without_duplicates,
)
from helisim.records.channels import Channel

_WRAP = 1.5 * np.pi
"""rad: an angle that jumps by more between two samples went around."""


class Options(NamedTuple):
    """How a log is to be read.

    Attributes:
        rate: of the records, Hz; None for the log's own.
        repairs: what may be done.
        max_gap: the longest step that is no gap, s; None for 4.5 median steps.
        min_duration: shorter parts are left out, s.
        limits: samples before the one and after the other are left out, s.
    """

    rate: float | None
    repairs: frozenset[str]
    max_gap: float | None
    min_duration: float
    limits: tuple[float, float]


def tidied(
    samples: tuple[Samples, ...], options: Options, findings: Findings
) -> tuple[tuple[Samples, ...], ...]:
    """Return stretches of all clocks, in order and without duplicates."""
    in_time = [in_order(one, options.repairs, findings) for one in samples]
    if len(samples) > 1 and any(len(stretches) > 1 for stretches in in_time):
        raise RecordError(
            f"{samples[0].path}: its channels have {len(samples)} clocks and one was reset, so "
            "they can't be matched after it: cut the log there, or map channels of one topic"
        )
    tidy = []
    for stretch in zip(*in_time):
        merged = [without_duplicates(one, options.repairs, findings) for one in stretch]
        for one in merged:
            check_missing(one, options.repairs, findings)
        tidy.append(tuple(merged))
    return tuple(tidy)


def unwrapped(
    samples: Samples, channels: Sequence[tuple[Column, Channel]], findings: list[LogFinding]
) -> Samples:
    """Return the samples with angles that went around made continuous."""
    values = samples.values.copy()
    for k, (column, channel) in enumerate(channels):
        if column.unwrap is False or (channel.unit != "rad" and not column.unwrap):
            continue
        known = np.flatnonzero(np.isfinite(values[:, k]))
        turns = np.flatnonzero(np.abs(np.diff(values[known, k])) > _WRAP)
        if not turns.size:
            continue
        values[known, k] = np.unwrap(values[known, k])
        rows = tuple(samples.rows[known[turns + 1]].tolist())
        text = (
            f"column {samples.columns[k]!r}: goes around {turns.size} times, the first in "
            f"{samples.counts} {rows[0]}; made continuous"
        )
        findings.append(LogFinding("angle wraps", text, turns.size, rows, True))
    return replace(samples, values=values)


@dataclass(frozen=True, eq=False)
class Cut:
    """What one stretch of a log became: time, values and origin of each part."""

    time: list[NDArray[np.float64]]
    values: list[NDArray[np.float64]]
    parts: list[Part]
    left_out: list[LogFinding]
    factor: int


def with_rate(
    stretches: Sequence[Sequence[Samples]], options: Options, findings: Findings
) -> Options:
    """Return the options with a rate where one is needed that wasn't given and can be told."""
    if options.rate is not None:
        return options
    rate = common_rate(stretches, options.repairs, options.max_gap, findings)
    return options._replace(rate=rate)


def cut(stretch: tuple[Samples, ...], options: Options, findings: Findings) -> Cut:
    """Cut a stretch at its gaps, fill what is missing, and resample where asked for.

    Where something is refused, nothing is made.
    """
    first = stretch[0]
    spans = []
    for one in stretch:
        found = pieces(one, options.repairs, options.max_gap, options.rate is not None, findings)
        spans.append([(float(one.time[x.first]), float(one.time[x.last])) for x in found])
    if findings.refused:
        return Cut([], [], [], [], 1)
    factor = 1
    if options.rate is not None:
        steps = [_median_step(one, k) for one in stretch for k in range(len(one.columns))]
        factor = max((oversampling(step, options.rate) for step in steps), default=1)
    starts = np.cumsum([0, *(len(one.columns) for one in stretch)])
    lines = [line for one, k in zip(stretch, starts) for line in lines_through(one, int(k))]
    order = np.argsort([k for line in lines for k in line.columns])
    made = Cut([], [], [], [], factor)
    short: list[tuple[int, int, int, float]] = []
    for start, stop in reduce(_shared, spans):
        low = int(np.searchsorted(first.time, start, side="left"))
        inside = slice(low, int(np.searchsorted(first.time, stop, side="right")))
        time = first.time[inside]
        if options.rate is not None:
            count = int(min(np.floor((stop - start) * options.rate + 1e-6), 1e12)) + 1
            time = grid(start, count, options.rate, factor, max(x.time.size for x in stretch))
        row = [int(first.rows[k]) for k in (low, inside.stop - 1)] if inside.stop > low else [0, 0]
        span = float(time[-1] - time[0])
        if time.size < 2 or span < options.min_duration:
            short.append((row[0], row[1], time.size, span))
            continue
        if options.rate is None:
            values = _filled(first.values[inside], time, lines, start, stop)
        else:
            through = [line.between(start, stop) for line in lines]
            values = resample(through, start, time.size, rate=options.rate, factor=factor)
            values = values[:, order]
        made.time.append(time)
        made.values.append(values)
        uneven, option = "", ""
        if options.rate is None:
            uneven, option = unevenness(first.take(inside), options.max_gap)
        made.parts.append(Part(row[0], row[1], time.size, float(time[0]), span, uneven, option))
    if short:
        made.left_out.append(_left_out(first.counts, short))
    return made


def _filled(
    values: NDArray[np.float64],
    time: NDArray[np.float64],
    lines: Sequence[Line],
    start: float,
    stop: float,
) -> NDArray[np.float64]:
    """Return values, (n_time, n_channel), with what is missing interpolated."""
    values = values.copy()
    for line in lines:
        for k, column in zip(line.columns, values.T[list(line.columns)]):
            holes = np.isnan(column)
            if holes.any():
                values[holes, k] = line.between(start, stop)(time[holes])[:, 0]
    return values


def _left_out(counts: str, short: Sequence[tuple[int, int, int, float]]) -> LogFinding:
    """Return the finding of parts that are too short: first and last row, samples, and s each."""
    first, last, samples, span = short[0]
    text = f"{counts}s {first} to {last}: {samples} samples, {span:.4g} s, left out as too short"
    if len(short) > 1:
        total = sum(one[2] for one in short)
        text += f"; so were {len(short) - 1} more parts ({total} samples in all)"
    rows = (first, last) if len(short) == 1 else tuple(one[0] for one in short)
    return LogFinding("short part", text, len(short), rows, True)


def _shared(
    one: Sequence[tuple[float, float]], other: Sequence[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Return the intervals that two sorted lists of intervals share."""
    shared = []
    i = j = 0
    while i < len(one) and j < len(other):
        start, stop = max(one[i][0], other[j][0]), min(one[i][1], other[j][1])
        if start < stop:
            shared.append((start, stop))
        if one[i][1] < other[j][1]:
            i += 1
        else:
            j += 1
    return shared


def _median_step(samples: Samples, k: int) -> float:
    steps = np.diff(samples.time[np.isfinite(samples.values[:, k])])
    return float(np.median(steps)) if steps.size else np.inf
