"""A DataFlash log as columns of numbers, for the reader of anyone's logs."""

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, StorageError
from helisim.base.unit_names import is_unit
from helisim.logs.dataflash.log import DataFlash
from helisim.logs.mapping import Clock
from helisim.logs.report import LogFinding
from helisim.logs.source import MAX_COLUMNS, check_no_infinity


class DataFlashLog:
    """The messages with a clock, a column each field with numbers.

    A column is called `RATE.R`; of a second sensor's messages, `IMU[1].GyrX`. Each type has its own
    clock, which counts microseconds. Rows are a type's messages, from 0.

    Args:
        log: the file.

    Attributes:
        log: the file.
    """

    format = "DataFlash"
    counts = "row"

    def __init__(self, log: DataFlash) -> None:
        self.path, self.log = log.path, log
        self.findings = _findings(log)
        self._columns = {
            f"{topic}.{field}": (topic, name, instance, field)
            for name in log.types
            if name in log.first_stamps
            for instance in log.instances(name)
            for topic in [name if instance == 0 else f"{name}[{instance}]"]
            for field in log.number_fields(name)
        }
        self.names: tuple[str, ...] = tuple(self._columns)
        if not self.names:
            raise StorageError(f"{log.path}: no messages with numbers in it")
        if len(self.names) > MAX_COLUMNS:
            raise StorageError(
                f"{log.path}: {len(self.names)} columns, at most {MAX_COLUMNS} are read"
            )
        self._times: dict[str, NDArray[np.float64]] = {}
        self._topics = {topic: (name, k) for topic, name, k, _ in self._columns.values()}

    def stated_unit(self, name: str) -> str | None:
        """Return the unit that the log states for a column, if it is a known one."""
        _, kind, _, field = self._columns[name]
        unit = self.log.units(kind).get(field)
        return unit if unit is not None and is_unit(unit) else None

    def clock(self, name: str) -> str:
        """Return the column's topic."""
        return self._columns[name][0]

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the numbers of a topic's messages, (n_time,)."""
        return np.arange(self._time(clock).size)

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return a column, (n_time,). Raises RecordError if a number is infinite."""
        _, kind, instance, field = self._columns[name]
        values = np.asarray(self.log.columns(kind, instance)[field], np.float64)
        check_no_infinity(self.path, self.counts, name, values)
        return values

    def stamps(self, clock: str, time: Clock | None) -> tuple[NDArray[np.float64], str, str]:
        """Return seconds (n_time,) since the log's first stamp, that stamp, and the column."""
        if time is not None:
            raise InputError(f"{self.path}: {self.format} has its own clock; leave out [time]")
        first = round(1e6 * min(self.log.first_stamps.values()))
        stamps = np.rint(1e6 * self._time(clock))
        return 1e-6 * (stamps - first), f"{first} us", f"{clock}'s clock"

    def _time(self, clock: str) -> NDArray[np.float64]:
        """Return when a topic's messages were written, (n_time,) s."""
        if clock not in self._times:
            self._times[clock] = self.log.table(*self._topics[clock]).time
        return self._times[clock]


@lru_cache(maxsize=1)
def open_dataflash(path: Path, digest: str) -> DataFlashLog:
    """Return a log; the one that was opened last is kept, as several readings of it follow.

    Args:
        path: the file.
        digest: of its bytes.
    """
    return DataFlashLog(DataFlash(path))


def _findings(log: DataFlash) -> list[LogFinding]:
    found = [LogFinding("format", note) for note in log.notes]
    if log.skipped:
        text = f"{log.skipped} of {log.size} bytes belong to no whole message"
        found.append(LogFinding("corruption", text))
    dropped = _dropped(log)
    if dropped:
        text = (
            f"the autopilot's logger dropped {dropped} messages: log fewer (LOG_BITMASK), or with "
            "a larger buffer (LOG_FILE_BUFSIZE)"
        )
        found.append(LogFinding("dropped", text, dropped))
    return found


def _dropped(log: DataFlash) -> int:
    """Return how many messages the autopilot says that its logger dropped."""
    if "DSF" not in log or "Dp" not in log.number_fields("DSF"):
        return 0
    counted = log.columns("DSF")["Dp"]
    return int(np.nanmax(counted)) if np.isfinite(counted).any() else 0
