"""Finds what is wrong with the times of a log, repairs it where asked, and judges its clocks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import RecordError
from helisim.base.note import Option, Remedy, options
from helisim.logs.mapping import Column
from helisim.logs.report import Findings, LogFinding
from helisim.logs.source import place
from helisim.records.record import UNIFORM, Channel

GAP = 4.5
"""A step longer than so many median steps is a gap."""
_STEPS = (2.5e-5, 2.0)
"""s: the shortest and longest steps of any flight's log; milliseconds taken for seconds give 2.5 to
100 s, seconds taken for milliseconds are shorter."""
_FEW = 10  # samples that don't tell a unit
_RESET = 20.0  # median steps by which time goes back, at least, where a clock began anew
_LONGEST = 3e9  # s, about a century: times further apart aren't times
_JITTER = 0.2
"""Of the mean step, rms: the largest jitter that is resampled unasked. At ten samples a period,
where the default band ends, a stamp that is off by so much is off by 7 degrees of the period."""
_WORST = 0.5  # of the mean step, by which each step may be off: from there on a sample may be lost
_ROUNDING = 1e-3  # of the mean step, rms: less than this comes from stamps with few digits


class Options(NamedTuple):
    """How a log is to be read: Hz, s; `limits` are the first and last instant that is used."""

    rate: float | None
    repairs: frozenset[str]
    max_gap: float | None
    min_duration: float
    limits: tuple[float, float]


class Taken(NamedTuple):
    """A column of a log as a channel: its heading, its unit and sign, and how it is computed."""

    channel: Channel
    heading: str
    column: Column
    computed: str


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of channels that share a clock, by rows (n_time,) of a log.

    Attributes:
        time: (n_time,) s.
        values: (n_time, n_channel) SI, NaN where the log has no number.
        taken: (n_channel,) what the columns are.
        clock: the name of the column of times.
    """

    path: Path
    counts: str
    rows: NDArray[np.int64]
    time: NDArray[np.float64]
    values: NDArray[np.float64]
    taken: tuple[Taken, ...]
    clock: str

    def take(self, keep: slice | NDArray) -> "Samples":
        """Return the samples at a slice, at positions (n_kept,), or where (n_time,) is true."""
        found = self.rows[keep], self.time[keep], self.values[keep]
        return replace(self, rows=found[0], time=found[1], values=found[2])

    def pick(self, columns: NDArray[np.bool_]) -> "Samples":
        """Return the samples with the columns, (n_channel,), that are true."""
        taken = tuple(one for one, there in zip(self.taken, columns) if there)
        return replace(self, values=self.values[:, columns], taken=taken)

    def at(self, k: int, column: str | None = None) -> str:
        """Return where the sample k is, for a message."""
        return place(self.path, self.counts, int(self.rows[k]), column)

    def empty(self, column: str) -> str:
        """Return what is wrong with a column that has no number."""
        rows = f"{self.counts}s {self.rows[0]} to {self.rows[-1]}"
        return f"{self.path}, column {column!r}, {rows}: no number at all"

    def report(
        self,
        findings: Findings,
        kind: str,
        where: NDArray[np.intp],
        what: str,
        done: str | None,
        advice: str,
        remedy: Remedy,
        column: str | None = None,
    ) -> None:
        """Note a fault that is repaired, or refuse the log.

        Args:
            findings: that it is added to.
            kind: of the fault.
            where: (n_fault,) its samples.
            what: it is.
            done: the repair; None where it wasn't asked for.
            advice: on how to repair it.
            remedy: options that allow the repair.
            column: that has it; that of times by default.
        """
        rows = tuple(self.rows[where].tolist())
        if done is not None:
            of = "" if column is None else f"column {column!r}, "
            text = f"{of}{self.counts} {rows[0]}: {what}; {done}"
            findings.note(kind, text, len(rows), rows, repaired=True)
        else:
            text = f"{self.at(int(where[0]), column or self.clock)}: {what}; {advice}"
            findings.refuse(kind, text, len(rows), rows, remedy=remedy)


def within(samples: Samples, limits: tuple[float, float], findings: Findings) -> Samples:
    """Return the samples between two instants, s, inclusive; a sample without a time stays.

    Raises:
        RecordError: there are fewer than two.
    """
    low, high = limits
    keep = ~((samples.time < low) | (samples.time > high))
    if keep.all():
        return samples
    start = "from the start" if np.isinf(low) else f"from {low:g} s"
    asked = f"{start} to the end" if np.isinf(high) else f"{start} to {high:g} s"
    kept, found = int(np.count_nonzero(keep)), samples.take(keep)
    if kept < 2:
        raise RecordError(
            f"{samples.path}: {kept} samples {asked}, and the log goes from "
            f"{np.nanmin(samples.time):g} to {np.nanmax(samples.time):g} s"
        )
    rows = f"{samples.counts}s {found.rows[0]} to {found.rows[-1]}"
    text = f"{rows} are used, {kept} of {keep.size} samples: {asked}"
    findings.note("limits", text, keep.size - kept, repaired=True)
    return found


def check_unit_of_time(samples: Samples, findings: Findings) -> None:
    """Refuse steps that no flight log has: the unit of its time is another one."""
    steps = np.diff(samples.time)
    step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    sane = step == 0.0 or _STEPS[0] <= step <= _STEPS[1]
    if samples.time.size < _FEW or sane or step > _LONGEST:  # what isn't time is told elsewhere
        return
    right = "ms" if step < 2e3 else "us" if step < 2e6 else "ns"
    wrong, right = ("ms or us", "s") if step < _STEPS[0] else ("s", right)
    text = (
        f"{samples.path}, column {samples.clock!r}: its steps are {step:.4g} s, the median, so "
        f"{samples.time.size} samples would last {samples.time[-1] - samples.time[0]:.4g} s: no "
        f"flight log has such; {right} declared as {wrong}?"
    )
    findings.refuse("unit of time", text, remedy=Option("time", f"{samples.clock}:{right}"))


def in_order(samples: Samples, options: Options, findings: Findings) -> tuple[Samples, ...]:
    """Return stretches in which time doesn't fall: one, or more where a clock was reset.

    Where time falls and no repair was asked for, that is refused, and the likelier one done.

    Raises:
        RecordError: it isn't time at all.
    """
    time = samples.time
    wild = np.flatnonzero(~(np.abs(time) < _LONGEST))
    if wild.size:
        raise RecordError(
            f"{samples.at(int(wild[0]), samples.clock)}: more than {_LONGEST:.0e} s from the "
            "first; is the unit of time right?"
        )
    back = np.flatnonzero(np.diff(time) < 0.0) + 1
    if not back.size:
        return (samples,)
    asked = [name for name in ("resets", "order") if name in options.repairs]
    anew = np.median(time[back - 1] - time[back]) > _RESET * np.median(np.abs(np.diff(time)))
    likely = asked[0] if asked else "resets" if anew else "order"
    kind, done = {"resets": ("reset", "split there"), "order": ("order", "sorted by time")}[likely]
    what = (
        f"time goes back from {time[back[0] - 1]:.9g} to {time[back[0]]:.9g} s after the start "
        f"({back.size} times in all)"
    )
    advice = (
        "if the clock was reset, split the log there with the repair 'resets', if rows are out of "
        "order, sort them with 'order'"
    )
    said = done if asked else None
    samples.report(findings, kind, back, what, said, advice, f"repair={likely}")
    if likely == "order":
        return (samples.take(np.argsort(time, kind="stable")),)
    return tuple(samples.take(slice(a, b)) for a, b in pairwise([0, *back.tolist(), time.size]))


def without_duplicates(samples: Samples, options: Options, findings: Findings) -> Samples:
    """Return the samples with rows of one stamp averaged; refused unless that was asked for."""
    same = np.flatnonzero(np.diff(samples.time) == 0.0) + 1
    if not same.size:
        return samples
    what = (
        f"the same time as the {samples.counts} before, {samples.time[same[0]]:.9g} s after the "
        f"start ({same.size} times in all)"
    )
    done = "such rows averaged" if "duplicates" in options.repairs else None
    advice = "average such rows with the repair 'duplicates', or use a finer clock"
    samples.report(findings, "duplicate stamp", same, what, done, advice, "repair=duplicates")
    first = np.flatnonzero(np.diff(samples.time, prepend=-np.inf) != 0.0)
    known = np.isfinite(samples.values)
    total = np.add.reduceat(np.where(known, samples.values, 0.0), first, axis=0)
    count = np.add.reduceat(known.astype(np.int64), first, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return replace(samples.take(first), values=total / count)


def check_missing(samples: Samples, options: Options, findings: Findings) -> None:
    """Report the cells without a number; refused unless they are to be filled."""
    for taken, values in zip(samples.taken, samples.values.T):
        holes = np.flatnonzero(np.isnan(values))
        if holes.size:
            what = f"no number ({holes.size} of {values.size} numbers are missing)"
            done = "interpolated" if "missing" in options.repairs else None
            advice = "interpolate with the repair 'missing', or cut the log"
            said = what, done, advice, "repair=missing", taken.heading
            samples.report(findings, "missing number", holes, *said)


class Steadiness(NamedTuple):
    """How even the steps of a clock are, gaps apart.

    Attributes:
        kind: "uniform", "jitter" (small enough to be resampled unasked) or "irregular".
        step: mean, s.
        rms: of what the steps are off, s.
        largest: of what they are off, s.
        gaps: steps that are gaps.
    """

    kind: Literal["uniform", "jitter", "irregular"]
    step: float
    rms: float
    largest: float
    gaps: int

    @property
    def rate(self) -> float:
        """The rate that stands for the clock, Hz: of three digits where it jitters."""
        digits = 3 if self.rms > _ROUNDING * self.step else 6
        return float(f"{1.0 / self.step:.{digits}g}") if self.step > 0.0 else 0.0

    @property
    def jitter(self) -> float:
        """How much the steps are off, rms, relative to the mean step."""
        return self.rms / max(self.step, 1e-12)

    def __str__(self) -> str:
        return (
            f"steps of {1e3 * self.step:.4g} ms that are off by {1e3 * self.rms:.2g} ms rms "
            f"({100.0 * self.jitter:.2g} %), at most {1e3 * self.largest:.2g} ms"
        )


def steadiness(time: NDArray[np.float64], max_gap: float | None = None) -> Steadiness:
    """Judge a clock.

    Args:
        time: (n_time,) s, increasing.
        max_gap: the longest step that is no gap, s; by default 4.5 median steps.
    """
    steps = np.diff(time)
    if not steps.size:
        return Steadiness("uniform", 0.0, 0.0, 0.0, 0)
    limit = GAP * float(np.median(steps)) if max_gap is None else max_gap
    usual = steps[steps <= limit]
    if not usual.size:
        return Steadiness("irregular", float(np.mean(steps)), 0.0, 0.0, int(steps.size))
    mean = float(np.mean(usual))
    off = np.abs(usual - mean)
    rms, largest = float(np.sqrt(np.mean(off**2))), float(np.max(off))
    small = rms <= _JITTER * mean and largest <= _WORST * mean
    kind = "uniform" if largest <= UNIFORM * mean else "jitter" if small else "irregular"
    return Steadiness(kind, mean, rms, largest, int(steps.size - usual.size))


def common_rate(
    stretches: Sequence[Sequence[Samples]], options: Options, findings: Findings
) -> float | None:
    """Return the rate that a log is resampled at unasked, Hz, and say so; None where it isn't.

    A log of one clock that jitters a little gets its own rate; channels of several clocks get the
    slowest one's. An irregular one of several is refused.

    Args:
        stretches: the samples of each clock, of each stretch between resets.
        options: of the reading.
        findings: what is done is added.
    """
    clocks = [one for stretch in stretches for one in stretch if one.time.size > 1]
    judged = [(steadiness(one.time, options.max_gap), one) for one in clocks]
    if not judged:
        return None
    kinds = {found.kind for found, _ in judged}
    worst, uneven = max(judged, key=lambda one: one[0].rms)
    if max(map(len, stretches)) == 1:
        gaps = any(found.gaps for found, _ in judged) and "gaps" not in options.repairs
        if gaps or "jitter" not in kinds or "irregular" in kinds:
            return None
        text = f"column {clocks[0].clock!r}: {worst}; resampled at {worst.rate:g} Hz"
        findings.note("jitter", text, repaired=True, remedy=f"resample={worst.rate:g}")
        return worst.rate
    slowest, last = max(judged, key=lambda one: one[0].step)
    names = ", ".join(dict.fromkeys(f"{one.clock} {j.rate:.3g} Hz" for j, one in judged))
    irregular = [one for one in judged if one[0].kind == "irregular"]
    worst, uneven = max(irregular or judged, key=lambda one: one[0].jitter)
    if irregular:
        text = (
            f"{uneven.path}: its channels have {len({one.clock for one in clocks})} clocks "
            f"({names}), and {uneven.clock} is irregular, {worst}; give a common rate, such as "
            f"{slowest.rate:g} Hz"
        )
        findings.refuse("clocks", text, remedy=f"resample={slowest.rate:g}")
    else:
        text = (
            f"channels of several clocks ({names}; jitter at most {1e3 * worst.rms:.2g} ms rms): "
            f"resampled at {slowest.rate:g} Hz, the slowest one's, {last.clock}"
        )
        findings.note("clocks", text, repaired=True, remedy=f"resample={slowest.rate:g}")
    return slowest.rate


def unevenness(samples: Samples, max_gap: float | None) -> LogFinding | None:
    """Return where samples of one part aren't uniform and what to do; None where they are.

    Args:
        samples: increasing.
        max_gap: the longest step that is no gap, s; None for 4.5 median steps.
    """
    steps = np.diff(samples.time)
    mean = float(np.mean(steps))
    worst = int(np.argmax(np.abs(steps - mean)))
    if abs(steps[worst] - mean) <= UNIFORM * mean:
        return None
    found = steadiness(samples.time, max_gap)
    text = (
        f"{samples.at(worst + 1, samples.clock)}: {steps[worst]:.6g} s after the {samples.counts} "
        f"before, on average {mean:.6g} s: samples must be uniform"
    )
    split = "split the log at its gaps with the repair 'gaps'"
    remedy = options("repair=gaps" if found.gaps else "")
    if found.gaps and found.kind != "irregular":
        return LogFinding("uneven", f"{text}; {split}", remedy)
    rate = float(f"{found.rate:.2g}")
    text += f", and this clock is irregular: {found}; resample the log, such as at {rate:g} Hz"
    text += f", and {split}" if found.gaps else ""
    return LogFinding("uneven", text, (Option("resample", f"{rate:g}"), *remedy))
