"""Reads a log: columns to channels, units to SI, screened, repaired, cut, to records."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import (
    HelisimError,
    InputError,
    RecordError,
    StorageError,
    UnknownNameError,
)
from helisim.base.files import first_bytes, read_bytes
from helisim.base.note import Option
from helisim.base.units import is_unit, unit
from helisim.logs.dataflash import is_dataflash, open_dataflash
from helisim.logs.mapping import (
    REPAIRS,
    TIME_NAMES,
    Clock,
    Column,
    Map,
    find_column,
    split_heading,
)
from helisim.logs.report import OURS, Findings, Log, LogReport
from helisim.logs.resample import Cut, check_rate, cut
from helisim.logs.screening import (
    Channels,
    clock_findings,
    implausible,
    note_lost_samples,
    screened,
)
from helisim.logs.source import Source, file_digest, place
from helisim.logs.tables import ParquetLog, TextLog
from helisim.logs.timing import (
    Options,
    Samples,
    Taken,
    check_missing,
    check_unit_of_time,
    common_rate,
    in_order,
    within,
    without_duplicates,
)
from helisim.logs.ulog import ULOG_MAGIC, open_ulog
from helisim.records.record import FlightRecord, made_by, plain
from helisim.records.storage import read_record, read_table

_OURS_CSV = b"# helisim flight record"
_PARQUET_MAGIC = b"PAR1"
_MANY_CLOCKS = 4
"""A log whose columns have more isn't read as a whole: hardly two of its messages are."""
_NO_MOVE = 1e-12
"""Of a channel's largest value: it is constant if it varies by less, which is rounding."""
_WRAP = 1.5 * np.pi  # rad: an angle that jumps by more between two samples went around
_LONG_ENOUGH = 20.0  # s, of a part whose clocks are looked at
_SAY = "say which column is which channel; a look at the log guesses which"


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
    options = reading_options(resample_hz, repair, max_gap, min_duration, start, stop)
    return read_as(Path(path), channels, time, options)


def read_as(
    path: Path,
    channels: Map | Mapping[str, Column | str] | Sequence[str] | None,
    time: Clock | str | None,
    options: Options,
) -> Log:
    """Read a flight log as `read_log` does, by options of `reading_options`."""
    content, findings = file_digest(path), Findings()
    by_name = (channels,) if isinstance(channels, str) else channels
    mapped = isinstance(by_name, Map | Mapping)
    ours = is_ours(path)
    if ours and not mapped:
        return _from_record(path, read_record(path), content, options, by_name)
    map_ = Map.of(by_name if mapped else None, time)
    source = _open(path, map_, "tail" in options.repairs, content)
    if by_name is not None and not mapped:
        map_ = map_.with_channels(_by_name(source, by_name, findings))
    elif not map_.channels:
        map_ = map_.with_channels(_stated(source))
    return from_source(source, map_, content, options, _ended(path) if ours else {}, findings)


def read_logs(
    paths: Iterable[str | Path],
    *,
    channels: Map | Mapping[str, Column | str] | Sequence[str] | None = None,
    wanted: Sequence[str] = (),
    moving: bool = False,
    time: Clock | str | None = None,
    resample_hz: float | None = None,
    repair: Iterable[str] = (),
    max_gap: float | None = None,
    min_duration: float = 0.0,
    start: float | None = None,
    stop: float | None = None,
    use_ended: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> tuple[Log, ...]:
    """Read logs that are to be used together: uniform, with the channels that are wanted.

    Args:
        paths: the files.
        channels: as for `read_log`, and so are all options that aren't below.
        wanted: channels that every log must have.
        moving: whether each of these must move in one of the logs.
        time: see `read_log`.
        resample_hz: Hz.
        repair: see `REPAIRS`.
        max_gap: s.
        min_duration: s.
        start: s.
        stop: s.
        use_ended: take logs of simulated flights that were terminated early, too.
        on_progress: called with each file's name.

    Raises:
        LogError: all that is wrong with any of them; `findings` has it item by item.
        InputError: an option doesn't exist, and nothing else is wrong.
    """
    asked = (repair,) if isinstance(repair, str) else tuple(repair)
    findings, logs, unknown = Findings(), [], None
    try:
        _check_repairs(asked)
    except InputError as error:
        asked, unknown = tuple(name for name in asked if name in REPAIRS), error
    options = reading_options(resample_hz, asked, max_gap, min_duration, start, stop)
    for path in map(Path, paths):
        try:
            log = read_as(path, channels, time, options)
        except HelisimError as error:
            findings.refuse_error(path, error)
            continue
        _check_usable(log, wanted, use_ended, findings)
        log.refuse_uneven(findings)
        logs.append(log)
        if on_progress is not None:
            on_progress(path.name)
    if unknown is not None and not findings.refused:
        raise unknown
    if unknown is not None:
        findings.refuse_error("", unknown)
    for name in wanted if moving else ():
        have = [log for log in logs if name in log.records[0]]
        columns = [record[name] for log in have for record in log.records]
        if columns and all(np.ptp(one) <= _NO_MOVE * np.max(np.abs(one)) for one in columns):
            text = (
                f"{'; '.join(log.where(name) for log in have)}: channel {name!r} is constant, so "
                "nothing can be identified from it; map it to another column, or leave it out"
            )
            findings.refuse("constant", text)
    findings.check()
    return tuple(logs)


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
    options = reading_options(resample_hz, repair, max_gap, min_duration)
    content = record.time.tobytes() + record.values.tobytes()
    wanted = (channels,) if isinstance(channels, str) else channels
    digest = blake2b(content, digest_size=16).hexdigest()
    return _from_record(Path("record"), record, digest, options, wanted)


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


def is_ours(path: Path) -> bool:
    """Return whether a file is a helisim record, which needs no map. Raises StorageError."""
    start = first_bytes(path, 64)
    if not start.startswith(_PARQUET_MAGIC):
        return start.removeprefix(b"\xef\xbb\xbf").startswith(_OURS_CSV)
    data = read_bytes(path)
    try:
        found = b"helisim" in data[-(1 << 16) :] and read_table(path, data).schema.metadata
    except StorageError:
        return False
    return b"helisim" in (found or {})


def _ended(path: Path) -> dict[str, Any]:
    """Return the mark of a helisim record whose flight was terminated early, or nothing."""
    try:
        provenance = read_record(path).provenance
    except (StorageError, RecordError):
        return {}  # it is read by a map as what it is: anyone's columns
    return {key: provenance[key] for key in ("ended",) if key in provenance}


def _open(path: Path, map_: Map, cut_tail: bool, content: str) -> Source:
    """Open a file whose digest is `content`."""
    if is_dataflash(path):
        return open_dataflash(path, content).source
    if first_bytes(path, len(ULOG_MAGIC)) == ULOG_MAGIC:
        return open_ulog(path, content)
    data = read_bytes(path)
    if data.startswith(_PARQUET_MAGIC):
        return ParquetLog(path, data)
    if data.lstrip().startswith(b"{"):
        raise StorageError(
            f"{path}: JSON, which no log is in; helisim identify takes frequency responses that "
            "helisim frf wrote, in place of logs"
        )
    return TextLog(path, data, map_.layout, cut_tail=cut_tail)


def _check_repairs(names: Iterable[str]) -> None:
    for name in sorted(names):
        if name not in REPAIRS:
            raise UnknownNameError("repair", name, REPAIRS)
    if {"order", "resets"} <= set(names):
        raise InputError("the repairs 'order' and 'resets' exclude each other: choose one")


def reading_options(
    rate: float | None,
    repair: Iterable[str] = (),
    max_gap: float | None = None,
    min_duration: float = 0.0,
    start: float | None = None,
    stop: float | None = None,
) -> Options:
    """Return how a log is to be read. Raises InputError."""
    names = frozenset((repair,) if isinstance(repair, str) else repair)
    _check_repairs(names)
    if max_gap is not None and not max_gap > 0.0:
        raise InputError(f"max_gap is {max_gap}, expected a time in s")
    if not 0.0 <= min_duration < np.inf:
        raise InputError(f"min_duration is {min_duration}, expected a time in s")
    limits = -np.inf if start is None else start, np.inf if stop is None else stop
    if not limits[0] < limits[1]:
        raise InputError(
            f"the log's limits are {limits[0]:g} and {limits[1]:g} s, expected start < stop"
        )
    rate = None if rate is None else check_rate(rate)
    names |= {"gaps"} if "frozen" in names else set()
    return Options(rate, names, max_gap, min_duration, limits)


def _by_name(source: Source, wanted: Sequence[str], findings: Findings) -> dict[str, Column]:
    """Return the columns of the wanted channels that there are; the others are refused."""
    found = {}
    for name in wanted:
        try:
            found[name] = Column(find_column(name, source.names, "column"))
        except UnknownNameError as error:
            text = f"{source.path}: {error}; {_SAY}"
            remedy = (Option("channel", f"{name}=COLUMN:UNIT"), Option("map"))
            findings.refuse("no such column", text, remedy=remedy)
        except InputError as error:
            findings.refuse_error(source.path, error)
    return found


def _stated(source: Source) -> dict[str, Column]:
    """Return a column for every heading that states a unit."""
    found: dict[str, Column] = {}
    for heading in source.names:
        name = split_heading(heading)[0] if source.counts == "line" else heading
        if name.lower() not in TIME_NAMES and source.stated_unit(heading):
            found.setdefault(name, Column(heading))
    remedy = (Option("channel", "NAME=COLUMN:UNIT"), Option("map"))
    if not found:
        said = "no column states its unit, as 'p [deg/s]' does"
        raise InputError(f"{source.path}: {said}; {_SAY}", remedy=remedy)
    clocks = {source.clock(column.column) for column in found.values()}
    if len(clocks) > _MANY_CLOCKS:
        said = f"{len(found)} columns with a unit on {len(clocks)} clocks"
        raise InputError(f"{source.path}: an autopilot's log, {said}; {_SAY}", remedy=remedy)
    return found


def _check_usable(log: Log, wanted: Sequence[str], use_ended: bool, findings: Findings) -> None:
    """Refuse a log that lacks a channel, or whose flight was terminated early."""
    path, first = log.report.path, log.records[0]
    for name in wanted:
        if name not in first.names:
            text = f"{path}: has no channel {name!r}; available: {', '.join(first.names)}"
            findings.refuse("no such channel", text)
    if first.ended and not use_ended:
        text = (
            f"{path}: of a flight that was terminated early, because {first.ended}; leave it out, "
            "or use it as it is, with use_ended"
        )
        findings.refuse("ended", text, remedy="use_ended")


def _from_record(
    path: Path, record: FlightRecord, digest: str, options: Options, wanted: Sequence[str] | None
) -> Log:
    """Read a helisim record, which needs no map."""
    findings, first = Findings(), float(record.time[0])
    taken = [
        Taken(
            one,
            one.name,
            Column(one.name, one.unit if is_unit(one.unit) else None, unwrap=False),
            f"as recorded, in {one.unit}",
        )
        for one in record.channels
    ]
    rows = np.arange(len(record))
    samples = Samples(path, "row", rows, record.time, record.values, tuple(taken), "time")
    within_limits = within(
        samples, (first + options.limits[0], first + options.limits[1]), findings
    )
    head = (str(path), OURS, digest, "row", len(record))
    facts, origin = record.provenance, f"{first:.9g} s"
    log = _assembled(head, (within_limits,), (), origin, options, findings, facts, wanted)
    report = log.report
    if report.resampled_hz or report.repairs or report.parts[0].samples != len(record):
        return log
    return replace(log, records=(record,))


def from_source(
    source: Source,
    map_: Map,
    digest: str,
    options: Options,
    facts: Mapping[str, Any],
    findings: Findings,
) -> Log:
    """Read anyone's log by a map whose channels are complete.

    Args:
        source: the opened log.
        map_: which column is which channel.
        digest: of the file.
        options: how it is read.
        facts: for the records' provenance.
        findings: what was found before, refusals too; more is added.

    Raises:
        LogError: all that stops its use.
    """
    try:
        findings += source.findings
        samples, origins = _samples(source, map_, options, findings)
        if not samples:
            source.stamps(source.clock(source.names[0]), map_.time)  # is time wrong, too?
            findings.check()
        used = {*(taken.heading for one in samples for taken in one.taken), *origins}
        unused = tuple(name for name in source.names if name not in used)
        longest = max(one.time.size for one in samples)
        head = (str(source.path), source.format, digest, source.counts, longest)
        made, origin = made_by("log reader", **facts), next(iter(origins.values()))
        return _assembled(head, samples, unused, origin, options, findings, made)
    except HelisimError as error:
        findings.refuse_error(source.path, error)
        findings.check()
        raise


def _samples(
    source: Source, map_: Map, options: Options, findings: Findings
) -> tuple[tuple[Samples, ...], dict[str, str]]:
    """Return the samples of each clock within the limits, and each clock's first stamp.

    Channels that can't be, or have no number, are refused and left out.
    """
    by_clock: dict[str, list[tuple[Taken, NDArray[np.float64]]]] = {}
    for name, column in map_.channels.items():
        try:
            taken, values = _taken(source, name, column)
        except HelisimError as error:
            findings.refuse_error(source.path, error)
            continue
        by_clock.setdefault(source.clock(taken.heading), []).append((taken, values))
    samples, origins = [], {}
    for clock, pairs in by_clock.items():
        stamps, origin, heading = source.stamps(clock, map_.time)
        origins[heading] = origin
        taken, values = tuple(one for one, _ in pairs), np.column_stack([one for _, one in pairs])
        rows = source.rows(clock)
        read = Samples(source.path, source.counts, rows, stamps, values, taken, heading)
        if map_.time is None or map_.time.rate is None:
            check_unit_of_time(read, findings)
        read = within(read, options.limits, findings)
        empty = np.all(np.isnan(read.values), axis=0)
        for k in np.flatnonzero(empty):
            findings.refuse("no number", read.empty(taken[k].heading))
        samples += [read.pick(~empty)] if not empty.all() else []
    return tuple(samples), origins


def _taken(source: Source, name: str, column: Column) -> tuple[Taken, NDArray[np.float64]]:
    """Return a column as a channel, and its values in SI, NaN where there is no number."""
    heading = find_column(column.column, source.names, f"column of channel {name!r}")
    stated = source.stated_unit(heading)
    channel, factor = column.converts(name, stated)
    raw, given = source.numbers(heading), column.unit or stated
    with np.errstate(over="ignore", invalid="ignore"):
        values = factor * (raw - (0.0 if column.trim is None else column.trim))
    wild = np.flatnonzero(np.isinf(values))
    if wild.size:
        row = int(source.rows(source.clock(heading))[wild[0]])
        where = place(source.path, source.counts, row, heading)
        raise RecordError(f"{where}: {raw[wild[0]]:g} is too large for its unit")
    number = f"{heading!r}" if column.trim is None else f"({heading!r} - {column.trim:g})"
    number = number if column.range is None else f"{number} / {column.range:g}"
    computed = f"{'-' if column.sign < 0 else ''}{number} [{given}] in {channel.unit}"
    known = unit(given).name if given and column.range is None else given
    return Taken(channel, heading, replace(column, column=heading, unit=known), computed), values


def _assembled(
    head: tuple[str, str, str, str, int],
    samples: tuple[Samples, ...],
    unused: tuple[str, ...],
    origin: str,
    options: Options,
    findings: Findings,
    provenance: Mapping[str, Any],
    wanted: Sequence[str] | None = None,
) -> Log:
    """Return the log of samples by their clocks: tidied, screened, cut, resampled."""
    taken = {one.channel.name: one for clock in samples for one in clock.taken}
    stretches = [
        tuple(screened(_unwrapped(one, findings), options, findings, wanted) for one in stretch)
        for stretch in _tidied(samples, options, findings)
    ]
    if options.rate is None:
        options = options._replace(rate=common_rate(stretches, options, findings))
    every = [one for stretch in stretches for one in stretch]
    for one in every:
        note_lost_samples(one, options, findings)
    made = [cut(stretch, options, findings) for stretch in stretches]
    parts = [part for found, _ in made for part in found]
    findings.check()
    _check_uniform_parts(parts, taken, samples[0].clock, findings)
    steps = np.concatenate([*(np.diff(one.time) for one in every), np.zeros(0)])
    steps = steps if steps.size else np.zeros(1)
    report = LogReport(
        *head,
        columns={name: one.computed for name, one in taken.items()},
        unused=unused,
        origin=origin,
        step=(float(np.min(steps)), float(np.median(steps)), float(np.max(steps))),
        findings=tuple(findings),
        resampled_hz=options.rate,
        passband_hz=next((band for _, band in made if band is not None), None),
        parts=tuple(one.part for one in parts),
    )
    if not parts:
        reasons = "; ".join(finding.text for finding in findings) or "no samples"
        raise RecordError(f"{head[0]}, {reasons}; nothing is left of it")
    shared, headings = plain({**provenance, "log": report.to_dict()}), [*taken.values()]
    channels, records = tuple(one.channel for one in headings), []
    for k, (time, values, part) in enumerate(parts):
        rows = f"{head[3]}s {part.first_row} to {part.last_row}"
        bad = np.flatnonzero(~np.all(np.isfinite(values), axis=0))
        if bad.size:
            where = f"{head[0]}, column {headings[bad[0]].heading!r}, {rows}"
            raise RecordError(f"{where}: too large to interpolate")
        try:
            records.append(FlightRecord(time, values, channels, shared.extended(part=k)))
        except RecordError as error:
            raise RecordError(f"{head[0]}, {rows}: {error}") from None
    return Log(tuple(records), report, {name: one.heading for name, one in taken.items()})


def _tidied(
    samples: tuple[Samples, ...], options: Options, findings: Findings
) -> list[tuple[Samples, ...]]:
    """Return stretches of all clocks, in order and without duplicates."""
    in_time = [in_order(one, options, findings) for one in samples]
    if len(samples) > 1 and any(len(stretches) > 1 for stretches in in_time):
        raise RecordError(
            f"{samples[0].path}: its channels have {len(samples)} clocks and one was reset, so "
            "they can't be matched after it: cut the log there, or map channels of one topic"
        )
    found = []
    for stretch in zip(*in_time):
        found.append(tuple(without_duplicates(one, options, findings) for one in stretch))
        for one in found[-1]:
            check_missing(one, options, findings)
    return found


def _unwrapped(samples: Samples, findings: Findings) -> Samples:
    """Return the samples with angles that went around made continuous."""
    values = samples.values.copy()
    for k, (channel, heading, column, _) in enumerate(samples.taken):
        known = np.flatnonzero(np.isfinite(values[:, k]))
        turns = np.flatnonzero(np.abs(np.diff(values[known, k])) > _WRAP)
        if turns.size and (channel.unit == "rad" if column.unwrap is None else column.unwrap):
            values[known, k] = np.unwrap(values[known, k])
            rows = tuple(samples.rows[known[turns + 1]].tolist())
            text = (
                f"column {heading!r}: goes around {turns.size} times, the first in "
                f"{samples.counts} {rows[0]}; made continuous"
            )
            findings.note("angle wraps", text, turns.size, rows, repaired=True)
    return replace(samples, values=values)


def _check_uniform_parts(
    parts: Sequence[Cut], taken: Mapping[str, Taken], clock: str, findings: Findings
) -> None:
    """Note wrong clocks of long uniform parts, and what the longest shows can't be as declared."""
    uniform = [(o, dict(zip(taken, o.values.T))) for o in parts if o.part.uneven is None]
    for one, columns in uniform:
        if one.part.duration >= _LONG_ENOUGH:
            findings += clock_findings(one.time, columns)
    if uniform:
        one, columns = max(uniform, key=lambda pair: pair[0].part.duration)
        step = one.part.duration / (one.time.size - 1)
        declared = {name: took.column for name, took in taken.items() if took.column.unit}
        findings += implausible(Channels(step, columns, declared, clock))
