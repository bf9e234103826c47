"""Opens an unknown log: clocks, channels and records, and what is found in it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.errors import HelisimError, LogError
from helisim.base.note import Option
from helisim.base.settings import grouped, setting, to_plain
from helisim.logs.mapping import REPAIRS, Clock, Map, own_column
from helisim.logs.read import is_ours, open_source, read_as
from helisim.logs.report import OURS, Findings, LogFinding
from helisim.logs.source import Source
from helisim.logs.timing import Options
from helisim.look.channels import AS_RECORDED, SeenChannel, SeenClock, guess
from helisim.look.excitation import FoundAnswer, FoundExcitation
from helisim.look.sweeps import FlownSweep
from helisim.records.record import FlightRecord

# SHORT: of the longest part of a log: shorter parts are left out
# _ATTEMPTS: readings, each with the options that the last one asked for
SHORT, _ATTEMPTS = 0.3, 4
_FASTEST = 200.0  # Hz, at which channels are looked at, at most
_SHOWN, _BEST = 8, 4  # unused columns that are printed; responses to a control that are printed
_QUIET = ("spikes", "frozen", "lost samples", "event")  # findings that are only noted


@dataclass(frozen=True)
class LogLook:
    """Findings of a first look at one log; `options` are those that its reading needed.

    `records` are its uninterrupted parts; `excitations` aren't sought where the log states its
    `sweeps`; `answers` are best first.
    """

    path: str
    format: str
    clocks: tuple[SeenClock, ...] = ()
    channels: tuple[SeenChannel, ...] = ()
    unused: tuple[str, ...] = ()
    records: tuple[FlightRecord, ...] = setting((), unsaid=True, repr=False, compare=False)
    findings: tuple[LogFinding, ...] = ()
    options: tuple[Option, ...] = ()
    excitations: tuple[FoundExcitation, ...] = ()
    answers: tuple[FoundAnswer, ...] = ()
    sweeps: tuple[FlownSweep, ...] = ()

    @property
    def duration(self) -> float:
        """Usable duration, s."""
        return sum(record.duration for record in self.records)

    @property
    def durations(self) -> list[float]:
        """Durations of the parts that are long enough to be used, s."""
        durations = [record.duration for record in self.records]
        return [duration for duration in durations if duration > SHORT * max(durations)]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: times in s, frequencies in rad/s."""
        return {
            **to_plain(replace(self, records=())),
            "duration": self.duration,
            "parts": len(self.records),
        }

    def __str__(self) -> str:
        return self.worded(lambda finding: finding.text)

    def worded(self, word: Callable[[LogFinding], str]) -> str:
        """Return the findings as text, each worded by `word`."""
        parts = f" in {len(self.records)} parts" if len(self.records) > 1 else ""
        ours = [one.name for one in self.channels if one.why == AS_RECORDED]
        more = f", and {len(self.unused) - _SHOWN} more" if len(self.unused) > _SHOWN else ""
        found = grouped(self.answers, lambda one: one.input)
        lines = [
            f"{self.path}: {self.format}, {self.duration:.4g} s{parts} can be used",
            *map(str, self.clocks),
            *([f"channels, as recorded: {', '.join(ours)}"] if ours else ()),
            *(str(one) for one in self.channels if one.why != AS_RECORDED),
            *([f"not used: {', '.join(self.unused[:_SHOWN])}{more}"] if self.unused else ()),
            *map(str, (*self.sweeps, *self.excitations)),
            *(
                f"coherent with {control}, rad/s (mean coherence): "
                f"{', '.join(map(str, mine[:_BEST]))}"
                for control, mine in found.items()
            ),
            *(
                f"{'!' if one.remedy and not one.repaired and one.kind not in _QUIET else 'note'}: "
                f"{word(one)}"
                for one in self.findings
            ),
        ]
        return "\n  ".join(lines)


def opened(path: Path, map_: Map, options: Options) -> LogLook:
    """Open a log and read what can be read. Raises StorageError, InputError."""
    if not map_.channels and is_ours(path):
        return _ours(path, options)
    source = open_source(path, map_)
    findings = Findings(source.findings)
    clocks = _clocks(source, map_.time, findings)
    seen = guess(source, map_.channels, clocks)
    moving = {one.name: one for one in seen if one.moves}
    used = {one.clock.name: one.clock for one in moving.values() if one.clock}
    shown = tuple(used[name] for name in sorted(used))
    mapped = {*(one.column.column for one in seen), *(one.name for one in clocks.values())}
    unused = tuple(name for name in source.names if name not in mapped)
    if not moving and (clocks or not findings.refused):
        findings.refuse(
            "channels",
            f"{path}: no column looks like a channel that moves; say which is which"
            if clocks
            else f"{path}: its time stands still, has fewer than two rows, or isn't there",
            remedy=(Option("channel", "NAME=COLUMN:UNIT") if clocks else Option("time"),),
        )
    found = LogLook(str(path), source.format, shown, seen, unused)
    if not moving or not clocks:
        return replace(found, findings=(*findings, *findings.refused))
    wanted = replace(map_, channels={name: one.column for name, one in moving.items()})
    fastest = (
        min(max(one.rate for one in shown), _FASTEST)
        if len(used) > 1 or any(one.rate > _FASTEST for one in shown)
        else None
    )
    records, said, taken = _read(path, wanted, options, fastest)
    return replace(
        found,
        records=records,
        findings=tuple(dict.fromkeys((*source.findings, *findings.refused, *said))),
        options=(*_written(map_), *taken),
    )


def alone(log: LogLook, names: Sequence[str], map_: Map, options: Options) -> LogLook:
    """Return a log as read with some of its channels alone, and the options which that needs.

    Raises LogError if nothing of it can be read so.
    """
    wanted = {one.name: one.column for one in log.channels if one.name in names}
    mine = None if log.format == OURS else replace(map_, channels=wanted)
    records, _, taken = _read(Path(log.path), mine, options)
    if not records:
        raise LogError(f"{log.path}: nothing of {', '.join(names)} can be read")
    return replace(log, records=records, options=(*_written(mine or Map()), *taken))


def _written(map_: Map) -> tuple[Option, ...]:
    """Return the options which say how a file is written."""
    said = {
        "names": ",".join(map_.file.names),
        "log": str(map_.file.log or ""),
        "time": map_.time.text if map_.time else "",
    }
    return tuple(Option(name, value) for name, value in said.items() if value)


def _ours(path: Path, options: Options) -> LogLook:
    records, said, taken = _read(path, None, options)
    found = LogLook(str(path), OURS, records=records, findings=said, options=taken)
    if not records:
        return found
    record = max(records, key=lambda one: one.duration)
    clock = SeenClock.of("time", record.time)
    of_flight = [one for one in record.channels if one.kind in ("IN1", "IN2", "OUT")]
    seen = tuple(
        SeenChannel.of(one.name, own_column(one), AS_RECORDED, clock, record[one.name])
        for one in of_flight
    )
    unused = tuple(one.name for one in record.channels if one not in of_flight)
    return replace(found, clocks=(clock,), channels=seen, unused=unused)


def _clocks(source: Source, time: Clock | None, findings: Findings) -> dict[str, SeenClock]:
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


_Read = tuple[tuple[FlightRecord, ...], tuple[LogFinding, ...], tuple[Option, ...]]


def _read(path: Path, map_: Map | None, options: Options, rate: float | None = None) -> _Read:
    """Read a log; if refused, again with the options that the error proposes; `rate` in Hz."""
    said: dict[str, LogFinding] = {}
    for _ in range(_ATTEMPTS):
        asked = replace(options, resample_hz=options.resample_hz or rate)
        try:
            log = read_as(path, map_, None, asked)
            log.check_uniform()
        except HelisimError as error:
            own = LogFinding("refused", str(error), error.remedy)
            found = error.findings if isinstance(error, LogError) else (own,)
            said |= {one.text: one for one in found}
            before, options = options, _mended(options, found)
            if options == before:
                break
        else:
            mended = () if map_ is None else ("repair", "resample")
            noted = [
                one
                for one in log.report.findings
                if one.kind in ("jitter", "clocks")
                or not (one.repaired and any(o.name in mended for o in one.remedy))
            ]
            taken = [Option("repair", one) for one in options.repair]
            given = {"resample": options.resample_hz, "max_gap": options.max_gap}
            taken += [Option(name, f"{one:g}") for name, one in given.items() if one is not None]
            return log.records, (*said.values(), *noted), tuple(taken)
    return (), tuple(said.values()), ()


def _mended(options: Options, found: Sequence[LogFinding]) -> Options:
    """Return options with what findings propose, where nothing was said of it."""
    asked = [one for finding in found for one in finding.remedy if isinstance(one, Option)]
    repairs = [one.value for one in asked if one.name == "repair" and one.value in REPAIRS]
    numbers = [one for one in asked if one.name in ("resample", "max_gap") and one.value]
    first = {one.name: float(one.value) for one in reversed(numbers)}
    return replace(
        options,
        repair=(*options.repair, *repairs),
        resample_hz=options.resample_hz or first.get("resample"),
        max_gap=options.max_gap or first.get("max_gap"),
    )
