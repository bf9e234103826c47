"""Opens a log of which nothing is known: its clocks, its channels, and the records it can give."""

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from helisim.base.errors import HelisimError, LogError
from helisim.base.unit_names import is_unit
from helisim.logs.clock import Steadiness, steadiness
from helisim.logs.log import Log
from helisim.logs.mapping import Clock, Column, Map, split_heading
from helisim.logs.read import is_ours, open_source, read_log
from helisim.logs.report import OURS, Findings, LogFinding
from helisim.logs.source import Source
from helisim.logs.terms import REPAIRS
from helisim.look.guess import SeenChannel, guess
from helisim.records.record import FlightRecord

AS_RECORDED = "as recorded"
_ATTEMPTS = 4
"""Readings, each with the options that the one before asked for."""
_FASTEST = 200.0
"""Hz, at which channels of several clocks are looked at, at most."""
_COUNTERS = {"index", "idx", "row", "sample", "count", "counter", "seq", "frame", "n", "i"}


@dataclass(frozen=True)
class SeenClock:
    """A clock of a log, and how even it is.

    Attributes:
        name: of the column or topic.
        rate: samples a second, Hz.
        samples: how many.
        duration: from the first to the last, s.
        jitter: of its steps, gaps apart, s rms.
        largest: by which a step is off, gaps apart, s.
        even: "uniform", "jitter" or "irregular".
        gaps: steps that are gaps.
    """

    name: str
    rate: float
    samples: int
    duration: float
    jitter: float
    largest: float
    even: str
    gaps: int

    def to_dict(self) -> dict[str, object]:
        """Return plain data for JSON."""
        return {
            "name": self.name,
            "rate_hz": self.rate,
            "samples": self.samples,
            "duration_s": self.duration,
            "jitter_rms_s": self.jitter,
            "largest_s": self.largest,
            "even": self.even,
            "gaps": self.gaps,
        }


class Opened(NamedTuple):
    """What could be read of a log.

    Attributes:
        format: of the file.
        clocks: that its channels have.
        seen: its channels.
        unused: its other columns.
        records: uniform; empty if nothing could be read.
        findings: what is wrong, or to be noted.
        options: of the command line, that it was read with.
    """

    format: str
    clocks: tuple[SeenClock, ...]
    seen: tuple[SeenChannel, ...]
    unused: tuple[str, ...]
    records: tuple[FlightRecord, ...]
    findings: tuple[LogFinding, ...]
    options: tuple[str, ...]


class Asked(NamedTuple):
    """How the user says that logs are to be read.

    Attributes:
        map: of the columns that are known.
        resample_hz: of the records, Hz.
        repair: see `REPAIRS`.
        max_gap: s.
        start: s.
        stop: s.
    """

    map: Map
    resample_hz: float | None
    repair: tuple[str, ...]
    max_gap: float | None
    start: float | None
    stop: float | None


def opened(path: Path, asked: Asked) -> Opened:
    """Open a log and read what can be read of it.

    Raises:
        StorageError: the file can't be read.
        InputError: an option doesn't exist.
    """
    if not asked.map.channels and is_ours(path):
        return _ours(path, asked)
    source = open_source(path, asked.map, cut_tail=True)
    if any(finding.kind == "incomplete last line" for finding in source.findings):
        asked = asked._replace(repair=(*asked.repair, "tail"))
    findings = Findings(source.findings)
    time, option = asked.map.time, ""
    if source.counts != "row" or source.format == "Parquet":
        time, option = _clock(source, asked.map.time)
    clocks = _clocks(source, time, findings)
    rates = {clock: one.rate for clock, one in clocks.items()}
    seen = guess(source, asked.map.channels, rates)
    used = {source.clock(c) for one in seen if one.moves for c in [one.column.column]}
    shown = tuple(clocks[clock] for clock in sorted(used) if clock in clocks)
    mapped = {*(one.column.column for one in seen), *(one.name for one in clocks.values())}
    unused = tuple(name for name in source.names if name not in mapped)
    wanted = {one.name: one.column for one in seen if one.moves}
    if not wanted:
        findings.refuse(
            "channels",
            f"{path}: no column looks like a channel that moves; say which is which "
            "(--channel NAME=COLUMN:UNIT)",
        )
    if not wanted or not clocks:
        said = (*findings.refused, *findings)
        return Opened(source.format, shown, seen, unused, (), said, ())
    rate = asked.resample_hz
    if rate is None and len(used) > 1:
        rate = min(max(one.rate for one in shown), _FASTEST)
    reading = _Reading(
        path,
        replace(asked.map, channels=wanted, time=time),
        asked._replace(resample_hz=rate),
        frozenset(one.name for one in seen if one.guessed),
    )
    records = reading.records()
    options = (option, *reading.options) if option else tuple(reading.options)
    if "tail" in asked.repair:
        options = (*options, "--repair tail")
    if reading.time != time:
        clocks = _clocks(source, reading.time, Findings())
        shown = tuple(clocks.get(clock, one) for clock, one in zip(sorted(used), shown))
    seen = tuple(
        replace(
            one,
            column=reading.channels.get(one.name, one.column),
            rate=clocks[source.clock(one.column.column)].rate,
            clock=clocks[source.clock(one.column.column)].name,
        )
        for one in seen
    )
    said = (*findings.refused, *reading.said)
    return Opened(source.format, shown, seen, unused, records, said, options)


def _ours(path: Path, asked: Asked) -> Opened:
    """Read a helisim record, which says itself what it holds."""
    reading = _Reading(path, None, asked, frozenset())
    records, findings, options = reading.records(), tuple(reading.said), tuple(reading.options)
    if not records:
        return Opened(OURS, (), (), (), (), findings, options)
    record = max(records, key=lambda one: one.duration)
    even = steadiness(record.time)
    clock = _seen_clock("time", record.time, even)
    seen = tuple(
        SeenChannel(
            channel.name,
            Column(channel.name, channel.unit if channel.unit not in ("N", "N m") else None),
            AS_RECORDED,
            clock.rate,
            float(record[channel.name].min()),
            float(record[channel.name].max()),
        )
        for channel in record.channels
        if channel.kind in ("IN1", "IN2", "OUT")
    )
    unused = tuple(one.name for one in record.channels if one.kind not in ("IN1", "IN2", "OUT"))
    return Opened(OURS, (clock,), seen, unused, records, findings, options)


def _seen_clock(name: str, time: np.ndarray, even: Steadiness) -> SeenClock:
    duration = float(np.ptp(time)) if time.size else 0.0
    return SeenClock(
        name, even.rate, time.size, duration, even.rms, even.largest, even.kind, even.gaps
    )


def _clocks(source: Source, time: Clock | None, findings: Findings) -> dict[str, SeenClock]:
    """Return the clocks of a log by their names in the source."""
    found = {}
    for clock in dict.fromkeys(map(source.clock, source.names)):
        try:
            stamps, _, name = source.stamps(clock, time)
        except HelisimError as error:
            findings.refuse_error(source.path, error)
            return {}
        rising = np.unique(stamps[np.isfinite(stamps)])
        if rising.size > 2:
            found[clock] = _seen_clock(name, rising, steadiness(rising))
    return found


def _clock(source: Source, time: Clock | None) -> tuple[Clock | None, str]:
    """Return where a table's time comes from, guessed where nothing says it, and the option."""
    try:
        source.stamps(source.clock(source.names[0]), time)
    except HelisimError:
        pass
    else:
        return time, ""
    if time is not None and (time.rate is not None or time.unit is not None):
        return time, ""
    names = source.names if time is None else (time.column or "",)
    for name in sorted(names, key=lambda one: "time" not in one.lower()):
        if name not in source.names or split_heading(name)[0].lower() in _COUNTERS:
            continue
        try:
            values = source.numbers(name)
        except HelisimError:
            continue
        steps = np.diff(values)
        if not (steps.size > 10 and np.all(np.isfinite(steps)) and np.all(steps >= 0.0)):
            continue
        step = float(np.median(steps))
        if step <= 0.0 or np.max(steps) > 1e6 * step:
            continue
        unit = "s" if step < 1.0 else "ms" if step < 1e3 else "us" if step < 1e6 else "ns"
        return Clock(name, unit), "--time " + shlex.quote(f"{name}:{unit}")
    return time, ""


class _Reading:
    """Reads a log; where that is refused, again with what the refusal says mends it.

    Attributes:
        said: what was refused, and what the last reading noted.
        options: of the command line, that were taken.
        channels: that are read, as far as they can be.
        time: the clock that they are read by.
    """

    def __init__(self, path: Path, map_: Map | None, asked: Asked, guessed: frozenset[str]) -> None:
        self.said: list[LogFinding] = []
        self.options: list[str] = []
        self.channels = {} if map_ is None else dict(map_.channels)
        self._path, self._map, self._asked, self._guessed = path, map_, asked, guessed
        self._repairs, self._rate = set(asked.repair), asked.resample_hz
        self._max_gap = asked.max_gap
        self.time = None if map_ is None else map_.time

    def records(self) -> tuple[FlightRecord, ...]:
        """Return the records, none if the log can't be read."""
        for _ in range(_ATTEMPTS):
            try:
                log = self._log()
                log.check_uniform()
            except LogError as error:
                known = {finding.text for finding in self.said}
                self.said += [one for one in error.findings if one.text not in known]
                if not sum(self._take(finding) for finding in error.findings):
                    return ()
            except HelisimError as error:
                self.said.append(LogFinding("refused", str(error)))
                return ()
            else:
                if not sum(self._take_unit(finding) for finding in log.report.findings):
                    mended = ("--repair", "--resample") if self._map is not None else ()
                    self.said += [
                        finding
                        for finding in log.report.findings
                        if not (finding.repaired and finding.option.startswith(mended))
                        or finding.kind in ("jitter", "clocks")
                    ]
                    return log.records
        return ()

    def _log(self) -> Log:
        channels = self._map
        if channels is not None:
            channels = replace(channels, channels=self.channels, time=self.time)
        return read_log(
            self._path,
            channels=channels,
            resample_hz=self._rate,
            repair=self._repairs,
            max_gap=self._max_gap,
            start=self._asked.start,
            stop=self._asked.stop,
        )

    def _take(self, finding: LogFinding) -> bool:
        """Take what a refusal says mends it; return whether there is such a thing."""
        words = shlex.split(finding.option)
        taken = False
        for option, value in zip(words[::2], words[1::2]):
            if option == "--repair" and value in REPAIRS and value not in self._repairs:
                self._repairs.add(value)
            elif option == "--resample" and self._rate is None:
                self._rate = float(value)
            elif option == "--max-gap" and self._max_gap is None:
                self._max_gap = float(value)
            elif option == "--time":
                column, _, unit = value.rpartition(":")
                self.time = Clock(column, unit)
            else:
                continue
            taken = True
            self.options.append(f"{option} {shlex.quote(value)}")
        if not finding.option:
            left = {k: c for k, c in self.channels.items() if repr(c.column) not in finding.text}
            taken = bool(left) and len(left) < len(self.channels)
            self.channels = left if taken else self.channels
        return taken

    def _take_unit(self, finding: LogFinding) -> bool:
        """Take a unit that the data show, where it was guessed; return whether it was."""
        if finding.kind != "unit" or not finding.option.startswith("--channel "):
            return False
        name, _, rest = shlex.split(finding.option)[1].partition("=")
        column = self.channels.get(name)
        parts = rest.split(":")
        if column is None or name not in self._guessed or not is_unit(parts[1]):
            return False
        if column.unit == parts[1]:
            return False
        self.said.append(replace(finding, text=f"{finding.text}: taken so"))
        self.channels[name] = replace(column, unit=parts[1])
        return True
