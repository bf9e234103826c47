"""Which column of a log is which channel: as values, or from a small TOML file."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from os import PathLike
from typing import Any

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import read_toml
from helisim.base.unit_names import PULSE, TIME_UNITS, check_same, is_unit, time_unit, unit
from helisim.base.value import FrozenMap
from helisim.records.channels import CHANNELS, Channel


@dataclass(frozen=True)
class Column:
    """Where a channel comes from: value = sign (number - trim) in SI, or over `range`.

    Attributes:
        column: the column's name in the log, with or without a unit in brackets.
        unit: its unit, such as "deg/s"; None if the log states it, such as "gyro_x [deg/s]".
        sign: 1 or -1.
        trim: the number that means zero, in the column's unit.
        range: span from one end to the other, in the column's unit: makes the channel
            unitised, without dimension. Pulses ("us") need it.
        unwrap: whether jumps of a whole turn are undone; by default in angles.
        meaning: what a channel of your own is.
    """

    column: str
    unit: str | None = None
    sign: int = 1
    trim: float | None = None
    range: float | None = None
    unwrap: bool | None = None
    meaning: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.column, str) or not self.column.strip():
            raise InputError(f"column is {self.column!r}, expected a column's name")
        for name in ("unit", "meaning"):
            value = getattr(self, name)
            if not isinstance(value, str) and not (value is None and name == "unit"):
                raise InputError(f"{name} of column {self.column!r} is {value!r}, expected text")
        if isinstance(self.sign, bool) or self.sign not in (1, -1):
            raise InputError(f"sign of column {self.column!r} is {self.sign!r}, expected 1 or -1")
        for name in ("trim", "range"):
            value = getattr(self, name)
            if value is not None and not _is_number(value):
                raise InputError(f"{name} of column {self.column!r} is {value!r}, not a number")
        if self.range is not None and not self.range > 0.0:
            raise InputError(f"range of column {self.column!r} is {self.range}, expected > 0")
        if self.unwrap not in (None, True, False):
            raise InputError(f"unwrap of column {self.column!r} is {self.unwrap!r}, expected true")
        if self.unit is not None and self.range is None:
            unit(self.unit)

    def converts(self, channel: str, stated: str | None) -> tuple[Channel, float]:
        """Return the channel that a log's column becomes, and SI per unit of the column.

        Args:
            channel: name of the channel.
            stated: the unit that the log itself states, if any.

        Raises:
            InputError: no unit is known, it isn't of the channel's kind, or a pulse has no
                trim and range.
        """
        name = self.unit or stated
        if name is None:
            known = CHANNELS.get(channel)
            hint = f", such as {known.unit!r}" if known else ""
            raise InputError(
                f"channel {channel!r}: neither the map nor the heading of column "
                f"{self.column!r} says its unit; give one{hint}"
            )
        pulse = is_unit(name) and unit(name).name == PULSE
        if pulse and (self.range is None or self.trim is None):
            raise InputError(
                f"channel {channel!r}: pulses in us need a trim and a range, such as trim = 1520 "
                "and range = 800"
            )
        if self.range is not None:
            si, factor = "1", 1.0 / self.range
        else:
            found = unit(name)
            si, factor = found.si, found.factor
        standard = CHANNELS.get(channel)
        if standard is None:
            return Channel(channel, si, "OTHER", self.meaning), self.sign * factor
        check_same(channel, standard.unit, name, si)
        return standard, self.sign * factor


@dataclass(frozen=True)
class Clock:
    """Where time comes from: a column and its unit, or a constant rate.

    Attributes:
        column: the column's name.
        unit: s, ms, us, ns, min or iso8601; None if the log states it, such as "t [ms]".
        rate: samples a second, Hz, of a log that has no column of times.
    """

    column: str | None = None
    unit: str | None = None
    rate: float | None = None

    def __post_init__(self) -> None:
        if (self.column is None) == (self.rate is None):
            raise InputError("time needs either a column or a rate in Hz")
        if self.column is not None and not isinstance(self.column, str):
            raise InputError(f"column of time is {self.column!r}, expected a column's name")
        if self.unit is not None:
            if not isinstance(self.unit, str):
                raise InputError(f"unit of time is {self.unit!r}, expected {', '.join(TIME_UNITS)}")
            time_unit(self.unit)
        if self.rate is not None and not (_is_number(self.rate) and self.rate > 0.0):
            raise InputError(f"rate of time is {self.rate!r}, expected a positive number, Hz")


@dataclass(frozen=True)
class Layout:
    """How a CSV is written, where that can't be found out from it.

    Attributes:
        delimiter: one character; found among , ; tab and | by default.
        decimal: "." or ",".
        encoding: such as "utf-16-le"; UTF-8, or what the byte order mark says, by default.
        header: number of the line that names the columns; the first that isn't a comment
            by default.
        skip: lines between the header and the numbers, such as a line of units.
        names: the columns' names of a file without a header.
    """

    delimiter: str | None = None
    decimal: str = "."
    encoding: str | None = None
    header: int | None = None
    skip: int = 0
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        delimiter = self.delimiter
        if delimiter is not None and not (
            isinstance(delimiter, str) and len(delimiter) == 1 and delimiter not in '\r\n" \0'
        ):
            raise InputError(f"delimiter is {delimiter!r}, expected one character, such as ';'")
        if self.decimal not in (".", ",") or self.decimal == delimiter:
            raise InputError(
                f"decimal is {self.decimal!r}, expected '.' or ',', and not the delimiter"
            )
        if self.encoding is not None:
            try:
                "".encode(self.encoding)
            except (LookupError, TypeError, ValueError):
                raise InputError(f"unknown encoding {self.encoding!r}, such as 'utf-8'") from None
        for name, least in (("header", 1), ("skip", 0)):
            value = getattr(self, name)
            if value is not None and (not _is_whole(value) or value < least):
                raise InputError(f"{name} is {value!r}, expected a whole number from {least}")
        if isinstance(self.names, str) or not all(isinstance(name, str) for name in self.names):
            raise InputError(f"names are {self.names!r}, expected a list of column names")
        object.__setattr__(self, "names", tuple(self.names))


@dataclass(frozen=True)
class Map:
    """From a log's columns to channels.

    Attributes:
        channels: channel -> its column.
        time: where time comes from; None where the log itself says it.
        layout: how a CSV is written.
    """

    channels: Mapping[str, Column] = field(default_factory=dict)
    time: Clock | None = None
    layout: Layout = field(default_factory=Layout)

    def __post_init__(self) -> None:
        for name, column in self.channels.items():
            if not isinstance(column, Column):
                raise InputError(f"channel {name!r} is {column!r}, expected a Column")
            if not isinstance(name, str) or not name or name == "time":
                raise InputError(f"a channel can't be called {name!r}")
        object.__setattr__(self, "channels", FrozenMap(self.channels))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Map":
        """Read a map from plain data, as a TOML file holds it; as in `MAP_EXAMPLE`.

        Raises:
            InputError: a key is unknown, missing or of the wrong kind.
        """
        for key in data:
            if key not in ("time", "channels", "file"):
                raise UnknownNameError("key of a map", key, ("time", "channels", "file"))
        tables = _table("channels", data.get("channels", {}))
        channels = {
            name: _build(
                Column, f"channels.{name}", {"column": name} | _table(f"channels.{name}", table)
            )
            for name, table in tables.items()
        }
        time = _build(Clock, "time", _table("time", data["time"])) if "time" in data else None
        return cls(channels, time, _build(Layout, "file", _table("file", data.get("file", {}))))

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> "Map":
        """Read a map from a TOML file; as in `MAP_EXAMPLE`.

        Raises:
            StorageError: the file can't be read or isn't TOML.
            InputError: a key is unknown, missing or of the wrong kind.
        """
        data = read_toml(path)
        try:
            return cls.from_dict(data)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

    def with_channels(self, channels: Mapping[str, Column]) -> "Map":
        """Return a copy with channels added or replaced."""
        return replace(self, channels={**self.channels, **channels})


_HEADING = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]$")


def split_heading(heading: str) -> tuple[str, str | None]:
    """Return the name and the text in brackets of a heading such as "gyro_x [deg/s]"."""
    match = _HEADING.match(heading.strip())
    if match is None or not match["name"]:
        return heading.strip(), None
    return match["name"], match["unit"].strip()


def find_column(wanted: str, names: Sequence[str], what: str) -> str:
    """Return the heading of a column by its name, with or without its unit in brackets.

    Raises:
        UnknownNameError: there is none; the message lists those that exist.
        InputError: there are several.
    """
    exact = [name for name in names if name == wanted]
    found = exact or [name for name in names if split_heading(name)[0] == wanted.strip()]
    if not found:
        raise UnknownNameError(what, wanted, [repr(name) for name in names[:60]])
    if len(found) > 1:
        raise InputError(f"{what} {wanted!r} is ambiguous: {len(found)} columns have that name")
    return found[0]


def _build(kind: type[Any], where: str, table: Mapping[str, Any]) -> Any:
    known = [one.name for one in fields(kind)]
    for key in table:
        if key not in known:
            raise UnknownNameError(f"key of [{where}]", key, known)
    try:
        return kind(**table)
    except InputError as error:
        raise InputError(f"[{where}] {error}") from None


def _table(where: str, data: object) -> dict[str, Any]:
    if not isinstance(data, Mapping):
        raise InputError(f"[{where}] is {data!r}, expected a table")
    return dict(data)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and _finite(value)


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
