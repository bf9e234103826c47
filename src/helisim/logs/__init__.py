"""Anyone's flight logs as flight records: CSV, Parquet, ULog, ArduPilot DataFlash.

A log is read as it is. What is wrong with it (gaps, missing numbers, clocks that go back) is
refused with the row's number, or repaired where the user asked for it, and every repair is
in the report and in the record's provenance. Spikes, dead sensors, lost samples and clocks that
go wrong are looked for in every log, and noted.
"""

from helisim.base.unit_names import UNITS
from helisim.logs.dataflash import DataFlash
from helisim.logs.log import Log
from helisim.logs.mapping import Clock, Column, Layout, Map
from helisim.logs.read import read_log, screen
from helisim.logs.report import LogFinding, LogReport
from helisim.logs.several import read_logs
from helisim.logs.terms import REPAIRS

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
