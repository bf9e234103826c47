"""Opens a log of which nothing is known: its clocks, its channels, and the records it can give."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError, LogError
from helisim.base.note import Option
from helisim.base.units import is_unit
from helisim.logs.mapping import REPAIRS, Clock, Column, Map, named_column, split_heading
from helisim.logs.read import is_ours, open_source, read_as
from helisim.logs.report import OURS, Findings, LogFinding
from helisim.logs.source import Source
from helisim.logs.timing import Options, steadiness
from helisim.look.channels import AS_RECORDED, SeenChannel, guess
from helisim.records.record import FlightRecord

_ATTEMPTS = 4
"""Readings, each with the options that the one before asked for."""
_FASTEST = 200.0  # Hz, at which channels of several clocks are looked at, at most
_COUNTERS = {"index", "idx", "row", "sample", "count", "counter", "seq", "frame", "n", "i"}
_UNITS = {
    "rate": "rate_hz",
    "duration": "duration_s",
    "jitter": "jitter_rms_s",
    "largest": "largest_s",
}


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

    @classmethod
    def of(cls, name: str, time: NDArray[np.float64]) -> "SeenClock":
        """Return a clock by its stamps, (n_time,) s, increasing."""
        even = steadiness(time)
        span = float(np.ptp(time)) if time.size else 0.0
        return cls(name, even.rate, time.size, span, even.rms, even.largest, even.kind, even.gaps)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {_UNITS.get(name, name): value for name, value in vars(self).items()}

    def __str__(self) -> str:
        gaps = f", {self.gaps} gap{'s' * (self.gaps > 1)}" if self.gaps else ""
        even = "irregular: " if self.even == "irregular" else ""
        even += f"jitter {1e3 * self.jitter:.2g} ms rms, at most {1e3 * self.largest:.2g} ms"
        even = "uniform" if self.even == "uniform" else even
        return (
            f"clock {self.name}: {self.rate:.4g} Hz, {self.samples} samples, {self.duration:.4g} "
            f"s, {even}{gaps}"
        )


class Opened(NamedTuple):
    """Content of a log as far as it can be read, its uniform records, and the options taken."""

    format: str
    clocks: tuple[SeenClock, ...] = ()
    seen: tuple[SeenChannel, ...] = ()
    unused: tuple[str, ...] = ()
    records: tuple[FlightRecord, ...] = ()
    findings: tuple[LogFinding, ...] = ()
    options: tuple[Option, ...] = ()


def opened(path: Path, map_: Map, options: Options) -> Opened:
    """Open a log and read what can be read of it.

    Raises:
        StorageError: the file can't be read.
        InputError: an option doesn't exist.
    """
    if not map_.channels and is_ours(path):
        return _ours(path, options)
    source = open_source(path, map_, cut_tail=True)
    findings = Findings(source.findings)
    time, tail = map_.time, ()
    if any(finding.kind == "incomplete last line" for finding in findings):
        options = options._replace(repairs=options.repairs | {"tail"})
        tail = (Option("repair", "tail"),)
    if source.counts == "line" or source.format == "Parquet":
        time = _clock(source, time)
    timed = () if time is None or time == map_.time else (_time_option(time),)
    clocks = _clocks(source, time, findings)
    rates = {clock: one.rate for clock, one in clocks.items()}
    seen = guess(source, map_.channels, rates)
    used = sorted({source.clock(one.column.column) for one in seen if one.moves} & set(clocks))
    mapped = {*(one.column.column for one in seen), *(one.name for one in clocks.values())}
    unused = tuple(name for name in source.names if name not in mapped)
    wanted = {one.name: one.column for one in seen if one.moves}
    if not wanted:
        text = f"{path}: no column looks like a channel that moves; say which is which"
        findings.refuse("channels", text, remedy=Option("channel", "NAME=COLUMN:UNIT"))
    shown = tuple(clocks[clock] for clock in used)
    if not wanted or not clocks:
        said = (*findings.refused, *findings)
        return Opened(source.format, shown, seen, unused, findings=said)
    if options.rate is None and len(used) > 1:
        options = options._replace(rate=min(max(one.rate for one in shown), _FASTEST))
    reading = _Reading(path, options, replace(map_, channels=wanted, time=time))
    reading.guessed = {one.name for one in seen if one.guessed}
    records = reading.records()
    if reading.map.time != time:
        clocks = _clocks(source, reading.map.time, Findings()) or clocks
    shown = tuple(clocks[clock] for clock in used if clock in clocks)
    sampled = [(one, clocks.get(source.clock(one.column.column))) for one in seen]
    seen = tuple(
        replace(one, rate=clock.rate, clock=clock.name) if clock is not None else one
        for one, clock in sampled
    )
    seen = tuple(
        replace(one, column=reading.map.channels.get(one.name, one.column)) for one in seen
    )
    found, taken = (*findings.refused, *reading.said), (*timed, *reading.taken, *tail)
    return Opened(source.format, shown, seen, unused, records, found, taken)


def _time_option(time: Clock) -> Option:
    return Option("time", f"{time.column}:{time.unit}")


def _ours(path: Path, options: Options) -> Opened:
    """Read a helisim record, which says itself what it holds."""
    reading = _Reading(path, options, None)
    records = reading.records()
    if not records:
        return Opened(OURS, findings=tuple(reading.said), options=tuple(reading.taken))
    record = max(records, key=lambda one: one.duration)
    clock = SeenClock.of("time", record.time)
    kinds = ("IN1", "IN2", "OUT")
    seen = tuple(
        SeenChannel(
            one.name,
            Column(one.name, one.unit if is_unit(one.unit) else None),
            AS_RECORDED,
            clock.rate,
            float(record[one.name].min()),
            float(record[one.name].max()),
        )
        for one in record.channels
        if one.kind in kinds
    )
    unused = tuple(one.name for one in record.channels if one.kind not in kinds)
    said, taken = tuple(reading.said), tuple(reading.taken)
    return Opened(OURS, (clock,), seen, unused, records, said, taken)


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
            found[clock] = SeenClock.of(name, rising)
    return found


def _clock(source: Source, time: Clock | None) -> Clock | None:
    """Return where a table's time comes from, guessed where nothing says it."""
    try:
        source.stamps(source.clock(source.names[0]), time)
        return time
    except HelisimError:
        if time is not None and (time.rate is not None or time.unit is not None):
            return time
    names = source.names if time is None else (time.column or "",)
    there = [name for name in names if name in source.names]
    for name in sorted(there, key=lambda one: "time" not in one.lower()):
        try:
            steps = np.diff(source.numbers(name))
        except HelisimError:
            continue
        sane = steps.size > 10 and np.all(np.isfinite(steps)) and np.all(steps >= 0.0)
        step = float(np.median(steps)) if sane else 0.0
        counter = split_heading(name)[0].lower() in _COUNTERS
        if step > 0.0 and np.max(steps) <= 1e6 * step and not counter:
            unit = "s" if step < 1.0 else "ms" if step < 1e3 else "us" if step < 1e6 else "ns"
            return Clock(name, unit)
    return time


class _Reading:
    """Reads a log; where that is refused, again with what the refusal says mends it.

    Attributes:
        said: what was refused, and what the last reading noted.
        taken: options that were taken.
        map: of the channels that are read, as far as they can be.
        guessed: channels whose unit was guessed.
    """

    def __init__(self, path: Path, options: Options, map_: Map | None) -> None:
        self.said: list[LogFinding] = []
        self.taken: list[Option] = []
        self.map, self.guessed = map_ or Map(), set[str]()
        self._path, self._options, self._ours = path, options, map_ is None

    def records(self) -> tuple[FlightRecord, ...]:
        """Return the records, none if the log can't be read."""
        mended = () if self._ours else ("repair", "resample")
        for _ in range(_ATTEMPTS):
            try:
                log = read_as(self._path, None if self._ours else self.map, None, self._options)
                log.check_uniform()
            except LogError as error:
                known = {finding.text for finding in self.said}
                self.said += [one for one in error.findings if one.text not in known]
                if not sum(self._take(finding) for finding in error.findings):
                    return ()
            except HelisimError as error:
                self.said.append(LogFinding("refused", str(error), error.remedy))
                return ()
            else:
                findings = log.report.findings
                if not sum(self._take_unit(finding) for finding in findings):
                    self.said += [
                        one
                        for one in findings
                        if one.kind in ("jitter", "clocks")
                        or not (one.repaired and any(o.name in mended for o in one.remedy))
                    ]
                    return log.records
        return ()

    def _take(self, finding: LogFinding) -> bool:
        """Take what a refusal says mends it; return whether there is such a thing."""
        before, channels = len(self.taken), self.map.channels
        for option in finding.remedy:
            if not isinstance(option, Option):
                continue
            name, value, options = option.name, option.value, self._options
            if name == "repair" and value in REPAIRS and value not in options.repairs:
                self._options = options._replace(repairs=options.repairs | {value})
            elif name == "resample" and options.rate is None:
                self._options = options._replace(rate=float(value))
            elif name == "max_gap" and options.max_gap is None:
                self._options = options._replace(max_gap=float(value))
            elif name == "time" and value:
                column, _, unit = value.rpartition(":")
                self.map = replace(self.map, time=Clock(column, unit))
            else:
                continue
            self.taken.append(option)
        kept = {k: c for k, c in channels.items() if repr(c.column) not in finding.text}
        if finding.remedy or not 0 < len(kept) < len(channels):
            return len(self.taken) > before
        self.map = replace(self.map, channels=kept)
        return True

    def _take_unit(self, finding: LogFinding) -> bool:
        """Take a unit that the data show, where it was guessed; return whether it was."""
        if finding.kind != "unit" or not finding.option or finding.option.name != "channel":
            return False
        name, found = named_column(finding.option.value)
        column = self.map.channels.get(name)
        if column is None or name not in self.guessed or column.unit == found.unit:
            return False
        self.said.append(replace(finding, text=f"{finding.text}: taken so"))
        self.map = self.map.with_channels({name: replace(column, unit=found.unit)})
        return True
