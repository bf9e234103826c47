"""Reads CSV files of any program: finds delimiter, encoding and header, checks every cell."""

import csv
from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from decimal import Decimal, InvalidOperation
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, RecordError, StorageError
from helisim.base.unit_names import DATES, TIME_UNITS, is_unit, time_unit
from helisim.logs.mapping import Clock, Layout, find_column, split_heading
from helisim.logs.report import LogFinding
from helisim.logs.source import MAX_COLUMNS, place

_DELIMITERS = (",", ";", "\t", "|")
_COMMENTS = ("#", "%", "//")
_SAMPLE_LINES = 50
"""Lines that are tried to find the delimiter out."""

_MISSING = frozenset(
    ("", "nan", "-nan", "+nan", "na", "n/a", "#n/a", "null", "none", "nan(ind)", "-nan(ind)")
)
"""Cells that mean "no number here", in lower case."""

_MARKS = (
    (b"\xff\xfe\x00\x00", "utf-32"),
    (b"\x00\x00\xfe\xff", "utf-32"),
    (b"\xef\xbb\xbf", "utf-8-sig"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)

TIME_NAMES = ("time", "t", "timestamp", "time_s", "time_ms", "time_us", "timestamp_us", "timeus")
"""Headings that mean time, in lower case and without a unit in brackets."""


class TextLog:
    """A CSV: a header and one line a sample. Row numbers are the file's lines, from 1."""

    format = "CSV"
    counts = "line"

    def __init__(self, path: Path, data: bytes, layout: Layout, *, cut_tail: bool) -> None:
        self.path = path
        self.findings: list[LogFinding] = []
        self._layout = layout
        comment, header, body, self._first = self._split(self._decode(data))
        self.delimiter = layout.delimiter or _delimiter([header, *body[:_SAMPLE_LINES]])
        if self._has_numbers(header):
            self.names = self._names_from(comment)
            body.insert(0, header)
            self._first -= 1
        else:
            self.names = tuple(cell.strip() for cell in self._cells_of(header))
            if layout.names:
                raise StorageError(f"{path}: has a header, and names are given as well")
        if len(self.names) > MAX_COLUMNS:
            raise StorageError(f"{path}: {len(self.names)} columns, at most {MAX_COLUMNS} are read")
        self._cells: list[list[str]] = []
        self._lines: list[int] = []
        self._read(body, cut_tail)

    def stated_unit(self, name: str) -> str | None:
        """Return the unit in the heading's brackets, if it is one."""
        unit = split_heading(name)[1]
        return unit if unit is not None and is_unit(unit) else None

    def clock(self, name: str) -> str:
        """Return the name of the file's one clock."""
        return "time"

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the line of each sample, (n_time,)."""
        return np.array(self._lines, dtype=np.int64)

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return a column, (n_time,), NaN where a cell says that it has none.

        Raises:
            StorageError: a cell isn't a number.
        """
        index = self.names.index(name)
        values = np.empty(len(self._cells))
        for k, row in enumerate(self._cells):
            text = row[index].strip()
            values[k] = np.nan if text.lower() in _MISSING else self._number(k, name, text)
        return values

    def stamps(self, clock: str, time: Clock | None) -> tuple[NDArray[np.float64], str, str]:
        """Return seconds since the first stamp (n_time,), that stamp, and the column.

        Differences are taken exactly, so a clock that counts from 1970 loses nothing.
        """
        if time is not None and time.rate is not None:
            return np.arange(len(self._cells)) / time.rate, "0", f"{time.rate:g} Hz"
        name, unit = time_column(self.path, self.names, time)
        index = self.names.index(name)
        cells = [row[index].strip() for row in self._cells]
        if unit == DATES:
            return self._dates(name, cells), cells[0] if cells else "", name
        numbers = np.empty(len(cells))
        for k, text in enumerate(cells):
            if text.lower() in _MISSING:
                raise RecordError(f"{self._place(k, name)}: no time")
            numbers[k] = self._number(k, name, text)
        seconds = self._differences(cells, numbers) * TIME_UNITS[unit]
        return seconds, f"{cells[0]} {unit}" if cells else "", name

    def _differences(
        self, cells: Sequence[str], numbers: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        if not numbers.size or float(np.max(np.abs(numbers))) < 1e6:
            return numbers - (numbers[0] if numbers.size else 0.0)
        try:
            exact = [Decimal(self._point(text)) for text in cells]
            return np.array([float(number - exact[0]) for number in exact])
        except (InvalidOperation, ArithmeticError, ValueError):
            return numbers - numbers[0]

    def _dates(self, name: str, cells: Sequence[str]) -> NDArray[np.float64]:
        seconds = np.empty(len(cells))
        first: datetime | None = None
        for k, text in enumerate(cells):
            try:
                date = datetime.fromisoformat(text)
                first = first or date
                seconds[k] = (date - first).total_seconds()
            except (ValueError, TypeError, OverflowError):
                raise StorageError(
                    f"{self._place(k, name)}: {_short(text)} is not a date such as "
                    "2024-05-01T12:00:00.25, or has another time zone than the first"
                ) from None
        return seconds

    def _number(self, k: int, name: str, text: str) -> float:
        try:
            if "_" in text:
                raise ValueError
            number = float(self._point(text))
        except ValueError:
            hint = ""
            if self._layout.decimal == "." and _is_number(text.replace(",", ".")):
                hint = "; if it has a decimal comma, say decimal = ',' in the map's [file]"
            raise StorageError(
                f"{self._place(k, name)}: {_short(text)} is not a number{hint}"
            ) from None
        if not isfinite(number):
            raise RecordError(f"{self._place(k, name)}: {_short(text)} is not finite")
        return number

    def _point(self, text: str) -> str:
        return text.replace(",", ".") if self._layout.decimal == "," else text

    def _place(self, k: int, name: str) -> str:
        return place(self.path, self.counts, self._lines[k], name)

    def _decode(self, data: bytes) -> str:
        given = self._layout.encoding
        encoding = given or next((name for mark, name in _MARKS if data.startswith(mark)), "utf-8")
        try:
            text = data.decode(encoding)
        except (ValueError, LookupError) as error:
            if given or encoding != "utf-8":
                raise StorageError(f"{self.path}: not text in {encoding}: {error}") from None
            start = error.start if isinstance(error, UnicodeDecodeError) else 0
            line = data.count(b"\n", 0, start) + 1
            text = data.decode("latin-1")
            message = f"not UTF-8 from line {line}, byte {start}: read as Latin-1"
            self.findings.append(LogFinding("encoding", message, rows=(line,)))
        text = text.removeprefix("\ufeff")
        if "\0" in text:
            line = text.count("\n", 0, text.index("\0")) + 1
            raise StorageError(
                f"{self.path}, line {line}: holds a zero byte: a binary file that is no ULog, "
                "DataFlash or Parquet, whose first bytes would say so, or UTF-16 without a mark "
                "(say encoding = 'utf-16-le' in the map's [file])"
            )
        return text

    def _split(self, text: str) -> tuple[str | None, str, list[str], int]:
        """Return the last comment, the header, the lines after it, and the first one's number."""
        lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
        comment: str | None = None
        position = (self._layout.header or 1) - 1
        while position < len(lines) and self._layout.header is None:
            line = lines[position].strip()
            if line and not line.startswith(_COMMENTS):
                break
            comment = line or comment
            position += 1
        if position >= len(lines) or not any(line.strip() for line in lines[position:]):
            raise StorageError(f"{self.path}: no header and no numbers in it")
        return comment, lines[position], lines[position + 1 :], position + 2

    def _has_numbers(self, header: str) -> bool:
        return all(_is_number(self._point(cell.strip())) for cell in self._cells_of(header))

    def _names_from(self, comment: str | None) -> tuple[str, ...]:
        """Return the columns' names of a file whose first line holds numbers."""
        if self._layout.names:
            return self._layout.names
        named = (comment or "").lstrip("#%/ ")
        if len(self._cells_of(named)) < 2 or not named:
            raise StorageError(
                f"{self.path}: no header, the first line has numbers only; give the columns' "
                "names in the map: [file] names = [...]"
            )
        return tuple(cell.strip() for cell in self._cells_of(named))

    def _cells_of(self, line: str) -> list[str]:
        try:
            return next(csv.reader([line], delimiter=self.delimiter, strict=True), [])
        except csv.Error as error:
            raise StorageError(f"{self.path}: the header can't be read: {error}") from None

    def _read(self, body: Sequence[str], cut_tail: bool) -> None:
        """Read the lines of numbers; a quoted cell may run over several."""
        reader = csv.reader((line + "\n" for line in body), delimiter=self.delimiter, strict=True)
        blank: list[int] = []
        line = self._first
        try:
            for count, row in enumerate(reader):
                if count >= self._layout.skip:
                    if len(row) > 1 or any(cell.strip() for cell in row):
                        self._lines.append(line)
                        self._cells.append(row)
                    else:
                        blank.append(line)
                line = self._first + reader.line_num
        except csv.Error as error:
            raise StorageError(f"{self.path}, line {line}: {error}") from None
        self._check_widths(cut_tail)
        inside = [line for line in blank if self._lines and line < self._lines[-1]]
        if inside:
            message = f"{len(inside)} blank lines, the first is line {inside[0]}"
            self.findings.append(LogFinding("blank line", message, len(inside), tuple(inside)))
        if not self._cells:
            raise StorageError(f"{self.path}: no numbers below the header")

    def _check_widths(self, cut_tail: bool) -> None:
        width = len(self.names)
        wrong = [k for k, row in enumerate(self._cells) if len(row) != width]
        if not wrong:
            return
        k = wrong[0]
        message = (
            f"{place(self.path, self.counts, self._lines[k])}: {len(self._cells[k])} columns, "
            f"the header has {width}"
        )
        if len(wrong) == 1 and k == len(self._cells) - 1 and len(self._cells[k]) < width:
            if not cut_tail:
                raise StorageError(
                    f"{message}; the last line is incomplete: finish it, or leave it out "
                    "with the repair 'tail'"
                )
            self.findings.append(
                LogFinding(
                    "incomplete last line",
                    f"line {self._lines[k]}, the last, is incomplete and was left out",
                    rows=(self._lines[k],),
                    repaired=True,
                )
            )
            del self._cells[k], self._lines[k]
            return
        raise StorageError(f"{message} (in all {len(wrong)} such lines)")


def time_column(path: Path, names: Sequence[str], time: Clock | None) -> tuple[str, str]:
    """Return the column of times and its unit, stated by the map or by the heading.

    Raises:
        InputError: there is none, there are several, or its unit is unknown.
    """
    if time is None or time.column is None:
        likely = [name for name in names if split_heading(name)[0].lower() in TIME_NAMES]
        if len(likely) != 1:
            message = f"several columns may be time: {likely}" if likely else "no column is time"
            raise InputError(
                f"{path}: {message}; say which, and its unit (--time COLUMN:UNIT), or the rate "
                f"(--rate HZ); columns: {', '.join(repr(name) for name in names[:60])}"
            )
        name, given = likely[0], None
    else:
        try:
            name = find_column(time.column, names, "column of time")
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        given = time.unit
    bare, bracketed = split_heading(name)
    ending = bare.lower().rpartition("_")[2]
    stated = given or bracketed or (ending if ending in TIME_UNITS else None)
    if bare.lower() == "timeus":
        stated = stated or "us"
    if stated is None:
        raise InputError(
            f"{path}: the heading of the time {name!r} says no unit; give one of "
            f"{', '.join((*TIME_UNITS, DATES))} (--time COLUMN:UNIT)"
        )
    try:
        return name, time_unit(stated)
    except InputError as error:
        raise InputError(f"{path}, column {name!r}: {error}") from None


def _delimiter(lines: Sequence[str]) -> str:
    """Return the delimiter that gives most lines the same, largest number of columns."""
    best, score = ",", (0.0, 1)
    for delimiter in _DELIMITERS:
        widths: Counter[int] = Counter()
        for line in lines:
            try:
                row = next(csv.reader([line], delimiter=delimiter), [])
            except csv.Error:
                continue
            if row:
                widths[len(row)] += 1
        if not widths:
            continue
        width, count = widths.most_common(1)[0]
        if width > 1 and (count / sum(widths.values()), width) > score:
            best, score = delimiter, (count / sum(widths.values()), width)
    return best


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def _short(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")
