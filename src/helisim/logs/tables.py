"""Reads tables, one row a sample: CSV, whose every cell is checked, Parquet, NumPy, MATLAB."""

import csv
import io
import math
import re
from abc import abstractmethod
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from decimal import Decimal
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, RecordError, StorageError, shown
from helisim.base.note import Option
from helisim.base.units import DATES, TIME_UNITS, is_unit, time_unit
from helisim.logs.mapping import TIME_LIKE, TIME_NAMES, Clock, Layout, find_column, split_heading
from helisim.logs.report import LogFinding
from helisim.logs.source import Source, usual_step
from helisim.records.storage import as_array, read_table

_COMMENTS = ("#", "%", "//")
_MISSING = frozenset(
    ("", "nan", "-nan", "+nan", "na", "n/a", "#n/a", "null", "none", "nan(ind)", "-nan(ind)")
)  # Cells without a number, in lower case
# Byte order marks, and their encodings.
_MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
_MATLAB, _MATLAB_HDF = b"MATLAB ", b"MATLAB 7.3"
ARRAYS = (_MATLAB, b"\x93NUMPY", b"PK\x03\x04")  # how files of MATLAB and NumPy begin
_STEPS = (0.0005, 0.2)  # s, between samples: 2 kHz to 5 Hz, as flight logs have
_OF_TIME = {*TIME_UNITS, "sec", "seconds"}
_TRIED = 9  # rows that show whether numbers have a decimal comma
_LONG_STAMP = 1e6  # from here on, stamps are subtracted by their decimal digits


class TimeTable(Source):
    """A log of one table: a column has the time of all others, unless a rate is given."""

    _count = 0  # rows

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the rows' numbers, (n_time,)."""
        return np.arange(self._count)

    @abstractmethod
    def _seconds(self, name: str, unit: str) -> tuple[NDArray[np.float64], str]:
        """Return a column of times as seconds since the first (n_time,), and the first."""

    def stamps(self, clock: str, time: Clock | None) -> tuple[NDArray[np.float64], str, str]:
        """Return seconds since the log's first stamp (n_time,), that stamp, and the column."""
        if time is not None and time.rate is not None:
            return np.arange(self.rows(clock).size) / time.rate, "0", f"{time.rate:g} Hz"
        name, unit = self._time_column(time)
        seconds, origin = self._seconds(name, unit)
        return seconds, shown(origin, 40), name

    def _time_column(self, time: Clock | None) -> tuple[str, str]:
        likely = [name for name in self.names if split_heading(name)[0].lower() in TIME_NAMES]
        says = {name: TIME_LIKE.fullmatch(split_heading(name)[0].lower()) for name in self.names}
        likely = (
            likely
            or [name for name in self.names if self._unit(name) == DATES]
            or [name for name, one in says.items() if one]
        )
        clock = time or Clock(likely[0] if len(likely) == 1 else "")
        try:
            if not clock.column:
                raise InputError(
                    f"{'several columns' if likely else 'no column'} may be time; say which, and "
                    "its unit, or the rate, such as 50:Hz; columns: "
                    f"{', '.join(map(repr, self.names[:60]))}"
                )
            name = find_column(clock.column, self.names, "column of time")
            said, ending = says[name], name.lower().rpartition("_")[2]
            known = ending if ending in TIME_UNITS else None
            stated = clock.unit or self._unit(name) or (said and said[3]) or known
            return name, time_unit(stated) if stated else self._unit_by_steps(name)
        except InputError as error:
            raise InputError(f"{self.path}: {error}", remedy=error.remedy or "time") from None

    def _unit_by_steps(self, name: str) -> str:
        """Return the unit of times that say none, if it is sure: dates, or s. Raises InputError."""
        try:
            steps = np.diff(self._numbers(name))
        except StorageError:
            return DATES
        step = usual_step(steps)
        units = (one for one, size in TIME_UNITS.items() if _STEPS[0] <= step * size <= _STEPS[1])
        likely = next(units, "")
        if likely != "s":
            known = ", ".join((*TIME_UNITS, DATES))
            raise InputError(
                f"the heading of the time {name!r} says no unit, and its steps are {step:.4g}; "
                f"give one of {known}",
                remedy=Option("time", f"{name}:{likely}") if likely else "time",
            )
        self.findings.note(
            "unit of time",
            f"column {name!r}: its steps are {step:.4g}, the median, so it is taken to be in s",
        )
        return likely


class TextLog(TimeTable):
    """A CSV: a header and one line a sample. Row numbers are the file's lines, from 1."""

    format = "CSV"
    counts = "line"

    def __init__(self, path: Path, data: bytes, layout: Layout) -> None:
        super().__init__(path, ())
        self._layout = layout
        lines = self._decoded(data).replace("\r\n", "\n").replace("\r", "\n").split("\n")
        there = (k for k, line in enumerate(lines) if line.strip())
        first = next((k for k in there if not lines[k].strip().startswith(_COMMENTS)), None)
        if first is None:
            raise StorageError(f"{path}: no header and no numbers in it")
        # of the heading, whose names may hold another one, and of the line below it
        delimiter = (
            layout.delimiter
            or max(
                ",;\t| ",
                key=lambda one: min(  # blanks count only where nothing else does
                    line.count(one) if one != " " else min(1, len(line.split()) - 1)
                    for line in islice(filter(str.strip, lines[first:]), 2)
                ),
            )
        )
        rows = self._read(lines[first:], first + 1, delimiter)
        names = list(layout.names) or rows.pop(0)[1]
        if delimiter == " ":  # "p [deg/s]" is one name
            names = re.sub(r" (?=[\[(])", "", " ".join(names)).split(" ")
        if all(_is_number(self._point(cell)) for cell in names):
            raise StorageError(
                f"{path}, line {first + 1}: numbers, expected the columns' names; give the names "
                f"of its {len(names)} columns",
                remedy=Option("names", "A,B,..."),
            )
        below = rows[0][1] if rows and not (layout.names or layout.skip) else []
        units = [one for one in below if is_unit(one) or one.lower() in _OF_TIME]
        if 2 * len(units) > len(below) and not any(_is_number(self._point(one)) for one in below):
            names = [f"{name} [{unit}]" for name, unit in zip(names, rows.pop(0)[1])]
        super().__init__(path, names, self.findings)
        self._cells = [cells for _, cells in rows[layout.skip :]]
        some = [cell for row in self._cells[:_TRIED] for cell in row if not _is_number(cell)]
        if delimiter != "," and any(_is_number(cell.replace(",", ".")) for cell in some):
            self._layout = replace(layout, decimal=",")
            self.findings.note("decimal", "numbers have a decimal comma")
        self._lines = [line for line, _ in rows[layout.skip :]]
        self._check_widths()

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the line of each sample, (n_time,)."""
        return np.array(self._lines, dtype=np.int64)

    def _column(self, name: str) -> list[str]:
        index = self.names.index(name)
        return [row[index] for row in self._cells]

    def _numbers(self, name: str) -> NDArray[np.float64]:
        return np.array(
            [
                np.nan if cell.lower() in _MISSING else self._number(k, name, cell)
                for k, cell in enumerate(self._column(name))
            ]
        )

    def _seconds(self, name: str, unit: str) -> tuple[NDArray[np.float64], str]:
        """Return times since the first, exactly even for stamps since 1970, and the first."""
        cells = self._column(name)
        if unit == DATES:
            return self._dates(name, cells), cells[0]
        numbers = self.numbers(name)
        missing = np.flatnonzero(np.isnan(numbers))
        if missing.size:
            raise RecordError(f"{self.place('time', int(missing[0]), name)}: no time")
        differences = numbers - numbers[0]
        if float(np.max(np.abs(numbers))) >= _LONG_STAMP:
            exact = [Decimal(self._point(cell)) for cell in cells]
            differences = np.array([float(number - exact[0]) for number in exact])
        return differences * TIME_UNITS[unit], f"{cells[0]} {unit}"

    def _dates(self, name: str, cells: Sequence[str]) -> NDArray[np.float64]:
        """Return seconds since the first; times of day are of one day."""
        first, seconds = None, list[float]()
        for k, cell in enumerate(cells):
            try:
                date = datetime.fromisoformat(cell if "-" in cell else f"2000-01-01T{cell}")
                first = first or date
                seconds.append((date - first).total_seconds())
            except (ValueError, TypeError):  # the latter of dates with a zone and without
                raise StorageError(
                    f"{self.place('time', k, name)}: {shown(cell, 40)!r} is neither a number, a "
                    "date as 2026-01-31T12:00:00.125 nor a time of day as 12:00:00.125"
                ) from None
        return np.array(seconds)

    def _number(self, k: int, name: str, cell: str) -> float:
        number = self._point(cell)
        if not _is_number(number):
            hint = "; if it has a decimal comma, say decimal = ',' in the map's [file]"
            comma = _is_number(cell.replace(",", "."))
            said = f"{shown(cell, 40)!r} is not a number{hint if comma else ''}"
            raise StorageError(f"{self.place('time', k, name)}: {said}")
        return float(number)

    def _point(self, text: str) -> str:
        return text.replace(",", ".") if self._layout.decimal == "," else text

    def _decoded(self, data: bytes) -> str:
        encoding = next((name for mark, name in _MARKS.items() if data.startswith(mark)), "utf-8")
        try:
            text = data.decode(encoding)
        except ValueError:
            text = data.decode("latin-1")
            self.findings.note("encoding", f"not {encoding}: read as Latin-1")
        if "\0" in text:
            line = text.count("\n", 0, text.index("\0")) + 1
            raise StorageError(
                f"{self.path}, line {line}: holds a zero byte: a binary file that is no ULog, "
                "DataFlash, Blackbox or Parquet, or UTF-16 without its mark"
            )
        return text

    def _read(
        self, lines: Sequence[str], first: int, delimiter: str
    ) -> list[tuple[int, list[str]]]:
        blank = delimiter == " "
        texts = (line.strip() + "\n" if blank else line + "\n" for line in lines)
        reader = csv.reader(texts, delimiter=delimiter, skipinitialspace=blank, strict=True)
        rows, line = [], first
        try:
            for row in reader:
                cells = [cell.strip() for cell in row]
                rows += [(line, cells)] if len(cells) > 1 or any(cells) else []
                line = first + reader.line_num
        except csv.Error as error:
            raise StorageError(f"{self.path}, line {line}: {error}") from None
        return rows

    def _check_widths(self) -> None:
        width, cells = len(self.names), self._cells
        if len(cells) > 1 and len(cells[-1]) < width:
            cells.pop()
            text = f"line {self._lines.pop()}, the last, is incomplete and was left out"
            self.findings.note("incomplete last line", text, repaired=True)
        wrong = [k for k, row in enumerate(cells) if len(row) != width]
        if wrong:
            have = f"{len(cells[wrong[0]])} columns, the header has {width}"
            raise StorageError(
                f"{self.place('time', wrong[0])}: {have} (in all {len(wrong)} such lines)"
            )
        if not cells:
            raise StorageError(f"{self.path}: no numbers below the header")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


class ParquetLog(TimeTable):
    """A Parquet table with one row a sample. Rows are counted from 0."""

    format = "Parquet"

    def __init__(self, path: Path, data: bytes) -> None:
        table = read_table(path, data)
        super().__init__(path, table.column_names)
        self._fields = dict(zip(self.names, zip(table.schema, table.columns)))
        self._count = table.num_rows
        if not self._count:
            raise StorageError(f"{path}: no rows")

    def _unit(self, name: str) -> str | None:
        field = self._fields[name][0]
        stated = (field.metadata or {}).get(b"unit")
        own = super()._unit(name) if stated is None else stated.decode("utf-8", "replace")
        return DATES if str(field.type).startswith("timestamp") else own

    def _cast(self, name: str, kind: str, **options: bool) -> Any:
        try:
            return self._fields[name][1].cast(kind, **options)
        # pyarrow's errors of a cast that fails, or that it has not
        except (ValueError, NotImplementedError, TypeError) as error:
            raise RecordError(f"{self.path}, column {name!r}: {error}") from None

    def _numbers(self, name: str) -> NDArray[np.float64]:
        kind = str(self._fields[name][0].type)
        if not kind.startswith(("int", "uint", "halffloat", "float", "double", "decimal", "bool")):
            raise StorageError(f"{self.path}, column {name!r}: holds {kind}, expected numbers")
        values = self._cast(name, "float64", safe=False).fill_null(math.nan)
        return np.array(as_array(values), dtype=np.float64)

    def _seconds(self, name: str, unit: str) -> tuple[NDArray[np.float64], str]:
        field, column = self._fields[name]
        dated = self._unit(name) == DATES
        if column.null_count:
            row = column.is_null().index(True).as_py()
            raise RecordError(f"{self.place('time', row, name)}: no time")
        if unit == DATES and not dated:
            raise StorageError(
                f"{self.path}, column {name!r}: holds {field.type}, and only timestamps are "
                f"dates; give its unit: {', '.join(TIME_UNITS)}"
            )
        whole = dated or str(field.type).startswith(("int", "uint"))
        values = as_array(self._cast(name, "int64")) if whole else self.numbers(name)
        seconds = (values - values[0]) * TIME_UNITS[field.type.unit if dated else unit]
        return seconds, str(column[0]) if dated else f"{column[0]} {unit}"


class ArrayLog(TimeTable):
    """Arrays of NumPy (.npy, .npz) or MATLAB (.mat before 7.3) with one row a sample, from 0.

    A column of a matrix is `name[0]`, a field of a structure `name.field`; `names` are the columns'
    in place of these, in order. Of several experiments that of the column `clock` is read: of its
    length, and in its structure.
    """

    def __init__(
        self, path: Path, data: bytes, names: Sequence[str], clock: str | None = None
    ) -> None:
        self.format = "MATLAB" if data.startswith(_MATLAB) else "NumPy"
        if data.startswith(_MATLAB_HDF):
            raise StorageError(
                f"{path}: MATLAB's format 7.3, which isn't read; in MATLAB: save('log.mat', '-v7')"
            )
        try:
            found = _loaded(io.BytesIO(data), self.format)
            columns = [one for one in _columns("", found) if one[1].dtype.kind in "iufb"]
        except Exception as error:  # of damaged bytes both raise anything
            reason = shown(str(error), 200) or type(error).__name__
            raise StorageError(f"{path}: not {self.format}, or damaged: {reason}") from None
        same = [one for one in columns if one[0].split(".")[0] == str(clock).split(".")[0]]
        sizes = Counter(values.size for _, values in same or columns)
        count = max(sizes, key=lambda size: (sizes[size] * (size > 1), size), default=0)
        kept = {
            name: values
            for name, values in (same if len(same) > 1 else columns)
            if values.size == count
        }
        bare = not all(name.strip("[0123456789]") for name in kept)
        if count < 2 or ((names or bare) and len(names) != len(kept)):
            raise StorageError(
                f"{path}: {len(kept)} columns of {count} numbers, and {len(names)} names; give the "
                "name of each column"
                if columns
                else f"{path}: no array of numbers is in it",
                remedy=(Option("names", "A,B,..."),) * bool(columns),
            )
        self._columns, self._count = dict(zip(names or map(shown, kept), kept.values())), count
        # of a structure, once
        some = Counter(name.rpartition(".")[0] or name for name, _ in columns if name not in kept)
        said = (
            f"{name}: {n} of another length or structure than those read"
            for name, n in some.items()
        )
        super().__init__(path, tuple(self._columns), [LogFinding("left out", one) for one in said])

    def _numbers(self, name: str) -> NDArray[np.float64]:
        return self._columns[name].astype(np.float64)

    def _seconds(self, name: str, unit: str) -> tuple[NDArray[np.float64], str]:
        values = self._columns[name]
        values = values.astype(np.int64) if values.dtype.kind in "iu" else self.numbers(name)
        if unit == DATES or np.isnan(values).any():
            raise RecordError(f"{self.path}, column {name!r}: holds no dates, or not every time")
        return (values - values[0]) * TIME_UNITS[unit], f"{values[0]} {unit}"


def _loaded(file: Any, kind: str) -> Any:
    if kind == "NumPy":
        return np.load(file, allow_pickle=False)
    from scipy.io import loadmat  # slow to import

    return loadmat(file, simplify_cells=True)


def _columns(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield names and arrays, (n_time,), of nested mappings, structures and matrices."""
    fields = getattr(getattr(value, "dtype", None), "names", None)
    if isinstance(value, Mapping) or fields:
        for one in fields or value:
            if not str(one).startswith("__"):
                yield from _columns(f"{name}.{one}".lstrip("."), value[one])
    elif isinstance(value, np.ndarray):
        value = value.squeeze()
        if value.ndim == 1:
            yield name, value
        elif value.ndim == 2:
            rows = value if value.shape[0] < value.shape[1] else value.T
            yield from ((f"{name}[{k}]", row) for k, row in enumerate(rows))
