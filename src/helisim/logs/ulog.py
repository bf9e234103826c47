"""Reads PX4's logs, ULog, by pyulog.

Columns are `topic.field`, such as `vehicle_angular_velocity.xyz[0]`; a second instance is
`topic[1].field`. Euler angles are added as `vehicle_attitude.roll`, `pitch` and `yaw`. Times
count from the first stamp that isn't before the header's, when logging began.
"""

import contextlib
import io
from collections.abc import Mapping
from functools import lru_cache
from importlib import import_module
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import StorageError, shown
from helisim.base.files import file_size
from helisim.logs.report import LogFinding
from helisim.logs.source import Topics

ULOG_MAGIC = b"ULog\x01\x12\x35"
_READS_A_BYTE = 4  # Most reads a byte; a sound log takes less than one


class _Finite(io.BufferedReader):
    """A file with a limit of reads: pyulog may read a corrupt log for ever."""

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self._reads = iter(range(_READS_A_BYTE * file_size(path) + 1000))

    def read(self, size: int | None = -1) -> bytes:
        if next(self._reads, None) is None:
            raise EOFError("its messages lead round in circles")
        return super().read(size)


@lru_cache(maxsize=1)
def open_ulog(path: Path, digest: str) -> Topics:
    """Return a log, the last one from a cache. Raises StorageError, also without pyulog."""
    try:
        pyulog = import_module("pyulog")
    except ImportError:
        raise StorageError(
            f"{path}: reading it needs pyulog, which isn't installed: pip install -e '.[logs]'"
        ) from None
    silent, quiet = contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore")
    try:
        with silent, quiet, _Finite(path) as file:
            log = pyulog.ULog(file)
    except Exception as error:  # pyulog may raise anything on damaged bytes
        reason = shown(str(error), 200) or type(error).__name__
        raise StorageError(f"{path}: not ULog, truncated or corrupt: {reason}") from None
    count, lost = len(log.dropouts), sum(dropout.duration for dropout in log.dropouts)
    damaged = LogFinding("corruption", "the log is damaged: messages were lost")
    dropouts = LogFinding(
        "dropout", f"{count} dropouts of the logger, {lost} ms in all", count=count
    )
    findings = [*([damaged] if log.file_corruption else ()), *([dropouts] if count else ())]
    columns: dict[str, NDArray] = {}
    topics, clocks, units = {}, {}, {}
    for one in log.data_list:
        topic = shown(f"{one.name}[{one.multi_id}]" if one.multi_id else one.name)
        stamps = one.data.get("timestamp")
        if stamps is None or topic in clocks:
            continue
        # what was published before logging began is logged with it, with a stale or no stamp
        fresh = stamps >= log.start_timestamp
        fresh = fresh if fresh.any() else slice(None)
        clocks[topic] = stamps[fresh].astype(np.float64)
        fields = {shown(k): v[fresh] for k, v in one.data.items() if v.dtype.kind in "iufb"}
        euler = _euler(fields) if topic.startswith("vehicle_attitude") else {}
        fields = {f"{topic}.{k}": v for k, v in (fields | euler).items() if k != "timestamp"}
        columns |= fields
        topics |= dict.fromkeys(fields, topic)
        units |= {f"{topic}.{name}": "rad" for name in euler}
    stamps = [float(one[0]) for one in clocks.values() if one[0] >= log.start_timestamp]
    first = min(stamps or [float(one[0]) for one in clocks.values()], default=0.0)
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
