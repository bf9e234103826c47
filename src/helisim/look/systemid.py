"""Infers from logs of ArduPilot's mode SystemID all that an identification has to be told.

The mode logs what it injects (SIDD) and how (SIDS). With the messages beside them that says sweeps,
channels, references, structures and bands.
"""

import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError, InputError, LogError
from helisim.base.note import Option
from helisim.base.settings import FrozenMap
from helisim.base.units import unit
from helisim.ident import (
    CrossControlWarning,
    FrequencyResponse,
    RecordQualityWarning,
    Structure,
    identify,
)
from helisim.ident.frf import ClosedLoopWarning, frequency_response
from helisim.logs.dataflash import DataFlash, open_dataflash
from helisim.logs.mapping import Column, Map
from helisim.logs.read import from_source, reading_options
from helisim.logs.report import Findings, Log
from helisim.logs.resample import PASSBAND
from helisim.logs.source import file_digest
from helisim.logs.timing import Options
from helisim.look.sweeps import PLACES, FlownSweep, SidAxis, sweeps
from helisim.records.record import ATTITUDES, RATES, Channel, FlightRecord, some_names

Band = tuple[float, float]
_Spans = Sequence[tuple[float, float]]
_FAST = 0.5  # of SIDD's rate: a message that is slower than that is no good beside it
_ONE_MORE = 1.6  # of the median step: a longer one has a message missing
_INJECTED = "injected"
_YAW, _SENT = "RATE.YOut", "RATE.YOut as sent"
"""Column of the mixer's yaw command, and of what the tail's servo was sent of it, 1 at its end."""
_TAIL, _SERVOS = 36, 32  # SERVOn_FUNCTION of a helicopter's tail, and how many servos there are
_FULL = 4500.0  # hundredths of a degree at the end of the tail servo's travel
_REPAIRS = frozenset({"gaps", "duplicates"})
"""What a logger that is pressed does: it drops messages, and writes some twice."""
_OUTPUT = "the mixer's command on this axis, the sweep in it; 1 is its full travel"
_THROTTLE = "throttle that the mixer is given, the sweep in it, 0 to 1, about its middle"
_SENT_WHY = (
    "the mixer's command as the tail's servo was sent it, in whole us, {:g} to the right and {:g} "
    "to the left of its trim"
)
_UNFILTERED = "gyro before its filter, of which nothing has to be known then"
_FILTERED = "gyro behind its filter"
_CANDIDATES: tuple[tuple[str, str, str, str], ...] = (
    ("lat", "RATE.ROut", "1", _OUTPUT),
    ("lon", "RATE.POut", "1", _OUTPUT),
    ("ped", _YAW, "1", _OUTPUT),
    ("col", "RATE.AOut", "1", _THROTTLE),
    *((name, f"SIDD.G{axis}", "deg/s", _UNFILTERED) for name, axis in zip(RATES, "xyz")),
    *((name, f"RATE.{axis}", "deg/s", _FILTERED) for name, axis in zip(RATES, "RPY")),
    *((name, f"IMU.Gyr{axis}", "rad/s", _FILTERED) for name, axis in zip(RATES, "XYZ")),
    *((f"a{axis}", f"SIDD.A{axis}", "m/s^2", "accelerometer before its filter") for axis in "xyz"),
    *(
        (f"a{axis}", f"IMU.Acc{axis.upper()}", "m/s^2", "accelerometer behind its filter")
        for axis in "xyz"
    ),
    *(
        (name, f"{message}.{word}", "deg", why)
        for message, why in (("ANG", "attitude as the controller has it"), ("ATT", "attitude"))
        for name, word in zip(ATTITUDES, ("Roll", "Pitch", "Yaw"))
    ),
)
"""Channel, column, unit, why: of a channel the best first. Signs are the same: forward-right-down,
and the mixer's commands are positive to the right, nose up, nose right, and up."""
_MIDDLE = {"col": 0.5}  # throttle in the middle of its range, which is no collective
_HELI = (
    ("rollpitch", ("lat", "lon"), ("p", "q"), "roll and pitch were swept"),
    ("tf:0/2", ("lat",), ("p",), "roll alone was swept, so pitch isn't told apart"),
    ("tf:0/2", ("lon",), ("q",), "pitch alone was swept, so roll isn't told apart"),
    ("yaw_base", ("ped",), ("r",), "yaw was swept"),
    ("heave_imu", ("col",), ("az",), "thrust was swept"),
)
_OTHERS = (
    ("tf:0/2", ("lat",), ("p",), "roll was swept"),
    ("tf:0/2", ("lon",), ("q",), "pitch was swept"),
    ("tf:1/2", ("ped",), ("r",), "yaw was swept; the rotors' inertia answers at once, a zero"),
    ("tf:1/2", ("col",), ("az",), "thrust was swept"),
)
"""Structure, inputs, outputs, why; of those with an input in common the first that there is."""
_ROOM = 1.1  # by which a band may be beyond another sweep's, whose effect is still taken out
_SAMPLES_A_PERIOD = 8.0  # of the highest frequency that was swept, in the records
_MAX_GAP = 0.25
"""s without a message that is interpolated: loggers that are pressed drop some now and then."""
_SHORTEST = 0.25
"""Of the longest sweep: parts of one that gaps cut off are left out if they are shorter, for the
shortest says what low frequencies are resolved."""
_HELICOPTER = 6
"""FRAME_CLASS of a helicopter with one main rotor."""
_DROPPED = 0.01  # share of messages that may be missing without a word
_FOLLOWS = 1.0  # average J at which a structure follows: a fiftieth of what is called excellent
_OF_LEAST = 1.3  # of the least average J of all lower edges, where noise keeps it larger than that
_STEP = 1.3  # from one lower edge of a band to the next
_OCTAVES = 3.0  # that a band must still span
_OF_FLAGS = (CrossControlWarning, RecordQualityWarning, ClosedLoopWarning)
"""Warnings that are among the responses' flags."""
_SIGNAL = re.compile(r"'([a-z]+)'(?!\))|\b([a-z]+/[a-z]+)\b")
"""A signal in quotes, or a response, in a flag; not a repair's name, as in repair='spikes')."""


@dataclass(frozen=True)
class TakenChannel:
    """A channel, where it comes from, and why from there.

    Attributes:
        name: of the channel, such as "lat".
        column: of the log, such as RATE.ROut, with its unit.
        rate: samples a second while sweeps were flown, Hz.
        why: it is taken for that.
    """

    name: str
    column: Column
    rate: float
    why: str

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        column = {"column": self.column.column, "unit": self.column.unit}
        return {"name": self.name, **column, "rate_hz": self.rate, "why": self.why}


@dataclass(frozen=True)
class InferredFit:
    """A fit that a log's sweeps allow.

    Attributes:
        structure: such as "rollpitch" or "tf:0/2".
        inputs: of the vehicle.
        outputs: of the vehicle.
        conditioning: further inputs that were swept: their effect is taken out.
        reference: what was injected, for the joint input-output method; none if it isn't possible.
        band: rad/s.
        why: this structure.
    """

    structure: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    conditioning: tuple[str, ...]
    reference: tuple[str, ...]
    band: Band
    why: str

    @property
    def signals(self) -> tuple[str, ...]:
        """All channels that it takes."""
        return (*self.inputs, *self.outputs, *self.conditioning, *self.reference)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        names = {"band": "band_rad_s"}
        said = vars(self).items()
        return {names.get(k, k): list(v) if isinstance(v, tuple) else v for k, v in said}

    def __str__(self) -> str:
        also = f", {', '.join(self.conditioning)} taken out" if self.conditioning else ""
        low, high = self.band
        return (
            f"{self.structure}: {', '.join(self.outputs)} over {', '.join(self.inputs)}{also}, "
            f"{low:.3g} to {high:.3g} rad/s: {self.why}"
        )


@dataclass(frozen=True)
class InferredLog:
    """A log with SystemID's messages, and what they say.

    Attributes:
        path: the file.
        version: what wrote it.
        helicopter: whether its frame is a helicopter's with one main rotor.
        sweeps: that it holds, those of no use too.
        channels: where each comes from.
        parameters: the autopilot's, by name, at last.
        dropped: share of the messages that the logger dropped while sweeps were flown.
    """

    path: str
    version: str
    helicopter: bool
    sweeps: tuple[FlownSweep, ...]
    channels: tuple[TakenChannel, ...]
    parameters: Mapping[str, float]
    dropped: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", FrozenMap(self.parameters))

    def __repr__(self) -> str:
        return f"InferredLog({Path(self.path).name!r}: {len(self.sweeps)} sweeps)"

    @property
    def used(self) -> tuple[FlownSweep, ...]:
        """The sweeps that can identify the vehicle."""
        return tuple(one for one in self.sweeps if not one.unused)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "path": self.path,
            "version": self.version,
            "sweeps": [sweep.to_dict() for sweep in self.sweeps],
            "channels": [channel.to_dict() for channel in self.channels],
            "dropped": self.dropped,
        }

    def __str__(self) -> str:
        lines = [f"{self.path}: {self.version or 'ArduPilot'}, {len(self.sweeps)} sweep(s)"]
        for one in self.sweeps:
            lines.append(f"  {one}" + (f"; not used: {one.unused}" if one.unused else ""))
        return "\n".join(lines)


@dataclass(frozen=True)
class Inferred:
    """An identification as logs say it: sweeps, channels, references, structures and bands.

    Attributes:
        logs: one each.
        sampling: of the records.
        fits: that the sweeps allow.
        diagnostics: what to know of it, and what to set for the next flight.
    """

    logs: tuple[InferredLog, ...]
    sampling: Options
    fits: tuple[InferredFit, ...] = ()
    diagnostics: tuple[str, ...] = ()

    def __repr__(self) -> str:
        swept = some_names(map(str, self.injected))
        fits = some_names(fit.structure for fit in self.fits)
        return f"Inferred({len(self.logs)} log(s); swept: {swept}; fits: {fits})"

    @property
    def used(self) -> tuple[FlownSweep, ...]:
        """The sweeps of all logs that can identify the vehicle."""
        return tuple(one for log in self.logs for one in log.used)

    @property
    def injected(self) -> tuple[SidAxis, ...]:
        """The axes of all sweeps that are used."""
        axes = {one.axis: one.sid_axis for one in self.used}
        return tuple(axes[number] for number in sorted(axes))

    @property
    def channels(self) -> frozenset[str]:
        """The channels that all logs have."""
        have = [frozenset(one.name for one in log.channels) for log in self.logs]
        return frozenset.intersection(*have)

    @property
    def bands(self) -> dict[str, Band]:
        """Control -> the band in which it was swept, rad/s, where it has a channel."""
        controls = dict.fromkeys(one.sid_axis.control for one in self.used)
        return {
            name: (min(one.low for one in mine), max(one.high for one in mine))
            for name in controls
            for mine in [[one for one in self.used if one.sid_axis.control == name]]
            if name in self.channels
        }

    def fit(
        self,
        structure: str,
        inputs: Sequence[str],
        outputs: Sequence[str],
        why: str = "as asked for",
    ) -> InferredFit:
        """Return a fit of another structure, its band and references as the sweeps say.

        Args:
            structure: its name.
            inputs: of the vehicle, which must have been swept.
            outputs: of the vehicle.
            why: this structure.

        Raises:
            InputError: an input wasn't swept, or an output isn't in the logs, or the sweeps have
                no frequency in common.
        """
        bands, channels = self.bands, self.channels
        for name in outputs:
            if name not in channels:
                text = (
                    f"the output {name!r} of {structure} isn't in the logs, as far as their "
                    f"messages say; there are {', '.join(sorted(channels))}; say which column it is"
                )
                raise InputError(text, remedy=Option("channel", f"{name}=COLUMN:UNIT"))
        for name in inputs:
            if name not in bands:
                have = ", ".join(bands) or "none"
                raise InputError(
                    f"the input {name!r} of {structure} wasn't swept in these logs; swept: {have}"
                )
        durations = [one.stop - one.start for one in self.used]
        window = min(min(durations) / 2.0, sum(durations) / 5.0)
        low = max(1.001 * 2.0 * math.pi / window, *(bands[name][0] for name in inputs))
        fastest = PASSBAND * math.pi * (self.sampling.rate or 0.0)
        high = min(fastest, *(bands[name][1] for name in inputs))
        if not low < high:
            raise InputError(
                f"the sweeps of {', '.join(inputs)} have no frequency in common that the log "
                f"resolves: from {low:.3g} to {high:.3g} rad/s; sweep longer, or log faster"
            )
        others = tuple(
            name
            for name, (lowest, highest) in bands.items()
            if name not in inputs and lowest <= _ROOM * low and high <= _ROOM * highest
        )
        moved = (*inputs, *others)
        reference = tuple(axis.name for axis in self.injected if axis.control in moved)
        return InferredFit(
            structure, tuple(inputs), tuple(outputs), others, reference, (low, high), why
        )

    def read(
        self,
        names: Iterable[str] | None = None,
        *,
        on_progress: Callable[[str], None] | None = None,
    ) -> tuple[Log, ...]:
        """Read the sweeps: a log each, whose records have the channels and what was injected.

        Args:
            names: of channels; all by default.
            on_progress: called with each file's name.

        Raises:
            LogError: what is wrong with a log.
        """
        wanted = None if names is None else set(names)
        found: list[Log] = []
        for log in self.logs:
            channels = [one for one in log.channels if wanted is None or one.name in wanted]
            found += self._read(Path(log.path), channels, log.used)
            if on_progress is not None:
                on_progress(Path(log.path).name)
        return tuple(found)

    def _read(
        self, path: Path, channels: Sequence[TakenChannel], used: Sequence[FlownSweep]
    ) -> Iterator[Log]:
        digest = file_digest(path)
        log = open_dataflash(path, digest)
        source, travel = log.source, tail_servo(log.parameters())
        if travel is not None:
            numbers = source.numbers
            source = source.with_column(_SENT, "RATE", lambda: sent_yaw(numbers(_YAW), travel), "1")
        for sweep in used:
            columns = {one.name: one.column for one in channels}
            columns[_INJECTED] = Column("SIDD.Targ", sweep.sid_axis.unit, meaning="injected")
            options = self.sampling._replace(limits=(sweep.start, sweep.stop))
            part = from_source(source, Map(columns), digest, options, {}, Findings())
            yield replace(part, records=tuple(self._named(one, sweep) for one in part.records))

    def _named(self, record: FlightRecord, sweep: FlownSweep) -> FlightRecord:
        """Return a record with what was injected under its axis's name, and none on the others."""
        injected, keep = self.injected, [name != _INJECTED for name in record.names]
        added = [record[_INJECTED] * (axis.number == sweep.axis) for axis in injected]
        channels = [one for one in record.channels if one.name != _INJECTED]
        channels += [
            Channel(axis.name, unit(axis.unit).si, "OTHER", f"injected by SID_AXIS {axis.number}")
            for axis in injected
        ]
        values = np.column_stack([record.values[:, keep], *added])
        facts = {**record.provenance, "sweep": sweep.to_dict()}
        return FlightRecord(record.time, values, tuple(channels), facts)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "logs": [one.to_dict() for one in self.logs],
            "fits": [one.to_dict() for one in self.fits],
            "resampled_hz": self.sampling.rate,
            "max_gap_s": self.sampling.max_gap,
            "diagnostics": list(self.diagnostics),
        }

    def __str__(self) -> str:
        lines = [str(log) for log in self.logs]
        lines += ["channels:", *self._channel_lines()]
        places: dict[tuple[str, str], list[SidAxis]] = {}
        for axis in self.injected:
            places.setdefault((axis.place, axis.unit), []).append(axis)
        lines += [
            f"  {', '.join(axis.name for axis in mine)} = SIDD.Targ [{unit}] of SID_AXIS "
            f"{', '.join(str(axis.number) for axis in mine)}: {PLACES[mine[0].place]}"
            for (_, unit), mine in places.items()
        ]
        lines += ["fits:", *(f"  {one}" for one in self.fits)]
        lines += [f"note: {one}" for one in self.diagnostics]
        return "\n".join(lines)

    def _channel_lines(self) -> list[str]:
        """Return a line for channels that come from one message for one reason, and the others."""
        used = {name for fit in self.fits for name in fit.signals}
        lines = []
        for log in self.logs:
            groups: dict[tuple[str, str, str], list[TakenChannel]] = {}
            for one in (one for one in log.channels if one.name in used):
                message = one.column.column.partition(".")[0]
                sign = "-" if one.column.sign < 0 else ""
                said = f"[{one.column.unit or 'as stated'}], {one.rate:.4g} Hz: {one.why}"
                groups.setdefault((message, sign, said), []).append(one)
            for (message, sign, said), ones in groups.items():
                names = ", ".join(one.name for one in ones)
                fields = ", ".join(one.column.column.partition(".")[2] for one in ones)
                lines.append(f"  {names} = {sign}{message}.{fields} {said}")
        unused = [one.name for one in self.logs[0].channels if one.name not in used]
        lines += [f"  there are also {', '.join(unused)}"] if unused else []
        return list(dict.fromkeys(lines))


def infer(
    logs: str | Path | Iterable[str | Path],
    *,
    channels: Map | Mapping[str, Column] | None = None,
    resample_hz: float | None = None,
    repair: Iterable[str] = (),
    max_gap: float | None = None,
    min_duration: float = 0.0,
    start: float | None = None,
    stop: float | None = None,
) -> Inferred:
    """Infer from logs of ArduPilot's mode SystemID all that an identification has to be told.

    Each sweep becomes a record. What the mixer was commanded drives the vehicle, gyro and
    accelerometer before their filters answer, and what was injected is the reference of the joint
    input-output method: outside the loop, whichever axis it was injected at.

    Args:
        logs: one file or several, of one vehicle.
        channels: channel -> column, where others are wanted than would be chosen.
        resample_hz: of the records, Hz; by default as fast as the sweeps need.
        repair: see `REPAIRS`, besides "gaps" and "duplicates".
        max_gap: the longest time without a message that is interpolated, s; by default 0.25.
        min_duration: parts of a sweep, cut at gaps, that are shorter are left out, s; by default a
            quarter of the longest sweep.
        start: sweeps that begin before are left out, s after the log's first stamp.
        stop: sweeps that end after are left out, s after the log's first stamp.

    Raises:
        StorageError: a file can't be read.
        LogError: a log has no SystemID messages, or lacks others; the message says what to set.
    """
    paths = [logs] if isinstance(logs, str | Path) else list(logs)
    if not paths:
        raise InputError("no logs were given; expected at least one file")
    given = Map.of(channels).channels
    limits = (-math.inf if start is None else start, math.inf if stop is None else stop)
    found = tuple(_inferred(Path(path), given, limits) for path in paths)
    used = [one for log in found for one in log.used]
    if not used:
        why: dict[str, list[str]] = {}
        for one in (sweep for log in found for sweep in log.sweeps):
            why.setdefault(one.unused, []).append(f"{one.axis} at {one.start:.1f} s")
        reasons = "; ".join(f"SID_AXIS {', '.join(at)}: {text}" for text, at in why.items())
        raise LogError(f"{paths[0]}: no sweep in it identifies the vehicle: {reasons}")
    needed = _SAMPLES_A_PERIOD * max(one.high for one in used) / (2.0 * math.pi)
    slowest = min(one.rate for log in found for one in log.channels if one.rate > 0.0)
    rate = resample_hz or float(f"{slowest / max(1, math.floor(slowest / needed)):.6g}")
    gap = _MAX_GAP if max_gap is None else max_gap
    asked = (repair,) if isinstance(repair, str) else repair
    shortest = min_duration or _SHORTEST * max(one.stop - one.start for one in used)
    made = Inferred(found, reading_options(rate, {*_REPAIRS, *asked}, gap, shortest))
    fits: list[InferredFit] = []
    for structure, inputs, outputs, reason in _HELI if _all_helicopters(found) else _OTHERS:
        taken = {name for fit in fits for name in fit.inputs}
        there = made.channels.issuperset(outputs) and set(inputs) <= set(made.bands)
        if there and not taken & set(inputs):
            fits.append(made.fit(structure, inputs, outputs, reason))
    said = [one for log in found for one in _diagnostics(log, rate)] + _of_fits(found, fits)
    return replace(made, fits=tuple(fits), diagnostics=tuple(dict.fromkeys(said)))


def _all_helicopters(logs: Sequence[InferredLog]) -> bool:
    return all(log.helicopter for log in logs)


def _inferred(path: Path, given: Mapping[str, Column], limits: Band) -> InferredLog:
    log = open_dataflash(path, file_digest(path))
    first, every, parameters = min(log.first_stamps.values()), sweeps(log), log.parameters()
    mine = tuple(one for one in every if limits[0] <= one.start and one.stop <= limits[1])
    if not mine:
        spans = ", ".join(f"{one.start:.1f} to {one.stop:.1f}" for one in every)
        text = f"{path}: no sweep lies within the limits; they are from {spans} s after the log's"
        raise LogError(f"{text} first sample", remedy="from,to")
    spans = [(one.start + first, one.stop + first) for one in mine]
    frame = parameters.get("FRAME_CLASS", float("H_SW_TYPE" in parameters) * _HELICOPTER)
    return InferredLog(
        path=str(path),
        version=log.version,
        helicopter=frame == _HELICOPTER,
        sweeps=mine,
        channels=_chosen_channels(log, given, spans),
        parameters=parameters,
        dropped=usual_step(log.table("SIDD").time, spans)[1],
    )


def _chosen_channels(
    log: DataFlash, given: Mapping[str, Column], spans: _Spans
) -> tuple[TakenChannel, ...]:
    """Return all channels that a log can give, beside those that its sweeps are."""
    columns = [column for _, column, *_ in _CANDIDATES] + [one.column for one in given.values()]
    rates = {}
    for message in dict.fromkeys(["SIDD", *(column.partition(".")[0] for column in columns)]):
        step = usual_step(log.table(message).time, spans)[0] if message in log else 0.0
        rates[message] = float(f"{1.0 / step:.3g}") if step > 0.0 else 0.0
    sent = tail_servo(log.parameters())
    taken = {
        name: TakenChannel(name, column, rates[column.column.partition(".")[0]], "given")
        for name, column in given.items()
    }
    for name, column, given_in, why in _CANDIDATES:
        message, _, field = column.partition(".")
        fast = message in log and rates[message] >= _FAST * rates["SIDD"]
        if name in taken or not fast or field not in log.table(message).columns:
            continue
        if column == _YAW and sent is not None:
            column, why = _SENT, _SENT_WHY.format(*sent)
        mapped = Column(column, given_in, trim=_MIDDLE.get(name))
        taken[name] = TakenChannel(name, mapped, rates[message], why)
    if not {"lat", "lon", "ped", "col"} & set(taken):
        raise LogError(
            f"{log.path}: no RATE messages beside the sweeps, which say what the mixer was "
            "commanded; set LOG_BITMASK's bits 0 and 1, or say which columns the commands are",
            remedy=Option("channel", "lat=COLUMN:UNIT"),
        )
    return tuple(taken.values())


def usual_step(time: NDArray[np.float64], spans: _Spans) -> tuple[float, float]:
    """Return the step between messages that none is missing in, s, and the share that is missing.

    Steps of a loop alternate where its period is no whole number of the clock's. Zeros if there
    are no steps.

    Args:
        time: (n_time,) of messages, s.
        spans: that are looked at, s.
    """
    each = [np.diff(time[(time >= start) & (time <= stop)]) for start, stop in spans]
    steps = np.concatenate(each)
    steps = steps[steps > 0.0]
    if not steps.size:
        return 0.0, 0.0
    usual = float(np.mean(steps[steps < _ONE_MORE * np.median(steps)]))
    missing = float(np.sum(np.rint(steps / usual).clip(1.0) - 1.0))
    return usual, missing / (missing + steps.size)


def tail_servo(parameters: Mapping[str, float]) -> tuple[float, float] | None:
    """Return the tail servo's travel to the right and to the left, us; None if it isn't one.

    ArduPilot moves the tail's servo by whole microseconds, cut toward its trim: a small command of
    yaw moves it less, or not at all, which the mixer's command doesn't tell.

    Args:
        parameters: the autopilot's, by name.
    """
    if parameters.get("H_TAIL_TYPE", 0.0) != 0.0 or parameters.get("H_COL2YAW", 0.0) != 0.0:
        return None
    servos = (f"SERVO{k}" for k in range(1, _SERVOS + 1))
    one = next((s for s in servos if parameters.get(f"{s}_FUNCTION") == _TAIL), "")
    low, trim, high = (parameters.get(f"{one}_{name}", 0.0) for name in ("MIN", "TRIM", "MAX"))
    right, left = high - trim, trim - low
    if parameters.get(f"{one}_REVERSED", 0.0):
        right, left = left, right
    return (right, left) if min(right, left) > 0.0 else None


def sent_yaw(command: NDArray[np.float64], travel: tuple[float, float]) -> NDArray[np.float64]:
    """Return the yaw command that a tail servo was sent, (n_time,), 1 at its end.

    Args:
        command: the mixer's, (n_time,).
        travel: to the right and to the left, us.
    """
    angle = np.trunc(command * _FULL)
    side = np.where(angle > 0.0, *travel)
    return np.sign(angle) * np.floor(np.abs(angle) * side / _FULL) / side


def _diagnostics(log: InferredLog, rate: float) -> Iterator[str]:
    """Yield what to know of a log in records of a rate, Hz."""
    if log.dropped > _DROPPED:
        yield (
            f"{log.path}: the logger dropped {100.0 * log.dropped:.0f} % of the messages while "
            "sweeps were flown; the rest is interpolated, which costs accuracy where the sweep is "
            "fast: log fewer messages (LOG_BITMASK), or with a larger buffer (LOG_FILE_BUFSIZE)"
        )
    fastest = max((one.high for one in log.used), default=0.0)
    if fastest > PASSBAND * math.pi * rate:
        yield (
            f"{log.path}: sweeps go up to {fastest:.3g} rad/s, and its messages, {rate:.4g} Hz, "
            f"show {PASSBAND * math.pi * rate:.3g} rad/s; set LOG_BITMASK's bits 0 and 1 to log "
            "every loop"
        )
    corner = 2.0 * math.pi * log.parameters.get("INS_GYRO_FILTER", 0.0)
    filtered = [one for one in log.channels if one.column.column.startswith(("RATE.", "IMU."))]
    behind = [one.name for one in filtered if one.name in RATES]
    if behind and corner > 0.0:
        yield (
            f"{', '.join(behind)} are behind the gyro's filter, INS_GYRO_FILTER "
            f"{corner / (2.0 * math.pi):g} Hz of second order, which delays by "
            f"{1e3 * math.sqrt(2.0) / corner:.2g} ms; take it out, as known: "
            f"{','.join(behind)}=low_pass:corner={corner:.4g},order=2"
        )
    arm = [log.parameters.get(f"INS_POS1_{axis}", 0.0) for axis in "XYZ"]
    if any(arm) and any(one.name == "az" for one in log.channels):
        yield (
            f"the accelerometer sits at {arm[0]:g}, {arm[1]:g}, {arm[2]:g} m (INS_POS1): its "
            "acceleration isn't moved to the centre of gravity"
        )


def _of_fits(logs: Sequence[InferredLog], fits: Sequence[InferredFit]) -> list[str]:
    """Return what to know of the fits that sweeps allow."""
    if not _all_helicopters(logs):
        return [
            "not a helicopter with one main rotor (FRAME_CLASS isn't 6): transfer functions are "
            "fitted in place of a helicopter's structures"
        ]
    alone = {name for fit in fits if fit.structure == "tf:0/2" for name in fit.inputs}
    return [
        f"{other} wasn't swept, so its controller's answer to {swept} is part of what is "
        f"identified; sweep {other} too (SID_AXIS {axis})"
        for name, swept, other, axis in (("lat", "roll", "pitch", 11), ("lon", "pitch", "roll", 10))
        if name in alone
    ]


def estimate_fits(
    records: Sequence[FlightRecord],
    fits: Sequence[InferredFit],
    options: Mapping[str, Any] | None = None,
) -> tuple[FrequencyResponse, ...]:
    """Return the frequency response of each fit, by the joint input-output method.

    Args:
        records: one each sweep or part of it, as `Inferred.read` gives them.
        fits: to estimate responses for; they may share one.
        options: further ones of `frequency_response`, such as {"estimator": "windows"}.

    Raises:
        IdentificationError: the records are too short, or inputs moved as one.
    """
    groups: dict[tuple[frozenset[str], tuple[str, ...]], list[int]] = {}
    for k, fit in enumerate(fits):
        active = frozenset((*fit.inputs, *fit.conditioning))
        groups.setdefault((active, fit.reference), []).append(k)
    found: dict[int, FrequencyResponse] = {}
    for (active, reference), places in groups.items():
        mine = [fits[k] for k in places]
        inputs = tuple(dict.fromkeys(name for fit in mine for name in fit.inputs))
        with warnings.catch_warnings():
            for category in _OF_FLAGS:
                warnings.simplefilter("ignore", category)
            response = frequency_response(
                records,
                inputs=inputs,
                outputs=tuple(dict.fromkeys(name for fit in mine for name in fit.outputs)),
                conditioning=tuple(sorted(active - set(inputs))),
                reference=reference,
                band=(min(fit.band[0] for fit in mine), max(fit.band[1] for fit in mine)),
                **(options or {}),
            )
        found |= {k: _flagged(response, fits[k]) for k in places}
    return tuple(found[k] for k in range(len(fits)))


def _flagged(response: FrequencyResponse, fit: InferredFit) -> FrequencyResponse:
    """Return a response with the flags that are about a fit's signals, or about none."""
    sensed = {*fit.outputs, *(f"{out}/{into}" for out in fit.outputs for into in fit.inputs)}
    kept = []
    for flag in response.flags:
        names = {a or b for a, b in _SIGNAL.findall(flag)}
        # a command's steps are a controller's own, and those of pulses in whole microseconds
        mine = sensed if "spikes" in flag else sensed | set(fit.inputs)
        kept += [flag] if not names or names & mine else []
    return replace(response, flags=tuple(kept))


def followed_band(frf: FrequencyResponse, structure: Structure, band: Band, **search: Any) -> Band:
    """Return the widest band of those with the same upper edge that a structure follows.

    At low frequencies a helicopter's speeds come into play, which structures of rates alone don't
    have. The lower edge is raised until the average J is small, or as small as noise lets it be.

    Args:
        frf: the data.
        structure: to fit.
        band: rad/s.
        **search: options of `identify`.
    """
    edge, high = band
    tried: list[tuple[float, float]] = []
    while not tried or high / edge >= 2.0**_OCTAVES:
        try:
            tried.append((edge, identify(frf, structure, band=(edge, high), **search).cost))
        except HelisimError:
            break
        if tried[-1][1] <= _FOLLOWS:
            break
        edge *= _STEP
    if not tried:
        return band
    least = max(_FOLLOWS, _OF_LEAST * min(cost for _, cost in tried))
    return next(edge for edge, cost in tried if cost <= least), high
