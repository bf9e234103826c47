"""Assembles a log from columns or from a record: channels in SI, screened, repaired, cut."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError, RecordError
from helisim.base.unit_names import unit
from helisim.logs.declared import Declared
from helisim.logs.log import Log, assemble_log, passband, steps
from helisim.logs.mapping import Column, Map, find_column
from helisim.logs.parts import Options, cut, tidied, unwrapped, with_rate
from helisim.logs.report import OURS, Findings, LogReport
from helisim.logs.screening import (
    check_clocks,
    check_plausible,
    note_lost_samples,
    screened,
)
from helisim.logs.source import Source, place
from helisim.logs.timing import Samples, check_unit_of_time, empty, within
from helisim.records.channels import Channel
from helisim.records.provenance import made_by
from helisim.records.record import FlightRecord


def from_record(
    path: Path,
    record: FlightRecord,
    log_digest: str,
    options: Options,
    wanted: Sequence[str] | None,
) -> Log:
    """Read a helisim record, which needs no map."""
    samples = Samples(
        path, "row", np.arange(len(record)), record.time, record.values, record.names, "time"
    )
    findings = Findings()
    samples = within(samples, record.time[0] + np.array(options.limits), findings)
    samples = screened(samples, record.channels, options.repairs, findings, wanted=wanted)
    options = with_rate([[samples]], options, findings)
    note_lost_samples(samples, options.rate is not None, findings)
    made = (cut((samples,), options, findings),)
    findings.check()
    findings += check_clocks(made, record.names)
    ours = {one.name: Declared(one.name, one.unit, 1.0, 1) for one in record.channels}
    findings += check_plausible(made, record.names, ours, "time")
    report = LogReport(
        path=str(path),
        format=OURS,
        digest=log_digest,
        counts="row",
        samples=len(record),
        columns={channel.name: f"as recorded, in {channel.unit}" for channel in record.channels},
        unused=(),
        origin=f"{record.time[0]:.9g} s",
        step=steps((samples,)),
        findings=(*findings, *(finding for one in made for finding in one.left_out)),
        resampled_hz=options.rate,
        passband_hz=passband(made, options.rate),
        parts=tuple(part for stretch in made for part in stretch.parts),
    )
    headings = {name: name for name in record.names}
    if options.rate is None and not report.repairs and report.parts[0].samples == len(record):
        return Log((record,), report, headings)
    return assemble_log(made, record.channels, report, headings, record.provenance)


def from_source(
    source: Source,
    map_: Map,
    log_digest: str,
    options: Options,
    facts: Mapping[str, Any],
    findings: Findings,
) -> Log:
    """Read anyone's log by a map whose channels are complete.

    Args:
        source: the opened log.
        map_: which column is which channel.
        log_digest: of the file.
        options: how it is read.
        facts: for the records' provenance.
        findings: what was found before, refusals too; more is added.

    Raises:
        LogError: all that stops its use.
    """
    try:
        return _from_source(source, map_, log_digest, options, facts, findings)
    except HelisimError as error:
        findings.refuse_error(source.path, error)
        findings.check()
        raise


def _from_source(
    source: Source,
    map_: Map,
    log_digest: str,
    options: Options,
    facts: Mapping[str, Any],
    findings: Findings,
) -> Log:
    findings += source.findings
    mapped = _mapped(source, map_, findings)
    channels = mapped.channels
    samples, origins = _samples(source, mapped, map_, options, findings)
    groups = [list(columns) for columns in mapped.by_clock.values()]
    if not samples:
        source.stamps(source.clock(source.names[0]), map_.time)  # says what is wrong with time, too
        findings.check()

    def each(
        stretches: Sequence[Sequence[Samples]], treat: Callable[[Samples, list[str]], Samples]
    ) -> tuple[tuple[Samples, ...], ...]:
        return tuple(tuple(map(treat, stretch, groups)) for stretch in stretches)

    def continuous(one: Samples, names: list[str]) -> Samples:
        return unwrapped(one, [(map_.channels[name], channels[name]) for name in names], findings)

    def sound(one: Samples, names: list[str]) -> Samples:
        return screened(one, [channels[name] for name in names], options.repairs, findings)

    stretches = each(each(tidied(samples, options, findings), continuous), sound)
    options = with_rate(stretches, options, findings)
    for one in (one for stretch in stretches for one in stretch):
        note_lost_samples(one, options.rate is not None, findings)
    made = tuple(cut(stretch, options, findings) for stretch in stretches)
    order = [name for names in groups for name in names]
    findings.check()
    findings += check_clocks(made, order)
    findings += check_plausible(made, order, mapped.declared, samples[0].clock)
    used = {*mapped.headings.values(), *origins}
    report = LogReport(
        path=str(source.path),
        format=source.format,
        digest=log_digest,
        counts=source.counts,
        samples=max(one.time.size for one in samples),
        columns=mapped.computed,
        unused=tuple(name for name in source.names if name not in used),
        origin=next(iter(origins.values())),
        step=steps(tuple(one for stretch in stretches for one in stretch)),
        findings=(*findings, *(finding for one in made for finding in one.left_out)),
        resampled_hz=options.rate,
        passband_hz=passband(made, options.rate),
        parts=tuple(part for one in made for part in one.parts),
    )
    provenance = made_by("log reader", **facts)
    ordered = tuple(channels[name] for name in order)
    return assemble_log(made, ordered, report, mapped.headings, provenance)


class _Mapped(NamedTuple):
    """A log's columns as channels in SI.

    Attributes:
        channels: name -> the channel.
        headings: name -> the column's heading.
        computed: name -> how it is computed, for people.
        declared: name -> what its column is declared to be.
        by_clock: clock -> name -> (n_time,) values, NaN where there is no number.
    """

    channels: dict[str, Channel]
    headings: dict[str, str]
    computed: dict[str, str]
    declared: dict[str, Declared]
    by_clock: dict[str, dict[str, NDArray[np.float64]]]


def _mapped(source: Source, map_: Map, findings: Findings) -> _Mapped:
    mapped = _Mapped({}, {}, {}, {}, {})
    for name, column in map_.channels.items():
        try:
            heading = find_column(column.column, source.names, f"column of channel {name!r}")
            stated = source.stated_unit(heading)
            channel, factor = column.converts(name, stated)
            values = _converted(source, heading, column, factor)
        except HelisimError as error:
            findings.refuse_error(source.path, error)
            continue
        mapped.channels[name] = channel
        mapped.headings[name] = heading
        mapped.computed[name] = _computation(column, heading, stated, channel)
        mapped.declared[name] = _declared(column, heading, stated, factor)
        mapped.by_clock.setdefault(source.clock(heading), {})[name] = values
    return mapped


def _samples(
    source: Source, mapped: _Mapped, map_: Map, options: Options, findings: Findings
) -> tuple[tuple[Samples, ...], dict[str, str]]:
    """Return the samples of each clock within the limits, and each clock's first stamp.

    Channels without a number are refused, and left out of `mapped`.
    """
    samples, origins = [], {}
    for clock, columns in list(mapped.by_clock.items()):
        stamps, origin, time_heading = source.stamps(clock, map_.time)
        origins[time_heading] = origin
        read = Samples(
            source.path,
            source.counts,
            source.rows(clock),
            stamps,
            np.column_stack(list(columns.values())),
            tuple(mapped.headings[name] for name in columns),
            time_heading,
        )
        if map_.time is None or map_.time.rate is None:
            check_unit_of_time(read, findings)
        read = within(read, np.array(options.limits), findings)
        full = ~np.all(np.isnan(read.values), axis=0)
        for k in np.flatnonzero(~full):
            findings.refuse("no number", empty(read, read.columns[k]))
        mapped.by_clock[clock] = {
            name: columns[name] for name, there in zip(columns, full) if there
        }
        if not full.any():
            del mapped.by_clock[clock]
            continue
        samples.append(read.pick(full))
    return tuple(samples), origins


def _declared(column: Column, heading: str, stated: str | None, factor: float) -> Declared:
    """Return what a column is declared to be, as the option that says so has it."""
    parts = (("trim", column.trim), ("range", column.range))
    further = "".join(f":{name}={value:g}" for name, value in parts if value is not None)
    name = unit(column.unit or stated or "1").name if column.range is None else "1"
    return Declared(heading, name, abs(factor), column.sign, further)


def _computation(column: Column, heading: str, stated: str | None, channel: Channel) -> str:
    """Return how a channel is computed, for people."""
    unit = column.unit or stated
    number = f"{heading!r}" if column.trim is None else f"({heading!r} - {column.trim:g})"
    number = number if column.range is None else f"{number} / {column.range:g}"
    sign = "-" if column.sign < 0 else ""
    return f"{sign}{number} [{unit}] in {channel.unit}"


def _converted(source: Source, heading: str, column: Column, factor: float) -> NDArray[np.float64]:
    """Return a column in SI, NaN where there is no number."""
    raw = source.numbers(heading)
    trim = 0.0 if column.trim is None else column.trim
    with np.errstate(over="ignore", invalid="ignore"):
        values = factor * (raw - trim)
    wild = np.flatnonzero(np.isinf(values))
    if wild.size:
        rows = source.rows(source.clock(heading))
        where = place(source.path, source.counts, int(rows[wild[0]]), heading)
        raise RecordError(f"{where}: {raw[wild[0]]:g} is too large for its unit")
    return values
