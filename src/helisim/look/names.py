"""What columns of logs are called: of PX4, of ArduPilot, and of anyone."""

import re
from typing import NamedTuple

from helisim.base.unit_names import is_unit, unit
from helisim.logs.mapping import split_heading
from helisim.records.channels import CHANNELS


class Named(NamedTuple):
    """What a column's name says.

    Attributes:
        channel: it may be.
        unit: that the name implies, None if it doesn't.
        sign: that makes it the channel's.
        rank: of names for the same channel the lowest is best.
        why: it is taken for that.
    """

    channel: str
    unit: str | None
    sign: int
    rank: int
    why: str


_RATES, _ANGLES, _FORCES = ("p", "q", "r"), ("phi", "theta", "psi"), ("ax", "ay", "az")
_INPUTS, _STICKS = ("lat", "lon", "ped", "col"), ("LAT", "LON", "PED", "COL")
_POSITIONS = ("north", "east", "down")


def _each(
    pattern: str, channels: tuple[str, ...], parts: tuple[str, ...], unit: str, signs: str = "++++"
) -> list[tuple[str, str, str, int]]:
    return [
        (pattern.format(part), channel, unit, -1 if sign == "-" else 1)
        for channel, part, sign in zip(channels, parts, signs)
    ]


_THREE = ("0", "1", "2")
_DOWN = "+-++"
"""Signs of PX4's sticks: that of pitch is positive forward, which is nose down."""
_PX4 = (
    *_each("vehicle_angular_velocity.xyz[{}]", _RATES, _THREE, "rad/s"),
    *_each("sensor_combined.gyro_rad[{}]", _RATES, _THREE, "rad/s"),
    *_each("vehicle_attitude.{}speed", _RATES, ("roll", "pitch", "yaw"), "rad/s"),
    *_each("vehicle_attitude.{}", _ANGLES, ("roll", "pitch", "yaw"), "rad"),
    *_each("vehicle_acceleration.xyz[{}]", _FORCES, _THREE, "m/s^2"),
    *_each("sensor_combined.accelerometer_m_s2[{}]", _FORCES, _THREE, "m/s^2"),
    *_each("vehicle_local_position.{}", _POSITIONS, ("x", "y", "z"), "m"),
    *_each("vehicle_torque_setpoint.xyz[{}]", _INPUTS, _THREE, "1"),
    ("vehicle_thrust_setpoint.xyz[2]", "col", "1", -1),
    *_each("actuator_controls_0.control[{}]", _INPUTS, (*_THREE, "3"), "1"),
    *_each(
        "manual_control_setpoint.{}", _STICKS, ("roll", "pitch", "yaw", "throttle"), "1", "+-++"
    ),
    *_each("manual_control_setpoint.{}", _STICKS, ("y", "x", "r", "z"), "1", "+-++"),
)
_ARDUPILOT = (
    *_each("RATE.{}", _RATES, ("R", "P", "Y"), "deg/s"),
    *_each("IMU.Gyr{}", _RATES, ("X", "Y", "Z"), "rad/s"),
    *_each("ATT.{}", _ANGLES, ("Roll", "Pitch", "Yaw"), "deg"),
    *_each("IMU.Acc{}", _FORCES, ("X", "Y", "Z"), "m/s^2"),
    *_each("XKF1.{}", _POSITIONS, ("PN", "PE", "PD"), "m"),
    *_each("NKF1.{}", _POSITIONS, ("PN", "PE", "PD"), "m"),
    *_each("RATE.{}Out", _INPUTS, ("R", "P", "Y", "A"), "1"),
    *_each("AETR.{}", _INPUTS, ("Ail", "Elev", "Rudd", "Thr"), "1"),
    *_each("RCIN.{}", _STICKS, ("C1", "C2", "C4", "C3"), "us"),
)
_EXACT: dict[str, dict[str, tuple[str, str, int, int]]] = {
    program: {
        name: (channel, unit, sign, rank) for rank, (name, channel, unit, sign) in enumerate(table)
    }
    for program, table in (("ULog", _PX4), ("DataFlash", _ARDUPILOT))
}
_PROGRAM = {"ULog": "PX4", "DataFlash": "ArduPilot"}

_WORDS: tuple[tuple[str, str, int], ...] = (
    # (words that must all be there, channel, sign); the first that fits counts
    *((f"{one} rate", channel, 1) for one, channel in zip(("roll", "pitch", "yaw"), _RATES)),
    *((f"{one}rate", channel, 1) for one, channel in zip(("roll", "pitch", "yaw"), _RATES)),
    *((f"{one}speed", channel, 1) for one, channel in zip(("roll", "pitch", "yaw"), _RATES)),
    *((f"gyro {axis}", channel, 1) for axis, channel in zip("xyz", _RATES)),
    *((f"gyr {axis}", channel, 1) for axis, channel in zip("xyz", _RATES)),
    *((f"omega {axis}", channel, 1) for axis, channel in zip("xyz", _RATES)),
    *((f"angular velocity {axis}", channel, 1) for axis, channel in zip("xyz", _RATES)),
    *((f"accel {axis}", channel, 1) for axis, channel in zip("xyz", _FORCES)),
    *((f"acc {axis}", channel, 1) for axis, channel in zip("xyz", _FORCES)),
    *((f"acceleration {axis}", channel, 1) for axis, channel in zip("xyz", _FORCES)),
    *(
        (f"{one} {act}", channel, 1)
        for act in ("cmd", "command", "input", "in", "swash", "cyclic", "servo", "out", "torque")
        for one, channel in zip(("roll", "pitch", "yaw"), _INPUTS)
    ),
    ("vertical speed", "w", -1),
    ("climb rate", "w", -1),
    ("climb", "w", -1),
    ("sink", "w", 1),
    ("altitude", "down", -1),
    ("height", "down", -1),
    ("aileron", "lat", 1),
    ("lateral", "lat", 1),
    ("elevator", "lon", 1),
    ("longitudinal", "lon", 1),
    ("rudder", "ped", 1),
    ("pedal", "ped", 1),
    ("collective", "col", 1),
    ("throttle", "col", 1),
    ("bank", "phi", 1),
    ("roll", "phi", 1),
    ("pitch", "theta", 1),
    ("heading", "psi", 1),
    ("yaw", "psi", 1),
)
_ALONE = {
    **dict(zip(("gx", "gy", "gz"), _RATES)),
    **dict(zip(("wx", "wy", "wz"), _RATES)),
    **dict(zip(("gyrox", "gyroy", "gyroz"), _RATES)),
    **dict(zip(("accx", "accy", "accz"), _FORCES)),
    **dict(zip(("ail", "ele", "rud", "thr"), _INPUTS)),
    **dict(zip(("da", "de", "dr", "dt"), _INPUTS)),
    "elev": "lon",
    "coll": "col",
    "hdg": "psi",
}
_RADIO: dict[str, str] = dict(zip(("1", "2", "4", "3"), _STICKS))
"""Channels of a radio in the usual order: aileron, elevator, throttle, rudder."""
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
    table = _EXACT.get(log_format)
    if table is not None:
        found = table.get(heading)
        if found is None:
            return None
        channel, implied, sign, rank = found
        return Named(channel, implied, sign, rank, f"{_PROGRAM[log_format]}'s name for it")
    return _by_words(heading)


def _by_words(heading: str) -> Named | None:
    bare, bracketed = split_heading(heading)
    implied = unit(bracketed).name if bracketed and is_unit(bracketed) else None
    if bare in CHANNELS:
        return Named(bare, implied, 1, 0, "its name")
    words = re.sub(r"([a-z])([A-Z])", r"\1 \2", bare).lower()
    words = re.sub(r"[^a-z0-9]+", " ", words).strip()
    for ending in sorted(_ENDINGS, key=len, reverse=True):
        if words.endswith(f" {ending}"):
            implied = implied or _ENDINGS[ending]
            words = words.removesuffix(f" {ending}")
            break
    have = set(words.split())
    if have & _ASKED:
        return None
    radio = re.fullmatch(r"(?:rc|rcin|ch|chan|channel|kanal)(?: in)? ?([1-4])", words)
    if radio:
        return Named(_RADIO[radio[1]], implied, 1, 30, "a radio's usual order of channels")
    pilot = have & _PILOT
    words = " ".join(word for word in words.split() if word not in pilot)
    channel, sign, rank = _meant(words)
    if channel is None:
        return None
    if pilot and channel in (*_ANGLES, *_INPUTS):
        channel = dict(zip((*_ANGLES, *_INPUTS), (*_STICKS[:3], *_STICKS))).get(channel, channel)
    return Named(channel, implied, sign, rank, f"named {bare!r}")


def _meant(words: str) -> tuple[str | None, int, int]:
    """Return the channel that words mean, its sign and rank."""
    if words in CHANNELS:
        return words, 1, 1
    if words in _ALONE:
        return _ALONE[words], 1, 2
    bare = " ".join(word for word in words.split() if word not in _ACTING)
    if _ALONE.get(bare) in _INPUTS:
        return _ALONE[bare], 1, 2
    have = set(words.split())
    for rank, (needed, channel, sign) in enumerate(_WORDS):
        if set(needed.split()) <= have:
            return channel, sign, 3 + rank
    return None, 1, 0
