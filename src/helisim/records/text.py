"""Reads and writes records as CSV.

Comment lines, then a header of `name [unit]` and one row a sample::

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
from dataclasses import asdict
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import RecordError, StorageError
from helisim.base.files import parse_object, read_text
from helisim.records import header
from helisim.records.channels import Channel
from helisim.records.record import FlightRecord

_TITLE = f"# helisim {header.FORMAT}, version "


def write_csv(record: FlightRecord, path: Path) -> None:
    """Write a record. Raises OSError."""
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"{_TITLE}{header.VERSION}\n")
        file.write(f"# rows: {len(record)}\n")
        file.write(f"# provenance: {header.one_line(dict(record.provenance))}\n")
        for channel in record.channels:
            file.write(f"# channel: {json.dumps(asdict(channel), ensure_ascii=False)}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([_heading(channel) for channel in (header.TIME, *record.channels)])
        # csv writes a float by its repr, which reads back as the same double
        writer.writerows(np.column_stack([record.time, record.values]).tolist())


def read_csv(path: Path) -> header.Contents:
    """Read what `write_csv` wrote. Raises StorageError, or RecordError for NaN."""
    text = read_text(path)
    comments, body = _split_comments(text)
    if not comments or not comments[0].startswith(_TITLE):
        raise StorageError(
            f"{path}: not a helisim flight record: line 1 must be '{_TITLE}{header.VERSION}'"
        )
    header.check_version(path, _integer(path, comments[0].removeprefix(_TITLE)))
    rows = _integer(path, _comment(path, comments, "rows"))
    provenance = parse_object(_comment(path, comments, "provenance"), f"{path}: '# provenance:'")
    channels = tuple(
        header.read_channel(path, parse_object(text, f"{path}: '# channel:'"))
        for text in _all(comments, "channel")
    )
    columns = _csv_columns(path, body, channels, first_line=len(comments) + 1)
    if len(columns) != rows or not text.endswith("\n"):
        raise StorageError(
            f"{path}: truncated: {len(columns)} rows, and its line '# rows:' says {rows} "
            "(if it was cut on purpose, correct that line)"
        )
    return header.Contents(columns, channels, provenance)


def _csv_columns(
    path: Path, body: str, channels: tuple[Channel, ...], *, first_line: int
) -> NDArray[np.float64]:
    """Return the numbers below the header as (n_time, 1 + n_channel)."""
    expected = [_heading(channel) for channel in (header.TIME, *channels)]
    reader = csv.reader(io.StringIO(body, newline=""))
    table: list[list[float]] = []
    try:
        headings = next(reader, [])
        if headings != expected:
            raise StorageError(f"{path}, line {first_line}: {_difference(headings, expected)}")
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


def _difference(headings: list[str], expected: list[str]) -> str:
    missing = [name for name in expected if name not in headings]
    extra = [name for name in headings if name not in expected]
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


def _integer(path: Path, text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise StorageError(f"{path}: {text!r} is not a whole number") from None
