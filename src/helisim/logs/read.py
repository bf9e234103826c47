"""Reads a log into records: columns to channels, units to SI, screening, repairs, cuts."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError, InputError, RecordError
from helisim.base.files import first_bytes, read_bytes
from helisim.base.note import Option
from helisim.base.settings import FrozenMap
from helisim.base.units import unit
from helisim.logs.blackbox import is_blackbox, open_blackbox
from helisim.logs.dataflash import is_dataflash, open_dataflash
from helisim.logs.mapping import (
    LOOK,
    TIME_NAMES,
    Clock,
    Column,
    Map,
    find_column,
    own_column,
    split_heading,
)
from helisim.logs.report import OURS, Findings, Log, LogReport
from helisim.logs.resample import cut
from helisim.logs.screening import Channels, implausible, note_lost_samples, screened
from helisim.logs.source import Source, file_digest
from helisim.logs.tables import ARRAYS, ArrayLog, ParquetLog, TextLog
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
from helisim.records.missing import told
from helisim.records.record import FlightRecord, made_by, plain
from helisim.records.storage import read_record, read_table

_OURS_CSV = b"# helisim flight record"
_PARQUET_MAGIC = b"PAR1"
_MANY_CLOCKS = 4  # Clocks above which a log isn't read as a whole
_WRAP = 1.5 * np.pi  # rad between two samples, from which an angle went around


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
    """Read a log: helisim record, CSV, Parquet, .npy, .mat, ULog, sdlog2, DataFlash, Blackbox.

    `channels` is channel -> column, or columns that state units ("p [deg/s]"), by default all such,
    and of Blackbox the channels that its fields are;
    `time` names the column of times if they don't. `resample_hz` is the records' rate: by default a
    clock with small jitter gets its own, several clocks the slowest one's, others stay as they are.
    `repair` is of `REPAIRS`. `max_gap`, s, is the longest step that is no gap, by default 4.5
    median steps; parts shorter than `min_duration`, s, are left out; `start` and `stop` are s after
    the first sample. Raises StorageError, InputError for an option, LogError with all that stops
    the use.
    """
    options = Options(resample_hz, repair, max_gap, min_duration, start, stop)
    return read_as(Path(path), channels, time, options)


def read_as(
    path: Path,
    channels: Map | Mapping[str, Column | str] | Sequence[str] | None,
    time: Clock | str | None,
    options: Options,
) -> Log:
    """Read a flight log as `read_log` does."""
    content, map_ = file_digest(path), Map.of(channels, time)
    if not isinstance(channels, Map | Mapping) and is_ours(path):
        names = None if channels is None else tuple(map_.channels)
        return _from_record(path, read_record(path), content, options, names)
    source = _open(path, map_, content)
    if not map_.channels or (source.channels and not isinstance(channels, Map | Mapping)):
        map_ = map_.with_channels(source.channels or _stated(source))
    return from_source(source, map_, content, options)


def read_logs(
    paths: Iterable[str | Path],
    *,
    channels: Map | Mapping[str, Column | str] | Sequence[str] | None = None,
    wanted: Sequence[str] = (),
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
    """Read logs that are to be used together: uniform, each with the channels `wanted`.

    `use_ended` takes flights that were terminated early, too; `on_progress` is told the files'
    names. Raises LogError, InputError.
    """
    findings, logs = Findings(), []
    options = Options(resample_hz, repair, max_gap, min_duration, start, stop)
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
    """Screen and repair a copy of a record, with the options of `read_log`.

    `channels`, all if None, are searched for spikes and frozen runs. Raises RecordError,
    InputError.
    """
    options = Options(resample_hz, repair, max_gap, min_duration)
    content = record.time.tobytes() + record.values.tobytes()
    wanted = None if channels is None else tuple(Map.of(channels).channels)
    digest = blake2b(content, digest_size=16).hexdigest()
    return _from_record(Path("record"), record, digest, options, wanted)


def open_source(path: str | Path, map_: Map | None = None) -> Source:
    """Return a file's columns, unmapped; `map_` tells how a CSV is written. Raises StorageError."""
    path = Path(path)
    return _open(path, map_ or Map(), file_digest(path))


def is_ours(path: Path) -> bool:
    """Return whether a file is a helisim record, which needs no map. Raises StorageError."""
    start = first_bytes(path, 64)
    if not start.startswith(_PARQUET_MAGIC):
        return start.removeprefix(b"\xef\xbb\xbf").startswith(_OURS_CSV)
    return b"helisim" in (read_table(path, read_bytes(path)).schema.metadata or {})


def _open(path: Path, map_: Map, content: str) -> Source:
    if first_bytes(path, len(ULOG_MAGIC)) == ULOG_MAGIC:
        return open_ulog(path, content)
    if is_blackbox(path):
        return open_blackbox(path, content, map_.file.log).source
    if is_dataflash(path):
        return open_dataflash(path, content).source
    data = read_bytes(path)
    if data.startswith(_PARQUET_MAGIC):
        return ParquetLog(path, data)
    if data.startswith(ARRAYS):
        return ArrayLog(path, data, map_.file.names, map_.time and map_.time.column)
    return TextLog(path, data, map_.file)


def _stated(source: Source) -> dict[str, Column]:
    found: dict[str, Column] = {}
    for heading in source.names:
        name = split_heading(heading)[0] if source.counts == "line" else heading
        if name.lower() not in TIME_NAMES and source.stated_unit(heading):
            found.setdefault(name, Column(heading))
    clocks = {source.clock(column.column) for column in found.values()}
    if not found or len(clocks) > _MANY_CLOCKS:
        said = (
            f"{len(found)} columns state their unit, as 'p [deg/s]' does, on {len(clocks)} clocks"
        )
        remedy = (Option("channel", "NAME=COLUMN:UNIT"), Option("map"))
        raise InputError(f"{source.path}: {said}; {LOOK}", remedy=remedy)
    return found


def _check_usable(log: Log, wanted: Sequence[str], use_ended: bool, findings: Findings) -> None:
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
    findings, first = Findings(), float(record.time[0])
    taken = [
        Taken(one, one.name, own_column(one), f"as recorded, in {one.unit}")
        for one in record.channels
    ]
    rows = np.arange(len(record))
    samples = Samples(path, "row", rows, record.time, record.values, tuple(taken), "time")
    low, high = options.limits
    within_limits = within(samples, (first + low, first + high), findings)
    head = (str(path), OURS, digest, "row", len(record))
    facts, origin = record.provenance, f"{first:.9g} s"
    log = _assembled(head, (within_limits,), (), origin, options, findings, facts, wanted)
    report = log.report
    return (
        log
        if report.resampled_hz or report.repairs or report.parts[0].samples != len(record)
        else replace(log, records=(record,))
    )


def from_source(
    source: Source,
    map_: Map,
    digest: str,
    options: Options,
) -> Log:
    """Read a log by a complete map. Raises LogError."""
    findings = Findings(source.findings)
    try:
        samples, origins = _samples(source, map_, options, findings)
        if not samples:
            source.stamps(source.clock(source.names[0]), map_.time)  # is time wrong, too?
            findings.check()
        findings += [one for one in source.findings if one not in findings]  # of the clock
        used = {*(taken.heading for one in samples for taken in one.taken), *origins}
        unused = tuple(name for name in source.names if name not in used)
        longest = max(one.time.size for one in samples)
        head = (str(source.path), source.format, digest, samples[0].counts, longest)
        own = {n: x for n, x in source.full.items() if map_.channels.get(n) == source.channels[n]}
        known = {"conditions": {"full": own, "known_by": {"full": source.format}}} if own else {}
        made, origin = made_by("log reader", **known), next(iter(origins.values()))
        return _assembled(head, samples, unused, origin, options, findings, made)
    except HelisimError as error:
        findings.refuse_error(source.path, error)
        damage = [one for one in source.findings if one.kind == "corruption"]
        findings.refused = list(dict.fromkeys([*damage, *findings.refused]))
        findings.check()
        raise


def _samples(
    source: Source, map_: Map, options: Options, findings: Findings
) -> tuple[tuple[Samples, ...], dict[str, str]]:
    """Return samples and first stamp of each clock; channels without a number are refused."""
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
        read = Samples(source.path, source.row_of(clock), rows, stamps, values, taken, heading)
        if map_.time is None or map_.time.rate is None:
            check_unit_of_time(read, findings)
        read = within(read, options.limits, findings)
        there = ~np.all(np.isnan(read.values), axis=0)
        for k in np.flatnonzero(~there):
            findings.refuse("no number", read.empty(taken[k].heading))
        taken = tuple(one for one, kept in zip(taken, there) if kept)
        there = slice(None) if there.all() else there  # without a copy
        samples += [replace(read, values=read.values[:, there], taken=taken)] if taken else []
    return tuple(samples), origins


def _taken(source: Source, name: str, column: Column) -> tuple[Taken, NDArray[np.float64]]:
    """Return a column as a channel, and its values (n_time,) in SI, NaN without a number."""
    heading = find_column(column.column, source.names, "column", name)
    stated = source.stated_unit(heading)
    channel, factor = column.converts(name, stated)
    raw, given = source.numbers(heading), column.unit or stated
    with np.errstate(over="ignore", invalid="ignore"):
        values = factor * (raw - (0.0 if column.trim is None else column.trim))
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
    taken = {one.channel.name: one for clock in samples for one in clock.taken}
    ours = head[1] == OURS
    stretches = [
        tuple(
            screened(one if ours else _unwrapped(one, findings), options, findings, wanted)
            for one in stretch
        )
        for stretch in _tidied(samples, options, findings)
    ]
    if options.resample_hz is None:
        options = replace(options, resample_hz=common_rate(stretches, options, findings))
    every = [one for stretch in stretches for one in stretch]
    for one in every:
        note_lost_samples(one, options, findings)
    made = [cut(stretch, options, findings) for stretch in stretches]
    parts = [part for found, _ in made for part in found]
    findings.check()
    uniform = [one for one in parts if one.part.uneven is None]
    if uniform:  # the longest shows best what can't be as declared
        one = max(uniform, key=lambda part: part.part.duration)
        step = one.part.duration / (one.time.size - 1)
        declared = {name: took.column for name, took in taken.items() if took.column.unit}
        findings += implausible(Channels(step, dict(zip(taken, one.values.T)), declared))
    steps = np.concatenate([np.diff(one.time) for one in every if one.time.size > 1] or [[0.0]])
    report = LogReport(
        *head,
        columns=FrozenMap({name: one.computed for name, one in taken.items()}),
        unused=unused,
        origin=origin,
        step=(float(np.min(steps)), float(np.median(steps)), float(np.max(steps))),
        findings=tuple(findings),
        resampled_hz=options.resample_hz,
        passband_hz=next((band for _, band in made if band is not None), None),
        parts=tuple(one.part for one in parts),
    )
    if not parts:
        reasons = "; ".join(finding.text for finding in findings) or "no samples"
        raise RecordError(f"{head[0]}, {reasons}; nothing is left of it")
    shared = plain({**provenance, "log": report.to_dict()})
    channels, records = tuple(one.channel for one in taken.values()), []
    before = provenance.get("missing", {})
    for k, (time, values, part, lost) in enumerate(parts):
        rows = f"{head[3]}s {part.first_row} to {part.last_row}"
        gone = {n: [*before.get(n, ()), *one] for n, one in told(time, list(taken), lost).items()}
        facts = {"missing": {**before, **gone}} if gone else {}
        try:
            records.append(FlightRecord(time, values, channels, shared.extended(part=k, **facts)))
        except RecordError as error:
            raise RecordError(f"{head[0]}, {rows}: {error}") from None
    headings = FrozenMap({name: one.heading for name, one in taken.items()})
    return Log(tuple(records), report, headings)


def _tidied(
    samples: tuple[Samples, ...], options: Options, findings: Findings
) -> list[tuple[Samples, ...]]:
    in_time = [in_order(one, options, findings, len(samples)) for one in samples]
    found = []
    for stretch in zip(*in_time):
        found.append(tuple(without_duplicates(one, options, findings) for one in stretch))
        for one in found[-1]:
            check_missing(one, options, findings)
    return found


def _unwrapped(samples: Samples, findings: Findings) -> Samples:
    """Return samples whose angles, in place, don't jump by a turn."""
    for k, (channel, heading, *_) in enumerate(samples.taken):
        known = np.flatnonzero(np.isfinite(samples.values[:, k]))
        turns = np.flatnonzero(np.abs(np.diff(samples.values[known, k])) > _WRAP)
        if turns.size and channel.unit == "rad":
            samples.values[known, k] = np.unwrap(samples.values[known, k])
            rows = tuple(samples.rows[known[turns + 1]].tolist())
            findings.note(
                *("angle wraps", f"column {heading!r}: unwrapped"), turns.size, rows, repaired=True
            )
    return samples
