"""Reads tables of any program, one row a sample: CSV, whose every cell is checked, and Parquet."""

import csv
import math
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import RecordError, StorageError
from helisim.base.units import DATES, TIME_UNITS
from helisim.logs.mapping import Clock, Layout, split_heading
from helisim.logs.report import LogFinding
from helisim.logs.source import Source, place
from helisim.records.storage import as_array, read_table

_COMMENTS = ("#", "%", "//")
_SAMPLE_LINES = 50  # lines that are tried to find the delimiter out
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


class TextLog(Source):
    """A CSV: a header and one line a sample. Row numbers are the file's lines, from 1."""

    format = "CSV"
    counts = "line"

    def __init__(self, path: Path, data: bytes, layout: Layout, *, cut_tail: bool) -> None:
        self.path, self._layout = path, layout
        text, noted = self._decoded(data)
        comment, header, body, first = self._split(text)
        self.delimiter = layout.delimiter or _delimiter([header, *body[:_SAMPLE_LINES]])
        names = self._cells_of(header)
        if all(_is_number(self._point(cell)) for cell in names):
            names = list(layout.names) or self._cells_of((comment or "").lstrip("#%/ "))
            if not layout.names and len(names) < 2:
                raise StorageError(
                    f"{path}: no header, the first line has numbers only; give the columns' "
                    "names in the map: [file] names = [...]"
                )
            body, first = [header, *body], first - 1
        elif layout.names:
            raise StorageError(f"{path}: has a header, and names are given as well")
        super().__init__(path, names, noted)
        self._cells: list[list[str]] = []
        self._lines: list[int] = []
        self._read(body, first)
        self._check_widths(cut_tail)

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the line of each sample, (n_time,)."""
        return np.array(self._lines, dtype=np.int64)

    def _column(self, name: str) -> list[str]:
        index = self.names.index(name)
        return [row[index].strip() for row in self._cells]

    def _numbers(self, name: str) -> NDArray[np.float64]:
        return np.array(
            [
                np.nan if text.lower() in _MISSING else self._number(k, name, text)
                for k, text in enumerate(self._column(name))
            ]
        )

    def _seconds(self, name: str, unit: str) -> tuple[NDArray[np.float64], str]:
        """Return times from the first on, exactly: a clock from 1970 on loses nothing."""
        cells = self._column(name)
        if unit == DATES:
            return self._dates(name, cells), cells[0]
        for k, text in enumerate(cells):
            if text.lower() in _MISSING:
                raise RecordError(f"{self._place(k, name)}: no time")
        numbers = np.array([self._number(k, name, text) for k, text in enumerate(cells)])
        differences = numbers - numbers[0]
        if float(np.max(np.abs(numbers))) >= 1e6:
            with suppress(ArithmeticError, ValueError):
                exact = [Decimal(self._point(text)) for text in cells]
                differences = np.array([float(number - exact[0]) for number in exact])
        return differences * TIME_UNITS[unit], f"{cells[0]} {unit}"

    def _dates(self, name: str, cells: Sequence[str]) -> NDArray[np.float64]:
        seconds: list[float] = []
        first: datetime | None = None
        for k, text in enumerate(cells):
            try:
                date = datetime.fromisoformat(text)
                first = first or date
                seconds.append((date - first).total_seconds())
            except (ValueError, TypeError, OverflowError):
                raise StorageError(
                    f"{self._place(k, name)}: {_short(text)} is not a date such as "
                    "2024-05-01T12:00:00.25, or has another time zone than the first"
                ) from None
        return np.array(seconds)

    def _number(self, k: int, name: str, text: str) -> float:
        number = self._point(text)
        if not _is_number(number):
            comma = self._layout.decimal == "." and _is_number(text.replace(",", "."))
            hint = "; if it has a decimal comma, say decimal = ',' in the map's [file]"
            said = f"{_short(text)} is not a number{hint if comma else ''}"
            raise StorageError(f"{self._place(k, name)}: {said}")
        if not math.isfinite(float(number)):
            raise RecordError(f"{self._place(k, name)}: {_short(text)} is not finite")
        return float(number)

    def _point(self, text: str) -> str:
        return text.replace(",", ".") if self._layout.decimal == "," else text

    def _place(self, k: int, name: str | None = None) -> str:
        return place(self.path, self.counts, self._lines[k], name)

    def _decoded(self, data: bytes) -> tuple[str, list[LogFinding]]:
        """Return the file's text, and that it isn't UTF-8 if it isn't. Raises StorageError."""
        given, noted = self._layout.encoding, []
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
            noted = [LogFinding("encoding", message, rows=(line,))]
        text = text.removeprefix("\ufeff")
        if "\0" in text:
            line = text.count("\n", 0, text.index("\0")) + 1
            raise StorageError(
                f"{self.path}, line {line}: holds a zero byte: a binary file that is no ULog, "
                "DataFlash or Parquet, whose first bytes would say so, or UTF-16 without a mark "
                "(say encoding = 'utf-16-le' in the map's [file])"
            )
        return text, noted

    def _split(self, text: str) -> tuple[str | None, str, list[str], int]:
        """Return the last comment, the header, the lines after it, and the first one's number."""
        lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
        comment, position = None, (self._layout.header or 1) - 1
        while position < len(lines) and self._layout.header is None:
            line = lines[position].strip()
            if line and not line.startswith(_COMMENTS):
                break
            comment, position = line or comment, position + 1
        if not any(line.strip() for line in lines[position:]):
            raise StorageError(f"{self.path}: no header and no numbers in it")
        return comment, lines[position], lines[position + 1 :], position + 2

    def _cells_of(self, line: str) -> list[str]:
        try:
            cells = next(csv.reader([line], delimiter=self.delimiter, strict=True), [])
        except csv.Error as error:
            raise StorageError(f"{self.path}: the header can't be read: {error}") from None
        return [cell.strip() for cell in cells]

    def _read(self, body: Sequence[str], first: int) -> None:
        """Read the lines of numbers, the first one's number; a quoted cell may run over several."""
        reader = csv.reader((line + "\n" for line in body), delimiter=self.delimiter, strict=True)
        blank: list[int] = []
        line = first
        try:
            for count, row in enumerate(reader):
                if count >= self._layout.skip:
                    if len(row) > 1 or any(cell.strip() for cell in row):
                        self._lines.append(line)
                        self._cells.append(row)
                    else:
                        blank.append(line)
                line = first + reader.line_num
        except csv.Error as error:
            raise StorageError(f"{self.path}, line {line}: {error}") from None
        inside = [line for line in blank if self._lines and line < self._lines[-1]]
        if inside:
            message = f"{len(inside)} blank lines, the first is line {inside[0]}"
            self.findings.append(LogFinding("blank line", message, (), len(inside), tuple(inside)))

    def _check_widths(self, cut_tail: bool) -> None:
        """Refuse lines with another number of cells; the last may be incomplete, and left out."""
        width, last = len(self.names), len(self._cells) - 1
        wrong = [k for k, row in enumerate(self._cells) if len(row) != width]
        if wrong:
            have = len(self._cells[wrong[0]])
            message = f"{self._place(wrong[0])}: {have} columns, the header has {width}"
            if wrong != [last] or have > width:
                raise StorageError(f"{message} (in all {len(wrong)} such lines)")
            if not cut_tail:
                text = "the last line is incomplete: finish it, or leave it out with the repair"
                raise StorageError(f"{message}; {text} 'tail'", remedy="repair=tail")
            line = self._lines.pop()
            self._cells.pop()
            text = f"line {line}, the last, is incomplete and was left out"
            self.findings.append(LogFinding("incomplete last line", text, (), 1, (line,), True))
        if not self._cells:
            raise StorageError(f"{self.path}: no numbers below the header")


def _delimiter(lines: Sequence[str]) -> str:
    """Return the delimiter that gives most lines the same, largest number of columns."""
    best, score = ",", (0.0, 1)
    for delimiter in (",", ";", "\t", "|"):
        widths: Counter[int] = Counter()
        for line in lines:
            with suppress(csv.Error):
                widths[len(next(csv.reader([line], delimiter=delimiter), []))] += 1
        del widths[0]
        width, count = max(widths.items(), key=lambda one: one[1], default=(0, 0))
        if width > 1 and (count / widths.total(), width) > score:
            best, score = delimiter, (count / widths.total(), width)
    return best


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def _short(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")


_NUMERIC = ("int", "uint", "halffloat", "float", "double", "decimal", "bool")
"""How the names of Arrow's types of numbers begin."""
_WIDEST = 9e18  # differences of whole numbers up to this are exact in 64 bits


class ParquetLog(Source):
    """A Parquet table with one row a sample. Rows are counted from 0."""

    format = "Parquet"

    def __init__(self, path: Path, data: bytes) -> None:
        self._table = read_table(path, data)
        super().__init__(path, self._table.column_names)
        self._fields = dict(zip(self.names, zip(self._table.schema, self._table.columns)))
        if not self._table.num_rows:
            raise StorageError(f"{path}: no rows")

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the rows' numbers, (n_time,)."""
        return np.arange(self._table.num_rows)

    def _metadata(self, name: str) -> str | None:
        """Return the unit that a field's metadata states."""
        stated = (self._fields[name][0].metadata or {}).get(b"unit")
        return None if stated is None else stated.decode("utf-8", "replace")

    def _unit(self, name: str) -> str | None:
        stated = self._metadata(name)
        return split_heading(name)[1] if stated is None else stated

    def _cast(self, name: str, kind: str, **options: bool) -> Any:
        """Return a column as another kind of numbers. Raises RecordError."""
        try:
            return self._fields[name][1].cast(kind, **options)
        except (ValueError, NotImplementedError, TypeError) as error:
            raise RecordError(f"{self.path}, column {name!r}: {error}") from None

    def _numbers(self, name: str) -> NDArray[np.float64]:
        kind = str(self._fields[name][0].type)
        if not kind.startswith(_NUMERIC):
            raise StorageError(f"{self.path}, column {name!r}: holds {kind}, expected numbers")
        values = self._cast(name, "float64", safe=False).fill_null(math.nan)
        return np.array(as_array(values), dtype=np.float64)

    def _time_column(self, time: Clock | None) -> tuple[str, str]:
        """Return the column of times and its unit; dates and metadata of a field say it too."""
        dated = [name for name, (one, _) in self._fields.items() if _is_date(one.type)]
        wanted = time.column if time is not None else dated[0] if len(dated) == 1 else "time"
        if wanted in dated:
            time = Clock(wanted, DATES)
        elif (time is None or time.unit is None) and wanted in self.names:
            unit = self._metadata(wanted)
            time = Clock(wanted, unit) if unit in TIME_UNITS else time
        return super()._time_column(time)

    def _seconds(self, name: str, unit: str) -> tuple[NDArray[np.float64], str]:
        field, column = self._fields[name]
        if column.null_count:
            row = column.is_null().index(True).as_py()
            raise RecordError(f"{place(self.path, self.counts, row, name)}: no time")
        if unit == DATES and not _is_date(field.type):
            raise StorageError(
                f"{self.path}, column {name!r}: holds {field.type}, and only timestamps are "
                f"dates; give its unit: {', '.join(TIME_UNITS)}"
            )
        origin = str(column[0]) if unit == DATES else f"{column[0]} {unit}"
        factor = TIME_UNITS[field.type.unit if unit == DATES else unit]
        if unit != DATES and not str(field.type).startswith(("int", "uint")):
            values = self.numbers(name)
            return (values - values[0]) * factor, origin
        whole = as_array(self._cast(name, "int64"))
        if float(np.max(whole)) - float(np.min(whole)) > _WIDEST:
            raise RecordError(f"{self.path}, column {name!r}: its times span too much")
        return (whole - whole[0]).astype(np.float64) * factor, origin


def _is_date(kind: Any) -> bool:
    return str(kind).startswith("timestamp")
