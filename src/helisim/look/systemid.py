"""Infers an identification from logs of ArduPilot's mode SystemID."""

import cmath
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.arrays import Real
from helisim.base.errors import HelisimError, InputError, LogError
from helisim.base.note import Option
from helisim.base.settings import FrozenMap, grouped, to_plain
from helisim.base.units import RAD_S_PER_RPM, STANDARD_GRAVITY
from helisim.ident import FrequencyResponse, Structure, identify
from helisim.ident.conditions import Conditions
from helisim.ident.frf import estimated
from helisim.ident.windows import lowest_line
from helisim.logs.dataflash import DataFlash, open_dataflash
from helisim.logs.mapping import Column, Map
from helisim.logs.read import from_source
from helisim.logs.report import Log
from helisim.logs.resample import PASSBAND
from helisim.logs.source import file_digest
from helisim.logs.timing import Options
from helisim.look.sweeps import DAMAGE, FlownSweep, SidAxis, Spans, sweeps, usual_step, within
from helisim.records.record import (
    ACCELERATIONS,
    ATTITUDES,
    RATES,
    Channel,
    FlightRecord,
    some_names,
)

Band = tuple[float, float]
_FAST = 0.5  # of SIDD's rate: a message that is slower than that is no good beside it
_YAW, _SENT = "RATE.YOut", "RATE.YOut as sent"
_TAIL, _SERVOS = 36, 32  # SERVOn_FUNCTION of a helicopter's tail, and how many servos there are
_FULL = 4500.0  # hundredths of a degree at the end of the tail servo's travel
_SIDE = "v_dot"
_SIDE_OF = ("ay", "phi", "p", "r")  # channels that side acceleration is made of
_SIDE_WHY = "side acceleration of the centre of gravity, ay + g sin(phi) less the lever arm's"
_REPAIRS = frozenset({"gaps", "duplicates", "missing"})  # faults of a logger, or of bytes
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
"""Channel, column, unit, why, best first; body axes, commands right, nose up, nose right, up."""
_MIXER = "ArduPilot's own commands to its mixer"
_OUTPUTS = ("RATE.ROut", "RATE.POut", _YAW, _SENT, "RATE.AOut")
_HOVER = (
    ("rotor_speed", "RPM", "RPM", RAD_S_PER_RPM, (1.0, math.inf)),
    ("rotor_speed", "RPM", "rpm1", RAD_S_PER_RPM, (1.0, math.inf)),
    ("hover", "RATE", "AOut", 1.0, (0.0, 1.0)),
    ("lean", "ANG", "Roll", math.radians(1.0), (-180.0, 180.0)),
    ("lean", "ATT", "Roll", math.radians(1.0), (-180.0, 180.0)),
)
"""What a message says of the hover, its field, SI per unit, and sound values in it; best first.

RPM's first sensor is ArduPilot's main rotor, 0 or -1 without a signal.
"""
# _GOVERNOR: H_RSC_MODE in which ArduPilot itself holds H_RSC_GOV_RPM
# _MIDDLE: throttle in the middle of its range, which is no collective
_GOVERNOR, _MIDDLE = 4.0, {"col": 0.5}
_HELI = (
    ("rollpitch_speeds", ("lat", "lon"), ("p", "q"), "roll and pitch were swept"),
    (
        "tf:0/2",
        ("lat",),
        ("p",),
        "roll was swept, pitch wasn't: its controller's answer is in the fit; sweep it too "
        "(SID_AXIS 11)",
    ),
    (
        "tf:0/2",
        ("lon",),
        ("q",),
        "pitch was swept, roll wasn't: its controller's answer is in the fit; sweep it too "
        "(SID_AXIS 10)",
    ),
    ("yaw_base", ("ped",), ("r",), "yaw was swept; what sideslip does is taken out"),
    (
        "yaw_alone",
        ("ped",),
        ("r",),
        "yaw was swept; sideslip, which isn't known, can make N_r a quarter too large: sweep roll "
        "too (SID_AXIS 10) and log attitude (ANG), which take it out",
    ),
    ("heave_imu", ("col",), ("az",), "thrust was swept"),
)
_OTHERS = (
    ("tf:0/2", ("lat",), ("p",), "roll was swept"),
    ("tf:0/2", ("lon",), ("q",), "pitch was swept"),
    ("tf:1/2", ("ped",), ("r",), "yaw was swept; the rotors' inertia answers at once, a zero"),
    ("tf:1/2", ("col",), ("az",), "thrust was swept"),
)  # Structure, inputs, outputs, why; of those with a common input the first possible one
# _ROOM: by which a band may be beyond another sweep's, whose effect is still taken out
# _SAMPLES_A_PERIOD: of the highest frequency that was swept, in the records
_ROOM, _SAMPLES_A_PERIOD = 1.1, 8.0
# _MAX_GAP: s without a message: at more a sweep is cut in two
# _SHORTEST: of the longest sweep: shorter parts are left out
_MAX_GAP, _SHORTEST = 1.0, 0.25
# _HELICOPTER: FRAME_CLASS of a helicopter with one main rotor
# _DROPPED: share of messages that may be missing without a word
_HELICOPTER, _DROPPED = 6, 0.01
# _FOLLOWS: average J at which a structure follows: a fiftieth of what is called excellent
# _OF_LEAST: of the least average J of all lower edges, where noise keeps it larger than that
_FOLLOWS, _OF_LEAST = 1.0, 1.3
_STEP, _OCTAVES = 1.3, 3.0  # from one lower edge of a band to the next; that a band must still span


@dataclass(frozen=True)
class TakenChannel:
    """A channel, its column such as RATE.ROut, its rate during sweeps (Hz), and why."""

    name: str
    column: Column
    rate: float
    why: str

    def __str__(self) -> str:
        return (
            f"{self.name} = {self.column.column} [{self.column.unit or 'as stated'}], "
            f"{self.rate:.4g} Hz: {self.why}"
        )


@dataclass(frozen=True)
class InferredFit:
    """A fit that the sweeps allow in a band, rad/s; `reference` are the injected signals."""

    structure: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    conditioning: tuple[str, ...]
    reference: tuple[str, ...]
    band: Band
    why: str

    def __str__(self) -> str:
        also = f", {', '.join(self.conditioning)} taken out" if self.conditioning else ""
        low, high = self.band
        return (
            f"{self.structure}: {', '.join(self.outputs)} over {', '.join(self.inputs)}{also}, "
            f"{low:.3g} to {high:.3g} rad/s: {self.why}"
        )


@dataclass(frozen=True)
class InferredLog:
    """A log with SystemID's messages; `dropped` is the share lost during sweeps.

    `conditions` are the commands' full travel, and the hover in which sweeps were flown.
    `findings` tell of damage, and of several logs in one.
    """

    path: str
    version: str
    helicopter: bool
    sweeps: tuple[FlownSweep, ...]
    channels: tuple[TakenChannel, ...]
    parameters: FrozenMap[str, float] = field(repr=False)
    dropped: float
    conditions: Conditions = field(default_factory=Conditions)
    findings: tuple[str, ...] = ()

    @property
    def used(self) -> tuple[FlownSweep, ...]:
        """Sweeps that can identify the vehicle."""
        return tuple(one for one in self.sweeps if not one.unused)

    def __str__(self) -> str:
        head = f"{self.path}: {self.version or 'ArduPilot'}, {len(self.sweeps)} sweep(s)"
        told = [f"  {self.conditions}"] if self.helicopter else []
        return "\n".join([head, *(f"  {one}" for one in self.sweeps), *told])


@dataclass(frozen=True)
class Inferred:
    """An identification inferred from logs; `diagnostics` tell what to set next time."""

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
        """Sweeps of all logs that can identify the vehicle."""
        return tuple(one for log in self.logs for one in log.used)

    @property
    def injected(self) -> tuple[SidAxis, ...]:
        """Axes of the used sweeps."""
        return tuple(sorted({one.sid_axis for one in self.used}, key=lambda axis: axis.number))

    @property
    def channels(self) -> frozenset[str]:
        """Channels that all logs have, or that are made of theirs."""
        have = frozenset.intersection(*(frozenset(c.name for c in o.channels) for o in self.logs))
        return have | {_SIDE} if have.issuperset(_SIDE_OF) else have

    @property
    def bands(self) -> dict[str, Band]:
        """Control -> the band in which it was swept, rad/s."""
        swept = grouped(self.used, lambda one: one.sid_axis.control)
        return {
            name: (min(one.low for one in of), max(one.high for one in of))
            for name, of in swept.items()
            if name in self.channels
        }

    def fit(
        self,
        structure: str,
        inputs: Sequence[str],
        outputs: Sequence[str],
        why: str = "as asked for",
    ) -> InferredFit:
        """Return a fit of another structure, with band and references of the sweeps.

        Raises InputError if an input wasn't swept, an output is missing, or bands don't overlap.
        """
        bands, channels = self.bands, self.channels
        for name in (one for one in outputs if one not in channels):
            raise InputError(
                f"the output {name!r} of {structure} isn't in the logs, as far as their messages "
                f"say; there are {', '.join(sorted(channels))}; say which column it is",
                remedy=Option("channel", f"{name}=COLUMN:UNIT"),
            )
        for name in (one for one in inputs if one not in bands):
            raise InputError(
                f"the input {name!r} of {structure} wasn't swept in these logs; swept: "
                f"{', '.join(bands) or 'none'}"
            )
        lasts = [one.stop - one.start for one in self.used]
        resolved = (
            1.001 * lowest_line(lasts),
            PASSBAND * math.pi * (self.sampling.resample_hz or 0.0),
        )
        lows, highs = zip(resolved, *(bands[name] for name in inputs))
        low, high = max(lows), min(highs)
        if not low < high:
            raise InputError(
                f"the sweeps of {', '.join(inputs)} have no frequency in common that the log "
                f"resolves: from {low:.3g} to {high:.3g} rad/s; sweep longer, or log faster"
            )
        others = tuple(
            name
            for name, (first, last) in bands.items()
            if name not in inputs and first <= _ROOM * low and high <= _ROOM * last
        )
        names = tuple(one.name for one in self.injected if one.control in (*inputs, *others))
        if structure == "yaw_base" and _SIDE in channels:
            # roll turns the nose by the side velocity that it makes, and so does yaw
            others = tuple(_SIDE if name == "lat" else name for name in others)
        return InferredFit(
            structure, tuple(inputs), tuple(outputs), others, names, (low, high), why
        )

    def read(
        self,
        names: Iterable[str] | None = None,
        *,
        on_progress: Callable[[str], None] | None = None,
    ) -> tuple[Log, ...]:
        """Return a log for each sweep: records of `names` (default all) and the injected signal.

        Raises LogError. `on_progress` is called with each file's name.
        """
        wanted = set(self.channels if names is None else names)
        wanted |= set(_SIDE_OF) if _SIDE in wanted else set()
        found: list[Log] = []
        for one in self.logs:
            path = Path(one.path)
            digest = file_digest(path)
            log = open_dataflash(path, digest)
            source, travel = log.source, tail_servo(log.parameters())
            if travel is not None:
                source = source.with_column(_SENT, _YAW, partial(sent_yaw, travel=travel))
            place = imu_place(log.parameters()) if _SIDE in wanted else None
            columns = {c.name: c.column for c in one.channels if c.name in wanted}
            for sweep in one.used:
                axis = sweep.sid_axis
                injected = {axis.name: Column("SIDD.Targ", axis.unit, meaning=axis.channel.meaning)}
                options = replace(self.sampling, start=sweep.start, stop=sweep.stop)
                part = from_source(source, Map(columns | injected), digest, options)
                told = {"sweep": sweep.to_dict(), "conditions": to_plain(one.conditions)}
                records = tuple(
                    self._completed(record, sweep, place, told) for record in part.records
                )
                found.append(replace(part, records=records))
            if on_progress is not None:
                on_progress(path.name)
        return tuple(found)

    def _completed(
        self,
        record: FlightRecord,
        sweep: FlownSweep,
        place: Sequence[float] | None,
        told: Mapping[str, Any],
    ) -> FlightRecord:
        """Return a sweep's record with all injected signals, and the side acceleration."""
        own = [one for one in record.channels if one.name != sweep.sid_axis.name]
        channels = [*own, *(axis.channel for axis in self.injected)]
        of_sweep = [
            record[sweep.sid_axis.name] * (axis == sweep.sid_axis) for axis in self.injected
        ]
        columns = [*(record[one.name] for one in own), *of_sweep]
        facts = {**record.provenance, **told}
        if place is not None:
            columns.append(side_acceleration(record, place))
            channels.append(Channel(_SIDE, "m/s^2", "OTHER", _SIDE_WHY))
            spans = record.provenance.get("missing", {})
            lost = [*chain.from_iterable(spans.get(one, ()) for one in _SIDE_OF)]
            facts |= {"missing": {**spans, _SIDE: lost}} if lost else {}
        return FlightRecord(record.time, np.column_stack(columns), tuple(channels), facts)

    def __str__(self) -> str:
        used = {n for fit in self.fits for n in (*fit.inputs, *fit.outputs, *fit.conditioning)}
        used |= set(_SIDE_OF) if _SIDE in used else set()
        taken = [one for log in self.logs for one in log.channels]
        rest = dict.fromkeys(one.name for one in taken if one.name not in used)
        lines = [
            *map(str, self.logs),
            "channels:",
            *dict.fromkeys(f"  {one}" for one in taken if one.name in used),
            *([f"  {_SIDE} [m/s^2]: {_SIDE_WHY}"] if _SIDE in used else ()),
            *([f"  there are also {', '.join(rest)}"] if rest else ()),
            *(
                f"  {axis.name} = SIDD.Targ [{axis.unit}] of SID_AXIS {axis.number}"
                for axis in self.injected
            ),
            "fits:",
            *(f"  {one}" for one in self.fits),
            *(f"note: {one}" for one in self.diagnostics),
        ]
        return "\n".join(lines)


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
    """Infer inputs, outputs, band and structures from logs of ArduPilot's mode SystemID.

    Each sweep becomes a record; the mixer's commands are inputs, unfiltered gyros and
    accelerometers outputs, and the injected signal is the reference (joint input-output method).

    Args:
        logs: one file or several, of one vehicle.
        channels: channel -> column, in place of the default choice.
        resample_hz: Hz; default as fast as the sweeps need.
        repair: see `REPAIRS`, besides "gaps" and "duplicates".
        max_gap: longest gap that cuts no sweep in two, s; default 1.
        min_duration: parts of a sweep below it are left out, s; default a quarter of the longest.
        start: earliest start of sweeps, s after the log's first stamp.
        stop: latest end of sweeps, s.

    Raises StorageError; LogError if messages are missing, with what to set.
    """
    paths = [logs] if isinstance(logs, str | Path) else list(logs)
    if not paths:
        raise InputError("no logs were given; expected at least one file")
    found = tuple(_inferred(Path(one), Map.of(channels).channels, start, stop) for one in paths)
    used = [one for log in found for one in log.used]
    if not used:
        every = [one for log in found for one in log.sweeps]
        why = "; ".join(dict.fromkeys(one.unused for one in every))
        axes = ", ".join(f"{one.axis} at {one.start:.1f} s" for one in every)
        raise LogError(
            f"{paths[0]}: no sweep in it identifies the vehicle: SID_AXIS {axes}: {why}; fly the "
            "mode SystemID again, with SID_AXIS 10 to 13"
        )
    needed = _SAMPLES_A_PERIOD * max(one.high for one in used) / (2.0 * math.pi)
    slowest = min(one.rate for log in found for one in log.channels if one.rate > 0.0)
    rate = resample_hz or float(f"{slowest / max(1, math.floor(slowest / needed)):.6g}")
    asked = (repair,) if isinstance(repair, str) else repair
    made = Inferred(
        found,
        Options(
            rate,
            {*_REPAIRS, *asked},
            _MAX_GAP if max_gap is None else max_gap,
            min_duration or _SHORTEST * max(one.stop - one.start for one in used),
        ),
    )
    helicopters = all(log.helicopter for log in found)
    fits: list[InferredFit] = []
    said = [one for log in found for one in _diagnostics(log, rate)]
    free = set(made.bands)  # controls that no fit has yet
    for structure, inputs, outputs, reason in _HELI if helicopters else _OTHERS:
        if made.channels.issuperset(outputs) and free.issuperset(inputs):
            try:
                fit = made.fit(structure, inputs, outputs, reason)
            except InputError as error:
                said.append(f"{structure} isn't fitted: {error}")
                continue
            # without side velocity the next structure is honest
            if structure != "yaw_base" or _SIDE in fit.conditioning:
                fits.append(fit)
                free.difference_update(inputs)
    if not helicopters:
        said.append(
            "not a helicopter with one main rotor (FRAME_CLASS isn't 6): transfer functions are "
            "fitted in place of a helicopter's structures"
        )
    return replace(made, fits=tuple(fits), diagnostics=tuple(dict.fromkeys(said)))


def _inferred(
    path: Path, given: Mapping[str, Column], start: float | None, stop: float | None
) -> InferredLog:
    log = open_dataflash(path, file_digest(path))
    every, parameters = sweeps(log), log.parameters()
    mine = within(every, start, stop)
    if not mine:
        spans = ", ".join(f"{one.start:.1f} to {one.stop:.1f}" for one in every)
        raise LogError(
            f"{path}: no sweep lies within the limits; they are from {spans} s after the log's "
            "first sample",
            remedy="from,to",
        )
    spans = [(one.start + log.begins, one.stop + log.begins) for one in mine]
    own = _HELICOPTER * (not parameters or any(one.startswith("H_RSC_") for one in parameters))
    channels = _chosen_channels(log, given, spans)
    return InferredLog(
        path=str(path),
        version=log.version,
        helicopter=parameters.get("FRAME_CLASS", own) == _HELICOPTER,
        sweeps=mine,
        channels=channels,
        parameters=FrozenMap(parameters),
        dropped=usual_step(log.table("SIDD").time, spans)[1],
        conditions=_conditions(log, channels, spans),
        findings=tuple(one.text for one in log.source.findings if one.kind in DAMAGE),
    )


def _conditions(log: DataFlash, channels: Sequence[TakenChannel], spans: Spans) -> Conditions:
    """Return what a log says of its commands and of the hover in which sweeps were flown."""
    parameters, found, known = log.parameters(), dict[str, float](), {"full": _MIXER}
    for name, message, word, factor, (low, high) in _HOVER:
        values = _flown(log, message, word, spans)
        if name not in found and values.size and low <= (middle := np.median(values)) <= high:
            found[name] = factor * float(middle)
            known[name] = f"{message}.{word}, median of the sweeps"
    governs = (
        parameters.get("H_RSC_MODE") == _GOVERNOR and parameters.get("H_RSC_GOV_RPM", 0.0) > 0.0
    )
    for name, word, factor, holds in (
        ("rotor_speed", "H_RSC_GOV_RPM", RAD_S_PER_RPM, governs),
        ("lean", "ATC_HOVR_ROL_TRM", math.radians(0.01), "ATC_HOVR_ROL_TRM" in parameters),
    ):
        if holds and name not in found:
            found[name] = factor * parameters[word]
            known[name] = f"the parameter {word}, not measured"
    if "rotor_speed" not in found:
        motor = _flown(log, "ESC", "RPM", spans)
        told = f"; ESC.RPM, {np.median(motor):.5g} rpm, is the motor's" if motor.size else ""
        known["rotor_speed"] = f"no RPM message, and H_RSC_MODE isn't 4, ArduPilot's governor{told}"
    north, east = (_flown(log, "XKF2", field, spans) for field in ("VWN", "VWE"))
    if np.any(north) or np.any(east):
        middle = complex(np.median(north), np.median(east))
        found["wind"] = abs(middle)
        blows = math.degrees(cmath.phase(-middle)) % 360.0
        known["wind"] = f"the EKF's, XKF2, median of the sweeps, from {blows:.0f} deg"
    else:
        known["wind"] = (
            "its EKF estimates none; steady lean tells none either, of a helicopter, which the "
            "tail rotor leans more: sweep in a calm, as derivatives by speeds change with it"
        )
    own = [one for one in channels if one.column.column in _OUTPUTS and one.why != "given"]
    return Conditions(full={one.name: 1.0 for one in own}, known_by=known, **found)


def _flown(log: DataFlash, message: str, field: str, spans: Spans) -> Real:
    """Return a field of a message's first sensor during sweeps, (n_message,); none if it lacks."""
    if not log.has(message, field) or 0 not in log.instances(message):
        return np.zeros(0)
    table = log.table(message)
    values, time = np.asarray(table[field], np.float64), table.time
    inside = np.any([(time >= start) & (time <= stop) for start, stop in spans], axis=0)
    return values[inside & np.isfinite(values)]


def _chosen_channels(
    log: DataFlash, given: Mapping[str, Column], spans: Spans
) -> tuple[TakenChannel, ...]:
    @cache
    def rate(message: str) -> float:
        step = usual_step(log.table(message).time, spans)[0] if message in log else 0.0
        return float(f"{1.0 / step:.3g}") if step > 0.0 else 0.0

    sent = tail_servo(log.parameters())
    known = [(name, column, "given") for name, column in given.items()]
    for name, column, given_in, why in _CANDIDATES:
        message = column.partition(".")[0]
        fast = message in log and rate(message) >= _FAST * rate("SIDD")
        if fast and column in log.source.names:
            if sent and column == _YAW:
                column, why = _SENT, _SENT_WHY.format(*sent)
            known.append((name, Column(column, given_in, trim=_MIDDLE.get(name)), why))
    taken: dict[str, TakenChannel] = {}
    for name, column, why in known:  # the first of a channel is the best
        taken.setdefault(
            name, TakenChannel(name, column, rate(column.column.partition(".")[0]), why)
        )
    if not {"lat", "lon", "ped", "col"} & set(taken):
        raise LogError(
            f"{log.named}no RATE messages {'can be read ' * bool(log.damage)}beside the sweeps, "
            "which say what the mixer was commanded; "
            f"{'' if log.damage else 'set bits 0 and 1 of LOG_BITMASK, or '}say which columns the "
            "commands are",
            remedy=Option("channel", "lat=COLUMN:UNIT"),
        )
    return tuple(taken.values())


def tail_servo(parameters: Mapping[str, float]) -> tuple[float, float] | None:
    """Return the tail servo's travel to the right and left, us; None if the tail has no servo."""
    if parameters.get("H_TAIL_TYPE", 0.0) or parameters.get("H_COL2YAW", 0.0):
        return None
    servos = (f"SERVO{k}" for k in range(1, _SERVOS + 1))
    one = next((s for s in servos if parameters.get(f"{s}_FUNCTION") == _TAIL), "")
    low, trim, high = (parameters.get(f"{one}_{name}", 0.0) for name in ("MIN", "TRIM", "MAX"))
    right, left = high - trim, trim - low
    sides = (left, right) if parameters.get(f"{one}_REVERSED", 0.0) else (right, left)
    return sides if min(sides) > 0.0 else None


def sent_yaw(command: Real, travel: tuple[float, float]) -> Real:
    """Return the yaw command as sent to a tail servo, 1 at its end, (n_time,) each."""
    angle = np.trunc(command * _FULL)
    side = np.where(angle > 0.0, *travel)
    return np.sign(angle) * np.floor(np.abs(angle) * side / _FULL) / side


def imu_place(parameters: Mapping[str, float]) -> tuple[float, ...]:
    """Return the accelerometer's place (INS_POS1), m forward, right, down of the centre."""
    return tuple(parameters.get(f"INS_POS1_{axis}", 0.0) for axis in "XYZ")


def side_acceleration(record: FlightRecord, place: Sequence[float]) -> Real:
    """Return dv/dt of the centre of gravity, m/s^2, (n_time,): ay + g sin(phi), less the arm's.

    `place`, m, is the accelerometer's, forward, right and down of it: there v + x r - z p is felt.
    """
    p, r = (np.gradient(record[name], record.sample_time) for name in "pr")
    return record["ay"] + STANDARD_GRAVITY * np.sin(record["phi"]) - place[0] * r + place[2] * p


def _diagnostics(log: InferredLog, rate: float) -> list[str]:
    """Return notes on a log read at a rate, Hz."""
    shown, have = PASSBAND * math.pi * rate, {one.name for one in log.channels}
    corner = 2.0 * math.pi * log.parameters.get("INS_GYRO_FILTER", 0.0)
    late = 1e3 * math.sqrt(2.0) / corner if corner > 0.0 else 0.0
    behind = ",".join(one.name for one in log.channels if one.why == _FILTERED)
    x, y, z = imu_place(log.parameters)
    yawed = any(one.sid_axis.control == "ped" for one in log.used)
    notes = (
        (
            log.findings and not log.parameters,
            f"{log.path}: no parameters (PARM) are left: it is taken for a helicopter with one "
            "main rotor, and nothing tells where its sensors sit",
        ),
        (
            log.dropped > _DROPPED and not log.findings,
            f"{log.path}: the logger dropped {100.0 * log.dropped:.0f} % of the messages while "
            "sweeps were flown; they count as missing, and errors hold what that costs: log fewer "
            "messages (LOG_BITMASK), or with a larger buffer (LOG_FILE_BUFSIZE)",
        ),
        (
            any(one.high > shown for one in log.used),
            f"{log.path}: its messages, {rate:.4g} Hz, show {shown:.3g} rad/s, and sweeps go on: "
            "set LOG_BITMASK's bits 0 and 1 to log every loop",
        ),
        (
            behind and late,
            f"{behind} are behind the gyro's filter, INS_GYRO_FILTER, which delays by "
            f"{late:.2g} ms; take it out, as known: "
            f"{behind}=low_pass:corner={corner:.4g},order=2",
        ),
        (
            (x or y or z) and not have.isdisjoint(ACCELERATIONS),
            f"the accelerometer sits at {x:g}, {y:g}, {z:g} m (INS_POS1): its "
            f"acceleration isn't moved to the centre of gravity, but for {_SIDE}",
        ),
        (
            not (x or y or z) and have.issuperset(_SIDE_OF) and yawed,
            f"{log.path}: INS_POS1 is 0, so the accelerometer is taken to sit at the centre of "
            "gravity: if it sits ahead of it, N_r comes out too large by that over the tail's arm",
        ),
    )
    return [*log.findings, *(text for holds, text in notes if holds)]


def estimate_fits(
    records: Sequence[FlightRecord],
    fits: Sequence[InferredFit],
    estimator: str = "local",
) -> tuple[FrequencyResponse, ...]:
    """Return the frequency response of each fit, by the joint input-output method.

    A fit without references has the inputs' sticks, where they excite it. `estimator` is as of
    `frequency_response`. Raises IdentificationError.
    """
    found = []
    for fit in fits:
        response = estimated(
            records,
            inputs=fit.inputs,
            outputs=fit.outputs,
            conditioning=fit.conditioning,
            reference=fit.reference,
            band=fit.band,
            estimator=estimator,
        )
        # steps of a controller's command, or of pulses in whole microseconds, are no spikes
        stepped = [repr(name) for name in (*fit.inputs, *fit.conditioning, *fit.reference)]
        flags = (
            flag
            for flag in response.flags
            if "spikes" not in flag or not any(name in flag for name in stepped)
        )
        found.append(replace(response, flags=tuple(flags)))
    return tuple(found)


def followed_band(frf: FrequencyResponse, structure: Structure, band: Band, **search: Any) -> Band:
    """Return the widest band, rad/s, of the same upper edge where a structure fits (low J)."""
    edge, high = band
    tried: dict[float, float] = {}
    while not tried or (high / edge >= 2.0**_OCTAVES and min(tried.values()) > _FOLLOWS):
        try:
            tried[edge] = identify(frf, structure, band=(edge, high), **search).cost
        except HelisimError:
            break
        edge *= _STEP
    least = max(_FOLLOWS, _OF_LEAST * min(tried.values(), default=0.0))
    return next((edge for edge, cost in tried.items() if cost <= least), band[0]), high
