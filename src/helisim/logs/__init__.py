"""Flight logs by any program as flight records: CSV, Parquet, ULog, DataFlash, Blackbox."""

from helisim.base.units import UNITS
from helisim.logs.blackbox import Blackbox, read_dump
from helisim.logs.dataflash import DataFlash
from helisim.logs.mapping import REPAIRS, Clock, Column, Layout, Map
from helisim.logs.read import read_log, read_logs, screen
from helisim.logs.report import Log, LogFinding, LogReport

__all__ = [
    "REPAIRS",
    "UNITS",
    "Blackbox",
    "Clock",
    "Column",
    "DataFlash",
    "Layout",
    "Log",
    "LogFinding",
    "LogReport",
    "Map",
    "read_dump",
    "read_log",
    "read_logs",
    "screen",
]
