"""The units that logs are written in, by the names that people write, and their SI values."""

import math
from dataclasses import dataclass

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.units import (
    METRE_PER_FOOT,
    METRE_S_PER_KNOT,
    RAD_PER_DEG,
    RAD_S_PER_RPM,
    STANDARD_GRAVITY,
)

METRE_PER_MILE = 5280.0 * METRE_PER_FOOT

PULSE = "us"
"""Unit of a servo or radio pulse: its trim and range must be given."""


@dataclass(frozen=True)
class Unit:
    """A unit: one of it is `factor` of the SI unit `si`."""

    name: str
    si: str
    factor: float


_TABLE = (
    ("rad", "rad", 1.0, ("radian", "radians")),
    ("deg", "rad", RAD_PER_DEG, ("degree", "degrees", "°")),
    ("cdeg", "rad", RAD_PER_DEG / 100.0, ("centideg", "centidegrees")),
    ("rad/s", "rad/s", 1.0, ("rad/sec", "radians/s")),
    ("deg/s", "rad/s", RAD_PER_DEG, ("deg/sec", "°/s", "dps", "degrees/s")),
    ("rpm", "rad/s", RAD_S_PER_RPM, ("rev/min",)),
    ("rad/s^2", "rad/s^2", 1.0, ("rad/s/s", "rad/s2", "rad/s²")),
    ("deg/s^2", "rad/s^2", RAD_PER_DEG, ("deg/s/s", "deg/s2", "deg/s²", "°/s^2", "°/s²")),
    ("m", "m", 1.0, ("metre", "metres", "meter", "meters")),
    ("cm", "m", 0.01, ()),
    ("mm", "m", 0.001, ()),
    ("km", "m", 1000.0, ()),
    ("ft", "m", METRE_PER_FOOT, ("feet", "foot")),
    ("in", "m", METRE_PER_FOOT / 12.0, ("inch", "inches")),
    ("m/s", "m/s", 1.0, ("m/sec",)),
    ("cm/s", "m/s", 0.01, ()),
    ("mm/s", "m/s", 0.001, ()),
    ("km/h", "m/s", 1000.0 / 3600.0, ("kph", "kmh")),
    ("ft/s", "m/s", METRE_PER_FOOT, ("ft/sec", "fps")),
    ("ft/min", "m/s", METRE_PER_FOOT / 60.0, ("fpm",)),
    ("kt", "m/s", METRE_S_PER_KNOT, ("kts", "knot", "knots", "kn")),
    ("mph", "m/s", METRE_PER_MILE / 3600.0, ()),
    ("m/s^2", "m/s^2", 1.0, ("m/s/s", "m/s2", "m/s²")),
    ("ft/s^2", "m/s^2", METRE_PER_FOOT, ("ft/s/s", "ft/s2", "ft/s²")),
    ("g", "m/s^2", STANDARD_GRAVITY, ("g0", "gee")),
    ("mg", "m/s^2", STANDARD_GRAVITY / 1000.0, ()),
    ("1", "1", 1.0, ("-", "none", "unitless", "norm")),
    ("percent", "1", 0.01, ("%", "pct")),
    (PULSE, "1", math.nan, ("µs", "μs", "pwm")),
)

UNITS: dict[str, Unit] = {name: Unit(name, si, factor) for name, si, factor, _ in _TABLE}
"""Every unit of a channel by its name."""

_ALIASES = {alias: name for name, _, _, aliases in _TABLE for alias in (name, *aliases)}

TIME_UNITS: dict[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
"""Every unit of a column of times, in s; `iso8601` stands for dates written out."""

DATES = "iso8601"

_TIME_ALIASES = {"sec": "s", "seconds": "s", "µs": "us", "μs": "us", "msec": "ms", "usec": "us"}


def is_unit(name: str) -> bool:
    """Return whether `unit` knows the name."""
    return name.strip().lower() in _ALIASES


def unit(name: str) -> Unit:
    """Return a channel's unit by a name of it, such as "deg/s" or "kts".

    Raises:
        UnknownNameError: no such unit; the message lists those that exist.
    """
    try:
        return UNITS[_ALIASES[name.strip().lower()]]
    except KeyError:
        raise UnknownNameError("unit", name, UNITS) from None


def time_unit(name: str) -> str:
    """Return the usual name of a unit of time, or `iso8601`. Raises UnknownNameError."""
    usual = name.strip().lower()
    usual = _TIME_ALIASES.get(usual, usual)
    if usual not in (*TIME_UNITS, DATES):
        raise UnknownNameError("unit of time", name, (*TIME_UNITS, DATES))
    return usual


def check_same(channel: str, expected: str, given: str, si: str) -> None:
    """Raise InputError unless a channel's SI unit is the one that its column's unit has."""
    if si != expected:
        raise InputError(
            f"channel {channel!r} is in {expected}, but the unit {given!r} is one of {si}"
        )
