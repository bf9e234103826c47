"""What a log's channels and stamps say of its recorder: spikes, dead sensors, lost samples.

Each is noted, and left out where that was asked for.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from helisim.records.channels import Channel
from helisim.records.logs.kinematics import clock_findings
from helisim.records.logs.parts import Cut
from helisim.records.logs.report import Finding
from helisim.records.logs.timing import GAP, Samples
from helisim.records.quality import frozen_runs, spikes

_TELLS_CLOCKS = 20.0
"""s, of a part whose clocks are looked at."""
_REGULAR = 0.01
"""Share of the median step by which a step of a steady recorder is off at most."""


def screened(
    samples: Samples,
    channels: Sequence[Channel],
    repair: Collection[str],
    findings: list[Finding],
    *,
    wanted: Collection[str] | None = None,
) -> Samples:
    """Return the samples without what no sensor saw, as far as that was asked for.

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
        known = np.flatnonzero(np.isfinite(values[:, k]))
        if channel.kind == "OUT":
            _leave_out_frozen(samples, known, values[:, k], k, repair, findings)
            known = np.flatnonzero(np.isfinite(values[:, k]))
        _leave_out_spikes(samples, known, values[:, k], k, repair, findings)
    return replace(samples, values=values)


def _leave_out_spikes(
    samples: Samples,
    known: NDArray[np.intp],
    column: NDArray[np.float64],
    k: int,
    repair: Collection[str],
    findings: list[Finding],
) -> None:
    out = known[spikes(column[known])]
    if not out.size:
        return
    rows = tuple(samples.rows[out].tolist())
    told = (
        f"column {samples.columns[k]!r}: {out.size} of {known.size} samples are spikes, the first "
        f"in {samples.counts} {rows[0]}, {samples.time[out[0]]:.6g} s after the start"
    )
    asked = "spikes" in repair
    done = "interpolated" if asked else "interpolate them with the repair 'spikes' (--repair)"
    findings.append(Finding("spikes", f"{told}; {done}", out.size, rows, asked))
    if asked:
        column[out] = np.nan


def _leave_out_frozen(
    samples: Samples,
    known: NDArray[np.intp],
    column: NDArray[np.float64],
    k: int,
    repair: Collection[str],
    findings: list[Finding],
) -> None:
    runs = frozen_runs(column[known])
    if not runs:
        return
    first = np.array([known[run.first] for run in runs])
    last = np.array([known[run.last] for run in runs])
    lost = float(np.sum(samples.time[last] - samples.time[first]))
    rows = tuple(samples.rows[first].tolist())
    told = (
        f"column {samples.columns[k]!r}: is frozen for {lost:.4g} s, "
        f"{'in one run' if first.size == 1 else f'in {first.size} runs, the first'} from "
        f"{samples.counts} {rows[0]}, {samples.time[first[0]]:.6g} s after the start"
    )
    asked = "frozen" in repair
    done = "left out, and split there" if asked else "leave it out with the repair 'frozen'"
    findings.append(Finding("frozen", f"{told}; {done}", first.size, rows, asked))
    if asked:
        for a, b in zip(first, last):
            column[a : b + 1] = np.nan


def clocks_of(made: Sequence[Cut], names: Sequence[str]) -> list[Finding]:
    """Return what uniform parts that are long enough say of their clocks."""
    parts = [
        (time, values)
        for one in made
        for time, values, part in zip(one.time, one.values, one.parts)
        if not part.uneven and part.duration >= _TELLS_CLOCKS
    ]
    return clock_findings(parts, names)


def note_lost_samples(samples: Samples, filled: bool, findings: list[Finding]) -> None:
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
    findings.append(Finding("lost samples", f"{text}; {done}", count, rows, filled))
