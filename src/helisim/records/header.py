"""The header of a record in both formats: version, provenance, channels."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import StorageError
from helisim.records.channels import Channel, Kind

FORMAT = "flight record"
VERSION = 1
"""The version of both layouts; it rises when older code can't read the new files."""

TIME = Channel("time", "s", "OTHER", "time since the start of the record")

MAX_NUMBERS = 1 << 28
"""Numbers of a record, at most: 2 GiB. A small file can claim many more."""


@dataclass(frozen=True, eq=False)
class Contents:
    """What a file holds, before the record checks it: time is the first column."""

    columns: NDArray[np.float64]
    channels: tuple[Channel, ...]
    provenance: dict[str, Any]


def one_line(data: Mapping[str, Any]) -> str:
    """Return JSON that is the same for equal data, whatever the order of the keys."""
    return json.dumps(data, sort_keys=True, ensure_ascii=False, allow_nan=False)


def read_channel(path: Path, data: Mapping[str, Any]) -> Channel:
    """Return a channel from plain data. Raises StorageError."""
    missing = [key for key in ("name", "unit", "kind", "meaning") if key not in data]
    if missing:
        raise StorageError(f"{path}: a channel lacks its {', '.join(missing)}: {dict(data)}")
    if data["kind"] not in get_args(Kind):
        raise StorageError(
            f"{path}: channel {data['name']!r} has the unknown kind {data['kind']!r}; "
            f"available: {', '.join(get_args(Kind))}"
        )
    return Channel(str(data["name"]), str(data["unit"]), data["kind"], str(data["meaning"]))


def check_version(path: Path, version: object) -> None:
    """Raise StorageError unless this helisim reads that version of the format."""
    if version != VERSION:
        raise StorageError(
            f"{path}: version {version} of the format, and this helisim reads version {VERSION}"
        )
