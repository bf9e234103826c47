"""Finds the gaps of a log: where it is cut, what is interpolated, and what to do about them."""

from collections.abc import Collection
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import RecordError
from helisim.logs.report import Findings, LogFinding
from helisim.logs.timing import GAP, Samples, empty
from helisim.records.quality import Run

_SLOW = 1.5
"""Median steps: a channel that is slower than the longest step has its own."""
_MANY, _MOST, _SHORT = 20, 0.95, 0.1
"""Gaps, of which such a share is shorter than so many s, are those of a logger that drops samples:
a tenth of a second is a fifth of a period at the usual end of the band, 2 Hz."""


def pieces(
    samples: Samples,
    repair: Collection[str],
    max_gap: float | None,
    strict: bool,
    findings: Findings,
) -> tuple[Run, ...]:
    """Return the intervals in which every channel has numbers close enough together.

    Args:
        samples: in order, without duplicates.
        repair: "gaps" cuts at gaps.
        max_gap: the longest step that is no gap, s; GAP median steps of a channel by default.
        strict: refuse gaps also where only rows are missing, as for resampling.
        findings: what is found is added.

    Raises:
        RecordError: a column has no number.
    """
    time = samples.time
    cuts: list[tuple[float, float]] = []
    holed = False
    for column, values in zip(samples.columns, samples.values.T):
        known = np.flatnonzero(np.isfinite(values))
        if not known.size:
            raise RecordError(empty(samples, column))
        steps = np.diff(time[known])
        limit = _limit(steps, max_gap)
        wide = np.flatnonzero(steps > limit)
        cuts += [(float(time[known[k]]), float(time[known[k + 1]])) for k in wide]
        holed = holed or any(known[k + 1] - known[k] > 1 for k in wide)
        if known[0] > 0 or known[-1] < time.size - 1:
            holed = True
            if known[0] > 0:
                cuts.append((-np.inf, float(time[known[0]])))
            if known[-1] < time.size - 1:
                cuts.append((float(time[known[-1]]), np.inf))
    if strict and max_gap is not None:
        _note_bridged(samples, max_gap, findings)
    if not cuts:
        return (Run(0, time.size - 1),)
    starts, stops = (np.array(edge) for edge in zip(*sorted(set(cuts))))
    refused = _report_gaps(samples, starts, stops, repair, strict or holed, findings)
    if "gaps" not in repair and not refused:
        return (Run(0, time.size - 1),)
    return _between(time, starts, stops)


def _between(
    time: NDArray[np.float64], starts: NDArray[np.float64], stops: NDArray[np.float64]
) -> tuple[Run, ...]:
    """Return the runs of samples that no open interval (start, stop) holds or separates."""
    n = time.size
    inside = np.zeros(n + 1, dtype=np.int64)
    np.add.at(inside, np.searchsorted(time, starts, side="right"), 1)
    np.add.at(inside, np.searchsorted(time, stops, side="left"), -1)
    # A sample at both a stop and a start belongs to no interval; after a start begins a new run.
    keep = np.cumsum(inside)[:n] <= 0
    breaks = np.zeros(n, dtype=bool)
    later = np.searchsorted(time, starts, side="right")
    breaks[later[later < n]] = True
    run = np.cumsum(breaks | ~keep)[keep]
    kept = np.flatnonzero(keep)
    edges = np.flatnonzero(np.diff(run, prepend=-1, append=-1))
    return tuple(Run(int(kept[a]), int(kept[b - 1])) for a, b in pairwise(edges))


def _limit(steps: NDArray[np.float64], max_gap: float | None) -> float:
    """Return the longest step that is no gap, s; a slow channel isn't all gaps."""
    if not steps.size:
        return np.inf
    median = float(np.median(steps))
    return GAP * median if max_gap is None or max_gap < _SLOW * median else max_gap


def _note_bridged(samples: Samples, max_gap: float, findings: Findings) -> None:
    """Note the gaps that are interpolated as the longest step allows it."""
    steps = np.diff(samples.time)
    own = _limit(steps, None)
    wide = np.flatnonzero((steps > own) & (steps <= max_gap))
    if not wide.size:
        return
    lost, rows = float(np.sum(steps[wide])), tuple(samples.rows[wide + 1].tolist())
    share = 100.0 * lost / float(samples.time[-1] - samples.time[0])
    text = (
        f"{samples.counts} {rows[0]}: {wide.size} gaps of up to {steps[wide].max():.4g} s "
        f"({lost:.4g} s, {share:.2g} % of the log) are interpolated, as {max_gap:g} s are allowed"
    )
    findings.append(LogFinding("bridged gap", text, wide.size, rows, True))


def _report_gaps(
    samples: Samples,
    starts: NDArray[np.float64],
    stops: NDArray[np.float64],
    repair: Collection[str],
    strict: bool,
    findings: Findings,
) -> bool:
    """Report gaps; return whether they are refused."""
    start = np.clip(starts, samples.time[0], None)
    stop = np.clip(stops, None, samples.time[-1])
    after = np.searchsorted(samples.time, starts, side="right")
    after = np.clip(after, 0, samples.time.size - 1)
    lost = float(np.sum(stop - start))
    span = float(samples.time[-1] - samples.time[0])
    k = int(after[0])
    share = f"{100.0 * lost / span:.2g} %" if span > 0.0 else "all"
    what = (
        f"a gap of {stop[0] - start[0]:.4g} s from {start[0]:.6g} s after the start "
        f"({starts.size} gaps, {lost:.4g} s, {share} of the log)"
    )
    rows = tuple(samples.rows[after].tolist())
    if "gaps" in repair:
        text = f"{samples.counts} {rows[0]}: {what}; split there"
        findings.append(LogFinding("gap", text, starts.size, rows, True))
    elif strict:
        advice, option = _advice(stop - start)
        findings.refuse(
            "gap",
            f"{samples.at(k, samples.clock)}: {what}; {advice}",
            rows=rows,
            count=starts.size,
            option=option,
        )
    else:
        text = f"{samples.counts} {rows[0]}: {what}"
        findings.append(LogFinding("gap", text, starts.size, rows))
    return strict and "gaps" not in repair


def _advice(widths: NDArray[np.float64]) -> tuple[str, str]:
    """Return what to do about gaps, (n_gap,) s, and the options."""
    split = "split the log at its gaps with the repair 'gaps' (--repair)"
    usual = float(np.quantile(widths, _MOST))
    if widths.size < _MANY or usual > _SHORT:
        return f"{split}, or allow longer ones (--max-gap S)", "--repair gaps"
    allowed = float(f"{1.1 * usual:.2g}")
    text = (
        f"most are short, as of a logger that drops samples: interpolate those (--max-gap "
        f"{allowed:g}), and {split}"
    )
    return text, f"--max-gap {allowed:g} --repair gaps"
