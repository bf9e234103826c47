"""Finds what is wrong with the times of a log, and repairs it where that was asked for."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from shlex import quote

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import RecordError
from helisim.logs.report import Findings, LogFinding
from helisim.logs.source import place

GAP = 4.5
"""A step longer than so many median steps is a gap."""

_LONGEST_STEP = 2.0
"""s: a log this slow shows nothing of a flight; milliseconds taken for seconds give 2.5 to 100."""
_SHORTEST_STEP = 2.5e-5
"""s: no recorder of a flight is faster; seconds taken for milliseconds are."""
_FEW = 10
"""Samples that don't tell a unit."""
_RESET = 20.0
"""Median steps by which time goes back, at least, where a clock began anew."""

_LONGEST = 3e9
"""s, about a century: times further apart aren't times."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of channels that share a clock.

    Attributes:
        path: the log.
        counts: what its rows are counted in.
        rows: (n_time,) row numbers.
        time: (n_time,) s.
        values: (n_time, n_channel) SI, NaN where the log has no number.
        columns: (n_channel,) the columns' names, for messages.
        clock: the name of the column of times.
    """

    path: Path
    counts: str
    rows: NDArray[np.int64]
    time: NDArray[np.float64]
    values: NDArray[np.float64]
    columns: tuple[str, ...]
    clock: str

    def take(self, keep: slice | NDArray) -> "Samples":
        """Return the samples at a slice, at positions (n_kept,), or where (n_time,) is true."""
        return Samples(
            self.path,
            self.counts,
            self.rows[keep],
            self.time[keep],
            self.values[keep],
            self.columns,
            self.clock,
        )

    def pick(self, columns: NDArray[np.bool_]) -> "Samples":
        """Return the samples with the columns, (n_channel,), that are true."""
        names = tuple(name for name, there in zip(self.columns, columns) if there)
        return replace(self, values=self.values[:, columns], columns=names)

    def at(self, k: int, column: str | None = None) -> str:
        """Return where the sample k is, for a message."""
        return place(self.path, self.counts, int(self.rows[k]), column)


def within(samples: Samples, limits: NDArray[np.float64], findings: list[LogFinding]) -> Samples:
    """Return the samples between two instants, inclusive; a sample without a time stays.

    Args:
        samples: of one clock.
        limits: (2,) first and last instant, s; infinite for none.
        findings: what is left out is added.

    Raises:
        RecordError: there are fewer than two.
    """
    low, high = limits
    keep = ~((samples.time < low) | (samples.time > high))
    if keep.all():
        return samples
    kept, count = int(np.count_nonzero(keep)), keep.size
    if kept < 2:
        raise RecordError(
            f"{samples.path}: {kept} samples {_limits(low, high)}, and the log goes from "
            f"{np.nanmin(samples.time):g} to {np.nanmax(samples.time):g} s"
        )
    found = samples.take(keep)
    text = (
        f"{samples.counts}s {found.rows[0]} to {found.rows[-1]} are used, {kept} of {count} "
        f"samples: {_limits(low, high)}"
    )
    findings.append(LogFinding("limits", text, count - kept, (), True))
    return found


def _limits(low: float, high: float) -> str:
    start = "from the start" if np.isinf(low) else f"from {low:g} s"
    return f"{start} to the end" if np.isinf(high) else f"{start} to {high:g} s"


def check_unit_of_time(samples: Samples, findings: Findings) -> None:
    """Refuse steps that no flight log has: the unit of its time is another one.

    Args:
        samples: of one clock, as the log has them.
        findings: what is found is refused.
    """
    steps = np.diff(samples.time)
    step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    if samples.time.size < _FEW or _SHORTEST_STEP <= step <= _LONGEST_STEP or step == 0.0:
        return
    if step > _LONGEST:
        return  # no times at all, which is said of the first one
    wrong, right = ("s", "ms") if step < 2e3 else ("s", "us") if step < 2e6 else ("s", "ns")
    if step < _SHORTEST_STEP:
        wrong, right = "ms or us", "s"
    option = f"--time {quote(f'{samples.clock}:{right}')}"
    findings.refuse(
        "unit of time",
        f"{samples.path}, column {samples.clock!r}: its steps are {step:.4g} s, the median, so "
        f"{samples.time.size} samples would last {samples.time[-1] - samples.time[0]:.4g} s: no "
        f"flight log has such; {right} declared as {wrong}? Try {option}",
        option=option,
    )


def empty(samples: Samples, column: str) -> str:
    """Return what is wrong with a column that has no number."""
    rows = f"{samples.counts}s {samples.rows[0]} to {samples.rows[-1]}"
    return f"{samples.path}, column {column!r}, {rows}: no number at all"


def in_order(samples: Samples, repair: Collection[str], findings: Findings) -> tuple[Samples, ...]:
    """Return stretches in which time doesn't fall: one, or more where a clock was reset.

    Where time falls and no repair was asked for, that is refused, and the likelier one done.

    Raises:
        RecordError: it isn't time at all.
    """
    wild = np.flatnonzero(~(np.abs(samples.time) < _LONGEST))
    if wild.size:
        raise RecordError(
            f"{samples.at(int(wild[0]), samples.clock)}: more than {_LONGEST:.0e} s from the "
            "first; is the unit of time right?"
        )
    back = np.flatnonzero(np.diff(samples.time) < 0.0) + 1
    if not back.size:
        return (samples,)
    k = int(back[0])
    what = (
        f"time goes back from {samples.time[k - 1]:.9g} to {samples.time[k]:.9g} s after the "
        f"start ({back.size} times in all)"
    )
    rows = tuple(samples.rows[back].tolist())
    reset = "resets" in repair
    if reset:
        text = f"{samples.counts} {rows[0]}: {what}; split there"
        findings.append(LogFinding("reset", text, back.size, rows, True))
    elif "order" in repair:
        text = f"{samples.counts} {rows[0]}: {what}; sorted by time"
        findings.append(LogFinding("order", text, back.size, rows, True))
    else:
        reset = _was_reset(samples.time, back)
        findings.refuse(
            "reset" if reset else "order",
            f"{samples.at(k, samples.clock)}: {what}; if the clock was reset, split the log there "
            "with the repair 'resets', if rows are out of order, sort them with 'order' (--repair)",
            rows=rows,
            count=back.size,
            option=f"--repair {'resets' if reset else 'order'}",
        )
    if not reset:
        return (samples.take(np.argsort(samples.time, kind="stable")),)
    edges = [0, *back.tolist(), samples.time.size]
    return tuple(samples.take(slice(a, b)) for a, b in pairwise(edges))


def _was_reset(time: NDArray[np.float64], back: NDArray[np.intp]) -> bool:
    """Return whether a clock began anew, rather than rows being out of order."""
    usual = float(np.median(np.abs(np.diff(time))))
    return bool(np.median(time[back - 1] - time[back]) > _RESET * usual)


def without_duplicates(samples: Samples, repair: Collection[str], findings: Findings) -> Samples:
    """Return the samples with rows of one stamp averaged; refused unless that was asked for."""
    same = np.flatnonzero(np.diff(samples.time) == 0.0) + 1
    if not same.size:
        return samples
    k = int(same[0])
    what = f"the same time as the {samples.counts} before, {samples.time[k]:.9g} s after the start"
    rows = tuple(samples.rows[same].tolist())
    if "duplicates" in repair:
        text = f"{samples.counts} {rows[0]}: {what}; {same.size} such rows averaged"
        findings.append(LogFinding("duplicate stamp", text, same.size, rows, True))
    else:
        findings.refuse(
            "duplicate stamp",
            f"{samples.at(k, samples.clock)}: {what} ({same.size} times in all); average such "
            "rows with the repair 'duplicates' (--repair), or use a finer clock",
            rows=rows,
            count=same.size,
            option="--repair duplicates",
        )
    first = np.flatnonzero(np.diff(samples.time, prepend=-np.inf) != 0.0)
    known = np.isfinite(samples.values)
    total = np.add.reduceat(np.where(known, samples.values, 0.0), first, axis=0)
    count = np.add.reduceat(known.astype(np.int64), first, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / count
    merged = samples.take(first)
    return Samples(
        merged.path,
        merged.counts,
        merged.rows,
        merged.time,
        mean,
        merged.columns,
        merged.clock,
    )


def check_missing(samples: Samples, repair: Collection[str], findings: Findings) -> None:
    """Report the cells without a number; refused unless they are to be filled."""
    for column, values in zip(samples.columns, samples.values.T):
        holes = np.flatnonzero(np.isnan(values))
        if not holes.size:
            continue
        what = f"{holes.size} of {values.size} numbers are missing"
        where = samples.at(int(holes[0]), column)
        rows = tuple(samples.rows[holes].tolist())
        if "missing" not in repair:
            findings.refuse(
                "missing number",
                f"{where}: no number ({what}); interpolate with the repair 'missing' (--repair), "
                "or cut the log",
                rows=rows,
                count=holes.size,
                option="--repair missing",
            )
            continue
        text = (
            f"column {column!r}: {what}, the first in {samples.counts} {samples.rows[holes[0]]}; "
            "interpolated"
        )
        if not any(finding.text == text for finding in findings):
            findings.append(LogFinding("missing number", text, holes.size, rows, True))
