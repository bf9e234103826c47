"""Judges how even a log's clock is, and takes a rate for one that jitters a little."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from helisim.logs.report import Findings, LogFinding
from helisim.logs.timing import GAP, Samples
from helisim.records.record import UNIFORM

_JITTER = 0.2
"""Of the mean step, rms: the largest jitter that is resampled unasked. At ten samples a period,
where the default band ends, a stamp that is off by so much is off by 7 degrees of the period."""
_WORST = 0.5
"""Of the mean step, by which each step may be off: from there on a sample may be lost."""
_ROUNDING = 1e-3
"""Of the mean step, rms: less than this comes from stamps with few digits."""

Kind = Literal["uniform", "jitter", "irregular"]


@dataclass(frozen=True)
class Steadiness:
    """How even the steps of a clock are, gaps apart.

    Attributes:
        kind: "uniform", "jitter" (small enough to be resampled unasked) or "irregular".
        step: mean, s.
        rms: of what the steps are off, s.
        largest: of what they are off, s.
        gaps: steps that are gaps.
    """

    kind: Kind
    step: float
    rms: float
    largest: float
    gaps: int

    @property
    def rate(self) -> float:
        """The rate that stands for the clock, Hz: of three digits where it jitters."""
        if self.step <= 0.0:
            return 0.0
        digits = 3 if self.rms > _ROUNDING * self.step else 6
        return float(f"{1.0 / self.step:.{digits}g}")

    def __str__(self) -> str:
        share = 100.0 * self.rms / self.step if self.step > 0.0 else 0.0
        return (
            f"steps of {1e3 * self.step:.4g} ms that are off by {1e3 * self.rms:.2g} ms rms "
            f"({share:.2g} %), at most {1e3 * self.largest:.2g} ms"
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
    gaps = int(steps.size - usual.size)
    if not usual.size:
        return Steadiness("irregular", float(np.mean(steps)), 0.0, 0.0, gaps)
    mean = float(np.mean(usual))
    off = np.abs(usual - mean)
    rms, largest = float(np.sqrt(np.mean(off**2))), float(np.max(off))
    small = rms <= _JITTER * mean and largest <= _WORST * mean
    kind: Kind = "uniform" if largest <= UNIFORM * mean else "jitter" if small else "irregular"
    return Steadiness(kind, mean, rms, largest, gaps)


def common_rate(
    stretches: Sequence[Sequence[Samples]],
    repairs: frozenset[str],
    max_gap: float | None,
    findings: Findings,
) -> float | None:
    """Return the rate that a log is resampled at unasked, Hz, and say so; None where it isn't.

    A log of one clock that jitters a little gets its own rate; channels of several clocks get the
    slowest one's. An irregular one of several is refused.

    Args:
        stretches: the samples of each clock, of each stretch between resets.
        repairs: that were asked for.
        max_gap: the longest step that is no gap, s; None for 4.5 median steps.
        findings: what is done is added.
    """
    clocks = [one for stretch in stretches for one in stretch if one.time.size > 1]
    judged = [steadiness(one.time, max_gap) for one in clocks]
    if not judged:
        return None
    if max(map(len, stretches)) > 1:
        return _slowest(clocks, judged, findings)
    gaps = any(one.gaps for one in judged) and "gaps" not in repairs
    kinds = {one.kind for one in judged}
    if gaps or "jitter" not in kinds or "irregular" in kinds:
        return None
    worst = max(judged, key=lambda one: one.rms)
    text = f"column {clocks[0].clock!r}: {worst}; resampled at {worst.rate:g} Hz"
    findings.append(LogFinding("jitter", text, repaired=True, option=f"--resample {worst.rate:g}"))
    return worst.rate


def _slowest(
    clocks: Sequence[Samples], judged: Sequence[Steadiness], findings: Findings
) -> float | None:
    """Return the rate of the slowest of several clocks."""
    slowest, one = max(zip(judged, clocks), key=lambda pair: pair[0].step)
    rate = slowest.rate
    names = ", ".join(dict.fromkeys(f"{c.clock} {j.rate:.3g} Hz" for j, c in zip(judged, clocks)))
    irregular = [(j, c) for j, c in zip(judged, clocks) if j.kind == "irregular"]
    option = f"--resample {rate:g}"
    if irregular:
        worst, clock = max(irregular, key=lambda pair: pair[0].rms / max(pair[0].step, 1e-12))
        count = len({c.clock for c in clocks})
        findings.refuse(
            "clocks",
            f"{clock.path}: its channels have {count} clocks ({names}), and {clock.clock} is "
            f"irregular, {worst}; give a common rate, such as {rate:g} Hz (--resample HZ)",
            option=option,
        )
    else:
        jitter = max(judged, key=lambda j: j.rms / max(j.step, 1e-12))
        text = (
            f"channels of several clocks ({names}; jitter at most {1e3 * jitter.rms:.2g} ms rms): "
            f"resampled at {rate:g} Hz, the slowest one's, {one.clock}"
        )
        findings.append(LogFinding("clocks", text, repaired=True, option=option))
    return rate


def unevenness(samples: Samples, max_gap: float | None) -> tuple[str, str]:
    """Return where samples aren't uniform and what to do, and the option; empty where they are.

    Args:
        samples: of one part of a log, increasing.
        max_gap: the longest step that is no gap, s; None for 4.5 median steps.
    """
    steps = np.diff(samples.time)
    mean = float(np.mean(steps))
    worst = int(np.argmax(np.abs(steps - mean)))
    if abs(steps[worst] - mean) <= UNIFORM * mean:
        return "", ""
    found = steadiness(samples.time, max_gap)
    where = samples.at(worst + 1, samples.clock)
    text = (
        f"{where}: {steps[worst]:.6g} s after the {samples.counts} before, on average "
        f"{mean:.6g} s: samples must be uniform"
    )
    if found.gaps and found.kind != "irregular":
        return f"{text}; split the log at its gaps with the repair 'gaps' (--repair)", (
            "--repair gaps"
        )
    option = f"--resample {float(f'{found.rate:.2g}'):g}"
    also = ", and split it at its gaps with the repair 'gaps' (--repair)" if found.gaps else ""
    return (
        f"{text}, and this clock is irregular: {found}; resample the log, such as at "
        f"{float(f'{found.rate:.2g}'):g} Hz (--resample HZ){also}",
        option + (" --repair gaps" if found.gaps else ""),
    )
