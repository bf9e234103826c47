"""Reads Parquet files of any program."""

import math
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from helisim.base.errors import RecordError, StorageError
from helisim.base.unit_names import DATES, TIME_UNITS, is_unit
from helisim.logs.mapping import Clock, split_heading
from helisim.logs.report import LogFinding
from helisim.logs.source import MAX_COLUMNS, check_no_infinity, place
from helisim.logs.text import time_column
from helisim.records.storage import as_array, read_table

_WIDEST = 9e18
"""Differences of whole numbers up to this are exact in 64 bits."""


class ParquetLog:
    """A Parquet table with one row a sample. Rows are counted from 0."""

    format = "Parquet"
    counts = "row"

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        self.findings: list[LogFinding] = []
        self._table = read_table(path, data)
        self.names: tuple[str, ...] = tuple(self._table.column_names)
        if len(self.names) > MAX_COLUMNS:
            raise StorageError(f"{path}: {len(self.names)} columns, at most {MAX_COLUMNS} are read")
        if not self._table.num_rows:
            raise StorageError(f"{path}: no rows")

    @property
    def metadata(self) -> dict[bytes, bytes]:
        """The schema's metadata."""
        return self._table.schema.metadata or {}

    def stated_unit(self, name: str) -> str | None:
        """Return the unit in the field's metadata or in the name's brackets, if it is one."""
        metadata = self._table.schema.field(self.names.index(name)).metadata or {}
        stated = metadata.get(b"unit")
        unit = stated.decode("utf-8", "replace") if stated is not None else split_heading(name)[1]
        return unit if unit is not None and is_unit(unit) else None

    def clock(self, name: str) -> str:
        """Return the name of the table's one clock."""
        return "time"

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the rows' numbers, (n_time,)."""
        return np.arange(self._table.num_rows)

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return a column, (n_time,), NaN where it is null.

        Raises:
            StorageError: the column doesn't hold numbers.
            RecordError: a number is infinite.
        """
        column = self._table.column(self.names.index(name))
        kind = column.type
        numeric = pa.types.is_integer(kind) or pa.types.is_floating(kind)
        if not (numeric or pa.types.is_decimal(kind) or pa.types.is_boolean(kind)):
            raise StorageError(f"{self.path}, column {name!r}: holds {kind}, expected numbers")
        try:
            values = as_array(column.cast(pa.float64(), safe=False).fill_null(math.nan))
        except pa.ArrowException as error:
            raise StorageError(f"{self.path}, column {name!r}: {error}") from None
        values = np.array(values, dtype=np.float64)
        check_no_infinity(self.path, self.counts, name, values)
        return values

    def stamps(self, clock: str, time: Clock | None) -> tuple[NDArray[np.float64], str, str]:
        """Return seconds since the first stamp (n_time,), that stamp, and the column."""
        count = self._table.num_rows
        if time is not None and time.rate is not None:
            return np.arange(count) / time.rate, "0", f"{time.rate:g} Hz"
        dated = [name for name, one in zip(self.names, self._table.schema) if _is_date(one.type)]
        if time is None and len(dated) == 1:
            time = Clock(dated[0], DATES)
        elif time is not None and time.column in dated:
            time = Clock(time.column, DATES)
        if time is None or time.unit is None:
            time = self._with_stated_unit(time)
        name, unit = time_column(self.path, self.names, time)
        column = self._table.column(self.names.index(name))
        if column.null_count:
            row = column.is_null().index(True).as_py()
            raise RecordError(f"{place(self.path, self.counts, row, name)}: no time")
        if _is_date(column.type):
            factor = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[column.type.unit]
            origin = str(column[0])
            column = column.cast(pa.int64())
        elif unit == DATES:
            raise StorageError(
                f"{self.path}, column {name!r}: holds {column.type}, and only timestamps are "
                f"dates; give its unit: {', '.join(TIME_UNITS)}"
            )
        else:
            factor = TIME_UNITS[unit]
            origin = f"{column[0]} {unit}"
        if pa.types.is_integer(column.type):
            try:
                whole = as_array(column.cast(pa.int64()))
            except pa.ArrowException as error:
                raise RecordError(f"{self.path}, column {name!r}: {error}") from None
            if float(np.max(whole)) - float(np.min(whole)) > _WIDEST:
                raise RecordError(f"{self.path}, column {name!r}: its times span too much")
            return (whole - whole[0]).astype(np.float64) * factor, origin, name
        values = self.numbers(name)
        return (values - values[0]) * factor, origin, name

    def _with_stated_unit(self, time: Clock | None) -> Clock | None:
        """Return the clock with the unit that the field's metadata states."""
        for name, field in zip(self.names, self._table.schema):
            wanted = name == (time.column if time is not None else "time")
            unit = (field.metadata or {}).get(b"unit", b"").decode("utf-8", "replace")
            if wanted and unit in TIME_UNITS:
                return Clock(name, unit)
        return time


def _is_date(kind: pa.DataType) -> bool:
    return pa.types.is_timestamp(kind)
