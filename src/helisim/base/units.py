"""Units: SI inside, and those of logs."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from helisim.base.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

RAD_PER_DEG = math.pi / 180.0
RAD_S_PER_RPM = 2.0 * math.pi / 60.0
# m/s^2, exact, by the 3rd General Conference on Weights and Measures, 1901.
STANDARD_GRAVITY = 9.80665
# Exact: nautical mile of the International Hydrographic Conference, 1929.
METRE_S_PER_KNOT = 1852.0 / 3600.0
METRE_PER_FOOT = 0.3048  # Exact: international yard and pound agreement, 1959
METRE_PER_MILE = 5280.0 * METRE_PER_FOOT
DB_PER_NEPER = 20.0 / math.log(10.0)  # dB per unit of a ratio's natural logarithm
PULSE = "us"  # servo or radio pulse: its trim and range must be given


@dataclass(frozen=True)
class Unit:
    """A unit of `factor` times the SI unit `si`."""

    name: str
    si: str
    factor: float


_TABLE = (
    ("rad", "rad", 1.0, ("radian", "radians")),
    ("deg", "rad", RAD_PER_DEG, ("degree", "degrees", "°")),
    ("cdeg", "rad", RAD_PER_DEG / 100.0, ("centideg", "centidegrees")),
    ("mdeg", "rad", RAD_PER_DEG / 1000.0, ("millideg", "millidegrees")),
    ("mrad", "rad", 0.001, ("milliradians",)),
    ("rad/s", "rad/s", 1.0, ("rad/sec", "radians/s")),
    ("deg/s", "rad/s", RAD_PER_DEG, ("deg/sec", "°/s", "dps", "degrees/s")),
    ("cdeg/s", "rad/s", RAD_PER_DEG / 100.0, ("cdps", "centideg/s")),
    ("mdeg/s", "rad/s", RAD_PER_DEG / 1000.0, ("mdps", "millideg/s")),
    ("mrad/s", "rad/s", 0.001, ()),
    ("rev/s", "rad/s", 2.0 * math.pi, ("rps",)),
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

# Channels' units by name.
UNITS: dict[str, Unit] = {name: Unit(name, si, factor) for name, si, factor, _ in _TABLE}

_ALIASES = {alias: name for name, _, _, aliases in _TABLE for alias in (name, *aliases)}

# Units of time, in s; `iso8601` is for timestamps of Parquet files.
TIME_UNITS: dict[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}

DATES = "iso8601"

_TIME_ALIASES = {"sec": "s", "seconds": "s", "µs": "us", "μs": "us", "msec": "ms", "usec": "us"}


def is_unit(name: str) -> bool:
    """Return whether `unit` knows the name."""
    return name.strip().lower() in _ALIASES


def unit(name: str) -> Unit:
    """Return a channel's unit by name, such as "deg/s" or "kts". Raises UnknownNameError."""
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


def decibel(magnitude: "ArrayLike") -> "NDArray[np.float64]":
    """Return magnitude ratios in dB, in the same shape each; -inf of zero."""
    import numpy as np  # the command line imports this without NumPy

    with np.errstate(divide="ignore"):
        return np.asarray(20.0 * np.log10(magnitude), dtype=np.float64)


def without_trend(columns: "NDArray[np.float64]") -> "NDArray[np.float64]":
    """Return columns, (n_time, n_column), less the straight line that fits each best."""
    import numpy as np

    time = np.linspace(-1.0, 1.0, columns.shape[0])
    level = columns - np.mean(columns, axis=0)
    return level - np.outer(time, (time @ level) / (time @ time))


def window_transforms(columns: "NDArray[np.float64]", length: int) -> "NDArray[np.complex128]":
    """Return transforms of Hann windows that overlap by half, (n_window, n_freq, n_column).

    `columns` are (n_time, n_column); each window, of an even `length`, is less its trend.
    """
    import numpy as np

    hann = np.hanning(length + 1)[:-1, None]
    starts = range(0, columns.shape[0] - length + 1, length // 2)
    windows = [without_trend(columns[start : start + length]) * hann for start in starts]
    return np.fft.rfft(windows, axis=1)
