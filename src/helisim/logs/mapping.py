"""Which column of a log is which channel, as values or from a small TOML file; and the repairs."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Any

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import read_toml
from helisim.base.note import Option
from helisim.base.settings import check, from_plain, placed, read_settings, setting
from helisim.base.units import PULSE, check_same, is_unit, time_unit, unit
from helisim.records.record import CHANNELS, Channel

REPAIRS: dict[str, str] = {
    "duplicates": "average rows that have the same stamp",
    "frozen": "leave out stretches in which measured motion is frozen, and split the log there "
    "as at gaps",
    "gaps": "split the log at its gaps",
    "missing": "interpolate cells without a number",
    "order": "sort rows by time",
    "resets": "split the log where the clock goes back",
    "spikes": "interpolate single samples, or two, that stick out",
    "tail": "leave out an incomplete last line",
}
"""What may be done to a log, each only on request."""

TIME_NAMES = ("time", "t", "timestamp", "time_s", "time_ms", "time_us", "timestamp_us", "timeus")
"""Headings that mean time, in lower case and without a unit in brackets."""


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
    sign: int = setting(1, choices=(1, -1))
    trim: float | None = None
    range: float | None = setting(None, above=0.0)
    unwrap: bool | None = None
    meaning: str = ""

    def __post_init__(self) -> None:
        check(self, f"column {self.column!r:.60}")
        if not self.column.strip():
            raise InputError(f"column is {self.column!r}, expected a column's name")
        if self.unit is not None and self.range is None:
            unit(self.unit)

    def option(self, channel: str) -> Option:
        """Return the option that says so, "NAME=COLUMN:UNIT:sign=-1", as `named_column` reads."""
        parts = [f"{channel}={self.column}:{self.unit or ''}", *["sign=-1"] * (self.sign < 0)]
        given = {"trim": self.trim, "range": self.range}
        parts += [f"{name}={value:g}" for name, value in given.items() if value is not None]
        return Option("channel", ":".join(parts))

    def converts(self, channel: str, stated: str | None) -> tuple[Channel, float]:
        """Return the channel that a log's column becomes, and SI per unit of the column.

        Args:
            channel: name of the channel.
            stated: the unit that the log itself states, if any.

        Raises:
            InputError: no unit is known, it isn't of the channel's kind, or a pulse has no
                trim and range.
        """
        name, standard = self.unit or stated, CHANNELS.get(channel)
        if name is None:
            hint = f", such as {standard.unit!r}" if standard else ""
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
            si, factor = unit(name).si, unit(name).factor
        if standard is not None:
            check_same(channel, standard.unit, name, si)
        return standard or Channel(channel, si, "OTHER", self.meaning), self.sign * factor


def named_column(text: str) -> tuple[str, Column]:
    """Return NAME=COLUMN[:UNIT][:sign=-1][:trim=X][:range=X] as a channel and its column.

    Raises:
        InputError: it is something else, or a unit or number in it can't be.
    """
    name, _, rest = text.partition("=")
    column, *further = rest.split(":")
    if not name.strip() or not column:
        raise InputError(f"expected NAME=COLUMN:UNIT, such as p=gyro_x:deg/s, got {text!r}")
    unit = further.pop(0) if further and "=" not in further[0] else None
    table = {"column": column, "unit": unit or None, **read_settings(Column, further, text)}
    return name.strip(), from_plain(Column, table, text)


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
    rate: float | None = setting(None, unit="Hz", above=0.0)

    def __post_init__(self) -> None:
        check(self)
        if (self.column is None) == (self.rate is None):
            raise InputError("time needs either a column or a rate in Hz")
        if self.unit is not None:
            time_unit(self.unit)


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
    decimal: str = setting(".", choices=(".", ","))
    encoding: str | None = None
    header: int | None = setting(None, low=1)
    skip: int = setting(0, low=0)
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check(self)
        one = self.delimiter
        if one is not None and (len(one) != 1 or one in '\r\n" \0'):
            raise InputError(f"delimiter is {one!r:.40}, expected one character, such as ';'")
        if self.decimal == one:
            raise InputError(f"decimal is {one!r}, expected another character than the delimiter")
        try:
            "".encode("utf-8" if self.encoding is None else self.encoding)
        except (LookupError, ValueError):
            raise InputError(f"unknown encoding {self.encoding!r:.40}, such as 'utf-8'") from None


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
        check(self)
        for name in self.channels:
            if not name or name == "time":
                raise InputError(f"a channel can't be called {name!r}")

    @classmethod
    def of(
        cls,
        channels: "Map | Mapping[str, Column | str] | None",
        time: Clock | str | None = None,
    ) -> "Map":
        """Return a map of what a user may say: columns and the clock as values or by name."""
        if not isinstance(channels, Map):
            given = (channels or {}).items()
            channels = Map({k: Column(one) if isinstance(one, str) else one for k, one in given})
        if time is None:
            return channels
        return replace(channels, time=Clock(time) if isinstance(time, str) else time)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Map":
        """Read a map from plain data, as a TOML file holds it.

        Raises:
            InputError: a key is unknown, missing or of the wrong kind.
        """
        for key in data:
            if key not in ("time", "channels", "file"):
                raise UnknownNameError("key of a map", key, ("time", "channels", "file"))
        channels = data.get("channels", {})
        if not isinstance(channels, Mapping):
            raise InputError(f"[channels] is {channels!r:.40}, expected a table")
        tables = {
            k: {"column": k, **o} if isinstance(o, Mapping) else o for k, o in channels.items()
        }
        columns = {k: from_plain(Column, one, f"channels.{k}") for k, one in tables.items()}
        time = from_plain(Clock, data["time"], "time") if "time" in data else None
        return cls(columns, time, from_plain(Layout, data.get("file", {}), "file"))

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> "Map":
        """Read a map from a TOML file, such as the help of `identify` shows.

        Raises:
            StorageError: the file can't be read or isn't TOML.
            InputError: a key is unknown, missing or of the wrong kind.
        """
        data = read_toml(path)
        with placed(path):
            return cls.from_dict(data)

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
    found = [name for name in names if name == wanted]
    found = found or [name for name in names if split_heading(name)[0] == wanted.strip()]
    if not found:
        raise UnknownNameError(what, wanted, [repr(name) for name in names[:60]])
    if len(found) > 1:
        raise InputError(f"{what} {wanted!r} is ambiguous: {len(found)} columns have that name")
    return found[0]
