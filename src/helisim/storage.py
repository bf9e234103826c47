"""Flight records on disk: Parquet, and CSV for people and spreadsheets.

Both carry the unit, kind and meaning of each channel and the provenance of the record,
and give back exactly the doubles that were written. No pickle.

Parquet has a column `time` (s) and one column a channel, with `unit`, `kind` and
`meaning` as field metadata; the schema metadata has one key, `helisim`, a JSON object
with `format`, `version` and `provenance`. The same record gives the same bytes, for one
version of pyarrow.

CSV begins with comment lines, then has a header of `name [unit]` and one row a sample::

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
import os
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from helisim.channels import Channel, Kind
from helisim.errors import RecordError, StorageError
from helisim.record import FlightRecord

SUFFIXES = (".parquet", ".csv")

FORMAT = "flight record"
VERSION = 1
"""The version of both layouts; it rises when older code can't read the new files."""

_METADATA = b"helisim"
_TIME = Channel("time", "s", "OTHER", "time since the start of the record")
_CSV_TITLE = f"# helisim {FORMAT}, version "


@dataclass(frozen=True, eq=False)
class _Contents:
    """What a file holds, before the record checks it: time is the first column."""

    columns: NDArray[np.float64]
    channels: tuple[Channel, ...]
    provenance: dict[str, Any]


def write_record(record: FlightRecord, path: str | Path) -> Path:
    """Write a record as Parquet or CSV, by the suffix of `path`; return the path.

    The file appears complete or not at all.

    Raises:
        StorageError: unknown suffix, or the file can't be written.
        RecordError: a channel is called `time`, which is the name of the time column.
    """
    path = Path(path)
    write = _write_csv if _suffix(path) == ".csv" else _write_parquet
    if _TIME.name in record:
        raise RecordError("a channel can't be called 'time', the time column's name: rename it")
    with atomic_write(path) as temporary:
        write(record, temporary)
    return path


def read_record(path: str | Path) -> FlightRecord:
    """Read a record that `write_record` wrote.

    Raises:
        StorageError: unknown suffix, missing file, or a file that is truncated, corrupt or
            not a flight record.
        RecordError: the numbers don't make a record, for example NaN or a time that falls.
    """
    path = Path(path)
    read = _read_csv if _suffix(path) == ".csv" else _read_parquet
    try:
        contents = read(path)
    except FileNotFoundError:
        raise StorageError(f"{path}: no such file") from None
    except OSError as error:
        raise StorageError(f"{path}: can't read it: {error.strerror or error}") from None
    try:
        return FlightRecord(
            contents.columns[:, 0], contents.columns[:, 1:], contents.channels, contents.provenance
        )
    except RecordError as error:
        raise RecordError(f"{path}: {error}") from None


def check_destination(path: str | Path, suffixes: tuple[str, ...] = SUFFIXES) -> Path:
    """Return `path` if a file could be written there now, so that long work is not in vain.

    Raises:
        StorageError: unknown suffix, or the folder or an existing file can't be written.
    """
    path = Path(path)
    _suffix(path, suffixes)
    with atomic_write(path, keep=False) as temporary:
        temporary.touch()
    return path


def make_folder(path: str | Path) -> Path:
    """Make a folder, and those above it, that files can be written to; return it.

    Raises:
        StorageError: it can't be made or written.
    """
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"can't make the folder {path}: {error.strerror}") from None
    check_destination(path / "probe.parquet")
    return path


@contextmanager
def atomic_write(path: str | Path, *, keep: bool = True) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to, and put it in place at the end.

    When the block raises, or `keep` is false, `path` stays as it was and the temporary file
    is removed.

    Raises:
        StorageError: the folder doesn't exist or can't be written, `path` is not a regular
            file, or writing fails.
    """
    path = Path(path)
    target = Path(os.path.realpath(path))  # a link is kept and its target replaced
    if target.exists() and not target.is_file():
        raise StorageError(f"{path}: can't write it: it exists and is not a regular file")
    if not target.parent.is_dir():
        raise StorageError(f"{path}: can't write it: {target.parent} is not a folder; create it")
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(4)}.tmp{target.suffix}")
    try:
        yield temporary
        if keep:
            _sync(temporary)
            os.replace(temporary, target)
    except OSError as error:
        raise StorageError(f"{path}: can't write it: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _sync(path: Path) -> None:
    """Have the file on the disk before its name is, so that a crash leaves no empty file."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def _suffix(path: Path, suffixes: tuple[str, ...] = SUFFIXES) -> str:
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise StorageError(
            f"{path}: unknown suffix {path.suffix!r}; available: {', '.join(suffixes)}"
        )
    return suffix


# Parquet


def _write_parquet(record: FlightRecord, path: Path) -> None:
    columns = [record.time, *record.values.T]
    fields = [
        pa.field(
            channel.name,
            pa.float64(),
            nullable=False,
            metadata={"unit": channel.unit, "kind": channel.kind, "meaning": channel.meaning},
        )
        for channel in (_TIME, *record.channels)
    ]
    header = {"format": FORMAT, "version": VERSION, "provenance": dict(record.provenance)}
    schema = pa.schema(fields, metadata={_METADATA: _json(header)})
    arrays = [pa.array(np.ascontiguousarray(column)) for column in columns]
    table = pa.Table.from_arrays(arrays, schema=schema)
    pq.write_table(table, path, compression="zstd", write_page_checksum=True)


def _read_parquet(path: Path) -> _Contents:
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            table = file.read()
    except FileNotFoundError:
        raise
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0]
        raise StorageError(f"{path}: not Parquet, truncated or corrupt: {reason}") from None
    header = _parquet_header(path, table.schema)
    channels = [_parquet_channel(path, field) for field in table.schema]
    if not channels or channels[0].name != _TIME.name:
        raise StorageError(f"{path}: the first column must be 'time'")
    for name, column in zip(table.column_names, table.columns):
        if column.null_count:
            row = column.is_null().index(True).as_py()
            raise StorageError(f"{path}: column {name!r} has no number at row {row}")
    columns = np.column_stack([column.to_numpy() for column in table.columns])
    return _Contents(columns, tuple(channels[1:]), header["provenance"])


def _parquet_header(path: Path, schema: pa.Schema) -> dict[str, Any]:
    metadata = (schema.metadata or {}).get(_METADATA)
    if metadata is None:
        raise StorageError(
            f"{path}: not a helisim flight record: its schema has no metadata 'helisim'"
        )
    header = _object(path, "the metadata 'helisim'", metadata)
    if header.get("format") != FORMAT:
        raise StorageError(f"{path}: holds a {header.get('format')!r}, expected a {FORMAT!r}")
    _check_version(path, header.get("version"))
    if not isinstance(header.get("provenance"), dict):
        raise StorageError(f"{path}: the metadata 'helisim' has no provenance")
    return header


def _parquet_channel(path: Path, field: pa.Field) -> Channel:
    if field.type != pa.float64():
        raise StorageError(f"{path}: column {field.name!r} holds {field.type}, expected double")
    metadata = field.metadata or {}
    return _channel(
        path,
        {"name": field.name} | {key.decode(): metadata[key].decode() for key in metadata},
    )


# CSV


def _write_csv(record: FlightRecord, path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"{_CSV_TITLE}{VERSION}\n")
        file.write(f"# rows: {len(record)}\n")
        file.write(f"# provenance: {_json(dict(record.provenance))}\n")
        for channel in record.channels:
            file.write(f"# channel: {json.dumps(asdict(channel), ensure_ascii=False)}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([_heading(channel) for channel in (_TIME, *record.channels)])
        # csv writes a float by its repr, which reads back as the same double
        writer.writerows(np.column_stack([record.time, record.values]).tolist())


def _read_csv(path: Path) -> _Contents:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise StorageError(f"{path}: not text: {error.reason} at byte {error.start}") from None
    comments, body = _split_comments(text)
    if not comments or not comments[0].startswith(_CSV_TITLE):
        raise StorageError(
            f"{path}: not a helisim flight record: line 1 must be '{_CSV_TITLE}{VERSION}'"
        )
    _check_version(path, _integer(path, comments[0].removeprefix(_CSV_TITLE)))
    rows = _integer(path, _comment(path, comments, "rows"))
    provenance = _object(path, "'# provenance:'", _comment(path, comments, "provenance"))
    channels = tuple(
        _channel(path, _object(path, "'# channel:'", text)) for text in _all(comments, "channel")
    )
    columns = _csv_columns(path, body, channels, first_line=len(comments) + 1)
    if len(columns) != rows or not text.endswith("\n"):
        raise StorageError(
            f"{path}: truncated: {len(columns)} rows, and its line '# rows:' says {rows} "
            "(if it was cut on purpose, correct that line)"
        )
    return _Contents(columns, channels, provenance)


def _csv_columns(
    path: Path, body: str, channels: tuple[Channel, ...], *, first_line: int
) -> NDArray[np.float64]:
    """Return the numbers below the header as (n_time, 1 + n_channel)."""
    expected = [_heading(channel) for channel in (_TIME, *channels)]
    reader = csv.reader(io.StringIO(body, newline=""))
    table: list[list[float]] = []
    try:
        header = next(reader, [])
        if header != expected:
            raise StorageError(f"{path}, line {first_line}: {_difference(header, expected)}")
        for row in reader:
            line = first_line - 1 + reader.line_num
            if len(row) != len(expected):
                raise StorageError(
                    f"{path}, line {line}: {len(row)} columns, expected {len(expected)}"
                )
            table.append([_number(path, line, *cell) for cell in zip(expected, row)])
    except csv.Error as error:
        raise StorageError(f"{path}, line {first_line - 1 + reader.line_num}: {error}") from None
    return np.array(table, dtype=np.float64).reshape(-1, len(expected))


def _number(path: Path, line: int, column: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        raise StorageError(
            f"{path}, line {line}, column {column!r}: {text!r} is not a number"
        ) from None
    if not isfinite(number):
        raise RecordError(f"{path}, line {line}, column {column!r}: {text!r} is not finite")
    return number


def _difference(header: list[str], expected: list[str]) -> str:
    missing = [name for name in expected if name not in header]
    extra = [name for name in header if name not in expected]
    if missing:
        return f"missing columns: {', '.join(missing)}; expected {', '.join(expected)}"
    if extra:
        return f"columns without a '# channel:' line: {', '.join(extra)}"
    return f"the columns must be, in this order: {', '.join(expected)}"


def _split_comments(text: str) -> tuple[list[str], str]:
    comments: list[str] = []
    while text.startswith("#"):
        line, _, text = text.partition("\n")
        comments.append(line)
    return comments, text


def _all(comments: list[str], key: str) -> list[str]:
    prefix = f"# {key}: "
    return [line.removeprefix(prefix) for line in comments if line.startswith(prefix)]


def _comment(path: Path, comments: list[str], key: str) -> str:
    found = _all(comments, key)
    if len(found) != 1:
        raise StorageError(f"{path}: needs one line '# {key}:' before the header, has {len(found)}")
    return found[0]


def _heading(channel: Channel) -> str:
    return f"{channel.name} [{channel.unit}]"


# Both


def _json(data: Mapping[str, Any]) -> str:
    """Return one line that is the same for equal data, whatever the order of the keys."""
    return json.dumps(data, sort_keys=True, ensure_ascii=False, allow_nan=False)


def _object(path: Path, what: str, text: str | bytes) -> dict[str, Any]:
    try:
        data = json.loads(text)
    except ValueError as error:
        raise StorageError(f"{path}: {what} is not JSON: {error}") from None
    if not isinstance(data, dict):
        raise StorageError(f"{path}: {what} is not a JSON object")
    return data


def _channel(path: Path, data: Mapping[str, Any]) -> Channel:
    missing = [key for key in ("name", "unit", "kind", "meaning") if key not in data]
    if missing:
        raise StorageError(f"{path}: a channel lacks its {', '.join(missing)}: {dict(data)}")
    if data["kind"] not in get_args(Kind):
        raise StorageError(
            f"{path}: channel {data['name']!r} has the unknown kind {data['kind']!r}; "
            f"available: {', '.join(get_args(Kind))}"
        )
    return Channel(str(data["name"]), str(data["unit"]), data["kind"], str(data["meaning"]))


def _integer(path: Path, text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise StorageError(f"{path}: {text!r} is not a whole number") from None


def _check_version(path: Path, version: object) -> None:
    if version != VERSION:
        raise StorageError(
            f"{path}: version {version} of the format, and this helisim reads version {VERSION}"
        )
