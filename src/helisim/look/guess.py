"""Guesses which column of a log is which channel, and in what unit, and says why."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError
from helisim.base.unit_names import PULSE, UNITS
from helisim.logs.mapping import Column, find_column, split_heading
from helisim.logs.source import Source
from helisim.look.names import Named, named
from helisim.records.channels import CHANNELS, IN1, IN2

CONTROLS = (*IN1, *IN2)
_PULSES = (700.0, 2300.0)
_PULSE_RANGE = 800.0
"""us, from one end of a stick to the other: 1100 to 1900."""
_UNITISED, _PERCENT = 1.5, 105.0
_FAST = 8.0
"""rad/s, the 99th percentile: rates beyond are in deg/s rather."""
_EULER = 1.02 * math.pi
_GRAVITIES = {"m/s^2": 9.80665, "g": 1.0, "mg": 1000.0, "ft/s^2": 32.174}
_NO_MOVE = 1e-9


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
    def guessed(self) -> bool:
        """Whether its unit was guessed, so that the data and other channels may know better."""
        return _sized(self) or self.why.endswith("unit by name")

    @property
    def moves(self) -> bool:
        """Whether the column isn't constant."""
        return self.high - self.low > _NO_MOVE * max(abs(self.low), abs(self.high))

    def to_dict(self) -> dict[str, object]:
        """Return plain data for JSON."""
        one = self.column
        return {
            "name": self.name,
            "column": one.column,
            "unit": one.unit,
            "sign": one.sign,
            "trim": one.trim,
            "range": one.range,
            "why": self.why,
            "rate_hz": self.rate,
            "low": self.low,
            "high": self.high,
            "given": self.given,
            "clock": self.clock,
        }


def guess(
    source: Source, given: Mapping[str, Column], rates: Mapping[str, float]
) -> tuple[SeenChannel, ...]:
    """Return the channels that a log seems to have.

    Args:
        source: the opened log.
        given: channel -> column, as far as the user says it.
        rates: of each clock of the log, Hz.
    """
    seen: dict[str, tuple[Named, SeenChannel]] = {}
    taken = set()
    for name, column in given.items():
        try:
            heading = find_column(column.column, source.names, "column")
            values = source.numbers(heading)
        except HelisimError:
            continue  # reading it will say so
        taken.add(heading)
        unit = column.unit or source.stated_unit(heading)
        column = replace(column, column=heading, unit=unit)
        rate = rates.get(source.clock(heading), 0.0)
        one = _seen(name, column, "given", rate, values)
        seen[name] = Named(name, unit, 1, -1, ""), replace(one, given=True)
    for heading in source.names:
        meant = named(heading, source.format) if heading not in taken else None
        rate = rates.get(source.clock(heading), 0.0) if meant is not None else 0.0
        if meant is None or rate <= 0.0 or not _better(meant, rate, seen):
            continue
        values = _numbers(source, heading)
        if values is not None and not _geographic(heading, values):
            seen[meant.channel] = meant, _guessed(source, heading, meant, rate, values)
    return _same_family(tuple(one for _, one in seen.values()))


def _better(meant: Named, rate: float, seen: Mapping[str, tuple[Named, SeenChannel]]) -> bool:
    """Return whether a column is a better one for its channel than what there is."""
    if meant.channel not in seen:
        return True
    other, one = seen[meant.channel]
    if one.given:
        return False
    if one.moves and rate > 1.5 * one.rate:
        return True
    return meant.rank < other.rank and rate > one.rate / 1.5


def _numbers(source: Source, heading: str) -> NDArray[np.float64] | None:
    try:
        values = source.numbers(heading)
    except HelisimError:
        return None
    return values if np.count_nonzero(np.isfinite(values)) > 1 else None


def _geographic(heading: str, values: NDArray[np.float64]) -> bool:
    """Return whether a column called lat or lon is of the globe."""
    bare = split_heading(heading)[0].lower()
    level, spread = abs(float(np.nanmedian(values))), float(np.ptp(values[np.isfinite(values)]))
    return bare in ("lat", "lon") and level > _UNITISED and spread < 0.05 * level


def _guessed(
    source: Source, heading: str, meant: Named, rate: float, values: NDArray[np.float64]
) -> SeenChannel:
    stated = source.stated_unit(heading)
    column = Column(heading, sign=meant.sign)
    if meant.channel in CONTROLS:
        column, why = _control(column, stated or meant.unit, values)
    else:
        si = CHANNELS[meant.channel].unit
        unit, why = stated, "unit stated"
        if unit is None and meant.unit is not None:
            unit, why = meant.unit, "unit by name"
        if unit is None or (unit in UNITS and UNITS[unit].si != si):
            unit, why = _by_size(meant.channel, values)
        column = replace(column, unit=unit)
    return _seen(meant.channel, column, f"{meant.why}; {why}", rate, values)


def _seen(
    name: str, column: Column, why: str, rate: float, values: NDArray[np.float64]
) -> SeenChannel:
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    return SeenChannel(name, column, why, rate, low, high)


def _control(column: Column, unit: str | None, values: NDArray[np.float64]) -> tuple[Column, str]:
    """Return a control's column with unit, trim and range, and why."""
    known = values[np.isfinite(values)]
    middle, size = float(np.median(known)), float(np.max(np.abs(known)))
    if unit == PULSE or (unit is None and _PULSES[0] <= known.min() and size <= _PULSES[1]):
        trim = float(round(middle))
        return (
            replace(column, unit=PULSE, trim=trim, range=_PULSE_RANGE),
            f"pulses; trim is their median, range the usual {_PULSE_RANGE:g} us",
        )
    if unit == "percent" or (unit in (None, "1") and _UNITISED < size <= _PERCENT):
        return replace(column, unit="percent"), f"percent: it reaches {size:.3g}"
    if unit in UNITS:
        if UNITS[unit].si == "1":
            return replace(column, unit=unit), "without dimension"
        span = float(np.ptp(known)) or 1.0
        text = f"in {unit}; range is what it spans"
        return replace(column, unit=unit, trim=middle, range=float(f"{span:.3g}")), text
    if size <= _UNITISED:
        return replace(column, unit="1"), f"without dimension: it reaches {size:.3g}"
    span = float(f"{np.ptp(known):.3g}") or 1.0
    text = "of unknown unit; trim is its median, range what it spans"
    return replace(column, unit="1", trim=float(f"{middle:.4g}"), range=span), text


def _by_size(channel: str, values: NDArray[np.float64]) -> tuple[str, str]:
    """Return the unit that the numbers' size says, and that it does."""
    known = values[np.isfinite(values)]
    si = CHANNELS[channel].unit
    high = float(np.quantile(np.abs(known), 0.99))
    if si == "rad/s":
        unit = "deg/s" if high > _FAST else "rad/s"
        return unit, f"{unit} by its size, to {high:.3g}"
    if si == "rad":
        most = _EULER / 2.0 if channel == "theta" else 2.0 * math.pi
        unit = "deg" if high > most else "rad"
        return unit, f"{unit} by its size, to {high:.3g}"
    if si == "m/s^2" and channel == "az":
        level = abs(float(np.median(known)))
        near = {one: abs(math.log(max(level, 1e-9) / size)) for one, size in _GRAVITIES.items()}
        unit = min(near, key=lambda one: near[one])
        return unit, f"{unit} by gravity, {level:.3g}"
    return si, "SI, for lack of another word"


def _same_family(seen: tuple[SeenChannel, ...]) -> tuple[SeenChannel, ...]:
    """Give rates, angles and accelerations whose unit was guessed by size the same unit."""
    families = (("p", "q", "r"), ("phi", "theta", "psi"), ("az", "ax", "ay"))
    unit_of = {}
    for family in families:
        units = [one.column.unit for one in seen if one.name in family and _sized(one)]
        large = next((u for u in units if u is not None and u not in ("rad", "rad/s")), None)
        if large is not None and family[0] != "az":
            unit_of |= dict.fromkeys(family, large)
        if family[0] == "az":
            az = next((one for one in seen if one.name == "az"), None)
            if az is not None:
                unit_of |= dict.fromkeys(family[1:], az.column.unit)
    return tuple(_like_others(one, unit_of.get(one.name)) for one in seen)


def _like_others(one: SeenChannel, unit: str | None) -> SeenChannel:
    """Return a channel in the unit of its family, where its own was guessed by size."""
    if unit is None or not _sized(one) or unit == one.column.unit:
        return one
    name = one.why.rpartition(";")[0]
    why = f"{name}; {unit} like the others, by their size"
    return replace(one, column=replace(one.column, unit=unit), why=why)


def _sized(one: SeenChannel) -> bool:
    return any(text in one.why for text in ("by its size", "by their size", "for lack of"))
