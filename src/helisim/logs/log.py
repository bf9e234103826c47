"""A log that was read: its records, and how they were made."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.errors import RecordError
from helisim.base.value import FrozenMap, Value
from helisim.logs.parts import Cut
from helisim.logs.report import Findings, LogReport
from helisim.logs.resample import PASSBAND
from helisim.logs.timing import Samples
from helisim.records.channels import Channel, some_names
from helisim.records.provenance import plain
from helisim.records.record import FlightRecord


@dataclass(frozen=True, eq=False)
class Log(Value):
    """A log that was read.

    Attributes:
        records: one for each uninterrupted part.
        report: how they were made.
        headings: channel -> the column that it comes from.
    """

    records: tuple[FlightRecord, ...]
    report: LogReport
    headings: Mapping[str, str]

    def __post_init__(self) -> None:
        object.__setattr__(self, "headings", FrozenMap(self.headings))

    def __repr__(self) -> str:
        samples = sum(map(len, self.records))
        return (
            f"Log({Path(self.report.path).name!r}: {samples} samples in {len(self.records)} "
            f"record(s), {len(self.headings)} channels: {some_names(self.headings)})"
        )

    @property
    def record(self) -> FlightRecord:
        """The record of a log that has one part. Raises RecordError if it has several."""
        if len(self.records) != 1:
            raise RecordError(
                f"{self.report.path}: has {len(self.records)} parts; use `records`, which "
                "frequency_response and verify accept"
            )
        return self.records[0]

    def where(self, channel: str) -> str:
        """Return where a channel comes from: file, column and rows."""
        parts, counts = self.report.parts, self.report.counts
        column = self.headings.get(channel, channel)
        rows = f"{counts}s {parts[0].first_row} to {parts[-1].last_row}"
        return f"{self.report.path}, column {column!r}, {rows}"

    def check_uniform(self) -> None:
        """Raise LogError, with the rows and what to do, unless every record is uniform."""
        findings = Findings()
        self.refuse_uneven(findings)
        findings.check()

    def refuse_uneven(self, findings: Findings) -> None:
        """Add every part whose samples aren't uniform to what is refused."""
        uneven = [part for part in self.report.parts if part.uneven]
        for part in uneven[:1]:
            more = f" (and in {len(uneven) - 1} more parts)" if len(uneven) > 1 else ""
            rows = (part.first_row, part.last_row)
            findings.refuse("uneven", part.uneven + more, rows=rows, option=part.option)


def steps(samples: tuple[Samples, ...]) -> tuple[float, float, float]:
    """Return the smallest, median and largest time between samples, s."""
    steps = np.concatenate([np.diff(one.time) for one in samples])
    if not steps.size:
        return (0.0, 0.0, 0.0)
    return float(np.min(steps)), float(np.median(steps)), float(np.max(steps))


def passband(made: Sequence[Cut], rate: float | None) -> float | None:
    """Return up to which frequency the anti-alias filter changes nothing, Hz; None without."""
    if rate is None or max(one.factor for one in made) == 1:
        return None
    return PASSBAND * rate / 2.0


def assemble_log(
    made: Sequence[Cut],
    channels: tuple[Channel, ...],
    report: LogReport,
    headings: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> Log:
    """Make the log of what its stretches became, the report in each record's provenance.

    Raises RecordError.
    """
    times = [time for one in made for time in one.time]
    values = [one_values for one in made for one_values in one.values]
    if not times:
        reasons = "; ".join(finding.text for finding in report.findings) or "no samples"
        raise RecordError(f"{report.path}, {reasons}; nothing is left of it")
    shared = plain({**provenance, "log": report.to_dict()})
    records = []
    for k, (time, numbers) in enumerate(zip(times, values)):
        part = report.parts[k]
        rows = f"{report.counts}s {part.first_row} to {part.last_row}"
        bad = np.flatnonzero(~np.all(np.isfinite(numbers), axis=0))
        if bad.size:
            column = headings[channels[bad[0]].name]
            raise RecordError(f"{report.path}, column {column!r}, {rows}: too large to interpolate")
        try:
            records.append(FlightRecord(time, numbers, channels, shared.extended(part=k)))
        except RecordError as error:
            raise RecordError(f"{report.path}, {rows}: {error}") from None
    return Log(tuple(records), report, headings)
