"""Flight records on disk: Parquet, and CSV for people and spreadsheets, without loss.

Parquet has a column `time` (s) and one a channel, whose field metadata are `unit`, `kind` and
`meaning`; the schema's metadata `helisim` is JSON with `format`, `version` and `provenance`. CSV::

    # helisim flight record, version 1
    # rows: 9001
    # provenance: {"seed": 1}
    # channel: {"name": "p", "unit": "rad/s", "kind": "OUT", "meaning": "roll rate"}
    time [s],p [rad/s]
    0.0,0.01
"""

import csv
import io
import json
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_args

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import RecordError, StorageError
from helisim.base.files import (
    SUFFIXES,
    atomic_write,
    check_suffix,
    parse_object,
    read_bytes,
    read_text,
)
from helisim.records.record import Channel, FlightRecord, Kind, one_line

if TYPE_CHECKING:
    import pyarrow as pa  # slow to import

_FORMAT = "flight record"
_VERSION = 1  # the version of both layouts; it rises when older code can't read the new files
_TITLE = f"# helisim {_FORMAT}, version "

_TIME = Channel("time", "s", "OTHER", "time since the start of the record")

_MAX_NUMBERS = 1 << 28  # Numbers of a record, at most: 2 GiB. A small file can claim many more

_Contents = tuple[NDArray[np.float64], tuple[Channel, ...], dict[str, Any]]
"""Time and channels as columns, the channels, the provenance."""


def write_record(record: FlightRecord, path: str | Path) -> Path:
    """Write a record as Parquet or CSV, by the suffix, complete or not at all; return the path.

    Raises StorageError, or RecordError if a channel is called `time`.
    """
    path = Path(path)
    suffix = check_suffix(path, SUFFIXES)
    if _TIME.name in record:
        raise RecordError("a channel can't be called 'time', the time column's name: rename it")
    with atomic_write(path) as temporary:
        (_write_csv if suffix == ".csv" else _write_parquet)(record, temporary)
    return path


def read_record(path: str | Path) -> FlightRecord:
    """Read a record that `write_record` wrote. Raises StorageError or RecordError."""
    read = _read_csv if check_suffix(Path(path), SUFFIXES) == ".csv" else _read_parquet
    columns, channels, provenance = read(Path(path))
    try:
        return FlightRecord(columns[:, 0], columns[:, 1:], channels, provenance)
    except RecordError as error:
        raise RecordError(f"{path}: {error}") from None


def _write_csv(record: FlightRecord, path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"{_TITLE}{_VERSION}\n# rows: {len(record)}\n")
        file.write(f"# provenance: {one_line(dict(record.provenance))}\n")
        for channel in record.channels:
            file.write(f"# channel: {json.dumps(asdict(channel), ensure_ascii=False)}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(f"{one.name} [{one.unit}]" for one in (_TIME, *record.channels))
        # csv writes a float by its repr, which reads back as the same double
        writer.writerows(np.column_stack([record.time, record.values]).tolist())


def _read_csv(path: Path) -> _Contents:
    lines = io.StringIO(read_text(path)).readlines()  # ends at \n alone: texts hold others
    count = next((k for k, line in enumerate(lines) if not line.startswith("#")), len(lines))
    title, *comments = (line.rstrip("\n") for line in (lines[:count] or [""]))
    if not title.startswith(_TITLE):
        raise StorageError(
            f"{path}: not a helisim flight record: line 1 must be '{_TITLE}{_VERSION}'"
        )
    _check_version(path, title.removeprefix(_TITLE))
    said = dict(line.removeprefix("# ").split(": ", 1) for line in comments if ": " in line)
    if missing := {"rows", "provenance"} - said.keys():
        raise StorageError(f"{path}: needs a line '# {min(missing)}:' before the header")
    provenance = parse_object(said["provenance"], f"{path}: '# provenance:'")
    channels = tuple(
        _channel(path, parse_object(line.removeprefix("# channel: "), f"{path}: '# channel:'"))
        for line in comments
        if line.startswith("# channel: ")
    )
    try:
        header, *rows = csv.reader(lines[count:] or [""])
    except csv.Error as error:
        raise StorageError(f"{path}: not a CSV table: {error}; is a quote left open?") from None
    expected = [f"{one.name} [{one.unit}]" for one in (_TIME, *channels)]
    if header != expected:
        raise StorageError(
            f"{path}, line {count + 1}: the columns are {', '.join(header) or 'none'}; by the "
            f"lines '# channel:' they must be {', '.join(expected)}"
        )
    columns = np.empty((len(rows), len(expected)))
    for k, row in enumerate(rows):
        try:
            columns[k] = np.array(row, dtype=np.float64).reshape(len(expected))
        except ValueError:
            raise StorageError(
                f"{path}, line {count + 2 + k}: expected {len(expected)} numbers, got {row}"
            ) from None
    if str(len(rows)) != said["rows"].strip() or not lines[-1].endswith("\n"):
        raise StorageError(
            f"{path}: truncated: {len(rows)} rows, and its line '# rows:' says {said['rows']} "
            "(if it was cut on purpose, correct that line)"
        )
    return columns, channels, provenance


def _channel(path: Path, data: Mapping[str, Any]) -> Channel:
    names = [one.name for one in fields(Channel)]
    missing = [name for name in names if name not in data]
    if missing:
        raise StorageError(f"{path}: a channel lacks its {', '.join(missing)}: {dict(data)}")
    if data["kind"] not in get_args(Kind):
        raise StorageError(
            f"{path}: channel {data['name']!r} has the unknown kind {data['kind']!r}; "
            f"available: {', '.join(get_args(Kind))}"
        )
    return Channel(*(cast(Any, str(data[name])) for name in names))


def _check_version(path: Path, version: object) -> None:
    if str(version) != str(_VERSION):
        raise StorageError(
            f"{path}: version {version} of the format, and this helisim reads version {_VERSION}"
        )


def _write_parquet(record: FlightRecord, path: Path) -> None:
    """Write the same bytes for the same record and version of pyarrow."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields_ = [
        pa.field(
            channel.name,
            pa.float64(),
            nullable=False,
            metadata={"unit": channel.unit, "kind": channel.kind, "meaning": channel.meaning},
        )
        for channel in (_TIME, *record.channels)
    ]
    header = {"format": _FORMAT, "version": _VERSION, "provenance": dict(record.provenance)}
    schema = pa.schema(fields_, metadata={b"helisim": one_line(header)})
    arrays = [  # `pa.array` would import pandas: a fifth of a second
        pa.Array.from_buffers(pa.float64(), one.size, [None, pa.py_buffer(one.tobytes())])
        for one in (record.time, *record.values.T)
    ]
    table = pa.Table.from_arrays(arrays, schema=schema)
    pq.write_table(table, path, compression="zstd", write_page_checksum=True)


def _read_parquet(path: Path) -> _Contents:
    import pyarrow as pa

    table = read_table(path, read_bytes(path))
    metadata = (table.schema.metadata or {}).get(b"helisim")
    if metadata is None:
        raise StorageError(
            f"{path}: not a helisim flight record: its schema has no metadata 'helisim'"
        )
    header = parse_object(metadata, f"{path}: the metadata 'helisim'")
    if header.get("format") != _FORMAT:
        raise StorageError(f"{path}: holds a {header.get('format')!r}, expected a {_FORMAT!r}")
    _check_version(path, header.get("version"))
    if not isinstance(header.get("provenance"), dict):
        raise StorageError(f"{path}: the metadata 'helisim' has no provenance")
    channels = []
    for one, column in zip(table.schema, table.columns):
        if one.type != pa.float64():
            raise StorageError(f"{path}: column {one.name!r} holds {one.type}, expected double")
        if column.null_count:
            row = column.is_null().index(True).as_py()
            raise StorageError(f"{path}: column {one.name!r} has no number at row {row}")
        stated = {
            key.decode("utf-8", "replace"): text.decode("utf-8", "replace")
            for key, text in (one.metadata or {}).items()
        }
        channels.append(_channel(path, {"name": one.name} | stated))
    if not channels or channels[0].name != _TIME.name:
        raise StorageError(f"{path}: the first column must be 'time'")
    columns = np.column_stack([as_array(column) for column in table.columns])
    return columns, tuple(channels[1:]), header["provenance"]


def as_array(column: "pa.ChunkedArray") -> np.ndarray:
    """Return a column without nulls, (n_time,), read-only."""
    return np.from_dlpack(column.combine_chunks())


def read_table(path: Path, data: bytes) -> "pa.Table":
    """Return the table in the bytes of any Parquet file. Raises StorageError.

    Decoded on the calling thread: Arrow's own may abort the process as the interpreter ends.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(
            pa.BufferReader(data), page_checksum_verification=True, pre_buffer=False
        ) as file:
            found = file.metadata
            if found.num_rows * max(found.num_columns, 1) > _MAX_NUMBERS:
                raise StorageError(
                    f"{path}: {found.num_rows} rows of {found.num_columns} columns, and at most "
                    f"{_MAX_NUMBERS} numbers are read; cut it"
                )
            return file.read(use_threads=False)
    except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise StorageError(f"{path}: not Parquet, truncated or corrupt: {reason}") from None
