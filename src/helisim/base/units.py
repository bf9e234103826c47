"""Units: SI inside; those that logs are written in, and those that people read results in.

A unit that results are read in is taken apart into powers of its parts, "rad/(s m)" into
rad^1 s^-1 m^-1, and put together again with others. Frequencies stay in rad/s: they are no angular
rates of a body.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from helisim.base.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

RAD_PER_DEG = math.pi / 180.0
RAD_S_PER_RPM = 2.0 * math.pi / 60.0
STANDARD_GRAVITY = 9.80665
"""m/s^2, exact, by the 3rd General Conference on Weights and Measures, 1901."""
METRE_S_PER_KNOT = 1852.0 / 3600.0
"""Exact: the nautical mile of the International Hydrographic Conference of 1929, an hour."""
METRE_PER_FOOT = 0.3048
"""Exact, by the international yard and pound agreement of 1959."""
METRE_PER_MILE = 5280.0 * METRE_PER_FOOT
DB_PER_NEPER = 20.0 / math.log(10.0)
"""dB per unit of natural logarithm of a magnitude ratio."""

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


CONTROL = "1 of range"
"""The part of a unit that counts control: 1 is the whole range of an input that is unitised."""

_CHOICES: Mapping[str, tuple[str, str, float]] = {
    "rad": ("rad", "rad", 1.0),
    "deg": ("rad", "deg", 1.0 / RAD_PER_DEG),
    "m": ("m", "m", 1.0),
    "ft": ("m", "ft", 1.0 / METRE_PER_FOOT),
    "1": (CONTROL, "1", 1.0),
    "percent": (CONTROL, "%", 100.0),
}
"""Choice -> the part that it stands for, how it is written, and how many of it are one in SI."""

_PART = re.compile(r"([A-Za-z%]+)(?:\^(-?\d+))?")

Powers = dict[str, int]
"""Part of a unit -> its power; empty for a pure number."""


@dataclass(frozen=True)
class UserUnits:
    """Which units to show results in; see `UserUnits.of`.

    Attributes:
        chosen: part in SI -> how it is written, and how many of it are one in SI.
    """

    chosen: tuple[tuple[str, str, float], ...]

    @classmethod
    def of(cls, text: str) -> "UserUnits":
        """Return the units that a list such as "deg,ft,percent" chooses; the others stay SI.

        Raises:
            InputError: an unknown unit, or two for the same.
        """
        chosen = {}
        for name in filter(None, (one.strip() for one in text.split(","))):
            if name not in _CHOICES:
                raise InputError(f"results can't be in {name!r}; available: {', '.join(_CHOICES)}")
            part, *rest = _CHOICES[name]
            if part in chosen:
                raise InputError(f"{name!r} is a second unit of the same as {chosen[part][0]!r}")
            chosen[part] = rest
        return cls(tuple((part, label, factor) for part, (label, factor) in chosen.items()))

    def shown(self, powers: Powers) -> tuple[str, float]:
        """Return how a unit is written, and how many of it are one in SI."""
        labels = {part: (label, factor) for part, label, factor in self.chosen}
        factor, written = 1.0, {}
        for part, power in powers.items():
            label, many = labels.get(part, ("" if part == CONTROL else part, 1.0))
            factor *= many**power
            if label not in ("", "1"):
                written[label] = power
        return unit_text(written), factor

    def of_signal(self, unit: str, *, control: bool) -> tuple[str, float]:
        """Return how a channel's unit is written, and how many of it are one in SI.

        Args:
            unit: SI, such as "rad/s"; one that can't be taken apart stays as it is.
            control: a unit of "1" counts a control's range.
        """
        powers = parts(unit)
        if powers is None or (not powers and not control):
            return unit, 1.0
        label, factor = self.shown(powers or {CONTROL: 1})
        return label or unit, factor


def parts(unit: str) -> Powers | None:
    """Return the powers of a unit's parts, such as {"rad": 1, "s": -1}; None if it has none."""
    above, _, below = unit.strip().partition("/")
    powers: Powers = {}
    for text, sign in ((above, 1), (below.strip("()"), -1)):
        for word in text.split():
            match = _PART.fullmatch(word)
            if word == "SI" or (match is None and not (word == "1" and sign == 1)):
                return None
            if match is not None:
                power = powers.get(match[1], 0) + sign * int(match[2] or 1)
                powers[match[1]] = power
    return {part: power for part, power in powers.items() if power} if unit.strip() else None


def unit_text(powers: Powers) -> str:
    """Return a unit of such powers as it is written: "deg/(s^2 %)", and "1" for none."""

    def words(sign: int) -> list[str]:
        return [
            part if abs(power) == 1 else f"{part}^{abs(power)}"
            for part, power in powers.items()
            if power * sign > 0
        ]

    above, below = words(1), words(-1)
    if not below:
        return " ".join(above) or "1"
    under = below[0] if len(below) == 1 else f"({' '.join(below)})"
    return f"{' '.join(above) or '1'}/{under}"


def decibel(magnitude: "ArrayLike") -> "NDArray[np.float64]":
    """Return magnitude ratios in dB, in the same shape each; -inf of zero."""
    import numpy as np  # not above: the command line knows units, and needs no arrays

    with np.errstate(divide="ignore"):
        return np.asarray(20.0 * np.log10(magnitude), dtype=np.float64)


def without_trend(columns: "NDArray[np.float64]") -> "NDArray[np.float64]":
    """Return columns, (n_time, n_column), less the straight line that fits each best.

    scipy.signal has it, and takes half a second to import.
    """
    import numpy as np

    time = np.linspace(-1.0, 1.0, columns.shape[0])
    level = columns - np.mean(columns, axis=0)
    return level - np.outer(time, (time @ level) / (time @ time))
