"""The interface of every kind of log: columns of numbers, and when they were taken."""

import hashlib
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import RecordError, StorageError
from helisim.base.files import file_size, pieces, read_bytes
from helisim.logs.mapping import Clock
from helisim.logs.report import LogFinding

MAX_COLUMNS = 20_000


class Source(Protocol):
    """An opened log. Columns that were sampled together share a clock."""

    path: Path
    format: str
    counts: str
    names: tuple[str, ...]
    findings: list[LogFinding]

    def stated_unit(self, name: str) -> str | None:
        """Return the unit that the log states for a column, if it is one."""
        ...

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return a column, (n_time,), NaN where it has no number. Raises StorageError."""
        ...

    def clock(self, name: str) -> str:
        """Return the name of a column's clock."""
        ...

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the row number of each sample of a clock, (n_time,)."""
        ...

    def stamps(self, clock: str, time: Clock | None) -> tuple[NDArray[np.float64], str, str]:
        """Return seconds since the log's first stamp (n_time,), that stamp, and the column."""
        ...


def place(path: Path, counts: str, row: int, column: str | None = None) -> str:
    """Return where something is, for a message."""
    where = f"{path}, {counts} {row}"
    return where if column is None else f"{where}, column {column!r}"


def check_no_infinity(path: Path, counts: str, name: str, values: NDArray[np.float64]) -> None:
    """Raise RecordError, with the place, if a number of a column, (n_time,), is infinite."""
    infinite = np.flatnonzero(np.isinf(values))
    if infinite.size:
        where = place(path, counts, int(infinite[0]), name)
        raise RecordError(f"{where}: {values[infinite[0]]} is not finite")


def read_log_bytes(path: Path) -> bytes:
    """Return a log's bytes. Raises StorageError, also for one that is empty or too large."""
    data = read_bytes(path)
    if not data:
        raise StorageError(f"{path}: the file is empty")
    return data


def digest(data: bytes) -> str:
    """Return a digest of a file's bytes, 32 hexadecimal digits."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def file_digest(path: Path) -> str:
    """Return a file's digest. Raises StorageError, also for one that is empty or too large."""
    if not file_size(path):
        raise StorageError(f"{path}: the file is empty")
    total = hashlib.blake2b(digest_size=16)
    for data in pieces(path):
        total.update(data)
    return total.hexdigest()
