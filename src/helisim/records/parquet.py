"""Reads and writes records as Parquet.

A column `time` (s) and one column a channel, with `unit`, `kind` and `meaning` as field
metadata; the schema metadata has one key, `helisim`, a JSON object with `format`, `version`
and `provenance`. The same record gives the same bytes, for one version of pyarrow.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from helisim.base.errors import StorageError
from helisim.base.files import parse_object, read_bytes
from helisim.records.channels import Channel
from helisim.records.header import (
    FORMAT,
    MAX_NUMBERS,
    TIME,
    VERSION,
    Contents,
    check_version,
    one_line,
    read_channel,
)
from helisim.records.record import FlightRecord

_METADATA = b"helisim"


def write_parquet(record: FlightRecord, path: Path) -> None:
    """Write a record. Raises OSError."""
    columns = [record.time, *record.values.T]
    fields = [
        pa.field(
            channel.name,
            pa.float64(),
            nullable=False,
            metadata={"unit": channel.unit, "kind": channel.kind, "meaning": channel.meaning},
        )
        for channel in (TIME, *record.channels)
    ]
    header = {"format": FORMAT, "version": VERSION, "provenance": dict(record.provenance)}
    schema = pa.schema(fields, metadata={_METADATA: one_line(header)})
    arrays = [pa.array(np.ascontiguousarray(column)) for column in columns]
    table = pa.Table.from_arrays(arrays, schema=schema)
    pq.write_table(table, path, compression="zstd", write_page_checksum=True)


def read_parquet(path: Path) -> Contents:
    """Read what `write_parquet` wrote. Raises StorageError."""
    table = read_table(path, read_bytes(path))
    header = _header(path, table.schema)
    channels = [_channel(path, field) for field in table.schema]
    if not channels or channels[0].name != TIME.name:
        raise StorageError(f"{path}: the first column must be 'time'")
    for name, column in zip(table.column_names, table.columns):
        if column.null_count:
            row = column.is_null().index(True).as_py()
            raise StorageError(f"{path}: column {name!r} has no number at row {row}")
    columns = np.column_stack([as_array(column) for column in table.columns])
    return Contents(columns, tuple(channels[1:]), header["provenance"])


def as_array(column: pa.ChunkedArray) -> np.ndarray:
    """Return a column without nulls, (n_time,), read-only.

    Arrow's own `to_numpy` imports pandas where there is one, which takes a fifth of a second.
    """
    return np.from_dlpack(column.combine_chunks())


def read_table(path: Path, data: bytes) -> pa.Table:
    """Return the table that the bytes of a Parquet file hold, by any program.

    It is decoded on the calling thread. A worker of Arrow lets go of `data`, a Python object,
    only some time after the read has returned; when the interpreter has ended by then, CPython
    ends the worker in the middle of a destructor, and the process aborts.

    Raises:
        StorageError: not Parquet, truncated, corrupt or too large.
    """
    try:
        with pq.ParquetFile(
            pa.BufferReader(data), page_checksum_verification=True, pre_buffer=False
        ) as file:
            found = file.metadata
            if found.num_rows * max(found.num_columns, 1) > MAX_NUMBERS:
                raise StorageError(
                    f"{path}: {found.num_rows} rows of {found.num_columns} columns, and at most "
                    f"{MAX_NUMBERS} numbers are read; cut it"
                )
            return file.read(use_threads=False)
    except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise StorageError(f"{path}: not Parquet, truncated or corrupt: {reason}") from None


def _header(path: Path, schema: pa.Schema) -> dict[str, Any]:
    metadata = (schema.metadata or {}).get(_METADATA)
    if metadata is None:
        raise StorageError(
            f"{path}: not a helisim flight record: its schema has no metadata 'helisim'"
        )
    header = parse_object(metadata, f"{path}: the metadata 'helisim'")
    if header.get("format") != FORMAT:
        raise StorageError(f"{path}: holds a {header.get('format')!r}, expected a {FORMAT!r}")
    check_version(path, header.get("version"))
    if not isinstance(header.get("provenance"), dict):
        raise StorageError(f"{path}: the metadata 'helisim' has no provenance")
    return header


def _channel(path: Path, field: pa.Field) -> Channel:
    if field.type != pa.float64():
        raise StorageError(f"{path}: column {field.name!r} holds {field.type}, expected double")
    metadata = {
        key.decode("utf-8", "replace"): text.decode("utf-8", "replace")
        for key, text in (field.metadata or {}).items()
    }
    return read_channel(path, {"name": field.name} | metadata)
