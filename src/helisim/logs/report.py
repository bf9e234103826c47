"""A log that was read, and the report of its findings and repairs."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from helisim.base.errors import HelisimError, LogError, RecordError
from helisim.base.note import Note, Option, Remedy, options
from helisim.base.settings import FrozenMap, Value
from helisim.records.record import FlightRecord

OURS = "helisim record"  # Name of helisim's own format, whose channels need no map
# _PARTS_SHOWN: of a log with more, only so many are printed
# _ROWS_KEPT: of a finding, at most
_PARTS_SHOWN, _ROWS_KEPT = 20, 20


@dataclass(frozen=True)
class LogFinding(Note):
    """One fault or oddity of a log, such as "gap"; `rows` are the first 20.

    They count as `LogReport.counts` says. `repaired` is whether data were changed because of it.
    """

    count: int = 1
    rows: tuple[int, ...] = ()
    repaired: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        remedy = [f"{one.name}={one.value}" for one in self.remedy if isinstance(one, Option)]
        return {**vars(self), "remedy": remedy, "rows": list(self.rows)}


class Findings(list[LogFinding]):
    """Findings of a log that is being read; `refused` are those that stop its use."""

    def __init__(self, noted: Iterable[LogFinding] = ()) -> None:
        super().__init__(noted)
        self.refused: list[LogFinding] = []

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
        """Add a finding, unless its text is there."""
        if all(text != one.text for one in self):
            self.append(LogFinding(kind, text, options(remedy), count, rows[:_ROWS_KEPT], repaired))

    def refuse(
        self,
        kind: str,
        text: str,
        count: int = 1,
        rows: tuple[int, ...] = (),
        *,
        remedy: Remedy = (),
    ) -> None:
        """Add a finding that stops the log's use, unless its text is there."""
        if all(text != one.text for one in self.refused):
            self.refused.append(LogFinding(kind, text, options(remedy), count, rows[:_ROWS_KEPT]))

    def refuse_error(self, path: object, error: HelisimError) -> None:
        """Add an exception as a finding that stops the log's use."""
        known = {one.text for one in self.refused}
        place = "" if str(error).startswith(str(path)) else f"{path}: "
        own = LogFinding("refused", f"{place}{error}", error.remedy)
        found = error.findings if isinstance(error, LogError) else ()
        self.refused += [one for one in found or (own,) if one.text not in known]

    def check(self) -> None:
        """Raise LogError with all refused findings, if there are any."""
        lines = [finding.text for finding in self.refused]
        if lines:
            many = [f"{len(lines)} things are wrong:", *(f"- {line}" for line in lines)]
            error = LogError("\n".join(many if len(lines) > 1 else lines))
            error.findings = tuple(self.refused)
            raise error


@dataclass(frozen=True)
class Part:
    """One uninterrupted stretch of a log that became a record, s; `start` is since the first stamp.

    `uneven` tells why samples aren't uniform, if so.
    """

    first_row: int
    last_row: int
    samples: int
    start: float
    duration: float
    uneven: LogFinding | None = None


@dataclass(frozen=True, eq=False)
class LogReport(Value):
    """How a log became records, with all that was changed.

    `counts` is "line" of the file from 1, or "row" from 0, such as "RATE row" of a topic; `digest`
    is BLAKE2 of the file; `origin` is the first stamp as the log has it; `step` is the least,
    median and most time between samples, s. `resampled_hz` is None if not resampled; the anti-alias
    filter changes nothing to `passband_hz`.
    """

    path: str
    format: str
    digest: str
    counts: str
    samples: int
    columns: FrozenMap[str, str] = field(repr=False)
    unused: tuple[str, ...] = field(repr=False)
    origin: str
    step: tuple[float, float, float]
    findings: tuple[LogFinding, ...] = field(repr=False)
    resampled_hz: float | None
    passband_hz: float | None
    parts: tuple[Part, ...] = field(repr=False)

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
        """Return the report as text, each finding as `word` returns it."""
        low, middle, high = self.step
        total = sum(part.duration for part in self.parts)
        filtered = (
            "no filter: the log is not faster"
            if self.passband_hz is None
            else f"low-pass filtered, unchanged up to {self.passband_hz:.4g} Hz"
        )
        parts = [
            f"    {self.counts}s {part.first_row} to {part.last_row}, {part.duration:.4g} s"
            for part in self.parts[:_PARTS_SHOWN]
        ]
        computed = [f"  {name} = {text}" for name, text in self.columns.items()]
        lines = [
            f"{self.path}: {self.format}, {self.samples} samples, {total:.4g} s, "
            f"step {middle:.4g} s (from {low:.4g} to {high:.4g} s)",
            *(computed if self.format != OURS else ()),
            *(
                [f"  resampled to {self.resampled_hz:g} Hz, {filtered}"]
                if self.resampled_hz
                else ()
            ),
            *([f"  {len(self.parts)} records, the first of them:", *parts] if parts[1:] else ()),
            *(f"  {'repaired' if one.repaired else 'note'}: {word(one)}" for one in self.findings),
        ]
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Log(Value):
    """A log that was read: a record for each part; `headings` is channel -> column."""

    records: tuple[FlightRecord, ...]
    report: LogReport = field(repr=False)
    headings: FrozenMap[str, str] = field(repr=False)

    @property
    def record(self) -> FlightRecord:
        """The record of a log with one part. Raises RecordError if it has several."""
        if len(self.records) != 1:
            raise RecordError(
                f"{self.report.path}: has {len(self.records)} parts; use `records`, which "
                "frequency_response and verify accept"
            )
        return self.records[0]

    def where(self, channel: str) -> str:
        """Return a channel's file, column and rows, for a message."""
        parts, counts = self.report.parts, self.report.counts
        rows = f"{counts}s {parts[0].first_row} to {parts[-1].last_row}"
        return f"{self.report.path}, column {self.headings.get(channel, channel)!r}, {rows}"

    def check_uniform(self) -> None:
        """Raise LogError, with the rows and a remedy, unless every record is uniform."""
        findings = Findings()
        self.refuse_uneven(findings)
        findings.check()

    def refuse_uneven(self, findings: Findings) -> None:
        """Refuse the first part that isn't uniform, with the number of others."""
        uneven = [part.uneven for part in self.report.parts if part.uneven is not None]
        if uneven:
            more = f" (and in {len(uneven) - 1} more parts)" if len(uneven) > 1 else ""
            findings.refuse("uneven", uneven[0].text + more, remedy=uneven[0].remedy)
