"""Reads PX4's logs, ULog, by its project's own reader.

A column is called `topic.field`, such as `vehicle_angular_velocity.xyz[0]`; a second instance is
`topic[1].field`. PX4 logs attitude as a quaternion; its Euler angles are added as
`vehicle_attitude.roll`, `pitch` and `yaw`.
"""

import contextlib
import io
from collections.abc import Mapping
from functools import lru_cache
from importlib import import_module
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import StorageError
from helisim.base.files import file_size
from helisim.base.text import shown
from helisim.logs.report import LogFinding
from helisim.logs.source import Topics

ULOG_MAGIC = b"ULog\x01\x12\x35"
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


@lru_cache(maxsize=1)
def open_ulog(path: Path, digest: str) -> Topics:
    """Return a log; the last one is cached, as several readings of it follow.

    Args:
        path: the file.
        digest: of its bytes.

    Raises:
        StorageError: it is damaged, or pyulog isn't installed.
    """
    try:
        pyulog = import_module("pyulog")
    except ImportError:
        raise StorageError(
            f"{path}: reading it needs pyulog, which isn't installed: pip install helisim[logs]"
        ) from None
    said = io.StringIO()
    quiet = contextlib.redirect_stdout(said), np.errstate(all="ignore")
    try:
        with quiet[0], quiet[1], _Finite(path) as file:
            log = pyulog.ULog(file)
    except Exception as error:  # a foreign reader of damaged bytes may raise anything
        reason = shown(str(error), 200) or type(error).__name__
        raise StorageError(f"{path}: not ULog, truncated or corrupt: {reason}") from None
    lines = [line.strip() for line in said.getvalue().splitlines() if line.strip()]
    notes = [f"the reader says: {shown(line, 200)}" for line in lines[:1]]
    findings = [LogFinding("reader's note", note, count=len(lines)) for note in notes]
    if log.file_corruption:
        findings.append(LogFinding("corruption", "the log is damaged: messages were lost"))
    if log.dropouts:
        lost = sum(dropout.duration for dropout in log.dropouts)
        text = f"{len(log.dropouts)} dropouts of the logger, {lost} ms in all"
        findings.append(LogFinding("dropout", text, count=len(log.dropouts)))
    columns: dict[str, NDArray] = {}
    topics, clocks, units = {}, {}, {}
    for one in log.data_list:
        topic = shown(one.name if one.multi_id == 0 else f"{one.name}[{one.multi_id}]")
        stamps = one.data.get("timestamp")
        if stamps is None or not len(stamps) or topic in clocks:
            continue
        clocks[topic] = stamps.astype(np.float64)
        fields = {shown(name): one for name, one in one.data.items() if one.dtype.kind in "iufb"}
        euler = _euler(fields) if topic.startswith("vehicle_attitude") else {}
        fields = {f"{topic}.{k}": v for k, v in (fields | euler).items() if k != "timestamp"}
        columns |= fields
        topics |= dict.fromkeys(fields, topic)
        units |= {f"{topic}.{name}": "rad" for name in euler}
    first = min((float(stamps[0]) for stamps in clocks.values()), default=0.0)
    read, clock = columns.__getitem__, clocks.__getitem__
    return Topics(path, "ULog", topics, read, clock, first, units, findings)


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
