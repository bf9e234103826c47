"""ArduPilot's binary logs, DataFlash, of which only the messages asked for are read.

PX4's logs of before ULog, sdlog2 (.px4log), have the same frame; there a message TIME goes before
those of its instant.

Sources: ArduPilot, "Downloading and analyzing data logs", and AP_Logger's README (format letters);
PX4, sdlog2_format.h and sdlog2_messages.h.
"""

import re
import struct
from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from helisim.base.errors import StorageError, UnknownNameError, check_known, item_of
from helisim.base.files import file_size, first_bytes
from helisim.base.text import shown
from helisim.logs.report import LogFinding
from helisim.logs.source import Topics
from helisim.logs.ulog import ULOG_MAGIC

_HEADER = 3  # bytes before a message's fields: two marks and its type's number
_MARKS = b"\xa3\x95"
_FMT = struct.Struct("<3xBB4s16s64s")
_FMT_NUMBER = 128
_FMT_START = _MARKS + bytes([_FMT_NUMBER, _FMT_NUMBER, _FMT.size])
_TEXT_START = re.compile(rb"^FMT, ?\d", re.MULTILINE)
_SNIFFED = 1 << 16  # bytes of a file that show whether it is a DataFlash log
_WINDOW = 4 << 20  # bytes that are searched for marks at a time
_ROWS = 20_000  # messages that are read at a time
# Fields that hold the time, and ticks a second.
_CLOCKS: Mapping[str, float] = {"TimeUS": 1e6, "TimeMS": 1e3, "StartTime": 1e6}
_TIMES = "TIME"  # message of sdlog2 with the time of those after it, StartTime
SDLOG2 = "sdlog2"
_INSTANCE = "#"  # unit of the field that says which of several sensors a message is of
# Letter -> kind of number, and its divisor; an array is no column, see `DataFlash.arrays`.
_LETTERS: dict[str, tuple[str, float]] = {
    "a": ("(32,)<i2", 1.0),
    "b": ("i1", 1.0), "B": ("u1", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0),
    "i": ("<i4", 1.0), "I": ("<u4", 1.0), "f": ("<f4", 1.0), "d": ("<f8", 1.0), "g": ("<f2", 1.0),
    "n": ("S4", 1.0), "N": ("S16", 1.0), "Z": ("S64", 1.0), "c": ("<i2", 100.0),
    "C": ("<u2", 100.0), "e": ("<i4", 100.0), "E": ("<u4", 100.0), "L": ("<i4", 1e7),
    "M": ("u1", 1.0), "q": ("<i8", 1.0), "Q": ("<u8", 1.0),
}  # fmt: skip

Column = NDArray[np.float64] | NDArray[np.str_]
_Places = NDArray[np.int64]


def is_dataflash(path: str | PathLike[str]) -> bool:
    """Return whether a file is a DataFlash log, damaged, whole or as text. Raises StorageError."""
    start = first_bytes(path, _SNIFFED)
    if start.startswith(ULOG_MAGIC):
        return False
    return start.startswith(_MARKS) or _FMT_START in start or bool(_TEXT_START.search(start))


class _Field(NamedTuple):
    kind: np.dtype
    offset: int
    divisor: float
    place: int


class _Layout(NamedTuple):
    """An FMT message; `lost` says why fields are left out."""

    number: int
    name: str
    length: int
    fields: Mapping[str, _Field]
    lost: str

    @property
    def clock(self) -> str | None:
        return next((name for name in self.fields if name in _CLOCKS), None)


def _layout(message: bytes) -> _Layout | None:
    number, length, *texts = _FMT.unpack(message)
    name, letters, labels = map(_text, texts)
    said = name + letters + labels
    if length < _HEADER or not name or not (said.isascii() and said.isprintable()):
        return None
    fields: dict[str, _Field] = {}
    offset, lost = _HEADER, ""
    for k, (letter, label) in enumerate(zip(letters, labels.split(",") + [""] * len(letters))):
        kind, divisor = _LETTERS.get(letter, (f"V{length}", 1.0))
        field = _Field(np.dtype(kind), offset, divisor, k)
        offset += field.kind.itemsize
        if offset > length:
            lost = f"{name}: {label.strip() or 'its rest'}, of the format letter {letter!r}, "
            lost += f"isn't known or goes beyond {length} bytes; it and what follows is left out"
            break
        if label.strip() and field.kind.base.kind != "V":
            fields.setdefault(label.strip(), field)
    return _Layout(number, name, length, fields, lost)


def _text(data: bytes) -> str:
    return data.split(b"\0", 1)[0].decode(errors="replace")


def _scan(read: Callable[[], NDArray[np.uint8]]) -> list[tuple[_Layout, _Places]]:
    """Return each type's first layout, and where its messages begin: those that another follows.

    `read` maps the log anew each time, so that no more than a window of it is in memory.
    """
    size = read().size
    kind: Any = np.int32 if size < np.iinfo(np.int32).max - _WINDOW else np.int64
    marks: list[Any] = [np.zeros(0, kind)]
    ids = [np.zeros(0, np.uint8)]
    for start in range(0, size - 2, _WINDOW):
        data = read()[start : start + _WINDOW + 2]
        found = np.flatnonzero((data[:-2] == _MARKS[0]) & (data[1:-1] == _MARKS[1]))
        marks.append((start + found).astype(kind))
        ids.append(data[found + 2])
    places: _Places = np.concatenate(marks)
    numbers = np.concatenate(ids)
    del marks, ids
    data, begins = read(), np.append(places, kind(size))
    fmts, layouts = places[numbers == _FMT_NUMBER], dict[int, _Layout]()
    for place in fmts[np.isin(fmts + _FMT.size, begins)].tolist():
        found = _layout(data[place : place + _FMT.size].tobytes())
        if found is not None and (found.number != _FMT_NUMBER or found.length == _FMT.size):
            layouts.setdefault(found.number, found)
    # PX4 writes none of FMT itself
    layouts.setdefault(_FMT_NUMBER, _Layout(_FMT_NUMBER, "FMT", _FMT.size, {}, ""))
    lengths = np.zeros(256, kind)
    lengths[list(layouts)] = [layout.length for layout in layouts.values()]
    ends = places + lengths[numbers]
    kept = np.flatnonzero((ends > places) & (begins[np.searchsorted(begins[:-1], ends)] == ends))
    while (inside := places[kept[1:]] < ends[kept[:-1]]).any():
        kept = np.delete(kept, 1 + np.flatnonzero(inside & ~np.append(False, inside[:-1])))
    places, numbers = places[kept], numbers[kept]
    del begins, ends, kept
    return [(layout, places[numbers == number]) for number, layout in layouts.items()]


class Table:
    """Messages of one type, in the file's order; `table["R"]` is a column, (n_message,).

    `time`, (n_message,) s since power-on, may go back; it is NaN without a clock. `units` is field
    -> unit, where the log states one.
    """

    def __init__(self, log: "DataFlash", name: str, places: _Places) -> None:
        self.name, self.time, self.units = name, log.time(name, places), log.units(name)
        self.columns = tuple(log.fields(name))
        self._read = lru_cache(lambda field: log.column(name, places, field))

    def __len__(self) -> int:
        return self.time.size

    def __getitem__(self, field: str) -> Column:
        """Return a column, (n_message,), in its unit. Raises UnknownNameError, StorageError."""
        check_known(f"field of {self.name}", [field], self.columns)
        return self._read(field)


class LogText(NamedTuple):
    """A text of the autopilot, and its time, s since power-on."""

    time: float
    text: str


class DataFlash:
    """An ArduPilot log; `skipped` bytes belong to no whole message.

    Raises StorageError if it can't be read, holds no message, or is text.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = Path(path)
        self.size = file_size(self.path)
        start = first_bytes(self.path, _SNIFFED)
        if _FMT_START not in start and _TEXT_START.search(start):
            raise StorageError(f"{path}: a DataFlash log as text; give the binary log itself, .bin")
        found = _scan(self._bytes) if self.size else []
        self.skipped = self.size - sum(layout.length * places.size for layout, places in found)
        self._types = {layout.name: (layout, places) for layout, places in found if places.size}
        if not self._types:
            raise StorageError(f"{path}: no DataFlash message in its {self.size} bytes")
        self.types = tuple(self._types)

    def __contains__(self, name: object) -> bool:
        return name in self._types

    def instances(self, name: str) -> tuple[int, ...]:
        """Return the numbers of a type's sensors, sorted; (0,) for one. Raises UnknownNameError."""
        which = self._which(name)
        return (0,) if which is None else tuple(np.unique(which).tolist())

    def table(self, name: str, instance: int = 0) -> Table:
        """Return the messages of a type, such as "RATE", of one sensor. Raises UnknownNameError."""
        which, places = self._which(name), self._types[name][1]
        if instance not in self.instances(name):
            raise UnknownNameError(f"instance of {name}", instance, map(str, self.instances(name)))
        return Table(self, name, places if which is None else places[which == instance])

    def fields(self, name: str) -> dict[str, _Field]:
        """Return the fields of a type but its clock. Raises UnknownNameError."""
        fields = self._layout(name).fields
        return {
            field: one
            for field, one in fields.items()
            if field not in _CLOCKS and not one.kind.shape
        }

    def arrays(self, name: str, field: str) -> NDArray[np.int16]:
        """Return a field of arrays of a type, (n_message, 32). Raises UnknownNameError."""
        arrays = {one for one, of in self._layout(name).fields.items() if of.kind.shape}
        check_known(f"array of {name}", [field], arrays)
        return self._stored(name, self._types[name][1], field)

    def units(self, name: str) -> dict[str, str]:
        """Return field -> unit of a type, where the log states one."""
        ids, units = self._ids(name)[0], self._scales[0]
        letters = {field: ids[k.place : k.place + 1] for field, k in self.fields(name).items()}
        return {field: units[letter] for field, letter in letters.items() if units.get(letter)}

    def time(self, name: str, places: _Places) -> NDArray[np.float64]:
        """Return when messages were written, (n_message,) s; NaN without a clock."""
        clock = self._layout(name).clock
        if clock is not None:
            return self._stored(name, places, clock) / _CLOCKS[clock]
        if not self.timed or name == "FMT":
            return np.full(places.size, np.nan)
        ticks = self._types[_TIMES][1]
        before = np.searchsorted(ticks, places) - 1
        return np.where(before < 0, np.nan, self.time(_TIMES, ticks)[before])

    def column(self, name: str, places: _Places, field: str) -> Column:
        """Return a field of messages, (n_message,), in its unit. Raises StorageError."""
        stored, one = self._stored(name, places, field), self._layout(name).fields[field]
        if one.kind.kind == "S":
            return stored
        # a letter of the format that scales does so alone, without the multiplier
        letter = self._ids(name)[1][one.place : one.place + 1] if one.divisor == 1.0 else ""
        factor, divisor = self._scales[1].get(letter) or 1.0, one.divisor
        if 0.0 < factor < 1.0:  # 1e-2 isn't exact in binary, 100 is
            divisor, factor = divisor * float(f"{1.0 / factor:.15g}"), 1.0
        with np.errstate(over="ignore", invalid="ignore"):
            values = stored.astype(np.float64) / divisor * factor
        values.flags.writeable = False
        return values

    @property
    def timed(self) -> bool:
        """Whether messages TIME say when those after them were written, as in PX4's sdlog2."""
        return _TIMES in self and self._layout(_TIMES).clock is not None

    @cached_property
    def begins(self) -> float:
        """The first stamp of any type, s; 0 without a clock."""
        stamps = [self.time(name, places[:1])[0] for name, (_, places) in self._types.items()]
        return float(min((one for one in stamps if one == one), default=0.0))

    def parameters(self, at: float | None = None) -> dict[str, float]:
        """Return the parameters at an instant, s since power-on; by default the last ones.

        One that was first logged later has its first value: -inf gives those at the start.
        """
        found: dict[str, float] = {}
        for time, name, value in self._rows("PARM", Name=True, Value=False):
            if name not in found or at is None or time <= at:
                found[name] = float(value)
        return found

    def messages(self) -> tuple[LogText, ...]:
        """Return the autopilot's texts, in their order."""
        return tuple(LogText(*row) for row in self._rows("MSG", Message=True))

    @property
    def version(self) -> str:
        """Name and version of what wrote the log, such as "ArduCopter V4.7.0"; may be empty."""
        said = [row[-1] for row in self._rows("VER", FWS=True)]
        said += [one.text for one in self.messages() if one.text.startswith("Ardu")]
        return next((shown(one) for one in said if " V" in one), "")

    @cached_property
    def source(self) -> Topics:
        """The messages with a clock as a log: `RATE.R`, and `IMU[1].GyrX` of a second sensor."""
        topics = {
            shown(f"{name}[{one}]" if one else name): (name, one)
            for name, (layout, _) in self._types.items()
            for one in (self.instances(name) if layout.clock or self.timed else ())
        }
        columns = {
            f"{topic}.{field}": (topic, field)
            for topic, (name, _) in topics.items()
            for field, one in self.fields(name).items()
            if one.kind.kind != "S"
        }
        table = lru_cache(lambda topic: self.table(*topics[topic]))
        return Topics(
            self.path,
            SDLOG2 if self.timed else "DataFlash",
            {column: topic for column, (topic, _) in columns.items()},
            lambda column: np.asarray(table(columns[column][0])[columns[column][1]], np.float64),
            lambda topic: np.rint(1e6 * table(topic).time),
            round(1e6 * self.begins),
            {
                f"{topic}.{field}": unit
                for topic, (name, _) in topics.items()
                for field, unit in self.units(name).items()
            },
            self._findings(),
        )

    def _bytes(self) -> NDArray[np.uint8]:
        try:
            data = np.memmap(self.path, np.uint8, "r")
        except (OSError, ValueError) as error:
            raise StorageError(f"{self.path}: can't read it: {error}") from None
        if data.size != self.size:
            raise StorageError(f"{self.path}: was written to while it was read; read it again")
        return data

    def _stored(self, name: str, places: _Places, field: str) -> NDArray:
        one = self._layout(name).fields[field]
        parts = np.array_split(places, 1 + places.size // _ROWS)  # of the log in memory at a time
        windows = (sliding_window_view(self._bytes(), one.kind.itemsize) for _ in parts)
        stored = np.concatenate(
            [data[part + one.offset].view(one.kind.base) for data, part in zip(windows, parts)]
        )
        stored = stored if one.kind.shape else stored[:, 0]
        if one.kind.kind != "S":
            return stored
        distinct, which = np.unique(stored, return_inverse=True)
        return np.array([_text(text) for text in distinct.tolist()], np.str_)[which]

    def _layout(self, name: str) -> _Layout:
        return item_of(self._types, name, "type of message")[0]

    @cached_property
    def _units_of(self) -> dict[int, tuple[str, str]]:
        rows = self._rows("FMTU", FmtType=False, UnitIds=True, MultIds=True)
        return {int(number): (units, factors) for _, number, units, factors in rows}

    def _ids(self, name: str) -> tuple[str, str]:
        return self._units_of.get(self._layout(name).number, ("", ""))

    @cached_property
    def _scales(self) -> tuple[dict[str, str], dict[str, float]]:
        units = self._rows("UNIT", Id=False, Label=True)
        factors = self._rows("MULT", Id=False, Mult=False)
        return (
            {chr(int(letter)): label for _, letter, label in units if 0 <= letter < 128},
            # written in single precision: 0.01 isn't 0.00999999977
            {
                chr(int(letter)): float(f"{factor:.7g}")
                for _, letter, factor in factors
                if 0 <= letter < 128 and np.isfinite(factor)
            },
        )

    def _rows(self, name: str, **texts: bool) -> list[tuple]:
        if name not in self:
            return []
        layout, places = self._types[name]
        kinds = [layout.fields[field].kind.kind for field in texts if field in layout.fields]
        if [kind == "S" for kind in kinds] != list(texts.values()):
            return []
        columns = (self._stored(name, places, field).tolist() for field in texts)
        rows = zip(self.time(name, places).tolist(), *columns)
        return [row for row in rows if not any(one != one for one in row[1:])]

    def _which(self, name: str) -> NDArray[np.integer] | None:
        """Return the sensor of each message of a type, (n_message,); None without such a field."""
        layout, index = self._layout(name), self._ids(name)[0].find(_INSTANCE)
        of = [k for k, one in layout.fields.items() if one.place == index and one.kind.kind in "iu"]
        return self._stored(name, self._types[name][1], of[0]) if of else None

    def _findings(self) -> list[LogFinding]:
        lost = [layout.lost for layout, _ in self._types.values() if layout.lost]
        dropped = max((int(count) for _, count in self._rows("DSF", Dp=False)), default=0)
        skipped = f"{self.skipped} of {self.size} bytes belong to no whole message"
        fewer = f"the autopilot's logger dropped {dropped} messages: log fewer (LOG_BITMASK)"
        return [
            *(LogFinding("format", text) for text in lost),
            *([LogFinding("corruption", skipped)] if self.skipped else ()),
            *([LogFinding("dropped", fewer, count=dropped)] if dropped else ()),
        ]


@lru_cache(maxsize=1)
def open_dataflash(path: Path, digest: str) -> DataFlash:
    """Return a log, the last one from a cache by its digest."""
    return DataFlash(path)
