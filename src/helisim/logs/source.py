"""An opened log of any format: columns of numbers, and the clocks that they were sampled by."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from hashlib import blake2b
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, RecordError, StorageError
from helisim.base.files import file_size, pieces
from helisim.base.text import shown
from helisim.base.units import DATES, TIME_UNITS, is_unit, time_unit
from helisim.logs.mapping import TIME_NAMES, Clock, find_column, split_heading
from helisim.logs.report import LogFinding

MAX_COLUMNS = 20_000


def place(path: Path, counts: str, row: int, column: str | None = None) -> str:
    """Return where something is, for a message."""
    return f"{path}, {counts} {row}" + ("" if column is None else f", column {column!r}")


def file_digest(path: Path) -> str:
    """Return a file's digest. Raises StorageError, also for one that is empty or too large."""
    if not file_size(path):
        raise StorageError(f"{path}: the file is empty")
    total = blake2b(digest_size=16)
    for data in pieces(path):
        total.update(data)
    return total.hexdigest()


class Source:
    """An opened log. Columns that were sampled together share a clock.

    Attributes:
        path: the file.
        format: such as "CSV".
        counts: what rows are counted in: "line" of the file from 1, or "row" from 0.
        names: of the columns, without control characters.
        findings: what the format's reader noticed.
    """

    format = ""
    counts = "row"

    def __init__(
        self, path: Path, names: Sequence[str], findings: Sequence[LogFinding] = ()
    ) -> None:
        self.path, self.findings = path, list(findings)
        self.names: tuple[str, ...] = tuple(shown(name, 1000) for name in names)
        if len(self.names) > MAX_COLUMNS:
            raise StorageError(f"{path}: {len(self.names)} columns, at most {MAX_COLUMNS} are read")

    def stated_unit(self, name: str) -> str | None:
        """Return the unit that the log states for a column, if it is a known one."""
        unit = self._unit(name)
        return unit if unit is not None and is_unit(unit) else None

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return a column, (n_time,), NaN where it has no number.

        Raises:
            StorageError: the column holds something else.
            RecordError: a number is infinite.
        """
        values = self._numbers(name)
        infinite = np.flatnonzero(np.isinf(values))
        if infinite.size:
            row = int(self.rows(self.clock(name))[infinite[0]])
            where = place(self.path, self.counts, row, name)
            raise RecordError(f"{where}: {values[infinite[0]]} is not finite")
        return values

    def clock(self, name: str) -> str:
        """Return the name of a column's clock."""
        return "time"

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the row number of each sample of a clock, (n_time,)."""
        raise NotImplementedError

    def stamps(self, clock: str, time: Clock | None) -> tuple[NDArray[np.float64], str, str]:
        """Return seconds since the log's first stamp (n_time,), that stamp, and the column."""
        if time is not None and time.rate is not None:
            return np.arange(self.rows(clock).size) / time.rate, "0", f"{time.rate:g} Hz"
        name, unit = self._time_column(time)
        seconds, origin = self._seconds(name, unit)
        return seconds, shown(origin, 40), name

    def _unit(self, name: str) -> str | None:
        return split_heading(name)[1]

    def _numbers(self, name: str) -> NDArray[np.float64]:
        raise NotImplementedError

    def _seconds(self, name: str, unit: str) -> tuple[NDArray[np.float64], str]:
        """Return a column of times as seconds since the first (n_time,), and the first."""
        raise NotImplementedError

    def _time_column(self, time: Clock | None) -> tuple[str, str]:
        """Return the column of times and its unit, stated by the map or by the heading."""
        if time is None or time.column is None:
            likely = [name for name in self.names if split_heading(name)[0].lower() in TIME_NAMES]
            if len(likely) != 1:
                said = f"several columns may be time: {likely}" if likely else "no column is time"
                names = ", ".join(map(repr, self.names[:60]))
                text = (
                    f"{self.path}: {said}; say which, and its unit, or the rate; columns: {names}"
                )
                raise InputError(text, remedy="time")
            name, given = likely[0], None
        else:
            try:
                name, given = find_column(time.column, self.names, "column of time"), time.unit
            except InputError as error:
                raise InputError(f"{self.path}: {error}") from None
        bare, bracketed = split_heading(name)
        ending = bare.lower().rpartition("_")[2]
        usual = "us" if bare.lower() == "timeus" else ending if ending in TIME_UNITS else None
        stated = given or bracketed or usual
        if stated is None:
            text = (
                f"{self.path}: the heading of the time {name!r} says no unit; give one of "
                f"{', '.join((*TIME_UNITS, DATES))}"
            )
            raise InputError(text, remedy="time")
        try:
            return name, time_unit(stated)
        except InputError as error:
            raise InputError(f"{self.path}, column {name!r}: {error}") from None


class Topics(Source):
    """Messages by topic, each with its own clock in microseconds. Rows count a topic's messages.

    Args:
        path: the file.
        format: such as "ULog".
        topics: column -> its topic.
        read: returns a column, (n_time,).
        clock: returns the stamps of a topic, (n_time,) us.
        first: the log's first stamp, us.
        units: column -> unit that the log states.
        findings: what the format's reader noticed.
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
    ) -> None:
        super().__init__(path, tuple(topics), findings)
        if not topics:
            raise StorageError(f"{path}: no messages with numbers in it")
        self.format, self._topics, self._units = format, dict(topics), dict(units)
        self._read, self._clock, self._first = read, clock, first

    def with_column(
        self, name: str, topic: str, values: Callable[[], NDArray[np.float64]], unit: str
    ) -> "Topics":
        """Return the log with one more column of a topic; `values` returns it, (n_row,)."""
        found, read = copy(self), self._read
        found.names += (name,)
        found._topics, found._units = self._topics | {name: topic}, self._units | {name: unit}
        found._read = lambda wanted: values() if wanted == name else read(wanted)
        return found

    def clock(self, name: str) -> str:
        """Return the column's topic."""
        return self._topics[name]

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the numbers of a topic's messages, (n_time,)."""
        return np.arange(self._clock(clock).size)

    def stamps(self, clock: str, time: Clock | None) -> tuple[NDArray[np.float64], str, str]:
        """Return seconds since the log's first stamp (n_time,), that stamp, and the clock."""
        if time is not None:
            raise InputError(f"{self.path}: {self.format} has its own clock; leave out [time]")
        seconds = 1e-6 * (self._clock(clock) - self._first)
        return seconds, f"{self._first:.0f} us", f"{clock}'s clock"

    def _unit(self, name: str) -> str | None:
        return self._units.get(name)

    def _numbers(self, name: str) -> NDArray[np.float64]:
        return np.asarray(self._read(name), np.float64)
