"""Guesses which column of a log is which channel, in what unit, and why."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from helisim.base.arrays import Real
from helisim.base.errors import HelisimError
from helisim.base.units import PULSE, STANDARD_GRAVITY, UNITS, is_unit, unit
from helisim.logs.mapping import Column, find_column, split_heading
from helisim.logs.screening import LARGEST, PULSE_RANGE, PULSES, UNITISED
from helisim.logs.source import Source
from helisim.logs.timing import steadiness
from helisim.records.record import ACCELERATIONS, ATTITUDES, CHANNELS, IN1, IN2, POSITIONS, RATES

CONTROLS = (*IN1, *IN2)
AS_RECORDED, GIVEN, FIRMWARE = (
    "as recorded",
    "given",
    "the firmware's name for it",
)  # why a channel is what it is
# most of a control in percent; rad/s, the 99th percentile: rates beyond are in deg/s rather
_PERCENT, _FAST = 105.0, 8.0
_GRAVITIES = {one: STANDARD_GRAVITY / UNITS[one].factor for one in ("m/s^2", "g", "mg", "ft/s^2")}
_NO_MOVE = 1e-9
_UNSAID = "SI, for lack of another word"
_SURFACES = ("lat", "lon", "ped")  # of one unit in a log


class Named(NamedTuple):
    """The meaning of a column's name; the lowest rank is best."""

    channel: str
    unit: str | None
    sign: int
    rank: int
    why: str


_INPUTS, _STICKS = ("lat", "lon", "ped", "col"), ("LAT", "LON", "PED", "COL")
_NAMES = {
    "ULog": (
        # pattern, parts, channels, unit, signs: a stick of pitch is positive forward, nose down
        ("vehicle_angular_velocity.xyz[{}]", "0 1 2", RATES, "rad/s", "+++"),
        ("sensor_combined.gyro_rad[{}]", "0 1 2", RATES, "rad/s", "+++"),
        ("vehicle_attitude.{}speed", "roll pitch yaw", RATES, "rad/s", "+++"),
        ("vehicle_attitude.{}", "roll pitch yaw", ATTITUDES, "rad", "+++"),
        ("vehicle_acceleration.xyz[{}]", "0 1 2", ACCELERATIONS, "m/s^2", "+++"),
        ("sensor_combined.accelerometer_m_s2[{}]", "0 1 2", ACCELERATIONS, "m/s^2", "+++"),
        ("vehicle_local_position.{}", "x y z", POSITIONS, "m", "+++"),
        ("vehicle_torque_setpoint.xyz[{}]", "0 1 2", _INPUTS, "1", "+++"),
        ("vehicle_thrust_setpoint.xyz[{}]", "2", ("col",), "1", "-"),
        ("actuator_controls_0.control[{}]", "0 1 2 3", _INPUTS, "1", "++++"),
        ("manual_control_setpoint.{}", "roll pitch yaw throttle", _STICKS, "1", "+-++"),
        ("manual_control_setpoint.{}", "y x r z", _STICKS, "1", "+-++"),
    ),
    "DataFlash": (
        ("RATE.{}", "R P Y", RATES, "deg/s", "+++"),
        ("IMU.Gyr{}", "X Y Z", RATES, "rad/s", "+++"),
        ("ANG.{}", "Roll Pitch Yaw", ATTITUDES, "deg", "+++"),
        ("ATT.{}", "Roll Pitch Yaw", ATTITUDES, "deg", "+++"),
        ("IMU.Acc{}", "X Y Z", ACCELERATIONS, "m/s^2", "+++"),
        ("XKF1.{}", "PN PE PD", POSITIONS, "m", "+++"),
        ("NKF1.{}", "PN PE PD", POSITIONS, "m", "+++"),
        ("RATE.{}Out", "R P Y A", _INPUTS, "1", "++++"),
        ("AETR.{}", "Ail Elev Rudd Thr", _INPUTS, "1", "++++"),
        ("RCIN.{}", "C1 C2 C4 C3", _STICKS, "us", "++++"),
    ),
    "sdlog2": (
        ("IMU.Gyro{}", "X Y Z", RATES, "rad/s", "+++"),
        ("ATT.{}Rate", "Roll Pitch Yaw", RATES, "rad/s", "+++"),
        ("ATT.{}", "Roll Pitch Yaw", ATTITUDES, "rad", "+++"),
        ("IMU.Acc{}", "X Y Z", ACCELERATIONS, "m/s^2", "+++"),
        ("LPOS.{}", "X Y Z", POSITIONS, "m", "+++"),
        ("ATTC.{}", "Roll Pitch Yaw Thrust", _INPUTS, "1", "++++"),
    ),
    "Blackbox": (),  # which says all itself
}  # Columns of PX4 and ArduPilot logs; the best of a channel first
_PROGRAM = {"ULog": "PX4", "DataFlash": "ArduPilot", "sdlog2": "PX4"}
EXACT = {
    log_format: {
        pattern.format(part): Named(
            channel, unit, 1 if sign == "+" else -1, rank, f"{_PROGRAM[log_format]}'s name for it"
        )
        for rank, (pattern, parts, channels, unit, signs) in enumerate(table)
        for part, channel, sign in zip(parts.split(), channels, signs)
    }
    for log_format, table in _NAMES.items()
}
_TURNS = "roll pitch yaw"
_PATTERNS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("actuator controls {}", "0 1 2 3", _INPUTS),
    ("rate {}", "0 1 2", RATES),
    ("attitude {}", "0 1 2", ATTITUDES),
    *(
        (f"{word} {{}}", "lat lon ped col", _INPUTS)
        for word in ("delta", "cyclic", "cmd", "input", "servo")
    ),
    ("delta {}", "a e r t", _INPUTS),
    *((pattern, _TURNS, RATES) for pattern in ("{} rate", "{}rate", "{}speed")),
    *(
        (f"{word} {{}}", axes, RATES)
        for word in ("gyro", "gyr", "omega", "angular velocity")
        for axes in ("x y z", "0 1 2")
    ),
    *((f"{word} {{}}", "x y z", ACCELERATIONS) for word in ("accel", "acc", "acceleration")),
    *(
        (f"{{}} {word}", _TURNS, _INPUTS)
        for word in (
            "cmd",
            "command",
            "input",
            "in",
            "swash",
            "cyclic",
            "servo",
            "out",
            "torque",
            "yoke",
            "actuator",
        )
    ),
)
_SHORT = (
    ("gx gy gz", RATES),
    ("wx wy wz", RATES),
    ("gyrox gyroy gyroz", RATES),
    ("accx accy accz", ACCELERATIONS),
    ("ail ele rud thr", _INPUTS),
    ("da de dr dt", _INPUTS),
    ("dlat dlon dped dcol", _INPUTS),
    ("dail delv drud", _INPUTS[:3]),
    ("ailrn ruddr", ("lat", "ped")),  # X-Plane's, whose elevator is "elev"
    ("elev coll hdg", ("lon", "col", "psi")),
)
_WORDS: tuple[tuple[str, str, int], ...] = (
    # words that must all be there, channel, sign; the first that fits counts
    *(
        (pattern.format(part), channel, 1)
        for pattern, parts, channels in _PATTERNS
        for part, channel in zip(parts.split(), channels)
    ),
    *(
        (short, channel, 1)
        for shorts, channels in _SHORT
        for short, channel in zip(shorts.split(), channels)
    ),
    *((words, "w", -1) for words in ("vertical speed", "climb", "altitude rate")),
    ("sink", "w", 1),
    *((words, "down", -1) for words in ("altitude", "height")),
    *((words, "lat", 1) for words in ("aileron", "lateral")),
    *((words, "lon", 1) for words in ("elevator", "longitudinal")),
    *(
        (words, "ped", 1)
        for words in ("rudder", "pedal", "pedals", "steer", "steering", "yoke heading")
    ),
    *((words, "col", 1) for words in ("collective", "throttle")),
    *((words, "phi", 1) for words in ("bank", "roll")),
    ("pitch", "theta", 1),
    *((words, "psi", 1) for words in ("heading", "yaw")),
)
# not those that only a simulation knows, or in a unit of no log
_OWN = {name for name, one in CHANNELS.items() if one.kind != "OTHER" and is_unit(one.unit)}
_PILOT = {"stick", "rc", "rcin", "pilot", "manual", "joystick"}
_ASKED = {"setpoint", "sp", "des", "desired", "target", "ref", "demand", "demanded", "std", "var"}
_ENDINGS = {
    "dps": "deg/s", "deg s": "deg/s", "degs": "deg/s", "rads": "rad/s", "rad s": "rad/s",
    "deg": "deg", "rad": "rad", "pct": "percent", "percent": "percent", "pwm": "us", "us": "us",
    "m s": "m/s", "mps": "m/s", "ms2": "m/s^2", "m s2": "m/s^2", "mss": "m/s^2", "ft s": "ft/s",
    "fps": "ft/s", "kt": "kt", "kts": "kt", "g": "g", "m": "m", "ft": "ft", "cm": "cm",
    "fpm": "ft/min", "ft min": "ft/min", "kmh": "km/h", "km h": "km/h", "kph": "km/h",
    "mph": "mph", "cm s": "cm/s", "mm s": "mm/s", "rpm": "rpm", "mm": "mm", "mg": "mg",
    "cdeg": "cdeg", "mdeg": "mdeg", "mrad": "mrad", "cdeg s": "cdeg/s", "cdps": "cdeg/s",
    "mdeg s": "mdeg/s", "mdps": "mdeg/s", "mrad s": "mrad/s",
}  # fmt: skip
# A heading's end that says another unit than known ones: what moves so is not guessed to be in SI
_FOREIGN = re.compile(
    r"[\[(].*/.*[\])]$|[^a-z](adc|bits?|counts?|hz|lsb|raw|ticks?)[\])]?$", re.IGNORECASE
)


def named(heading: str, log_format: str) -> Named | None:
    """Return the meaning of a column's heading, None if unknown."""
    if log_format in EXACT:
        return EXACT[log_format].get(heading)
    if log_format == "MATLAB" and "." in heading:  # of a structure, whose name means nothing
        return named(heading.rpartition(".")[2], log_format)
    bare, bracketed = split_heading(heading)
    implied = unit(bracketed).name if bracketed and is_unit(bracketed) else None
    if bare in _OWN:
        return Named(bare, implied, 1, 0, "its name")
    words = re.sub(r"([a-z])([A-Z])", r"\1 \2", bare).lower()
    words = re.sub(r"[^a-z0-9]+", " ", words).strip()
    ending = max((one for one in _ENDINGS if words.endswith(f" {one}")), key=len, default="")
    words, implied = words.removesuffix(f" {ending}"), implied or _ENDINGS.get(ending)
    have = set(words.split())
    if have & _ASKED:
        return None
    rest = have - _PILOT - ({"in"} if have & _PILOT else set())  # inches of stick, or what comes in
    meant = (
        (channel, sign, 1 + rank)
        for rank, (needed, channel, sign) in enumerate(_WORDS)
        if set(needed.split()) <= rest
    )
    own = " ".join(word for word in words.split() if word in rest)
    channel, sign, rank = (own, 1, 1) if own in _OWN else next(meant, ("", 1, 0))
    sticks = dict(zip((*ATTITUDES, *_INPUTS), (*_STICKS[:3], *_STICKS)))
    channel = sticks.get(channel, channel) if have & _PILOT else channel
    return Named(channel, implied, sign, rank, f"named {bare!r}") if channel else None


@dataclass(frozen=True)
class SeenClock:
    """A clock of a log: `rate` in Hz, `duration` and `jitter` (rms, without gaps) in s."""

    name: str
    rate: float
    samples: int
    duration: float
    jitter: float
    even: str
    gaps: int

    @classmethod
    def of(cls, name: str, time: Real) -> "SeenClock":
        """Return a clock from its stamps, (n_time,) s, increasing."""
        with np.errstate(over="ignore"):
            even = steadiness(time)
        span = float(np.ptp(time)) if time.size else 0.0
        return cls(name, even.rate, time.size, span, even.rms, even.kind, even.gaps)

    def __str__(self) -> str:
        jitter = f"jitter {1e3 * self.jitter:.2g} ms rms"
        even = {"jitter": jitter, "irregular": f"{jitter}, irregular"}.get(self.even, self.even)
        gaps = f", {self.gaps} gap(s)" if self.gaps else ""
        return (
            f"clock {self.name}: {self.rate:.4g} Hz, {self.samples} samples, {self.duration:.4g} "
            f"s, {even}{gaps}"
        )


@dataclass(frozen=True)
class SeenChannel:
    """A column taken for a channel, its range, and why; a "given" one is no guess."""

    name: str
    column: Column
    why: str
    clock: SeenClock | None
    low: float
    high: float

    @classmethod
    def of(
        cls, name: str, column: Column, why: str, clock: SeenClock | None, known: Real
    ) -> "SeenChannel":
        """Return a channel with the range of its values, (n_known,)."""
        edges = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
        return cls(name, column, why, clock, *edges)

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""
        return self.clock.rate if self.clock else 0.0

    @property
    def sized(self) -> bool:
        """Whether the unit was guessed from the numbers' size."""
        return "unit stated" not in self.why and any(
            one in self.why
            for one in ("by its size", "for lack of", "; percent: ", "; without dimension: ")
        )

    @property
    def size(self) -> float:
        """Largest magnitude, in its unit."""
        return max(abs(self.low), abs(self.high))

    @property
    def moves(self) -> bool:
        """Whether the column isn't constant."""
        return self.high - self.low > _NO_MOVE * self.size

    def __str__(self) -> str:
        sign, still = "-" if self.column.sign < 0 else "", "" if self.moves else ", constant"
        return (
            f"{self.name} = {sign}{self.column.column!r} [{self.column.unit or '?'}], "
            f"{self.rate:.4g} Hz, {self.low:.4g} to {self.high:.4g}{still}: {self.why}"
        )


def guess(
    source: Source, given: Mapping[str, Column], clocks: Mapping[str, SeenClock]
) -> tuple[SeenChannel, ...]:
    """Return the channels that a log seems to have; `given` ones as the user named them."""
    seen: dict[str, SeenChannel] = {}
    ranks: dict[str, int] = {}
    for name, column in {**source.channels, **given}.items():
        try:
            heading = find_column(column.column, source.names, "column")
            known = _known(source, heading)
        except HelisimError:
            continue  # reading reports it
        column = replace(column, column=heading, unit=column.unit or source.stated_unit(heading))
        seen[name] = SeenChannel.of(
            name,
            column,
            GIVEN if name in given else FIRMWARE,
            clocks.get(source.clock(heading)),
            known,
        )
    given_ones, taken = tuple(seen), {one.column.column for one in seen.values()}
    for heading in (name for name in source.names if name not in taken):
        meant, clock = named(heading, source.format), clocks.get(source.clock(heading))
        if meant is None or clock is None or meant.channel in given_ones:
            continue
        try:
            known = _known(source, heading)
        except HelisimError:
            continue
        if (
            known.size > 1
            and not _geographic(heading, known)
            and (meant.unit or meant.channel in CONTROLS or not _FOREIGN.search(heading))
        ):
            stated = source.stated_unit(heading)
            column, why = _in_unit(stated and unit(stated).name, heading, meant, known)
            found = SeenChannel.of(meant.channel, column, why, clock, known)
            other = seen.get(meant.channel)
            if other is None or _better(found, meant.rank, other, ranks[meant.channel]):
                seen[meant.channel], ranks[meant.channel] = found, meant.rank
    return _same_family(tuple(seen.values()))


def _better(one: SeenChannel, rank: int, other: SeenChannel, others: int) -> bool:
    """Return whether a column is the better one for a channel: it moves, is faster, named so."""
    quick = one.rate > 1.5 * other.rate or (rank < others and one.rate > other.rate / 1.5)
    return quick if one.moves == other.moves else one.moves


def _known(source: Source, heading: str) -> Real:
    values = source.numbers(heading)
    return values[np.isfinite(values)]


def _geographic(heading: str, known: Real) -> bool:
    """Return whether a column "lat" or "lon" is a place's: a stick moves by more of its level.

    A twentieth of 45 degrees of latitude is 250 km; near the equator or Greenwich, at 1 degree,
    0.002 is 200 m.
    """
    named = re.sub(r"[^a-z]|deg", "", split_heading(heading)[0].lower())
    level, moved = abs(float(np.median(known))), float(np.ptp(known))
    return named in ("lat", "lon") and (
        moved < 0.05 * level if level > UNITISED else 0.0 < moved < 0.002 * level
    )


def _in_unit(stated: str | None, heading: str, meant: Named, known: Real) -> tuple[Column, str]:
    """Return a column with its unit, stated or guessed from values (n_known,), and why."""
    unit, found = stated or meant.unit, dict[str, Any]()
    if meant.channel in CONTROLS:
        found, why = _control(unit, known)
        why = "unit stated; " * bool(stated) + why
    else:
        why = "unit stated" if stated else "unit by name"
        if unit is None or (unit in UNITS and UNITS[unit].si != CHANNELS[meant.channel].unit):
            unit, why = _by_size(meant.channel, known)
        found["unit"] = unit
    return Column(heading, sign=meant.sign, **found), f"{meant.why}; {why}"


def _control(unit: str | None, known: Real) -> tuple[dict[str, Any], str]:
    """Return a control's unit, trim and range from values (n_known,), and why."""
    middle, size = float(np.median(known)), float(np.max(np.abs(known)))
    pulses, bare = PULSES[0] <= known.min() and size <= PULSES[1], unit in (None, "1")
    reaches = f"it reaches {size:.3g}"
    rules: tuple[tuple[bool, dict[str, Any], str], ...] = (
        (
            unit == PULSE or (unit is None and pulses),
            {"unit": PULSE, "trim": float(round(middle)), "range": PULSE_RANGE},
            f"pulses; trim is their median, range the usual {PULSE_RANGE:g} us",
        ),
        (
            unit == "percent" or (unit is None and UNITISED < size <= _PERCENT),
            {"unit": "percent"},
            f"percent: {reaches}",
        ),
        (
            bare and size <= (_PERCENT if unit else UNITISED),
            {"unit": "1"},
            f"without dimension: {reaches}",
        ),
        (
            unit is not None and UNITS[unit].si == "rad",
            {"unit": unit, "trim": middle},
            f"in {unit}; 1 is a radian from its median",
        ),
        (
            True,
            {"unit": "1", "trim": middle, "range": 1.0},
            f"as it is, in {unit or 'no known unit'}; 1 is one of it from its median; {reaches}",
        ),
    )
    return next((found, why) for holds, found, why in rules if holds)


def _by_size(channel: str, known: Real) -> tuple[str, str]:
    """Return the unit that fits the size of values (n_known,), and why."""
    si, high = CHANNELS[channel].unit, float(np.quantile(np.abs(known), 0.99))
    level = max(abs(float(np.median(known))), 1e-9)
    if channel == "az":
        unit = min(_GRAVITIES, key=lambda one: abs(math.log(level / _GRAVITIES[one])))
        return unit, f"{unit} by gravity, {level:.3g}"
    angle = LARGEST["theta"] if channel == "theta" else 2.0 * math.pi
    degrees, limit = {"rad/s": ("deg/s", _FAST), "rad": ("deg", angle)}.get(si, ("", 0.0))
    unit = degrees if high > limit else si
    return (unit, f"{unit} by its size, to {high:.3g}") if degrees else (si, _UNSAID)


def _same_family(seen: tuple[SeenChannel, ...]) -> tuple[SeenChannel, ...]:
    units = {name: one.column.unit for one in seen if one.name == "az" for name in ("ax", "ay")}
    for family in (RATES, ATTITUDES, _SURFACES):
        sized = [one.column.unit for one in seen if one.name in family and one.sized]
        large = [unit for unit in sized if unit in ("deg", "deg/s", "percent")]
        units |= dict.fromkeys(family, large[0]) if large else {}
    return tuple(
        replace(
            one,
            column=replace(one.column, unit=units[one.name]),
            why=f"{one.why.rpartition(';')[0]}; {units[one.name]} by its size, like the others",
        )
        if one.sized and units.get(one.name, one.column.unit) != one.column.unit
        else one
        for one in seen
    )
