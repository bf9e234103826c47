"""Maps a log's columns to channels, as values or from a small TOML file; and names the repairs."""

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
    "missing": "take cells without a number for missing samples",
    "resets": "split the log where the clock goes back",
    "spikes": "interpolate single samples, or two, that stick out",
}  # Repair -> its effect; each is done only on request

LOOK = "say which column is which channel; a look at the log guesses which"

# Headings of time, in lower case and without a unit in brackets.
TIME_NAMES = ("time", "t", "timestamp", "time_s", "time_ms", "time_us", "timestamp_us", "timeus")
TIME_LIKE = re.compile(
    r"(.*\.)?(t|\w*time|times|timestamp|tempo|tiempo|temps|zeit)"
    r"_?(s|secs?|seconds|m?sec|usec|ms|us|ns|min)?"
)


@dataclass(frozen=True)
class Column:
    """Where a channel comes from: value = sign (number - trim) in SI, or over `range`.

    `unit` is None if the log states it, such as "gyro_x [deg/s]"; `trim` is the number that means
    zero and `range` that from end to end, in it. "us" needs a range, which makes the channel
    unitised.
    """

    column: str
    unit: str | None = None
    sign: int = setting(1, choices=(1, -1))
    trim: float | None = None
    range: float | None = setting(None, above=0.0)
    meaning: str = ""

    def __post_init__(self) -> None:
        check(self, f"column {self.column!r:.60}")
        if not self.column.strip():
            raise InputError(f"column is {self.column!r}, expected a column's name")
        if self.unit is not None and self.range is None:
            unit(self.unit)

    def option(self, channel: str) -> Option:
        """Return the option "NAME=COLUMN:UNIT:sign=-1", as `named_column` reads it."""
        parts = [f"{channel}={self.column}:{self.unit or ''}", *["sign=-1"] * (self.sign < 0)]
        given = {"trim": self.trim, "range": self.range}
        parts += [f"{name}={value:g}" for name, value in given.items() if value is not None]
        return Option("channel", ":".join(parts))

    def converts(self, channel: str, stated: str | None) -> tuple[Channel, float]:
        """Return a column's channel, and SI per unit; `stated` is the log's. Raises InputError."""
        name, standard = self.unit or stated, CHANNELS.get(channel)
        if name is None:
            raise InputError(
                f"channel {channel!r}: neither the map nor the heading of column {self.column!r} "
                f"says its unit; give one, such as {standard.unit if standard else 'deg/s'!r}"
            )
        pulse = is_unit(name) and unit(name).name == PULSE
        if pulse and None in (self.range, self.trim):
            raise InputError(
                f"channel {channel!r}: pulses in us need a trim and a range, such as trim = 1520 "
                "and range = 800"
            )
        if self.range is not None:
            si, factor = "1", 1.0 / self.range
        else:
            si, factor = unit(name).si, unit(name).factor
        if standard is not None and (
            (standard.kind, si) in (("IN1", "rad"), ("IN2", "rad"), ("IN2", "rad/s"))
        ):
            si = (
                "1"  # a deflection, or a rate that a stick asks for: 1 is a radian, or one a second
            )
        if standard is not None:
            check_same(channel, standard.unit, name, si)
        return standard or Channel(channel, si, "OTHER", self.meaning), self.sign * factor


def own_column(channel: Channel) -> Column:
    """Return the column of a record's channel."""
    return Column(channel.name, channel.unit if is_unit(channel.unit) else None)


def named_column(text: str) -> tuple[str, Column]:
    """Read NAME=COLUMN[:UNIT][:sign=-1][:trim=X][:range=X]. Raises InputError."""
    name, _, rest = text.partition("=")
    column, *further = rest.split(":")
    if not name.strip() or not column:
        raise InputError(f"expected NAME=COLUMN:UNIT, such as p=gyro_x:deg/s, got {text!r}")
    unit = further.pop(0) if further and "=" not in further[0] else None
    table = {"column": column, "unit": unit or None, **read_settings(Column, further, text)}
    return name.strip(), from_plain(Column, table, text)


@dataclass(frozen=True)
class Clock:
    """Where time comes from: a column and its unit, or a constant rate, Hz.

    `unit` is s, ms, us, ns, min or iso8601 (Parquet); None if the log states it, such as "t [ms]".
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

    @classmethod
    def of(cls, text: str) -> "Clock":
        """Return the clock that COLUMN, COLUMN:UNIT or RATE:Hz says."""
        column, _, unit = text.partition(":")
        return (
            cls(rate=float(column))
            if re.fullmatch(r"(?i)\d+(\.\d+)?:hz", text)
            else cls(column, unit or None)
        )

    @property
    def text(self) -> str:
        """What `of` takes."""
        return f"{self.rate:g}:Hz" if self.rate else f"{self.column}:{self.unit or ''}".strip(":")


@dataclass(frozen=True)
class Layout:
    """How a CSV is written, `delimiter` found by default; `skip` is rows below the header.

    `names` are the columns' of a file without a header, in order, also of a bare matrix; `log` is
    which of several Blackbox logs in a file is read, from 1, by default the largest.
    """

    delimiter: str | None = None
    names: tuple[str, ...] = ()
    decimal: str = setting(".", choices=(".", ","))
    skip: int = setting(0, low=0)
    log: int | None = setting(None, low=1)

    def __post_init__(self) -> None:
        check(self)
        one = self.delimiter
        if one is not None and (len(one) != 1 or one in '\r\n" \0' or one == self.decimal):
            raise InputError(
                f"delimiter is {one!r:.40}, expected one character, such as ';', and another than "
                "the decimal"
            )


@dataclass(frozen=True)
class Map:
    """From a log's columns to channels; `time` is None where the log states its clock."""

    channels: Mapping[str, Column] = field(default_factory=dict)
    time: Clock | None = None
    file: Layout = field(default_factory=Layout)

    def __post_init__(self) -> None:
        check(self)
        for name in self.channels:
            if not name or name == "time":
                raise InputError(f"a channel can't be called {name!r}")

    @classmethod
    def of(
        cls,
        channels: "Map | Mapping[str, Column | str] | Sequence[str] | None",
        time: Clock | str | None = None,
    ) -> "Map":
        """Return a map from a map, columns or names; the clock as a value or a column's name."""
        if isinstance(channels, str):
            channels = (channels,)
        if not isinstance(channels, Map):
            named = channels if isinstance(channels, Mapping) else {k: k for k in channels or ()}
            channels = Map(
                {k: Column(one) if isinstance(one, str) else one for k, one in named.items()}
            )
        if time is None:
            return channels
        return replace(channels, time=Clock.of(time) if isinstance(time, str) else time)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Map":
        """Read a map from plain data, as in a TOML file. Raises InputError."""
        channels = data.get("channels")
        if isinstance(channels, Mapping):
            tables = ((k, o) for k, o in channels.items() if isinstance(o, Mapping))
            named = {name: {"column": name, **table} for name, table in tables}
            data = {**data, "channels": {**channels, **named}}
        return from_plain(cls, data, "map")

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> "Map":
        """Read a map from a TOML file, as in `identify`'s help. Raises StorageError, InputError."""
        with placed(path):
            return cls.from_dict(read_toml(path))

    def with_channels(self, channels: Mapping[str, Column]) -> "Map":
        """Return a copy with channels added or replaced."""
        return replace(self, channels={**self.channels, **channels})


_PLACE = re.compile(r"\S[\[(]\d+[\])]$")  # a place in an array, such as "xyz[0]", no unit
_HEADING = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]$")


def split_heading(heading: str) -> tuple[str, str | None]:
    """Return the name and the text in brackets of a heading such as "gyro_x [deg/s]"."""
    match = _HEADING.match(heading.strip())
    if match is None or not match["name"] or _PLACE.search(heading.strip()):
        return heading.strip(), None
    return match["name"], match["unit"].strip()


def find_column(wanted: str, names: Sequence[str], what: str, channel: str = "") -> str:
    """Return a column's heading by its name, with or without its unit in brackets.

    Raises UnknownNameError, which says how to map the channel, or, for several, InputError.
    """
    found = [name for name in names if name == wanted]
    found = found or [name for name in names if split_heading(name)[0] == wanted.strip()]
    if not found:
        remedy = (Option("channel", f"{channel}=COLUMN:UNIT"), Option("map")) if channel else ()
        listed = [repr(name) for name in names[:60]]
        raise UnknownNameError(what, wanted, listed, advice=LOOK * bool(channel), remedy=remedy)
    if len(found) > 1:
        raise InputError(f"{what} {wanted!r} is ambiguous: {len(found)} columns have that name")
    return found[0]
