"""How one quantity of a campaign is set or varied: levels, or a distribution."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import norm

from helisim.base.errors import InputError, UnknownNameError

Value = bool | int | float | str | tuple[float, ...]
"""What a setting can be: as in TOML, a list of numbers being one value."""

FORMS = (
    "{ value = ... }",
    "{ values = [...] } or just [...]",
    "{ low, high } with scale = 'log' or count = N if wanted",
    "{ mean, std }",
)

_KEYS = ("value", "values", "low", "high", "scale", "count", "mean", "std", "relative")


@dataclass(frozen=True)
class Levels:
    """A few values, each as likely as the others."""

    values: tuple[Value, ...]

    def at(self, share: float) -> Value:
        """Return the value below which this share lies, in [0, 1), of all draws."""
        return self.values[int(share * len(self.values))]


@dataclass(frozen=True)
class Uniform:
    """Every value between two is as likely, or every ratio where `log`."""

    low: float
    high: float
    log: bool = False

    def at(self, share: float) -> Value:
        """Return the value below which this share of all draws lies."""
        if self.log:
            return self.low * (self.high / self.low) ** share
        return self.low + (self.high - self.low) * share


@dataclass(frozen=True)
class Normal:
    """The normal distribution."""

    mean: float
    std: float

    def at(self, share: float) -> Value:
        """Return the value below which this share, in (0, 1), of all draws lies."""
        return float(norm.ppf(share, self.mean, self.std))


Law = Levels | Uniform | Normal


@dataclass(frozen=True, kw_only=True)
class Variation:
    """One quantity and the law of its values.

    Attributes:
        section: whose it is, such as "recorder".
        name: in that section, such as "antialias_hz"; dotted inside a mapping, such as "noise.p".
        law: of its values.
        relative: values are factors of the quantity's usual value.
    """

    section: str
    name: str
    law: Law
    relative: bool = False

    @property
    def key(self) -> str:
        """Section and name, dotted."""
        return f"{self.section}.{self.name}"

    @property
    def varies(self) -> bool:
        """Whether it has more than one value."""
        return not (isinstance(self.law, Levels) and len(self.law.values) == 1)


def is_variation(item: Any) -> bool:
    """Return whether a TOML item says how something varies, and is no table of such items."""
    return not isinstance(item, Mapping) or any(key in item for key in _KEYS)


def parse(section: str, name: str, item: Any, *, varied: bool = True) -> Variation:
    """Read one item of a campaign file: of its part `vary`, or of `set` if not `varied`.

    Raises:
        InputError: it has no known form, or its numbers make no sense.
    """
    where = f"{section}.{name}"
    bare = "values" if varied else "value"
    table = dict(item) if isinstance(item, Mapping) else {bare: item}
    unknown = [key for key in table if key not in _KEYS]
    if unknown:
        raise UnknownNameError(f"key of {where}", unknown[0], _KEYS)
    relative = table.pop("relative", False)
    if not isinstance(relative, bool):
        raise InputError(f"{where}: relative must be true or false, got {relative!r}")
    variation = Variation(section=section, name=name, law=_law(where, table), relative=relative)
    if variation.varies != varied:
        right, least = ("set", "one value") if varied else ("vary", "several values")
        raise InputError(f"{where} has {least}: it belongs under [{right}.{section}]")
    return variation


def _law(where: str, table: dict[str, Any]) -> Law:
    given = set(table)
    if given == {"value"}:
        return Levels((_value(where, table["value"]),))
    if given == {"values"}:
        values = table["values"]
        return _levels(where, values if isinstance(values, list) else [values])
    if given >= {"low", "high"} and given <= {"low", "high", "scale", "count"}:
        return _between(where, table)
    if given == {"mean", "std"}:
        mean, std = _number(where, table, "mean"), _number(where, table, "std")
        if std <= 0.0:
            raise InputError(f"{where}: std must be positive, got {std}")
        return Normal(mean, std)
    raise InputError(f"{where} is {table}; expected {', '.join(FORMS)}")


def _between(where: str, table: dict[str, Any]) -> Law:
    low, high = _number(where, table, "low"), _number(where, table, "high")
    scale = table.get("scale", "linear")
    if scale not in ("linear", "log"):
        raise InputError(f"{where}: scale must be 'linear' or 'log', got {scale!r}")
    if not low < high or (scale == "log" and low <= 0.0):
        least = "0 < low < high" if scale == "log" else "low < high"
        raise InputError(f"{where} needs {least}, got {low} and {high}")
    if "count" not in table:
        return Uniform(low, high, scale == "log")
    count = table["count"]
    if not isinstance(count, int) or isinstance(count, bool) or count < 2:
        raise InputError(f"{where}: count must be an integer of 2 or more, got {count!r}")
    space = np.geomspace if scale == "log" else np.linspace
    return Levels(tuple(space(low, high, count).tolist()))


def _levels(where: str, items: list[Any]) -> Levels:
    values = tuple(_value(where, item) for item in items)
    if not values:
        raise InputError(f"{where} has no values")
    kinds = {_kind(value) for value in values}
    if len(kinds) > 1:
        raise InputError(f"{where} mixes {' and '.join(sorted(kinds))}: {items}")
    if len(set(values)) < len(values):
        raise InputError(f"{where} has a value twice: {items}")
    return Levels(values)


def _value(where: str, item: Any) -> Value:
    if isinstance(item, list):
        if not item or not all(_is_number(one) for one in item):
            raise InputError(f"{where}: a list inside the list must hold numbers, got {item}")
        return tuple(float(one) for one in item)
    if isinstance(item, (bool, str)) or _is_number(item):
        return item
    raise InputError(f"{where}: {item!r} is no finite number, text, true or false, or list")


def _kind(value: Value) -> str:
    if isinstance(value, bool):
        return "true or false"
    return {str: "text", tuple: "lists"}.get(type(value), "numbers")


def _number(where: str, table: dict[str, Any], key: str) -> float:
    if not _is_number(table[key]):
        raise InputError(f"{where}: {key} must be a finite number, got {table[key]!r}")
    return float(table[key])


def _is_number(item: Any) -> bool:
    return isinstance(item, (int, float)) and not isinstance(item, bool) and math.isfinite(item)
