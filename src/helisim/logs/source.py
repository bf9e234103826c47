"""An opened log of any format: columns of numbers, and the clocks that they were sampled by."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from hashlib import blake2b
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, StorageError, shown
from helisim.base.files import file_size, pieces
from helisim.base.units import is_unit
from helisim.logs.mapping import Clock, Column, split_heading
from helisim.logs.report import Findings, LogFinding


def place(path: Path, counts: str, row: int, column: str | None = None) -> str:
    """Return a place in a log, for a message."""
    return f"{path}, {counts} {row}" + ("" if column is None else f", column {column!r}")


def usual_step(steps: NDArray[np.float64]) -> float:
    """Return the median of steps ahead, (n_step,); 0 without any."""
    ahead = steps[steps > 0.0]
    return float(np.median(ahead)) if ahead.size else 0.0


def file_digest(path: Path) -> str:
    """Return a file's digest. Raises StorageError, also for an empty or too large file."""
    if not file_size(path):
        raise StorageError(f"{path}: the file is empty")
    total = blake2b(digest_size=16)
    for data in pieces(path):
        total.update(data)
    return total.hexdigest()


# Numbers that stand for none, of either sign, where they are twice as large as all others
_CODES = (999.0, 9999.0, 99999.0, 32767.0, 32768.0, 65535.0)


class Source(ABC):
    """An opened log; columns sampled together share a clock, several of which are `Topics`.

    A reader overrides `rows`, `_numbers`, `stamps`. `counts` is "line" from 1 or "row" from 0.
    """

    format = ""
    counts = "row"
    channels: Mapping[str, Column] = MappingProxyType({})
    """Channel -> column, where a format says all by its names."""
    full: Mapping[str, float] = MappingProxyType({})
    """Command of `channels` -> its value at full travel from the middle, SI, where it is known."""

    def __init__(
        self, path: Path, names: Sequence[str], findings: Sequence[LogFinding] = ()
    ) -> None:
        self.path, self.findings = path, Findings(findings)
        self.names: tuple[str, ...] = tuple(shown(name, 1000) for name in names)

    @abstractmethod
    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the row numbers of a clock's samples, (n_time,)."""

    @abstractmethod
    def _numbers(self, name: str) -> NDArray[np.float64]:
        """Return a column, (n_time,), NaN without a number. Raises StorageError."""

    def _unit(self, name: str) -> str | None:
        return split_heading(name)[1]

    def clock(self, name: str) -> str:
        """Return the name of a column's clock."""
        return "time"

    def stated_unit(self, name: str) -> str | None:
        """Return a column's unit by the log, if it is a known one."""
        unit = self._unit(name)
        return unit if unit is not None and is_unit(unit) else None

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return a column, (n_time,), NaN where it has no finite number, or a code for none.

        Raises StorageError.
        """
        values = self._numbers(name)
        known, coded = np.isfinite(values), np.isin(np.abs(values), _CODES)
        most = np.max(np.abs(values), where=known & ~coded, initial=0.0)
        return np.where(known & ~(coded & (np.abs(values) > 2.0 * most)), values, np.nan)

    def row_of(self, clock: str) -> str:
        """Return what a row of a clock's samples is called."""
        return self.counts

    def place(self, clock: str, k: int, column: str | None = None) -> str:
        """Return the place of a clock's sample k, for a message."""
        return place(self.path, self.row_of(clock), int(self.rows(clock)[k]), column)

    @abstractmethod
    def stamps(self, clock: str, time: Clock | None) -> tuple[NDArray[np.float64], str, str]:
        """Return seconds since the log's first stamp (n_time,), that stamp, and the column."""


class Topics(Source):
    """Messages by topic, each with its own clock, stamps in us; rows count a topic's messages.

    `read` returns a column, (n_time,), `clock` a topic's stamps, (n_time,).
    """

    def __init__(
        self,
        path: Path,
        format: str,
        topics: Mapping[str, str],
        read: Callable[[str], NDArray],
        clock: Callable[[str], NDArray[np.float64]],
        first: float,
        units: Mapping[str, str],
        findings: Sequence[LogFinding],
        channels: Mapping[str, Column] = MappingProxyType({}),
    ) -> None:
        super().__init__(path, tuple(topics), findings)
        if not topics:
            raise StorageError(f"{path}: no messages with numbers in it")
        self.format, self._topics, self._units, self.channels = (
            format, dict(topics), dict(units), channels,
        )  # fmt: skip
        self._read, self._clock, self._first = read, clock, first

    def with_column(self, name: str, of: str, made: Callable[[NDArray], NDArray]) -> "Topics":
        """Return the log with one more column, which is made of another one, (n_row,) each."""
        found, read = copy(self), self._read
        found.names, found._topics = (*self.names, name), {**self._topics, name: self._topics[of]}
        found._read = lambda wanted: made(read(of)) if wanted == name else read(wanted)
        return found

    def clock(self, name: str) -> str:
        """Return the column's topic."""
        return self._topics[name]

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the numbers of a topic's messages, (n_time,)."""
        return np.arange(self._clock(clock).size)

    def row_of(self, clock: str) -> str:
        """Return what a row is called: that of a topic."""
        return f"{clock} row"

    def stamps(self, clock: str, time: Clock | None) -> tuple[NDArray[np.float64], str, str]:
        """Return seconds since the log's first stamp (n_time,), that stamp, and the clock."""
        if time is not None:
            raise InputError(f"{self.path}: {self.format} has its own clock; leave out [time]")
        seconds = 1e-6 * (self._clock(clock) - self._first)
        return seconds, f"{self._first:.0f} us", f"{clock}'s clock"

    def _unit(self, name: str) -> str | None:
        return self._units.get(name)

    def _numbers(self, name: str) -> NDArray[np.float64]:
        with np.errstate(invalid="ignore"):  # signalling NaN
            return np.asarray(self._read(name), np.float64)
