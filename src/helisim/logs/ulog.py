"""Reads PX4's logs, ULog, by its project's own reader.

A column is called `topic.field`, such as `vehicle_angular_velocity.xyz[0]`; a second instance is
`topic[1].field`. Each topic has its own clock, which counts microseconds. Rows are a topic's
messages, from 0. PX4 logs attitude as a quaternion; its Euler angles are added as
`vehicle_attitude.roll`, `pitch` and `yaw`.
"""

import contextlib
import io
from collections.abc import Mapping
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, StorageError
from helisim.base.files import file_size
from helisim.base.unit_names import is_unit
from helisim.logs.mapping import Clock
from helisim.logs.report import LogFinding
from helisim.logs.source import MAX_COLUMNS, check_no_infinity

ULOG_MAGIC = b"ULog\x01\x12\x35"

_MICROSECOND = 1e-6

_READS_A_BYTE = 4
"""A reader that asks more often goes round in circles: a sound log takes less than one."""


class _Finite(io.BufferedReader):
    """A file with a limit of reads: a corrupt log sends pyulog back to where it was."""

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self._reads_left = _READS_A_BYTE * file_size(path) + 1000

    def read(self, size: int | None = -1) -> bytes:
        """Read as a file does. Raises EOFError after too many reads."""
        self._reads_left -= 1
        if self._reads_left < 0:
            raise EOFError("its messages lead round in circles")
        return super().read(size)


class TopicLog:
    """Messages by topic, each with its own clock.

    Args:
        path: the file.
        topics: topic -> field -> (n_time,) numbers as they are stored, of any kind.
        clocks: topic -> (n_time,) microseconds.
        units: column -> unit that the log states.
        findings: what the format's reader noticed.
    """

    format = "ULog"
    counts = "row"

    def __init__(
        self,
        path: Path,
        topics: Mapping[str, Mapping[str, NDArray]],
        clocks: Mapping[str, NDArray],
        units: Mapping[str, str],
        findings: list[LogFinding],
    ) -> None:
        self.path = path
        self.findings = findings
        self._columns = {
            f"{topic}.{field}": (topic, numbers)
            for topic, fields in topics.items()
            for field, numbers in fields.items()
        }
        self._clocks = clocks
        self._units = units
        self.names: tuple[str, ...] = tuple(self._columns)
        if not self.names:
            raise StorageError(f"{path}: no messages with numbers in it")
        if len(self.names) > MAX_COLUMNS:
            raise StorageError(f"{path}: {len(self.names)} columns, at most {MAX_COLUMNS} are read")

    def stated_unit(self, name: str) -> str | None:
        """Return the unit that the log states for a column, if it is a known one."""
        unit = self._units.get(name)
        return unit if unit is not None and is_unit(unit) else None

    def clock(self, name: str) -> str:
        """Return the column's topic."""
        return self._columns[name][0]

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the numbers of a topic's messages, (n_time,)."""
        return np.arange(self._clocks[clock].size)

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return a column, (n_time,). Raises RecordError if a number is infinite."""
        values = self._columns[name][1].astype(np.float64)
        check_no_infinity(self.path, self.counts, name, values)
        return values

    def stamps(self, clock: str, time: Clock | None) -> tuple[NDArray[np.float64], str, str]:
        """Return seconds (n_time,) since the log's first stamp, that stamp, and the column."""
        if time is not None:
            raise InputError(f"{self.path}: {self.format} has its own clock; leave out [time]")
        first = min(float(stamps[0]) for stamps in self._clocks.values() if stamps.size)
        stamps = self._clocks[clock].astype(np.float64)
        return (stamps - first) * _MICROSECOND, f"{first:.0f} us", f"{clock}'s clock"


@lru_cache(maxsize=1)
def open_ulog(path: Path, digest: str) -> TopicLog:
    """Return a log; the one that was opened last is kept, as several readings of it follow.

    Args:
        path: the file.
        digest: of its bytes.

    Raises:
        StorageError: it is damaged, or pyulog isn't installed.
    """
    pyulog = _import("pyulog", path)
    printed = io.StringIO()
    try:
        with (
            contextlib.redirect_stdout(printed),
            np.errstate(all="ignore"),
            _Finite(path) as file,
        ):
            log = pyulog.ULog(file)
    except Exception as error:  # a foreign reader of damaged bytes may raise anything
        raise _unreadable(path, "ULog", error) from None
    findings = _notes(printed.getvalue())
    if log.file_corruption:
        findings.append(LogFinding("corruption", "the log is damaged: messages were lost"))
    if log.dropouts:
        lost = sum(dropout.duration for dropout in log.dropouts)
        text = f"{len(log.dropouts)} dropouts of the logger, {lost} ms in all"
        findings.append(LogFinding("dropout", text, len(log.dropouts)))
    topics: dict[str, dict[str, NDArray]] = {}
    clocks: dict[str, NDArray] = {}
    for one in log.data_list:
        topic = one.name if one.multi_id == 0 else f"{one.name}[{one.multi_id}]"
        stamps = one.data.get("timestamp")
        if stamps is None or not len(stamps) or topic in topics:
            continue
        clocks[topic] = stamps
        topics[topic] = {
            field: values
            for field, values in one.data.items()
            if field != "timestamp" and values.dtype.kind in "iufb"
        }
    units = {}
    for topic, fields in topics.items():
        added = _euler(fields) if topic.startswith("vehicle_attitude") else {}
        fields.update(added)
        units |= {f"{topic}.{name}": "rad" for name in added}
    return TopicLog(path, topics, clocks, units, findings)


def _euler(fields: Mapping[str, NDArray]) -> dict[str, NDArray[np.float64]]:
    """Return roll, pitch and yaw, rad, of PX4's quaternion from body to world, scalar first."""
    if not {"q[0]", "q[1]", "q[2]", "q[3]"} <= set(fields) or "roll" in fields:
        return {}
    w, x, y, z = (fields[f"q[{k}]"].astype(np.float64) for k in range(4))
    return {
        "roll": np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        "pitch": np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
        "yaw": np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    }


def _import(module: str, path: Path) -> Any:
    try:
        return import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise StorageError(
            f"{path}: reading it needs {package}, which isn't installed: pip install helisim[logs]"
        ) from None


def _unreadable(path: Path, format: str, error: Exception) -> StorageError:
    reason = (str(error).splitlines() or [""])[0] or type(error).__name__
    return StorageError(f"{path}: not {format}, truncated or corrupt: {reason}")


def _notes(printed: str) -> list[LogFinding]:
    """Return what a reader printed as one finding, so that it isn't lost."""
    lines = [line.strip() for line in printed.splitlines() if line.strip()]
    if not lines:
        return []
    return [LogFinding("reader's note", f"the reader says: {lines[0][:200]}", len(lines))]
