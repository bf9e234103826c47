"""Cuts a log's samples into the parts that become records, and resamples them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.errors import RecordError
from helisim.records.channels import Channel
from helisim.records.logs.clock import common_rate, unevenness
from helisim.records.logs.mapping import Column
from helisim.records.logs.report import Findings, LogFinding, Part
from helisim.records.logs.resample import Interpolant, interpolant, oversampling, resample
from helisim.records.logs.timing import (
    Samples,
    check_missing,
    in_order,
    pieces,
    without_duplicates,
)

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
    """Cut a stretch at its gaps, fill what is missing, and resample where asked for."""
    first = stretch[0]
    spans = []
    for one in stretch:
        found = pieces(one, options.repairs, options.max_gap, options.rate is not None, findings)
        spans.append([(float(one.time[x.first]), float(one.time[x.last])) for x in found])
    factor = 1
    if options.rate is not None:
        steps = [_median_step(one, k) for one in stretch for k in range(len(one.columns))]
        factor = max((oversampling(step, options.rate) for step in steps), default=1)
    made = Cut([], [], [], [], factor)
    for start, stop in _shared(spans):
        inside = np.flatnonzero((first.time >= start) & (first.time <= stop))
        if options.rate is None:
            time = first.time[inside]
            values = first.values[inside].copy()
            for k in range(values.shape[1]):
                holes = np.isnan(values[:, k])
                if holes.any():
                    values[holes, k] = _line(first, k, start, stop)(time[holes])
        else:
            count = int(min(np.floor((stop - start) * options.rate + 1e-6), 1e12)) + 1
            values = resample(
                [_line(one, k, start, stop) for one in stretch for k in range(len(one.columns))],
                start,
                count,
                rate=options.rate,
                factor=factor,
                samples=max(one.time.size for one in stretch),
            )
            time = start + np.arange(count) / options.rate
        row = [int(first.rows[k]) for k in (inside[[0, -1]] if inside.size else (0, 0))]
        span = float(time[-1] - time[0])
        if time.size < 2 or span < options.min_duration:
            text = (
                f"{first.counts}s {row[0]} to {row[1]}: {time.size} samples, {span:.4g} s, left "
                "out as too short"
            )
            made.left_out.append(LogFinding("short part", text, 1, tuple(row), True))
            continue
        made.time.append(time)
        made.values.append(values)
        uneven, option = "", ""
        if options.rate is None:
            uneven, option = unevenness(first.take(inside), options.max_gap)
        made.parts.append(Part(row[0], row[1], time.size, float(time[0]), span, uneven, option))
    return made


def _line(samples: Samples, k: int, start: float, stop: float) -> Interpolant:
    """Return a function of time for a column between two instants.

    Samples beyond are used only where it has none at the instant itself.
    """
    known = np.flatnonzero(np.isfinite(samples.values[:, k]))
    time = samples.time[known]
    low = max(int(np.searchsorted(time, start, side="right")) - 1, 0)
    high = min(int(np.searchsorted(time, stop, side="left")), time.size - 1)
    keep = known[low : high + 1]
    return interpolant(samples.time[keep], samples.values[keep, k])


def _shared(spans: Sequence[Sequence[tuple[float, float]]]) -> list[tuple[float, float]]:
    """Return the intervals that all of several sorted lists of intervals have."""
    shared = list(spans[0])
    for other in spans[1:]:
        shared = [
            (max(a, c), min(b, d)) for a, b in shared for c, d in other if max(a, c) < min(b, d)
        ]
    return shared


def _median_step(samples: Samples, k: int) -> float:
    steps = np.diff(samples.time[np.isfinite(samples.values[:, k])])
    return float(np.median(steps)) if steps.size else np.inf
