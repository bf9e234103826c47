"""Finds faults in the times of a log, repairs them where asked, and judges its clocks."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, RecordError, check_known
from helisim.base.note import Option, Remedy, options
from helisim.base.settings import check, convert, setting
from helisim.logs.mapping import REPAIRS, Column
from helisim.logs.report import Findings, LogFinding
from helisim.logs.source import place, usual_step
from helisim.records.record import UNIFORM, Channel

GAP = 4.5  # Median steps above which a step is a gap
# s: shortest and longest steps of any flight's log; others show a wrong unit of time.
_STEPS = (2.5e-5, 2.0)
_FEW, _LONGEST = 10, 3e9  # samples too few to tell a unit; s, about a century
_JITTER = 0.2  # Largest jitter that is resampled unasked, rms, of the mean step
_WORST = 0.5  # of the mean step: an error of a step from which a sample may be lost
_ROUNDING = 1e-3  # of the mean step, rms: less comes from stamps with few digits


@dataclass(frozen=True)
class Options:
    """How a log is to be read, as `read_log` takes it. Raises InputError."""

    resample_hz: float | None = setting(None, unit="Hz", low=1e-3, high=1e6)
    repair: Iterable[str] = ()
    max_gap: float | None = setting(None, unit="s", above=0.0, finite=False)
    min_duration: float = setting(0.0, unit="s", low=0.0)
    start: float | None = setting(None, unit="s", finite=False)
    stop: float | None = setting(None, unit="s", finite=False)

    def __post_init__(self) -> None:
        one = isinstance(self.repair, str) or not isinstance(self.repair, Iterable)
        names = {*convert(tuple[str, ...], [self.repair] if one else [*self.repair], "repair")}
        check_known("repair", sorted(names), REPAIRS)
        implied = {"gaps"} if "frozen" in names else set()
        object.__setattr__(self, "repair", tuple(sorted(names | implied)))
        check(self, "log")
        low, high = self.limits
        if not low < high:
            raise InputError(f"a log's limits are {low:g} and {high:g} s, expected start < stop")

    @property
    def limits(self) -> tuple[float, float]:
        """The first and last instant that is used, s after the log's first stamp."""
        return (
            -np.inf if self.start is None else self.start,
            np.inf if self.stop is None else self.stop,
        )


class Taken(NamedTuple):
    """A column of a log as a channel, and how it is computed."""

    channel: Channel
    heading: str
    column: Column
    computed: str


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of channels that share a clock, by rows (n_time,) of a log.

    `time` is (n_time,) s, `values` (n_time, n_channel) SI, NaN without a number.
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
        return replace(self, rows=self.rows[keep], time=self.time[keep], values=self.values[keep])

    def at(self, k: int, column: str | None = None) -> str:
        """Return the place of sample k, for a message."""
        return place(self.path, self.counts, int(self.rows[k]), column)

    def empty(self, column: str) -> str:
        """Return the message of a column without any number."""
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
        """Note a fault of samples `where`, (n_fault,), as repaired; refuse it if `done` is None."""
        rows = tuple(self.rows[where].tolist())
        if done is not None:
            of = "" if column is None else f"column {column!r}, "
            text = f"{of}{self.counts} {rows[0]}: {what}; {done}"
            findings.note(kind, text, len(rows), rows, repaired=True)
        else:
            text = f"{self.at(int(where[0]), column or self.clock)}: {what}; {advice}"
            findings.refuse(kind, text, len(rows), rows, remedy=remedy)


def within(samples: Samples, limits: tuple[float, float], findings: Findings) -> Samples:
    """Return the samples between two instants, s, inclusive, and those without a time.

    Raises RecordError if there are fewer than two.
    """
    low, high = limits
    keep = ~((samples.time < low) | (samples.time > high))
    if keep.all():
        return samples
    kept, found = int(np.count_nonzero(keep)), samples.take(keep)
    start = "from the start" if np.isinf(low) else f"from {low:g} s"
    text = f"{kept} samples {start} to {'the end' if np.isinf(high) else f'{high:g} s'}"
    if kept < 2:
        raise RecordError(
            f"{samples.path}: {text}, and the log goes from {np.nanmin(samples.time):g} to "
            f"{np.nanmax(samples.time):g} s"
        )
    findings.note(
        "limits", f"of {keep.size} samples {text} are used", keep.size - kept, repaired=True
    )
    return found


def check_unit_of_time(samples: Samples, findings: Findings) -> None:
    """Refuse steps that no flight log has: the unit of time is wrong."""
    step = usual_step(np.diff(samples.time))
    sane = step == 0.0 or _STEPS[0] <= step <= _STEPS[1]
    if samples.time.size < _FEW or sane or step > _LONGEST:  # refused elsewhere
        return
    right = "s" if step < _STEPS[0] else "ms" if step < 2e3 else "us" if step < 2e6 else "ns"
    text = (
        f"{samples.path}, column {samples.clock!r}: its steps are {step:.4g} s, the median, and no "
        f"flight log has such; is its unit {right}?"
    )
    findings.refuse("unit of time", text, remedy=Option("time", f"{samples.clock}:{right}"))


def in_order(
    samples: Samples, options: Options, findings: Findings, clocks: int = 1
) -> tuple[Samples, ...]:
    """Return stretches of increasing time, several where a clock was reset. Raises RecordError.

    A reset is refused where the channels have several `clocks`: they can't be matched after it.
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
    what = (
        f"time goes back from {time[back[0] - 1]:.9g} to {time[back[0]]:.9g} s after the start "
        f"({back.size} in all)"
    )
    done = "split there" if "resets" in options.repair and clocks == 1 else None
    advice = "split the log where its clock was reset with the repair 'resets', or sort its rows"
    several = (
        f"the {clocks} clocks of the channels can't be matched after it: cut the log there, or "
        "take channels of one topic"
    )
    said = (advice, "repair=resets") if clocks == 1 else (several, "channel")
    samples.report(findings, "reset", back, what, done, *said)
    return tuple(samples.take(slice(a, b)) for a, b in pairwise([0, *back.tolist(), time.size]))


def without_duplicates(samples: Samples, options: Options, findings: Findings) -> Samples:
    """Return the samples with rows of one stamp averaged; refuse them unless that was asked for."""
    same = np.flatnonzero(np.diff(samples.time) == 0.0) + 1
    if not same.size:
        return samples
    what = f"the same time as the {samples.counts} before ({same.size} in all)"
    done = "such rows averaged" if "duplicates" in options.repair else None
    advice = "average such rows with the repair 'duplicates', or use a finer clock"
    samples.report(findings, "duplicate stamp", same, what, done, advice, "repair=duplicates")
    first = np.flatnonzero(np.diff(samples.time, prepend=-np.inf) != 0.0)
    known = np.isfinite(samples.values)
    total = np.add.reduceat(np.where(known, samples.values, 0.0), first, axis=0)
    count = np.add.reduceat(known.astype(np.int64), first, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return replace(samples.take(first), values=total / count)


def check_missing(samples: Samples, options: Options, findings: Findings) -> None:
    """Report the cells without a number; refuse them unless they are to be filled."""
    for taken, values in zip(samples.taken, samples.values.T):
        holes = np.flatnonzero(np.isnan(values))
        if holes.size:
            what = f"no number ({holes.size} of {values.size} numbers are missing)"
            done = "taken for missing samples" if "missing" in options.repair else None
            advice = "take them for missing samples with the repair 'missing', or cut the log"
            said = what, done, advice, "repair=missing", taken.heading
            samples.report(findings, "missing number", holes, *said)


class Steadiness(NamedTuple):
    """How even a clock's steps are, gaps apart, s; "jitter" is resampled unasked.

    `rms` and `largest` are errors of the steps.
    """

    kind: Literal["uniform", "jitter", "irregular"]
    step: float
    rms: float
    largest: float
    gaps: int

    @property
    def rate(self) -> float:
        """The rate that stands for the clock, Hz: rounded to three digits where it jitters."""
        digits = 3 if self.rms > _ROUNDING * self.step else 6
        return float(f"{1.0 / self.step:.{digits}g}") if self.step > 0.0 else 0.0

    def __str__(self) -> str:
        return (
            f"steps of {1e3 * self.step:.4g} ms that are off by {1e3 * self.rms:.2g} ms rms, at "
            f"most {1e3 * self.largest:.2g} ms"
        )


def steadiness(time: NDArray[np.float64], max_gap: float | None = None) -> Steadiness:
    """Judge increasing times, (n_time,) s; `max_gap` is 4.5 median steps by default, s."""
    steps = np.diff(time)
    if not steps.size:
        return Steadiness("uniform", 0.0, 0.0, 0.0, 0)
    usual = steps[steps <= (GAP * float(np.median(steps)) if max_gap is None else max_gap)]
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
    """Return the rate that a log is resampled at unasked, Hz, and note it; None if it isn't."""
    clocks = [one for stretch in stretches for one in stretch if one.time.size > 1]
    judged = [(steadiness(one.time, options.max_gap), one.clock) for one in clocks]
    if not judged:
        return None
    several, kinds = max(map(len, stretches)) > 1, {found.kind for found, _ in judged}
    gaps = any(found.gaps for found, _ in judged) and "gaps" not in options.repair
    if not several and (gaps or kinds - {"uniform"} != {"jitter"}):
        return None
    chosen, clock = max(judged, key=lambda one: one[0].step if several else one[0].rms)
    remedy = f"resample={chosen.rate:g}"
    worst, uneven = max(judged, key=lambda one: (one[0].kind == "irregular", one[0].rms))
    if not several:
        text = f"column {clock!r}: {worst}; resampled at {chosen.rate:g} Hz"
        findings.note("jitter", text, repaired=True, remedy=remedy)
        return chosen.rate
    names = ", ".join(dict.fromkeys(f"{name} {one.rate:.3g} Hz" for one, name in judged))
    said = f"channels of several clocks ({names}); {uneven}: {worst}"
    if worst.kind == "irregular":
        text = f"{clocks[0].path}: {said}: it is irregular; give a common rate, such as "
        findings.refuse("clocks", f"{text}{chosen.rate:g} Hz", remedy=remedy)
    else:
        text = f"{said}; resampled at {chosen.rate:g} Hz, the slowest one's"
        findings.note("clocks", text, repaired=True, remedy=remedy)
    return chosen.rate


def unevenness(samples: Samples, max_gap: float | None) -> LogFinding | None:
    """Return where samples aren't uniform, or None; `max_gap` is 4.5 median steps if None, s."""
    steps = np.diff(samples.time)
    mean = float(np.mean(steps))
    worst = int(np.argmax(np.abs(steps - mean)))
    if abs(steps[worst] - mean) <= UNIFORM * mean:
        return None
    found = steadiness(samples.time, max_gap)
    rate = f"{float(f'{found.rate:.2g}'):g}"
    text = (
        f"{samples.at(worst + 1, samples.clock)}: {steps[worst]:.6g} s after the {samples.counts} "
        f"before, on average {mean:.6g} s: samples must be uniform, and this clock is irregular: "
        f"{found}; resample the log, such as at {rate} Hz"
    )
    remedy = f"resample={rate}" + ",repair=gaps" * (found.gaps > 0)
    return LogFinding("uneven", text, options(remedy))
