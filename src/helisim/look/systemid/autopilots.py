"""Tells by their first bytes the logs of autopilots that say themselves what was identified."""

from os import PathLike

from helisim.records.files import first_bytes
from helisim.records.logs.dataflash.layout import SNIFFED, is_dataflash


def says_itself(path: str | PathLike[str]) -> bool:
    """Return whether a file is a log of an autopilot that logs what it injects.

    Raises:
        StorageError: it can't be read.
    """
    return is_dataflash(first_bytes(path, SNIFFED))
