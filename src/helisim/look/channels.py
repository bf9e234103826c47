"""Guesses which column of a log is which channel, and in what unit, and says why."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError
from helisim.base.units import PULSE, UNITS, is_unit, unit
from helisim.logs.mapping import Column, find_column, split_heading
from helisim.logs.source import Source
from helisim.records.record import (
    ACCELERATIONS,
    ATTITUDES,
    CHANNELS,
    IN1,
    IN2,
    POSITIONS,
    RATES,
)

CONTROLS = (*IN1, *IN2)
AS_RECORDED = "as recorded"
_PULSES = (700.0, 2300.0)
_PULSE_RANGE = 800.0  # us, from one end of a stick to the other: 1100 to 1900
_UNITISED, _PERCENT = 1.5, 105.0
_FAST = 8.0  # rad/s, the 99th percentile: rates beyond are in deg/s rather
_EULER = 1.02 * math.pi
_GRAVITIES = {"m/s^2": 9.80665, "g": 1.0, "mg": 1000.0, "ft/s^2": 32.174}
_NO_MOVE = 1e-9


class Named(NamedTuple):
    """The meaning of a column's name; of names for the same channel the lowest rank is best."""

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
        ("ATT.{}", "Roll Pitch Yaw", ATTITUDES, "deg", "+++"),
        ("IMU.Acc{}", "X Y Z", ACCELERATIONS, "m/s^2", "+++"),
        ("XKF1.{}", "PN PE PD", POSITIONS, "m", "+++"),
        ("NKF1.{}", "PN PE PD", POSITIONS, "m", "+++"),
        ("RATE.{}Out", "R P Y A", _INPUTS, "1", "++++"),
        ("AETR.{}", "Ail Elev Rudd Thr", _INPUTS, "1", "++++"),
        ("RCIN.{}", "C1 C2 C4 C3", _STICKS, "us", "++++"),
    ),
}
"""Names of columns in logs of PX4 and of ArduPilot, of a channel the best first."""
_PROGRAM = {"ULog": "PX4", "DataFlash": "ArduPilot"}
_EXACT = {
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
    *((pattern, _TURNS, RATES) for pattern in ("{} rate", "{}rate", "{}speed")),
    *((f"{word} {{}}", "x y z", RATES) for word in ("gyro", "gyr", "omega", "angular velocity")),
    *((f"{word} {{}}", "x y z", ACCELERATIONS) for word in ("accel", "acc", "acceleration")),
    *(
        (f"{{}} {word}", _TURNS, _INPUTS)
        for word in ("cmd", "command", "input", "in", "swash", "cyclic", "servo", "out", "torque")
    ),
)
_WORDS: tuple[tuple[str, str, int], ...] = (
    # words that must all be there, channel, sign; the first that fits counts
    *(
        (pattern.format(part), channel, 1)
        for pattern, parts, channels in _PATTERNS
        for part, channel in zip(parts.split(), channels)
    ),
    *((words, "w", -1) for words in ("vertical speed", "climb rate", "climb")),
    ("sink", "w", 1),
    *((words, "down", -1) for words in ("altitude", "height")),
    *((words, "lat", 1) for words in ("aileron", "lateral")),
    *((words, "lon", 1) for words in ("elevator", "longitudinal")),
    *((words, "ped", 1) for words in ("rudder", "pedal")),
    *((words, "col", 1) for words in ("collective", "throttle")),
    *((words, "phi", 1) for words in ("bank", "roll")),
    ("pitch", "theta", 1),
    *((words, "psi", 1) for words in ("heading", "yaw")),
)
_ALONE = {
    short: channel
    for shorts, channels in (
        ("gx gy gz", RATES),
        ("wx wy wz", RATES),
        ("gyrox gyroy gyroz", RATES),
        ("accx accy accz", ACCELERATIONS),
        ("ail ele rud thr", _INPUTS),
        ("da de dr dt", _INPUTS),
        ("elev coll hdg", ("lon", "col", "psi")),
    )
    for short, channel in zip(shorts.split(), channels)
}
_RADIO = dict(zip("1243", _STICKS))
"""Channels of a radio in the usual order: aileron, elevator, throttle, rudder."""
_RADIO_WORD = re.compile(r"(?:rc|rcin|ch|chan|channel|kanal)(?: in)? ?([1-4])")
_PILOT = {"stick", "rc", "rcin", "pilot", "manual", "joystick"}
_ACTING = {"cmd", "command", "input", "in", "out", "servo", "defl", "deflection", "pos", "surface"}
"""Beside a control's short name."""
_ASKED = {"setpoint", "sp", "des", "desired", "target", "ref", "demand", "demanded", "std", "var"}
"""Of what was wanted, not of what was measured."""
_ENDINGS = {
    "dps": "deg/s", "deg s": "deg/s", "degs": "deg/s", "rads": "rad/s", "rad s": "rad/s",
    "deg": "deg", "rad": "rad", "pct": "percent", "percent": "percent", "pwm": "us", "us": "us",
    "m s": "m/s", "mps": "m/s", "ms2": "m/s^2", "m s2": "m/s^2", "mss": "m/s^2", "ft s": "ft/s",
    "fps": "ft/s", "kt": "kt", "kts": "kt", "g": "g", "m": "m", "ft": "ft", "cm": "cm",
}  # fmt: skip


def named(heading: str, log_format: str) -> Named | None:
    """Return what a column's name says, or None.

    Args:
        heading: of the column, with or without a unit.
        log_format: such as "ULog": it says whose names they are.
    """
    if log_format in _EXACT:
        return _EXACT[log_format].get(heading)
    bare, bracketed = split_heading(heading)
    implied = unit(bracketed).name if bracketed and is_unit(bracketed) else None
    if bare in CHANNELS:
        return Named(bare, implied, 1, 0, "its name")
    words = re.sub(r"([a-z])([A-Z])", r"\1 \2", bare).lower()
    words = re.sub(r"[^a-z0-9]+", " ", words).strip()
    ending = max((one for one in _ENDINGS if words.endswith(f" {one}")), key=len, default="")
    words, implied = words.removesuffix(f" {ending}"), implied or _ENDINGS.get(ending)
    have = set(words.split())
    radio = _RADIO_WORD.fullmatch(words)
    if have & _ASKED:
        return None
    if radio:
        return Named(_RADIO[radio[1]], implied, 1, 30, "a radio's usual order of channels")
    channel, sign, rank = _meant([word for word in words.split() if word not in _PILOT])
    if have & _PILOT:
        sticks = dict(zip((*ATTITUDES, *_INPUTS), (*_STICKS[:3], *_STICKS)))
        channel = sticks.get(channel, channel)
    return Named(channel, implied, sign, rank, f"named {bare!r}") if channel else None


def _meant(words: list[str]) -> tuple[str, int, int]:
    """Return the channel that words mean, "" if none, its sign and rank."""
    name, acted = " ".join(words), " ".join(word for word in words if word not in _ACTING)
    if name in CHANNELS:
        return name, 1, 1
    if name in _ALONE or _ALONE.get(acted) in _INPUTS:
        return _ALONE.get(name) or _ALONE[acted], 1, 2
    found = (
        (channel, sign, 3 + rank)
        for rank, (needed, channel, sign) in enumerate(_WORDS)
        if set(needed.split()) <= set(words)
    )
    return next(found, ("", 1, 0))


@dataclass(frozen=True)
class SeenChannel:
    """A column of a log that was taken for a channel.

    Attributes:
        name: of the channel.
        column: where it comes from, and in what unit.
        why: it is taken for that, and where its unit comes from.
        rate: samples a second, Hz.
        low: smallest number in the column.
        high: largest number in the column.
        given: whether the map says so, which is then no guess.
        clock: that it was sampled by.
    """

    name: str
    column: Column
    why: str
    rate: float
    low: float
    high: float
    given: bool = False
    clock: str = ""

    @property
    def sized(self) -> bool:
        """Whether its unit was guessed by the numbers' size."""
        return any(text in self.why for text in ("by its size", "by their size", "for lack of"))

    @property
    def guessed(self) -> bool:
        """Whether its unit was guessed, so that the data and other channels may know better."""
        return self.sized or self.why.endswith("unit by name")

    @property
    def moves(self) -> bool:
        """Whether the column isn't constant."""
        return self.high - self.low > _NO_MOVE * max(abs(self.low), abs(self.high))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        column = {name: getattr(self.column, name) for name in ("unit", "sign", "trim", "range")}
        rest = {name: getattr(self, name) for name in ("low", "high", "given", "clock")}
        about = {"name": self.name, "column": self.column.column, **column}
        return {**about, "why": self.why, "rate_hz": self.rate, **rest}

    def __str__(self) -> str:
        sign, still = "-" if self.column.sign < 0 else "", "" if self.moves else ", constant"
        return (
            f"{self.name} = {sign}{self.column.column!r} [{self.column.unit or '?'}], "
            f"{self.rate:.4g} Hz, {self.low:.4g} to {self.high:.4g}{still}: {self.why}"
        )


def guess(
    source: Source, given: Mapping[str, Column], rates: Mapping[str, float]
) -> tuple[SeenChannel, ...]:
    """Return the channels that a log seems to have.

    Args:
        source: the opened log.
        given: channel -> column, as far as the user says it.
        rates: of each clock of the log, Hz.
    """
    seen: dict[str, SeenChannel] = {}
    ranks: dict[str, int] = {}
    for name, column in given.items():
        try:
            heading = find_column(column.column, source.names, "column")
            values = source.numbers(heading)
        except HelisimError:
            continue  # reading it will say so
        column = replace(column, column=heading, unit=column.unit or source.stated_unit(heading))
        rate = rates.get(source.clock(heading), 0.0)
        seen[name] = replace(_seen(name, column, "given", rate, values), given=True)
    taken = {one.column.column for one in seen.values()}
    for heading in source.names:
        meant = named(heading, source.format) if heading not in taken else None
        rate = rates.get(source.clock(heading), 0.0) if meant is not None else 0.0
        if meant is None or rate <= 0.0:
            continue
        other = seen.get(meant.channel)
        if other is not None and (
            other.given
            or not (
                (other.moves and rate > 1.5 * other.rate)
                or (meant.rank < ranks[meant.channel] and rate > other.rate / 1.5)
            )
        ):
            continue
        try:
            values = source.numbers(heading)
        except HelisimError:
            continue
        if np.count_nonzero(np.isfinite(values)) > 1 and not _geographic(heading, values):
            seen[meant.channel] = _guessed(source, heading, meant, rate, values)
            ranks[meant.channel] = meant.rank
    return _same_family(tuple(seen.values()))


def _geographic(heading: str, values: NDArray[np.float64]) -> bool:
    """Return whether a column called lat or lon is of the globe."""
    level, spread = abs(float(np.nanmedian(values))), float(np.nanmax(values) - np.nanmin(values))
    named = split_heading(heading)[0].lower() in ("lat", "lon")
    return named and level > _UNITISED and spread < 0.05 * level


def _guessed(
    source: Source, heading: str, meant: Named, rate: float, values: NDArray[np.float64]
) -> SeenChannel:
    stated, known = source.stated_unit(heading), values[np.isfinite(values)]
    column = Column(heading, sign=meant.sign)
    if meant.channel in CONTROLS:
        column, why = _control(column, stated or meant.unit, known)
    else:
        unit, why = (stated, "unit stated") if stated else (meant.unit, "unit by name")
        if unit is None or (unit in UNITS and UNITS[unit].si != CHANNELS[meant.channel].unit):
            unit, why = _by_size(meant.channel, known)
        column = replace(column, unit=unit)
    return _seen(meant.channel, column, f"{meant.why}; {why}", rate, values)


def _seen(
    name: str, column: Column, why: str, rate: float, values: NDArray[np.float64]
) -> SeenChannel:
    known = values[np.isfinite(values)]
    known = known if known.size else np.zeros(1)
    return SeenChannel(name, column, why, rate, float(known.min()), float(known.max()))


def _control(column: Column, unit: str | None, known: NDArray[np.float64]) -> tuple[Column, str]:
    """Return a control's column with unit, trim and range by its numbers, (n_known,), and why."""
    middle, size = float(np.median(known)), float(np.max(np.abs(known)))
    span = float(f"{np.ptp(known):.3g}") or 1.0
    if unit == PULSE or (unit is None and _PULSES[0] <= known.min() and size <= _PULSES[1]):
        found = {"unit": PULSE, "trim": float(round(middle)), "range": _PULSE_RANGE}
        why = f"pulses; trim is their median, range the usual {_PULSE_RANGE:g} us"
    elif unit == "percent" or (unit in (None, "1") and _UNITISED < size <= _PERCENT):
        found, why = {"unit": "percent"}, f"percent: it reaches {size:.3g}"
    elif unit in UNITS and UNITS[unit].si == "1":
        found, why = {"unit": unit}, "without dimension"
    elif unit in UNITS:
        found = {"unit": unit, "trim": middle, "range": span}
        why = f"in {unit}; range is what it spans"
    elif size <= _UNITISED:
        found, why = {"unit": "1"}, f"without dimension: it reaches {size:.3g}"
    else:
        found = {"unit": "1", "trim": float(f"{middle:.4g}"), "range": span}
        why = "of unknown unit; trim is its median, range what it spans"
    return replace(column, **found), why


def _by_size(channel: str, known: NDArray[np.float64]) -> tuple[str, str]:
    """Return the unit that the numbers' size says, (n_known,), and that it does."""
    si, high = CHANNELS[channel].unit, float(np.quantile(np.abs(known), 0.99))
    if channel == "az":
        level = abs(float(np.median(known)))
        off = {one: abs(math.log(max(level, 1e-9) / size)) for one, size in _GRAVITIES.items()}
        unit = min(off, key=lambda one: off[one])
        return unit, f"{unit} by gravity, {level:.3g}"
    angle = _EULER / 2.0 if channel == "theta" else 2.0 * math.pi
    limits = {"rad/s": ("deg/s", _FAST), "rad": ("deg", angle)}
    if si not in limits:
        return si, "SI, for lack of another word"
    unit = limits[si][0] if high > limits[si][1] else si
    return unit, f"{unit} by its size, to {high:.3g}"


def _same_family(seen: tuple[SeenChannel, ...]) -> tuple[SeenChannel, ...]:
    """Give rates, angles and accelerations whose unit was guessed by size the same unit."""
    units: dict[str, str | None] = {}
    for family in (RATES, ATTITUDES):
        large = [
            one.column.unit
            for one in seen
            if one.name in family and one.sized and one.column.unit not in (None, "rad", "rad/s")
        ]
        units |= dict.fromkeys(family, large[0]) if large else {}
    units |= {name: one.column.unit for one in seen if one.name == "az" for name in ("ax", "ay")}
    found = []
    for one in seen:
        unit = units.get(one.name)
        if unit is not None and one.sized and unit != one.column.unit:
            why = f"{one.why.rpartition(';')[0]}; {unit} like the others, by their size"
            one = replace(one, column=replace(one.column, unit=unit), why=why)
        found.append(one)
    return tuple(found)
