"""The report of a log that was read: what was found, and what was repaired."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from helisim.base.errors import HelisimError, LogError, UnknownNameError
from helisim.base.value import FrozenMap, Value

OURS = "helisim record"
"""Name of helisim's own format, whose channels need no map."""

_PARTS_SHOWN = 20
"""Of a log with more, only so many are printed."""
_ROWS_KEPT = 20
"""Row numbers that a finding keeps; its count says how many there were."""


@dataclass(frozen=True)
class LogFinding:
    """One fault or oddity of a log, and whether it was repaired.

    Attributes:
        kind: such as "gap", "duplicate stamp" or "missing number".
        text: what was found, where, and what was done.
        count: how often.
        rows: where, the first 20, numbered as `LogReport.counts` says.
        repaired: whether the data were changed because of it.
        option: of the command line, that mends it or is worth a try, such as "--repair gaps".
    """

    kind: str
    text: str
    count: int = 1
    rows: tuple[int, ...] = ()
    repaired: bool = False
    option: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", tuple(int(row) for row in self.rows[:_ROWS_KEPT]))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "kind": self.kind,
            "text": self.text,
            "count": self.count,
            "rows": list(self.rows),
            "repaired": self.repaired,
            "option": self.option,
        }


class Findings(list[LogFinding]):
    """What is found while a log is read; what stops its use is collected apart, to be said at once.

    Attributes:
        refused: what stops its use.
    """

    def __init__(self, noted: Iterable[LogFinding] = ()) -> None:
        super().__init__(noted)
        self.refused: list[LogFinding] = []
        self._unlisted: tuple[str, ...] = ()

    def refuse(
        self, kind: str, text: str, *, rows: Iterable[int] = (), count: int = 1, option: str = ""
    ) -> None:
        """Add what stops the log's use; the same text is kept once."""
        if all(text != finding.text for finding in self.refused):
            finding = LogFinding(kind, text, count, tuple(rows), option=option)
            self.refused.append(finding)

    def refuse_error(self, path: object, error: HelisimError) -> None:
        """Add what an exception says stops the log's use."""
        if isinstance(error, LogError):
            for finding in error.findings:
                self.refuse(finding.kind, finding.text, option=finding.option, rows=finding.rows)
            self._unlisted += error.unlisted
            return
        text = str(error)
        if isinstance(error, UnknownNameError):
            self._unlisted += error.unlisted
        self.refuse("refused", text if text.startswith(str(path)) else f"{path}: {text}")

    def check(self) -> None:
        """Raise LogError, with everything that stops the log's use, if anything does."""
        if not self.refused:
            return
        lines = [finding.text for finding in self.refused]
        if len(lines) > 1:
            lines = [f"{len(lines)} things are wrong:", *(f"- {line}" for line in lines)]
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
        uneven: where and how the samples aren't uniform, and what to do; empty if they are.
        option: of the command line, that makes them uniform.
    """

    first_row: int
    last_row: int
    samples: int
    start: float
    duration: float
    uneven: str = ""
    option: str = ""


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
        passband_hz: frequency up to which the anti-alias filter changes nothing, if there
            was one.
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
        low, middle, high = self.step
        return {
            "path": self.path,
            "format": self.format,
            "digest": self.digest,
            "rows_counted_as": self.counts,
            "samples": self.samples,
            "columns": dict(self.columns),
            "unused_columns": list(self.unused),
            "origin": self.origin,
            "step_s": {"smallest": low, "median": middle, "largest": high},
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
        low, middle, high = self.step
        total = sum(part.duration for part in self.parts)
        lines = [
            f"{self.path}: {self.format}, {self.samples} samples, {total:.4g} s, "
            f"step {middle:.4g} s (from {low:.4g} to {high:.4g} s)"
        ]
        if self.format != OURS:
            lines += [f"  {name} = {text}" for name, text in self.columns.items()]
        if self.resampled_hz is not None:
            message = (
                f"low-pass filtered, unchanged up to {self.passband_hz:.4g} Hz"
                if self.passband_hz is not None
                else "no filter: the log is not faster"
            )
            lines.append(f"  resampled to {self.resampled_hz:g} Hz, {message}")
        if len(self.parts) > 1:
            more = f", the {_PARTS_SHOWN} longest" if len(self.parts) > _PARTS_SHOWN else ""
            lines.append(f"  {len(self.parts)} records{more}:")
            longest = sorted(self.parts, key=lambda part: -part.duration)[:_PARTS_SHOWN]
            lines += [
                f"    {self.counts}s {part.first_row} to {part.last_row}, {part.duration:.4g} s"
                for part in self.parts
                if part in longest
            ]
        lines += [
            f"  {'repaired' if finding.repaired else 'note'}: {finding.text}"
            for finding in self.findings
        ]
        return "\n".join(lines)
