"""ArduPilot's logs, DataFlash's binary format: read with NumPy, and only what is asked for.

A message is two marks, its type's number, and as many bytes as the log's own FMT message says, with
units and multipliers by FMTU, UNIT and MULT. Source: ArduPilot, "Downloading and analyzing data
logs", and the format characters in the README of its library AP_Logger.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from helisim.base.errors import StorageError, UnknownNameError
from helisim.base.files import file_size, first_bytes
from helisim.base.settings import FrozenMap, Value
from helisim.base.text import shown
from helisim.logs.report import LogFinding
from helisim.logs.source import Topics

_HEADER = 3
"""Bytes of a message before its fields: two marks and its type's number."""
_MARKS = b"\xa3\x95"
_FMT_NUMBER, _FMT_LENGTH = 128, 89
_FMT = b"".join(
    (
        _MARKS,
        bytes([_FMT_NUMBER, _FMT_NUMBER, _FMT_LENGTH]),
        b"FMT\0",
        b"BBnNZ".ljust(16, b"\0"),
        b"Type,Length,Name,Format,Columns".ljust(64, b"\0"),
    )
)
"""The FMT message that describes itself, the one layout that is known beforehand."""
_TEXT_START = re.compile(rb"^FMT, ?\d", re.MULTILINE)
_SNIFFED = 1 << 16  # bytes of a file that show whether it is a DataFlash log
_WINDOW = 4 << 20  # bytes that are in memory at a time: the log itself never is
_CLOCKS: Mapping[str, float] = {"TimeUS": 1e-6, "TimeMS": 1e-3}
"""Fields that say when, and their units in s."""
_INSTANCE = "#"  # unit of the field that says which of several sensors a message is of
_SAMPLES = 32  # numbers in an `a`
_LETTERS: dict[str, tuple[str, float]] = {
    "a": ("<i2", 1.0), "b": ("i1", 1.0), "B": ("u1", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0),
    "i": ("<i4", 1.0), "I": ("<u4", 1.0), "f": ("<f4", 1.0), "d": ("<f8", 1.0), "g": ("<f2", 1.0),
    "n": ("S4", 1.0), "N": ("S16", 1.0), "Z": ("S64", 1.0), "c": ("<i2", 100.0),
    "C": ("<u2", 100.0), "e": ("<i4", 100.0), "E": ("<u4", 100.0), "L": ("<i4", 1e7),
    "M": ("u1", 1.0), "q": ("<i8", 1.0), "Q": ("<u8", 1.0),
}  # fmt: skip
"""Letter -> kind of number, and by how much it is divided."""

Column = NDArray[np.float64] | NDArray[np.str_]
_Read = Callable[[int, int], NDArray[np.uint8]]
"""Returns the bytes of a file from a place to another, (n_byte,)."""
_Places = NDArray[np.signedinteger]
"""Bytes from the file's start, of 32 bits where they are enough: a log has millions."""


def is_dataflash(path: str | PathLike[str]) -> bool:
    """Return whether a file is a DataFlash log, damaged or not, by its start; text too.

    Raises:
        StorageError: it can't be read.
    """
    start = first_bytes(path, _SNIFFED)
    return start.startswith(_MARKS) or _FMT[:8] in start or _TEXT_START.search(start) is not None


@dataclass(frozen=True)
class _Field:
    """A field of a message, such as "Roll": `count` numbers of a kind of NumPy's.

    They stand `offset` bytes from the message's start, and are divided by `divisor`; `index` is
    the field's place in the FMT message.
    """

    name: str
    kind: str
    count: int
    offset: int
    divisor: float
    index: int

    @property
    def is_text(self) -> bool:
        return self.kind.startswith("S")


class _Layout(NamedTuple):
    """An FMT message: a type's number, name, bytes, fields, and why some are lost."""

    number: int
    name: str
    length: int
    fields: tuple[_Field, ...]
    lost: str = ""

    @property
    def clock(self) -> _Field | None:
        """The field that says when."""
        return next((one for one in self.fields if one.name in _CLOCKS), None)

    def field(self, name: str) -> _Field | None:
        return next((one for one in self.fields if one.name == name), None)


def _layout(message: bytes) -> _Layout | None:
    """Return what an FMT message says; None if it can't be one.

    A letter that isn't known, or a field beyond the message's length, ends what can be read.
    """
    number, length = message[3], message[4]
    words = [_text(part) for part in (message[5:9], message[9:25], message[25:89])]
    plain = all(" " <= letter <= "~" for letter in "".join(words))
    if length < _HEADER or not words[0] or not plain:
        return None
    name, letters, labels = words[0], words[1], words[2].split(",") if words[2] else []
    fields: dict[str, _Field] = {}
    offset, lost = _HEADER, ""
    for k, (letter, label) in enumerate(zip(letters, labels + [""] * len(letters))):
        if letter not in _LETTERS:
            lost = f"{name}: format letter {letter!r} isn't known, so {label or 'its rest'}"
            break
        kind, divisor = _LETTERS[letter]
        count = _SAMPLES if letter == "a" else 1
        field = _Field(label.strip(), kind, count, offset, divisor, k)
        offset += count * np.dtype(kind).itemsize
        if offset > length:
            lost = f"{name}: its format {letters} is longer than {length} bytes, so {label}"
            break
        if field.name:
            fields.setdefault(field.name, field)
    lost = lost and f"{lost} and what follows it is left out"
    return _Layout(number, name, length, tuple(fields.values()), lost)


def _text(data: bytes) -> str:
    """Return characters up to the first NUL, in UTF-8, or else in Latin-1."""
    data = data.split(b"\0", 1)[0]
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1")


class _Scales(NamedTuple):
    """Units of fields, as the log's FMTU, UNIT and MULT messages say.

    `ids` are of each type a letter each field for its unit, and one for its multiplier.
    """

    ids: Mapping[int, tuple[str, str]]
    units: Mapping[str, str]
    multipliers: Mapping[str, float]

    def letters(self, layout: _Layout, field: _Field) -> tuple[str, str]:
        units, factors = self.ids.get(layout.number, ("", ""))
        return units[field.index : field.index + 1], factors[field.index : field.index + 1]

    def factor(self, layout: _Layout, field: _Field) -> float:
        """Return what a field's stored number is multiplied by, besides its divisor.

        A letter of the format that scales does so alone: the multiplier says the same again.
        """
        letter = self.letters(layout, field)[1]
        return self.multipliers.get(letter, 1.0) or 1.0 if field.divisor == 1.0 else 1.0


class _Part(NamedTuple):
    """Messages of one layout, and (n_message,) where they begin in the file, increasing."""

    layout: _Layout
    places: _Places


_Wanted = Sequence[tuple[_Part, Sequence[_Field]]]
"""Fields of each of several parts."""


def _scan(read: _Read, size: int) -> tuple[list[_Part], int]:
    """Return the messages of each layout in a log of `size` bytes, and the bytes of all.

    Nothing in a message says that it is whole. One that no other follows is left out where another
    begins inside of it that one does follow: then some of its bytes were lost. A type that is
    defined anew has another layout.
    """
    places, numbers = _marks(read, size)
    defined = _definitions(read, size, places[numbers == _FMT_NUMBER])
    while True:
        kinds = _kinds(places, numbers, defined)
        lengths = np.array([*(layout.length for _, layout in defined), 0], np.int16)
        whole = _whole(places, lengths[kinds], size)
        believed = set(places[whole & (numbers == _FMT_NUMBER)].tolist()) | {-1}
        kept = [one for one in defined if one[0] in believed]
        if len(kept) == len(defined):
            break
        defined = kept
    places, kinds = places[whole], kinds[whole]
    parts = [_Part(layout, places[kinds == k]) for k, (_, layout) in enumerate(defined)]
    return parts, int(np.sum(lengths[kinds], dtype=np.int64))


def _marks(read: _Read, size: int) -> tuple[_Places, NDArray[np.uint8]]:
    """Return where messages may begin, (n,), and the numbers of their types, (n,)."""
    dtype = np.int32 if size < np.iinfo(np.int32).max - _WINDOW else np.int64
    places, numbers = [np.empty(0, dtype)], [np.empty(0, np.uint8)]
    for start in range(0, size - _HEADER + 1, _WINDOW):
        data = read(start, min(size, start + _WINDOW + _HEADER - 1))
        found = np.flatnonzero(data[: 1 - _HEADER] == _MARKS[0])
        found = found[data[found + 1] == _MARKS[1]]
        places.append((found + start).astype(dtype))
        numbers.append(data[found + 2])
    return np.concatenate(places), np.concatenate(numbers)


def _definitions(read: _Read, size: int, places: _Places) -> list[tuple[int, _Layout]]:
    """Return where and what the log's FMT messages say, each where it differs from the last."""
    first = _layout(_FMT)
    assert first is not None
    defined, latest = [(-1, first)], {_FMT_NUMBER: first}
    for place in places[places <= size - _FMT_LENGTH].tolist():
        found = _layout(read(place, place + _FMT_LENGTH).tobytes())
        if found and found.number != _FMT_NUMBER and latest.get(found.number) != found:
            latest[found.number] = found
            defined.append((place, found))
    return defined


def _kinds(
    places: _Places, numbers: NDArray[np.uint8], defined: list[tuple[int, _Layout]]
) -> NDArray[np.int16]:
    """Return the definition of each message, (n,), -1 where there is none.

    A type's first definition counts for messages before it too: the log's head may be lost.
    """
    of_number: dict[int, list[int]] = {}
    for k, (_, layout) in enumerate(defined):
        of_number.setdefault(layout.number, []).append(k)
    first = np.full(256, -1, np.int16)
    first[list(of_number)] = [ones[0] for ones in of_number.values()]
    kinds = first[numbers]
    for number, ones in of_number.items():
        if len(ones) > 1:
            these = np.flatnonzero(numbers == number)
            starts = np.array([defined[k][0] for k in ones[1:]], places.dtype)
            latest = np.searchsorted(starts, places[these], side="right")
            kinds[these] = np.array(ones, np.int16)[latest]
    return kinds


def _whole(places: _Places, lengths: NDArray[np.int16], size: int) -> NDArray[np.bool_]:
    """Return which marks begin a message, (n,)."""
    found = np.zeros(places.size, dtype=bool)
    ends = places + lengths
    possible = (lengths > 0) & (ends <= size)
    plain = possible.copy()  # another follows at once
    plain[:-1] &= ends[:-1] == places[1:]
    plain[-1:] = False
    breaks = np.flatnonzero(~plain)
    beyond = dict(zip(breaks.tolist(), np.searchsorted(places, ends[breaks]).tolist()))

    def followed(k: int) -> bool:
        if plain[k]:
            return True
        end, n = int(ends[k]), beyond[k]
        return bool(possible[k]) and (end == size or (n < places.size and int(places[n]) == end))

    k = 0
    for last in breaks.tolist():
        if last < k:
            continue
        found[k:last] = True
        k = last + 1
        if possible[last]:
            inside = () if followed(last) else range(last + 1, beyond[last])
            better = next((n for n in inside if followed(n)), None)
            found[last] = better is None
            k = beyond[last] if better is None else better
    return found


def _file_reader(path: Path) -> _Read:
    """Return a function that reads a file piece by piece, as long as it stays what it is now."""

    def version() -> tuple[int, ...]:
        state = path.stat()
        return state.st_ino, state.st_size, state.st_mtime_ns

    def read(start: int, stop: int) -> NDArray[np.uint8]:
        try:
            with path.open("rb", buffering=0) as file:
                found = np.fromfile(file, np.uint8, stop - start, offset=start)
            changed = found.size != stop - start or version() != known
        except OSError as error:
            raise StorageError(f"{path}: can't read it: {error.strerror}") from None
        if changed:
            raise StorageError(f"{path}: was written to while it was read; read it again")
        return found

    known = version()
    return read


def _numbers(stored: NDArray, divisor: float, factor: float) -> NDArray[np.float64]:
    """Return stored numbers, (n_message,) or (n_message, n_number), in their unit."""
    if 0.0 < factor < 1.0:  # 1e-2 isn't exact in binary, 100 is
        divisor, factor = divisor * float(f"{1.0 / factor:.15g}"), 1.0
    values = stored.astype(np.float64)
    if divisor != 1.0:
        values /= divisor
    if factor != 1.0:
        values *= factor
    return values


def _texts(stored: NDArray) -> NDArray[np.str_]:
    """Return stored characters, (n_message,), as texts, (n_message,)."""
    distinct, which = np.unique(stored, return_inverse=True)
    return np.array([_text(one) for one in distinct.tolist()], dtype=np.str_)[which]


def _in_file_order(parts: Sequence[_Part], ones: Sequence[NDArray | None]) -> NDArray:
    """Return one column, (n_message, ...), of those of parts of a file, each (n_message, ...).

    What a part lacks, or has as something else than the first one, has no number there.
    """
    like = next(one for one in ones if one is not None)
    if len(parts) == 1:
        return like
    nothing = "" if like.dtype.kind == "U" else np.nan
    alike = [
        one
        if one is not None and (one.dtype.kind, one.shape[1:]) == (like.dtype.kind, like.shape[1:])
        else np.full((part.places.size, *like.shape[1:]), nothing)
        for part, one in zip(parts, ones)
    ]
    order = np.argsort(np.concatenate([part.places for part in parts]), kind="stable")
    return np.concatenate(alike)[order]


class _Columns(Mapping[str, Column]):
    """Columns of a table, each read from the file when it is asked for, and then cached."""

    def __init__(self, log: "DataFlash", parts: Sequence[_Part], scales: _Scales) -> None:
        self._log, self._parts, self._scales = log, tuple(parts), scales
        known = [one.name for part in parts for one in part.layout.fields]
        self._names = tuple(dict.fromkeys(name for name in known if name not in _CLOCKS))
        self._cached: dict[str, Column] = {}

    def load(self, names: Sequence[str]) -> None:
        """Read several columns in one pass through the file. Raises UnknownNameError."""
        for name in names:
            if name not in self._names:
                raise UnknownNameError("field", name, self._names)
        wanted = [name for name in dict.fromkeys(names) if name not in self._cached]
        of_part = [[part.layout.field(name) for name in wanted] for part in self._parts]
        asked = [[one for one in fields if one is not None] for fields in of_part]
        stored = map(iter, self._log.raw(list(zip(self._parts, asked))) if wanted else ())
        columns = [
            [None if one is None else self._scaled(part.layout, one, next(found)) for one in fields]
            for part, fields, found in zip(self._parts, of_part, stored)
        ]
        for name, *ones in zip(wanted, *columns):
            values = _in_file_order(self._parts, ones)
            values.flags.writeable = False
            self._cached[name] = values

    def __getitem__(self, name: str) -> Column:
        self.load([name])
        return self._cached[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __repr__(self) -> str:
        return f"columns {', '.join(self._names)}"

    def __reduce__(self) -> tuple[object, ...]:
        return FrozenMap, (dict(self),)

    def _scaled(self, layout: _Layout, field: _Field, stored: NDArray) -> Column:
        factor = self._scales.factor(layout, field)
        return _texts(stored) if field.is_text else _numbers(stored, field.divisor, factor)


@dataclass(frozen=True, eq=False, repr=False)
class Table(Value):
    """Messages of one type, in the file's order.

    Attributes:
        name: of the type, such as "RATE".
        time: (n_message,) s since the autopilot was switched on; NaN where the type has no clock.
            It goes back where the log's clock does.
        columns: field -> (n_message,) numbers in their unit, or texts; (n_message, 32) for a field
            that holds 32 numbers. Each is read from the file when it is asked for.
        units: field -> its unit as the log states it, such as "deg/s"; empty where it doesn't.
    """

    name: str
    time: NDArray[np.float64]
    columns: Mapping[str, Column]
    units: Mapping[str, str]

    def __post_init__(self) -> None:
        self.time.flags.writeable = False
        object.__setattr__(self, "units", FrozenMap(self.units))

    def __repr__(self) -> str:
        return f"Table({self.name!r}: {self.time.size} messages, fields {', '.join(self.columns)})"

    def __len__(self) -> int:
        return self.time.size

    def __getitem__(self, field: str) -> Column:
        """Return one column. Raises UnknownNameError."""
        if field not in self.columns:
            raise UnknownNameError(f"field of {self.name}", field, self.columns)
        return self.columns[field]


class LogText(NamedTuple):
    """A message that the autopilot said: `time`, s since it was switched on, and `text`."""

    time: float
    text: str


class DataFlash:
    """An ArduPilot log, of which only what is asked for is read.

    Args:
        path: the file.

    Attributes:
        path: the file.
        size: of the file, bytes.
        skipped: bytes that belong to no whole message.
        notes: what of the log's format isn't understood, and left out.

    Raises:
        StorageError: the file can't be read, holds no message, or is a log as text.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = Path(path)
        self.size = file_size(self.path)
        start = first_bytes(self.path, _SNIFFED)
        if _FMT[:8] not in start and _TEXT_START.search(start):
            raise StorageError(
                f"{path}: a DataFlash log as text, which a ground station made of a binary one: "
                "give the .bin itself, or convert the text's columns that you need to CSV"
            )
        self._read = _file_reader(self.path)
        parts, used = _scan(self._read, self.size)
        self.skipped = self.size - used
        self._parts: dict[str, list[_Part]] = {}
        for part in parts:
            if part.places.size:
                self._parts.setdefault(part.layout.name, []).append(part)
        if not self._parts:
            raise StorageError(f"{path}: no DataFlash message in its {self.size} bytes")
        self.notes = tuple(one.layout.lost for one in parts if one.layout.lost)

    def __repr__(self) -> str:
        return f"DataFlash({str(self.path)!r}: {', '.join(self.types)})"

    @property
    def types(self) -> tuple[str, ...]:
        """Names of the types of messages that the log has, such as "RATE"."""
        return tuple(self._parts)

    def __contains__(self, name: object) -> bool:
        return name in self._parts

    def count(self, name: str) -> int:
        """Return how many messages of a type there are, of all instances."""
        return sum(part.places.size for part in self._parts.get(name, ()))

    def instances(self, name: str) -> tuple[int | str, ...]:
        """Return of which sensors a type has messages, (0,) where it has one. Sorted.

        Raises UnknownNameError.
        """
        found: set[int | str] = set()
        for part in self._of(name):
            which = self._instances.get(id(part.places))
            found |= {0} if which is None else set(np.unique(which).tolist())
        return tuple(sorted(found, key=lambda one: (isinstance(one, str), one)))

    def table(self, name: str, instance: int | str = 0, *, fields: Sequence[str] = ()) -> Table:
        """Return the messages of a type.

        Args:
            name: of the type, such as "RATE".
            instance: of which of several sensors, where the type has such a field.
            fields: to read at once; any other when it is asked for.

        Raises:
            UnknownNameError: no such type, instance or field.
            StorageError: the file can't be read any more.
        """
        parts = self._parts_of(name, instance)
        columns = _Columns(self, parts, self._scales)
        columns.load(fields)
        return Table(name, self._time(parts), columns, self.units(name))

    def columns(self, name: str, instance: int | str = 0) -> Mapping[str, Column]:
        """Return a type's columns without its clock, as `table` does. Raises UnknownNameError."""
        return _Columns(self, self._parts_of(name, instance), self._scales)

    def units(self, name: str) -> dict[str, str]:
        """Return field -> unit of a type, as far as the log states them."""
        return {
            field.name: unit
            for part in self._of(name)
            for field in part.layout.fields
            if field.name not in _CLOCKS
            and (unit := self._scales.units.get(self._scales.letters(part.layout, field)[0], ""))
        }

    def number_fields(self, name: str) -> tuple[str, ...]:
        """Return the fields of a type that hold one number each. Raises UnknownNameError."""
        fields = [field for part in self._of(name) for field in part.layout.fields]
        known = [one.name for one in fields if one.count == 1 and not one.is_text]
        return tuple(dict.fromkeys(one for one in known if one not in _CLOCKS))

    @cached_property
    def first_stamps(self) -> dict[str, float]:
        """Type of message -> the time of its first one, s; those without a clock are left out."""
        firsts = [_Part(p.layout, p.places[:1]) for parts in self._parts.values() for p in parts]
        found: dict[str, float] = {}
        for part, stamps in zip(firsts, self._stamps(firsts)):
            if part.layout.clock is not None:
                found.setdefault(part.layout.name, float(stamps[0]))
        return found

    def parameters(self, at: float | None = None) -> dict[str, float]:
        """Return the autopilot's parameters by name.

        Args:
            at: s since it was switched on: as they were then; by default as they were at last.
                One that was logged later only has its first value, so -inf gives those at the
                start.
        """
        found: dict[str, float] = {}
        for time, name, value in self._rows("PARM", Name=True, Value=False):
            if name not in found or at is None or time <= at:
                found[name] = value
        return found

    def messages(self) -> tuple[LogText, ...]:
        """Return what the autopilot said, in its order."""
        return tuple(LogText(*row) for row in self._rows("MSG", Message=True))

    @property
    def version(self) -> str:
        """Name and version of what wrote the log, such as "ArduCopter V4.7.0"; may be empty."""
        said = [row[-1] for row in self._rows("VER", FWS=True)]
        said += [one.text for one in self.messages() if one.text.startswith("Ardu")]
        return next((shown(one) for one in said if " V" in one), "")

    @cached_property
    def source(self) -> Topics:
        """The messages with a clock as a log: `RATE.R`, of a second sensor's `IMU[1].GyrX`."""
        columns = {
            f"{topic}.{field}": (topic, name, instance, field)
            for name in self.types
            if name in self.first_stamps
            for instance in self.instances(name)
            for topic in [name if instance == 0 else shown(f"{name}[{instance}]")]
            for field in self.number_fields(name)
        }
        units = {name: self.units(name) for name in self.first_stamps}
        stated = {name: units[one[1]].get(one[3], "") for name, one in columns.items()}
        topics = {topic: (name, instance) for topic, name, instance, _ in columns.values()}

        def read(column: str) -> NDArray[np.float64]:
            _, name, instance, field = columns[column]
            return np.asarray(self.columns(name, instance)[field], np.float64)

        @cache
        def clock(topic: str) -> NDArray[np.float64]:
            return np.rint(1e6 * self._time(self._parts_of(*topics[topic])))

        first = round(1e6 * min(self.first_stamps.values(), default=0.0))
        of = {name: one[0] for name, one in columns.items()}
        return Topics(self.path, "DataFlash", of, read, clock, first, stated, self._findings())

    def raw(self, wanted: _Wanted) -> list[list[NDArray]]:
        """Return fields of parts as stored, each (n_message,) or (n_message, n_number).

        In one pass through the file. Raises StorageError.
        """
        found = [
            [np.empty((part.places.size, one.count), one.kind) for one in fields]
            for part, fields in wanted
        ]
        for pieces, data in self._windows([part for part, _ in wanted]):
            for (which, at), (_, fields), columns in zip(pieces, wanted, found):
                for field, values in zip(fields, columns):
                    size = field.count * np.dtype(field.kind).itemsize
                    stored = sliding_window_view(data, size)[at + field.offset]
                    values[which] = stored.view(field.kind)
        return [
            [values if one.count > 1 else values[:, 0] for one, values in zip(fields, columns)]
            for (_, fields), columns in zip(wanted, found)
        ]

    def _windows(
        self, parts: Sequence[_Part]
    ) -> Iterator[tuple[list[tuple[slice, NDArray[np.int64]]], NDArray[np.uint8]]]:
        """Yield which messages of each part are in a piece of the file, where in it, and it."""
        done = [0] * len(parts)
        while ahead := [int(one.places[k]) for one, k in zip(parts, done) if k < one.places.size]:
            start = min(ahead)
            stop = [
                int(np.searchsorted(one.places, one.places.dtype.type(start + _WINDOW)))
                for one in parts
            ]
            end = max(
                int(one.places[k - 1]) + one.layout.length for one, k in zip(parts, stop) if k
            )
            pieces = [
                (slice(a, b), one.places[a:b].astype(np.int64) - start)
                for one, a, b in zip(parts, done, stop)
            ]
            yield pieces, self._read(start, end)
            done = stop

    @cached_property
    def _scales(self) -> _Scales:
        """The units, as the log's own messages say them."""
        ids = self._rows("FMTU", FmtType=False, UnitIds=True, MultIds=True)
        units = self._rows("UNIT", Id=False, Label=True)
        factors = self._rows("MULT", Id=False, Mult=False)
        return _Scales(
            {int(number): (unit, factor) for _, number, unit, factor in ids},
            {chr(int(letter)): label for _, letter, label in units if 0 <= letter < 128},
            # written in single precision: 0.01 isn't 0.00999999977
            {
                chr(int(letter)): float(f"{factor:.7g}")
                for _, letter, factor in factors
                if 0 <= letter < 128 and np.isfinite(factor)
            },
        )

    def _rows(self, name: str, **texts: bool) -> list[tuple]:
        """Return the rows of a type that the format itself knows, each with its time first.

        None where the type lacks a field, or has it as something else.
        """
        parts = [
            part
            for part in self._parts.get(name, ())
            if all(
                (one := part.layout.field(field)) and (one.is_text, one.count) == (is_text, 1)
                for field, is_text in texts.items()
            )
        ]
        if not parts:
            return []
        columns = _Columns(self, parts, _Scales({}, {}, {}))
        columns.load(tuple(texts))
        rows = zip(self._time(parts).tolist(), *(columns[one].tolist() for one in texts))
        return [row for row in rows if not any(one != one for one in row[1:])]

    def _of(self, name: str) -> list[_Part]:
        if name not in self._parts:
            raise UnknownNameError("type of message", name, self.types)
        return self._parts[name]

    def _parts_of(self, name: str, instance: int | str) -> list[_Part]:
        """Return the messages of one of several sensors. Raises UnknownNameError."""
        found = []
        for part in self._of(name):
            which = self._instances.get(id(part.places))
            if which is not None:
                part = _Part(part.layout, part.places[which == instance])
            if part.places.size and (which is not None or instance == 0):
                found.append(part)
        if not found:
            known = [str(one) for one in self.instances(name)]
            raise UnknownNameError(f"instance of {name}", instance, known)
        return found

    @cached_property
    def _instances(self) -> dict[int, NDArray]:
        """The instance of each message, (n_message,), of parts that have several sensors' ones."""
        wanted = [
            (part, [field])
            for parts in self._parts.values()
            for part in parts
            for k in [self._scales.ids.get(part.layout.number, ("", ""))[0].find(_INSTANCE)]
            for field in part.layout.fields
            if field.index == k and field.count == 1
        ]
        return {
            id(part.places): _texts(stored) if fields[0].is_text else stored
            for (part, fields), (stored,) in zip(wanted, self.raw(wanted))
        }

    def _stamps(self, parts: Sequence[_Part]) -> list[NDArray[np.float64]]:
        """Return when messages of each part were written, (n_message,) s, NaN without a clock."""
        clocks = [part.layout.clock for part in parts]
        wanted = [(part, [clock] if clock else []) for part, clock in zip(parts, clocks)]
        return [
            _numbers(found[0], 1.0, _CLOCKS[clock.name])
            if clock is not None
            else np.full(part.places.size, np.nan)
            for part, clock, found in zip(parts, clocks, self.raw(wanted))
        ]

    def _time(self, parts: Sequence[_Part]) -> NDArray[np.float64]:
        return _in_file_order(parts, self._stamps(parts))

    def _findings(self) -> list[LogFinding]:
        """Return what isn't understood, damaged, or was dropped by the autopilot's logger."""
        found = [LogFinding("format", note) for note in self.notes]
        if self.skipped:
            text = f"{self.skipped} of {self.size} bytes belong to no whole message"
            found.append(LogFinding("corruption", text))
        counts = self.columns("DSF") if "DSF" in self and "Dp" in self.number_fields("DSF") else {}
        dropped = int(np.max(np.nan_to_num(counts.get("Dp", np.zeros(1)))))
        if dropped:
            text = (
                f"the autopilot's logger dropped {dropped} messages: log fewer (LOG_BITMASK), or "
                "with a larger buffer (LOG_FILE_BUFSIZE)"
            )
            found.append(LogFinding("dropped", text, count=dropped))
        return found


@lru_cache(maxsize=1)
def open_dataflash(path: Path, digest: str) -> DataFlash:
    """Return a log; the last one is cached, as several readings of it follow.

    Args:
        path: the file.
        digest: of its bytes.
    """
    return DataFlash(path)
