"""ArduPilot's logs, in DataFlash's binary format: read with NumPy, and only what is asked for.

A message is a few bytes whose layout the log itself says (FMT), with units and multipliers (FMTU,
UNIT, MULT): `layout`. `scan` finds them all, also between bytes that are none; `table` reads
columns of one type; `log` is what the reader of a log sees.
"""

from helisim.logs.dataflash.log import DataFlash, LogText
from helisim.logs.dataflash.table import Table

__all__ = ["DataFlash", "LogText", "Table"]
