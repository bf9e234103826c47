"""A log that was read, and its report: what was found, and what was repaired."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from helisim.base.errors import HelisimError, LogError, RecordError, UnknownNameError
from helisim.base.note import Note, Option, Remedy, options
from helisim.base.settings import FrozenMap, Value
from helisim.records.record import FlightRecord, some_names

OURS = "helisim record"
"""Name of helisim's own format, whose channels need no map."""
_PARTS_SHOWN = 20  # of a log with more, only so many are printed
_ROWS_KEPT = 20  # row numbers that a finding keeps; its count says how many there were


@dataclass(frozen=True)
class LogFinding(Note):
    """One fault or oddity of a log, and whether it was repaired.

    Attributes:
        kind: such as "gap", "duplicate stamp" or "missing number".
        text: what was found, where, and what was done.
        remedy: options that mend it or are worth a try, such as Option("repair", "gaps").
        count: how often.
        rows: where, the first 20, numbered as `LogReport.counts` says.
        repaired: whether the data were changed because of it.
    """

    count: int = 1
    rows: tuple[int, ...] = ()
    repaired: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", tuple(int(row) for row in self.rows[:_ROWS_KEPT]))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        remedy = [f"{one.name}={one.value}" for one in self.remedy if isinstance(one, Option)]
        return {**vars(self), "remedy": remedy, "rows": list(self.rows)}


class Findings(list[LogFinding]):
    """Findings of a log that is being read; those that stop its use are collected apart.

    Attributes:
        refused: what stops its use.
    """

    def __init__(self, noted: Iterable[LogFinding] = ()) -> None:
        super().__init__(noted)
        self.refused: list[LogFinding] = []
        self._unlisted: tuple[str, ...] = ()

    def note(
        self,
        kind: str,
        text: str,
        count: int = 1,
        rows: tuple[int, ...] = (),
        *,
        repaired: bool = False,
        remedy: Remedy = (),
    ) -> None:
        """Add what is noted; the same text is kept once."""
        if all(text != one.text for one in self):
            self.append(LogFinding(kind, text, options(remedy), count, rows, repaired))

    def refuse(
        self,
        kind: str,
        text: str,
        count: int = 1,
        rows: tuple[int, ...] = (),
        *,
        remedy: Remedy = (),
    ) -> None:
        """Add what stops the log's use; the same text is kept once."""
        if all(text != one.text for one in self.refused):
            self.refused.append(LogFinding(kind, text, options(remedy), count, rows))

    def refuse_error(self, path: object, error: HelisimError) -> None:
        """Add what an exception says stops the log's use."""
        if isinstance(error, LogError | UnknownNameError):
            self._unlisted += error.unlisted
        found = error.findings if isinstance(error, LogError) else ()
        for one in found:
            self.refuse(one.kind, one.text, one.count, one.rows, remedy=one.remedy)
        if not found:
            text = str(error)
            text = text if text.startswith(str(path)) else f"{path}: {text}"
            self.refuse("refused", text, remedy=error.remedy)

    def check(self) -> None:
        """Raise LogError, with everything that stops the log's use, if anything does."""
        lines = [finding.text for finding in self.refused]
        if len(lines) > 1:
            lines = [f"{len(lines)} things are wrong:", *(f"- {line}" for line in lines)]
        if lines:
            error = LogError("\n".join(lines))
            error.findings, error.unlisted = tuple(self.refused), self._unlisted
            raise error


@dataclass(frozen=True)
class Part:
    """One uninterrupted stretch of a log that became a record.

    Attributes:
        first_row, last_row: where it comes from.
        samples: how many the record has.
        start: s since the log's first stamp.
        duration: s.
        uneven: where and how the samples aren't uniform, and what makes them so; None if they are.
    """

    first_row: int
    last_row: int
    samples: int
    start: float
    duration: float
    uneven: LogFinding | None = None


@dataclass(frozen=True, eq=False)
class LogReport(Value):
    """How a log became records. Nothing happened that isn't here.

    Attributes:
        path: the file.
        format: such as "CSV".
        digest: BLAKE2 of the file's bytes.
        counts: what rows are counted in: "line" of the file from 1, or "row" from 0.
        samples: samples in the log, of the channels' column with the most.
        columns: channel -> how it was computed from which column.
        unused: columns that no channel comes from.
        origin: the first stamp, as the log has it.
        step: smallest, median and largest time between samples, s.
        findings: what was noticed and what was repaired.
        resampled_hz: rate of the records, if they were resampled.
        passband_hz: frequency up to which the anti-alias filter changes nothing, if there was one.
        parts: one a record.
    """

    path: str
    format: str
    digest: str
    counts: str
    samples: int
    columns: Mapping[str, str]
    unused: tuple[str, ...]
    origin: str
    step: tuple[float, float, float]
    findings: tuple[LogFinding, ...]
    resampled_hz: float | None
    passband_hz: float | None
    parts: tuple[Part, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", FrozenMap(self.columns))

    def __repr__(self) -> str:
        return (
            f"LogReport({self.path!r}: {self.format}, {self.samples} samples, "
            f"{len(self.findings)} finding(s), {len(self.repairs)} repair(s), "
            f"{len(self.parts)} part(s))"
        )

    @property
    def repairs(self) -> tuple[LogFinding, ...]:
        """The findings because of which data were changed."""
        return tuple(finding for finding in self.findings if finding.repaired)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "path": self.path,
            "format": self.format,
            "digest": self.digest,
            "rows_counted_as": self.counts,
            "samples": self.samples,
            "columns": dict(self.columns),
            "unused_columns": list(self.unused),
            "origin": self.origin,
            "step_s": dict(zip(("smallest", "median", "largest"), self.step)),
            "findings": [finding.to_dict() for finding in self.findings],
            "resampled_hz": self.resampled_hz,
            "passband_hz": self.passband_hz,
            "parts": [
                {
                    "first_row": part.first_row,
                    "last_row": part.last_row,
                    "samples": part.samples,
                    "start_s": part.start,
                    "duration_s": part.duration,
                }
                for part in self.parts
            ],
        }

    def __str__(self) -> str:
        return self.worded(lambda finding: finding.text)

    def worded(self, word: Callable[[LogFinding], str]) -> str:
        """Return the report for people, each finding as `word` has it."""
        low, middle, high = self.step
        total = sum(part.duration for part in self.parts)
        lines = [
            f"{self.path}: {self.format}, {self.samples} samples, {total:.4g} s, "
            f"step {middle:.4g} s (from {low:.4g} to {high:.4g} s)"
        ]
        if self.format != OURS:
            lines += [f"  {name} = {text}" for name, text in self.columns.items()]
        if self.resampled_hz is not None:
            filtered = "no filter: the log is not faster"
            if self.passband_hz is not None:
                filtered = f"low-pass filtered, unchanged up to {self.passband_hz:.4g} Hz"
            lines.append(f"  resampled to {self.resampled_hz:g} Hz, {filtered}")
        if len(self.parts) > 1:
            more = f", the {_PARTS_SHOWN} longest" if len(self.parts) > _PARTS_SHOWN else ""
            longest = sorted(self.parts, key=lambda part: -part.duration)[:_PARTS_SHOWN]
            lines += [f"  {len(self.parts)} records{more}:"] + [
                f"    {self.counts}s {part.first_row} to {part.last_row}, {part.duration:.4g} s"
                for part in self.parts
                if part in longest
            ]
        for one in self.findings:
            lines.append(f"  {'repaired' if one.repaired else 'note'}: {word(one)}")
        return "\n".join(lines)


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
        rows = f"{counts}s {parts[0].first_row} to {parts[-1].last_row}"
        return f"{self.report.path}, column {self.headings.get(channel, channel)!r}, {rows}"

    def check_uniform(self) -> None:
        """Raise LogError, with the rows and what to do, unless every record is uniform."""
        findings = Findings()
        self.refuse_uneven(findings)
        findings.check()

    def refuse_uneven(self, findings: Findings) -> None:
        """Add the first part whose samples aren't uniform, and how many more there are."""
        uneven = [part for part in self.report.parts if part.uneven is not None]
        for part, found in [(one, one.uneven) for one in uneven[:1] if one.uneven]:
            more = f" (and in {len(uneven) - 1} more parts)" if len(uneven) > 1 else ""
            rows = (part.first_row, part.last_row)
            findings.refuse(found.kind, found.text + more, rows=rows, remedy=found.remedy)
