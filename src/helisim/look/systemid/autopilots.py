"""Tells by their first bytes the logs of autopilots that say themselves what was identified."""

from os import PathLike
from pathlib import Path

from helisim.base.errors import LogError
from helisim.base.files import first_bytes
from helisim.logs.dataflash.layout import SNIFFED, is_dataflash
from helisim.look.systemid.reading import opened_log
from helisim.look.systemid.sweeps import FlownSweep, sweeps


def says_itself(path: str | PathLike[str]) -> bool:
    """Return whether a file is a log of an autopilot that logs what it injects.

    Raises:
        StorageError: it can't be read.
    """
    return is_dataflash(first_bytes(path, SNIFFED))


def own_sweeps(path: Path) -> tuple[FlownSweep, ...]:
    """Return the sweeps that a log says itself were injected, none of any other log.

    Raises:
        StorageError: it can't be read.
    """
    if not says_itself(path):
        return ()
    log = opened_log(path)[0].log
    try:
        return sweeps(log, min(log.first_stamps.values()))
    except LogError:
        return ()
