"""Reads a log: columns to channels, units to SI, gaps and clocks to records."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.errors import InputError, RecordError, StorageError, UnknownNameError
from helisim.base.files import first_bytes
from helisim.logs.assembly import from_record, from_source
from helisim.logs.dataflash.layout import SNIFFED, is_dataflash
from helisim.logs.dataflash.source import open_dataflash
from helisim.logs.log import Log
from helisim.logs.mapping import Clock, Column, Map, find_column, split_heading
from helisim.logs.parts import Options
from helisim.logs.report import Findings
from helisim.logs.resample import check_rate
from helisim.logs.source import Source, digest, file_digest, read_log_bytes
from helisim.logs.terms import REPAIRS
from helisim.logs.text import TIME_NAMES, TextLog
from helisim.logs.ulog import ULOG_MAGIC, open_ulog
from helisim.records.record import FlightRecord
from helisim.records.storage import read_record

_OURS_CSV = b"# helisim flight record"
_PARQUET_MAGIC = b"PAR1"
_MANY_CLOCKS = 4
"""A log whose columns have more isn't read as a whole: hardly two of its messages are."""


def read_log(
    path: str | Path,
    *,
    channels: Map | Mapping[str, Column | str] | Sequence[str] | None = None,
    time: Clock | str | None = None,
    resample_hz: float | None = None,
    repair: Iterable[str] = (),
    max_gap: float | None = None,
    min_duration: float = 0.0,
    start: float | None = None,
    stop: float | None = None,
) -> Log:
    """Read a flight log by any program.

    What kind of file it is, its first bytes say: a helisim record, CSV, Parquet, ULog (PX4) or
    DataFlash (ArduPilot).

    Args:
        path: the file.
        channels: channel -> column; or names of channels whose columns have the same names
            and state their units, such as "p [deg/s]"; by default all columns that do. A
            helisim record needs none.
        time: the column of times, if the map doesn't say it and it isn't called time.
        resample_hz: a rate for the records. By default every sample stays where it is, but a
            clock that jitters a little (up to 20 % of a step, rms, no step off by half) is
            resampled at its own rate, channels of several clocks at the slowest one's, and the
            report says so.
        repair: what may be done to the log, see `REPAIRS`. Nothing else is done.
        max_gap: the longest time between samples that is no gap, s; by default 4.5 median
            steps.
        min_duration: shorter parts are left out, s, and the report says so.
        start: samples before it are left out, s after the log's first one.
        stop: samples after it are left out, s after the log's first one.

    Raises:
        StorageError: the file can't be read.
        InputError: an option doesn't exist.
        LogError: the log can't be used so: columns or units that don't exist, cells that aren't
            numbers, and what would need a repair that wasn't asked for, all at once.
    """
    path = Path(path)
    options = _options(resample_hz, repair, max_gap, min_duration, (start, stop))
    findings = Findings()
    content = file_digest(path)
    mapped = isinstance(channels, Map | Mapping)
    map_, wanted = _as_map(channels)
    if not mapped and is_ours(path):
        return from_record(path, read_record(path), content, options, wanted)
    if time is not None:
        map_ = replace(map_, time=Clock(time) if isinstance(time, str) else time)
    source = _open(path, map_, "tail" in options.repairs, content)
    if wanted is not None:
        map_ = map_.with_channels(_by_name(source, wanted, map_.channels, findings))
    elif not map_.channels:
        map_ = map_.with_channels(_stated(source))
    ended = _ended(path) if mapped and is_ours(path) else {}
    return from_source(source, map_, content, options, ended, findings)


def open_source(path: str | Path, map_: Map | None = None, *, cut_tail: bool = False) -> Source:
    """Return a file's columns as they are, unmapped and unscreened; a record's too.

    Args:
        path: the file.
        map_: says how a CSV is written; its channels don't matter.
        cut_tail: leave out an incomplete last line.

    Raises:
        StorageError: the file can't be read.
    """
    path = Path(path)
    return _open(path, map_ or Map(), cut_tail, file_digest(path))


def screen(
    record: FlightRecord,
    *,
    channels: Sequence[str] | None = None,
    resample_hz: float | None = None,
    repair: Iterable[str] = (),
    max_gap: float | None = None,
    min_duration: float = 0.0,
) -> Log:
    """Screen and repair a record in memory, as `read_log` does one in a file.

    Args:
        record: to screen; it stays as it is.
        channels: to look at for spikes and frozen runs; all if None.
        resample_hz: as for `read_log`, and so are all others.
        repair: see `REPAIRS`.
        max_gap: s.
        min_duration: s.

    Raises:
        RecordError: the record can't be used without a repair that wasn't asked for.
        InputError: an option doesn't exist.
    """
    options = _options(resample_hz, repair, max_gap, min_duration, (None, None))
    content = digest(record.time.tobytes() + record.values.tobytes())
    wanted = (channels,) if isinstance(channels, str) else channels
    return from_record(Path("record"), record, content, options, wanted)


def check_repairs(names: Iterable[str]) -> None:
    """Raise InputError if a repair doesn't exist, or excludes another."""
    for name in sorted(names):
        if name not in REPAIRS:
            raise UnknownNameError("repair", name, REPAIRS)
    if {"order", "resets"} <= set(names):
        raise InputError("the repairs 'order' and 'resets' exclude each other: choose one")


def _options(
    rate: float | None,
    repair: Iterable[str],
    max_gap: float | None,
    min_duration: float,
    limits: tuple[float | None, float | None],
) -> Options:
    names = frozenset((repair,) if isinstance(repair, str) else repair)
    check_repairs(names)
    if max_gap is not None and not max_gap > 0.0:
        raise InputError(f"max_gap is {max_gap}, expected a time in s")
    if not 0.0 <= min_duration < np.inf:
        raise InputError(f"min_duration is {min_duration}, expected a time in s")
    if "frozen" in names:
        names |= {"gaps"}
    start = -np.inf if limits[0] is None else limits[0]
    stop = np.inf if limits[1] is None else limits[1]
    if not start < stop:
        raise InputError(f"the log's limits are {start:g} and {stop:g} s, expected start < stop")
    rate = None if rate is None else check_rate(rate)
    return Options(rate, names, max_gap, min_duration, (start, stop))


def _as_map(
    channels: Map | Mapping[str, Column | str] | Sequence[str] | None,
) -> tuple[Map, tuple[str, ...] | None]:
    """Return a map, and the names of channels that are to be found by their names."""
    if channels is None:
        return Map(), None
    if isinstance(channels, Map):
        return channels, None
    if isinstance(channels, Mapping):
        columns = {
            name: Column(column) if isinstance(column, str) else column
            for name, column in channels.items()
        }
        return Map(columns), None
    return Map(), (channels,) if isinstance(channels, str) else tuple(channels)


def is_ours(path: Path) -> bool:
    """Return whether a file is a helisim record, which needs no map. Raises StorageError."""
    start = first_bytes(path, 64)
    if start.removeprefix(b"\xef\xbb\xbf").startswith(_OURS_CSV):
        return True
    if not start.startswith(_PARQUET_MAGIC):
        return False
    data = read_log_bytes(path)
    return b"helisim" in data[-(1 << 16) :] and _has_key(data)


def _ended(path: Path) -> dict[str, Any]:
    """Return the mark of a helisim record whose flight was terminated early, or nothing."""
    try:
        provenance = read_record(path).provenance
    except (StorageError, RecordError):
        return {}  # it is read by a map as what it is: anyone's columns
    return {key: provenance[key] for key in ("ended",) if key in provenance}


def _has_key(data: bytes) -> bool:
    from helisim.logs.columnar import ParquetLog  # pyarrow is slow to import

    try:
        return b"helisim" in ParquetLog(Path("."), data).metadata
    except StorageError:
        return False


def _open(path: Path, map_: Map, cut_tail: bool, content: str) -> Source:
    """Open a file whose digest is `content`."""
    start = first_bytes(path, SNIFFED)
    if is_dataflash(start):
        return open_dataflash(path, content)
    if start.startswith(ULOG_MAGIC):
        return open_ulog(path, content)
    data = read_log_bytes(path)
    if data.startswith(_PARQUET_MAGIC):
        from helisim.logs.columnar import ParquetLog

        return ParquetLog(path, data)
    if data.lstrip().startswith(b"{"):
        raise StorageError(
            f"{path}: JSON, which no log is in; helisim identify takes frequency responses that "
            "helisim frf wrote, in place of logs"
        )
    return TextLog(path, data, map_.layout, cut_tail=cut_tail)


def _by_name(
    source: Source, wanted: Sequence[str], mapped: Mapping[str, Column], findings: Findings
) -> dict[str, Column]:
    """Return the columns of the wanted channels that there are; the others are refused."""
    found = {}
    for name in wanted:
        if name in mapped:
            continue
        try:
            found[name] = Column(find_column(name, source.names, "column"))
        except UnknownNameError as error:
            findings.refuse(
                "no such column",
                f"{source.path}: {error}; map the channel to a column (--channel "
                f"{name}=COLUMN:UNIT, or --map FILE.toml); helisim look guesses which",
                option=f"--channel {name}=COLUMN:UNIT",
            )
        except InputError as error:
            findings.refuse_error(source.path, error)
    return found


def _stated(source: Source) -> dict[str, Column]:
    """Return a column for every heading that states a unit."""
    found = {}
    for heading in source.names:
        name = split_heading(heading)[0] if source.counts == "line" else heading
        if name.lower() not in TIME_NAMES and source.stated_unit(heading) and name not in found:
            found[name] = Column(heading)
    if not found:
        raise InputError(
            f"{source.path}: no column states its unit, as 'p [deg/s]' does; say which column is "
            "which channel (--channel NAME=COLUMN:UNIT, or --map FILE.toml)"
        )
    clocks = {source.clock(column.column) for column in found.values()}
    if len(clocks) > _MANY_CLOCKS:
        raise InputError(
            f"{source.path}: an autopilot's log, {len(found)} columns with a unit on {len(clocks)} "
            "clocks; say which column is which channel (--channel NAME=COLUMN:UNIT, or --map "
            "FILE.toml); helisim look guesses which"
        )
    return found
