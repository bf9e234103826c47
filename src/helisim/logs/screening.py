"""Screens a log for faults of its recorder: spikes, frozen sensors, lost samples, wrong clocks.

Each is noted, and left out where that was asked for.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.logs.declared import Channels, Declared
from helisim.logs.kinematics import clock_findings
from helisim.logs.parts import Cut
from helisim.logs.plausibility import implausible
from helisim.logs.report import LogFinding
from helisim.logs.timing import GAP, Samples
from helisim.records.channels import Channel
from helisim.records.quality import frozen_runs, spikes

_LONG_ENOUGH = 20.0
"""s, of a part whose clocks are looked at."""
_REGULAR = 0.01
"""Share of the median step by which a step of a steady recorder is off at most."""


def screened(
    samples: Samples,
    channels: Sequence[Channel],
    repair: Collection[str],
    findings: list[LogFinding],
    *,
    wanted: Collection[str] | None = None,
) -> Samples:
    """Look for spikes and frozen runs; return the samples without those that were to be repaired.

    Args:
        samples: in order, without duplicates.
        channels: that the columns become.
        repair: "spikes" and "frozen" take those samples out.
        findings: what is found is added.
        wanted: names of the channels to look at; all if None.
    """
    values = samples.values.copy()
    for k, channel in enumerate(channels):
        if wanted is not None and channel.name not in wanted:
            continue
        for look in (_frozen, _spikes) if channel.kind == "OUT" else (_spikes,):
            known = np.flatnonzero(np.isfinite(values[:, k]))
            fault = look(samples, known, values[known, k])
            if fault is None:
                continue
            asked = fault.kind in repair
            text = (
                f"column {samples.columns[k]!r}: {fault.text}; "
                f"{fault.done if asked else fault.advice}"
            )
            rows = tuple(samples.rows[fault.first].tolist())
            findings.append(LogFinding(fault.kind, text, len(rows), rows, asked))
            if asked:
                values[fault.samples, k] = np.nan
    return replace(samples, values=values)


class _Fault(NamedTuple):
    """What is wrong with a channel: which repair mends it, and what the report says.

    Attributes:
        kind: of the finding and of the repair.
        text: what was found and where.
        done: what the repair did.
        advice: what the repair would do.
        first: (n_place,) first sample of each place.
        samples: (n_fault,) all samples that no sensor saw.
    """

    kind: str
    text: str
    done: str
    advice: str
    first: NDArray[np.intp]
    samples: NDArray[np.intp]


def _spikes(
    samples: Samples, known: NDArray[np.intp], values: NDArray[np.float64]
) -> _Fault | None:
    """Look for spikes among the known samples of a column, (n_known,) positions and values."""
    out = known[spikes(values)]
    if not out.size:
        return None
    return _Fault(
        "spikes",
        f"{out.size} of {known.size} samples are spikes, the first in {_where(samples, out[0])}",
        "interpolated",
        "interpolate them with the repair 'spikes' (--repair)",
        out,
        out,
    )


def _frozen(
    samples: Samples, known: NDArray[np.intp], values: NDArray[np.float64]
) -> _Fault | None:
    """Look for frozen runs among the known samples of a column, as `_spikes` does for spikes."""
    runs = [(known[run.first], known[run.last]) for run in frozen_runs(values)]
    if not runs:
        return None
    first, last = (np.array(edge) for edge in zip(*runs))
    lost = float(np.sum(samples.time[last] - samples.time[first]))
    places = "in one run" if len(runs) == 1 else f"in {len(runs)} runs, the first"
    return _Fault(
        "frozen",
        f"is frozen for {lost:.4g} s, {places} from {_where(samples, first[0])}",
        "left out, and split there",
        "leave it out with the repair 'frozen'",
        first,
        np.concatenate([np.arange(a, b + 1) for a, b in runs]),
    )


def _where(samples: Samples, k: int) -> str:
    return f"{samples.counts} {samples.rows[k]}, {samples.time[k]:.6g} s after the start"


def check_clocks(made: Sequence[Cut], names: Sequence[str]) -> list[LogFinding]:
    """Return the errors of the clocks, of uniform parts that are long enough to show them."""
    parts = [
        (time, values)
        for one in made
        for time, values, part in zip(one.time, one.values, one.parts)
        if not part.uneven and part.duration >= _LONG_ENOUGH
    ]
    return clock_findings(parts, names)


def check_plausible(
    made: Sequence[Cut], names: Sequence[str], declared: Mapping[str, Declared], clock: str
) -> list[LogFinding]:
    """Return what the longest uniform part shows can't be as it is declared.

    Args:
        made: what the log's stretches became.
        names: of the channels.
        declared: what each of them is declared to be.
        clock: the column of times.
    """
    parts = [
        (part.duration, time, values)
        for one in made
        for time, values, part in zip(one.time, one.values, one.parts)
        if not part.uneven
    ]
    if not parts:
        return []
    duration, time, values = max(parts, key=lambda part: part[0])
    columns = {name: values[:, k] for k, name in enumerate(names)}
    return implausible(Channels(duration / (time.size - 1), columns, declared, clock))


def note_lost_samples(samples: Samples, filled: bool, findings: list[LogFinding]) -> None:
    """Note how many samples a steady recorder lost between those that it wrote, gaps apart.

    Args:
        samples: in order, without duplicates.
        filled: whether resampling interpolates them.
        findings: what is found is added.
    """
    steps = np.diff(samples.time)
    median = float(np.median(steps)) if steps.size else 0.0
    steady = np.abs(steps - median) <= _REGULAR * median
    if median <= 0.0 or np.count_nonzero(steady) < 0.5 * steps.size:
        return
    missing = np.rint(steps / median).astype(np.int64) - 1
    short = (missing > 0) & (steps <= GAP * median)
    short &= np.abs(steps - (missing + 1) * median) <= _REGULAR * median
    if not short.any():
        return
    after = np.flatnonzero(short) + 1
    rows = tuple(samples.rows[after].tolist())
    count = int(np.sum(missing[short]))
    text = (
        f"{samples.counts} {rows[0]}: {count} samples were lost in {after.size} places, besides "
        f"{samples.time.size} that are there; the longest step is {steps[short].max():.4g} s"
    )
    done = "interpolated" if filled else "resample the log (--resample HZ)"
    findings.append(LogFinding("lost samples", f"{text}; {done}", count, rows, filled))
