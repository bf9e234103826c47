"""Anyone's flight logs as flight records: CSV, Parquet, ULog, ArduPilot DataFlash.

A log is read as it is. What is wrong with it (gaps, missing numbers, clocks that go back) is
refused with the row's number, or repaired where the user asked for it, and every repair is
in the report and in the record's provenance.
"""

from helisim.base.units import UNITS
from helisim.logs.dataflash import DataFlash
from helisim.logs.mapping import REPAIRS, Clock, Column, Layout, Map
from helisim.logs.read import read_log, read_logs, screen
from helisim.logs.report import Log, LogFinding, LogReport

__all__ = [
    "REPAIRS",
    "UNITS",
    "Clock",
    "Column",
    "DataFlash",
    "Layout",
    "Log",
    "LogFinding",
    "LogReport",
    "Map",
    "read_log",
    "read_logs",
    "screen",
]
