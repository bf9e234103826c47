"""ArduPilot's binary logs, DataFlash, of which only the messages asked for are read.

PX4's logs of before ULog, sdlog2 (.px4log), have the same frame; there a message TIME goes before
those of its instant.

Sources: ArduPilot, "Downloading and analyzing data logs", and AP_Logger's README (format letters);
PX4, sdlog2_format.h and sdlog2_messages.h.
"""

import math
import re
import struct
from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import pairwise
from operator import ne
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from helisim.base.errors import StorageError, UnknownNameError, check_known, item_of, shown
from helisim.base.files import file_size, first_bytes
from helisim.logs.report import LogFinding
from helisim.logs.source import Topics
from helisim.logs.ulog import ULOG_MAGIC
from helisim.records.quality import spikes

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
# AutoTune's own messages. While it tests it writes RATE and PIDs, ahead of those of the loop.
_AUTOTUNE = {"ATUN", "ATDE", "ATNH", "ATDH", "ATSH"}
_TWICE = re.compile("RATE|PID.")
_INSTANCE = "#"  # unit of the field that says which of several sensors a message is of
_BLOCK = 16  # messages on either side of a clock's reset, whose medians go back
_NAMED = 3  # types of messages that a sentence names
_FEW = 9  # messages that tell a reset from a wrong stamp, and when a log began and ended
_APART = 600.0  # s that a message may be before or after all types of more than a few
_HIT = 3  # bytes of a format, and formats, that damage may change; another firmware's are more
_FEWER = "the autopilot's logger dropped {} messages: log fewer (LOG_BITMASK)"
_REST = 10.0  # s from one to the next of logs that are joined
_WILD = 1e6  # magnitude, and medians and one more, that no number of a flight has
_ROUNDS = 20  # searches for spikes at most, each without those found before
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
_Times = NDArray[np.float64]


def is_dataflash(path: str | PathLike[str]) -> bool:
    """Return whether a file is a DataFlash log, damaged, whole or as text. Raises StorageError."""
    start = first_bytes(path, _SNIFFED)
    return not start.startswith(ULOG_MAGIC) and (
        start.startswith(_MARKS)
        or _FMT_START in start
        or start.count(_FMT_START[:_HEADER]) >= _FEW
        or bool(_TEXT_START.search(start))
    )


class _Field(NamedTuple):
    kind: np.dtype
    offset: int
    divisor: float
    place: int


class _Layout(NamedTuple):
    """An FMT message; `lost` says why fields are left out: all, if it contradicts itself."""

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
    name, letters, said = map(_text, texts)
    if length < _HEADER or not (name and name.isascii() and name.isprintable()):
        return None
    labels = [label.strip() for label in said.split(",")]
    kinds = [_LETTERS.get(letter, ("V0", 1.0)) for letter in letters]
    rest = length - _HEADER - sum(np.dtype(kind).itemsize for kind, _ in kinds)
    if len(labels) != len(letters) or rest < 0 or (rest > 0) != (kinds.count(("V0", 1.0)) == 1):
        return _Layout(number, name, length, {}, "contradicts itself")
    fields: dict[str, _Field] = {}
    offset, lost = _HEADER, ""
    for k, (letter, label) in enumerate(zip(letters, labels)):
        kind, divisor = _LETTERS.get(letter, (f"V{rest}", 1.0))
        field = _Field(np.dtype(kind), offset, divisor, k)
        offset += field.kind.itemsize
        if field.kind.base.kind == "V" or not (label.isascii() and label.isprintable()):
            lost = (
                f"{name}: {label!r}, of the format letter {letter!r}, isn't known; it is left out"
            )
        elif label:
            fields.setdefault(label, field)
    return _Layout(number, name, length, fields, lost)


def _text(data: bytes) -> str:
    return data.split(b"\0", 1)[0].decode(errors="replace")


def _some(texts: Sequence[str]) -> str:
    return ", ".join(texts[:_NAMED]) + f" and {len(texts) - _NAMED} others" * (len(texts) > _NAMED)


def _scan(
    read: Callable[[], NDArray[np.uint8]],
) -> tuple[list[tuple[_Layout, _Places]], int]:
    """Return each type's layout, and where its messages begin: those that another follows.

    A whole layout of the first of joined logs goes first, then the one that most messages have, as
    damage may hit its number. Also how many types have messages and no layout: FMT comes once.
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
    fmts, stated, log = places[numbers == _FMT_NUMBER], defaultdict[int, list](list), 0
    fmts = fmts[fmts <= size - _FMT.size]
    for place, followed in zip(fmts.tolist(), _holds(begins, fmts + kind(_FMT.size))):
        found = _layout(data[place : place + _FMT.size].tobytes())
        right = found and (found.number != _FMT_NUMBER or found.length == _FMT.size)
        if found and right and (followed or not found.lost):
            log += found.number == _FMT_NUMBER
            stated[found.number].append((not found.lost, -log, found))

    def rank(one: tuple[bool, int, _Layout]) -> tuple[Any, ...]:
        mine = places[numbers == one[2].number]
        return (*one[:2], np.count_nonzero(_holds(begins, mine + kind(one[2].length))))

    layouts = {n: (max(some, key=rank) if some[1:] else some[0])[2] for n, some in stated.items()}
    # PX4 writes none of FMT itself
    layouts.setdefault(_FMT_NUMBER, _Layout(_FMT_NUMBER, "FMT", _FMT.size, {}, ""))
    lengths = np.zeros(256, kind)
    lengths[list(layouts)] = [layout.length for layout in layouts.values()]
    ends = places + lengths[numbers]
    kept = np.flatnonzero((ends > places) & _holds(begins, ends))
    while (inside := places[kept[1:]] < ends[kept[:-1]]).any():
        kept = np.delete(kept, 1 + np.flatnonzero(inside & ~np.append(False, inside[:-1])))
    # of types that stand where whole messages end, more often than damage makes any
    alone = lengths[numbers] == 0
    after = _holds(np.append(ends[kept], kind(size)), places[alone])
    counts = np.bincount(numbers[alone][after], minlength=256)
    formless = int(np.sum(counts > _FEW * (1.0 + np.median(counts[lengths == 0]))))
    places, numbers = places[kept], numbers[kept]
    begins = ends = kept = np.zeros(0, kind)  # let go of
    return [(one, places[numbers == number]) for number, one in layouts.items()], formless


def _holds(increasing: NDArray[Any], wanted: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which wanted numbers, none above the last, are among increasing ones.

    `np.isin` makes a hash table of all of them: it took two thirds of the time to open a log.
    """
    return increasing[np.searchsorted(increasing[:-1], wanted)] == wanted


def _in_order(time: _Times, sensors: NDArray[np.integer] | None = None) -> NDArray[np.intp]:
    """Return the most messages, (n_kept,), whose stamps, of (n_time,) s, don't go back.

    Those of each of `sensors`, (n_time,), and from a clock's reset on, count for themselves.
    """
    back = np.flatnonzero(np.diff(time) < 0.0) + 1
    if not back.size:
        return np.arange(time.size)
    if sensors is not None:
        mine = (np.flatnonzero(sensors == one) for one in np.unique(sensors))
        return np.sort(np.concatenate([one[_in_order(time[one])] for one in mine]))
    resets = [
        k
        for k in back[(back >= _FEW) & (back <= time.size - _FEW)].tolist()
        if np.median(time[max(k - _BLOCK, 0) : k]) > np.median(time[k : k + _BLOCK])
    ]
    edges = pairwise([0, *resets, time.size])
    return np.concatenate([start + _longest(time[start:stop]) for start, stop in edges])


def _longest(time: _Times) -> NDArray[np.intp]:
    """Return the most messages, (n_kept,), whose stamps, of (n_time,) s, don't go back.

    As in patience: `ends` are the least stamps that one, two, ... messages in a row end with.
    """
    ends, last, before = list[float](), list[int](), np.empty(time.size, np.intp)
    for k, stamp in enumerate(time.tolist()):
        count = bisect_right(ends, stamp)
        before[k] = last[count - 1] if count else -1
        ends[count : count + 1], last[count : count + 1] = [stamp], [k]
    kept = last[-1:]
    while before[kept[-1]] >= 0:
        kept.append(int(before[kept[-1]]))
    return np.array(kept[::-1])


def _drop_wild(values: NDArray[np.float64], rounds: int) -> None:
    """Set numbers, (n_message,), NaN that can't be, and those that stick out in so many `rounds`.

    These are spikes, and what is alone other than two before and two after it, which are the same.
    """
    size = np.abs(values)
    if not np.max(size, initial=0.0) < _WILD:
        values[~(size < _WILD * (1.0 + np.nanmedian(np.append(size, 0.0))))] = np.nan
    for _ in range(rounds):
        known = np.flatnonzero(np.isfinite(values))
        one = values[known]
        rests = (one[:-4] == one[1:-3]) & (one[1:-3] == one[3:-1]) & (one[3:-1] == one[4:])
        out = spikes(one)
        out[2:-2] |= rests & (one[2:-2] != one[1:-3])
        values[known[out]] = np.nan
        if not out.any():
            break


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
    """An ArduPilot log; `skipped` bytes belong to no whole message, the last `cut_off` of them.

    `formless` types of messages have no format (FMT) that can be read.
    `strays` is type -> messages that are left out for their stamp. Logs joined one after the other
    (`joined` tells) are one, each later than that before. Raises StorageError if it can't be read,
    holds no message, or is text.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = Path(path)
        self.size = file_size(self.path)
        start = first_bytes(self.path, _SNIFFED)
        if _FMT_START not in start and _TEXT_START.search(start):
            raise StorageError(f"{path}: a DataFlash log as text; give the binary log itself, .bin")
        found, self.formless = _scan(self._bytes) if self.size else ([], 0)
        self._contradicting = [one.name for one, _ in found if one.lost and not one.fields]
        self.skipped = self.size - sum(layout.length * places.size for layout, places in found)
        self._types = {layout.name: (layout, places) for layout, places in found if places.size}
        if not self._types:
            raise StorageError(f"{path}: no DataFlash message in its {self.size} bytes")
        ends = [layout.length + places[-1] for layout, places in self._types.values()]
        self.cut_off = self.size - int(max(ends))
        self.joints, self.strays = self._joints(), Counter[str]()
        self._times = dict[str, _Times]()
        self._put_in_order()
        self.types = tuple(self._types)

    def __contains__(self, name: object) -> bool:
        return name in self._types

    def has(self, name: str, *fields: str) -> bool:
        """Return whether it has messages of a type, with a clock and these fields."""
        return name in self and (
            bool(self._layout(name).clock or self.timed) and self.fields(name).keys() >= set(fields)
        )

    def instances(self, name: str) -> tuple[int, ...]:
        """Return the numbers of a type's sensors, sorted; (0,) for one. Raises UnknownNameError."""
        which = self._which(name)
        return (0,) if which is None else tuple(np.unique(which).tolist())

    def table(self, name: str, instance: int = 0) -> Table:
        """Return the messages of a type, such as "RATE", of one sensor. Raises UnknownNameError."""
        which, places = self._which(name), self._types[name][1]
        if instance not in self.instances(name):
            raise UnknownNameError(f"instance of {name}", instance, map(str, self.instances(name)))
        places = places if which is None else places[which == instance]
        return Table(self, name, self._last_of_ticks(name, places))

    def _last_of_ticks(self, name: str, places: _Places) -> _Places:
        """Return the last message of each tick of types that AutoTune writes besides the loop."""
        if not (_TWICE.fullmatch(name) and _AUTOTUNE & self._types.keys()):
            return places
        half = 0.5 / self.parameters().get("SCHED_LOOP_RATE", math.inf)
        step = np.diff(self.time(name, places), append=math.inf)
        return places[~((step >= 0.0) & (step <= half))]

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
        if name in self._times:
            return self._times[name][np.searchsorted(self._types[name][1], places)]
        clock = self._layout(name).clock
        if clock is not None:
            return self._stored(name, places, clock) / _CLOCKS[clock]
        if not self.timed or name == "FMT":
            return np.full(places.size, np.nan)
        ticks = self._types[_TIMES][1]
        before = np.searchsorted(ticks, places) - 1
        return np.where(before < 0, np.nan, self.time(_TIMES, ticks)[before])

    def column(self, name: str, places: _Places, field: str) -> Column:
        """Return a field of messages, (n_message,), in its unit; NaN where it can't be.

        Raises StorageError.
        """
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
        if one.kind.kind == "f" or self.damaged:
            _drop_wild(values, _ROUNDS * self.damaged)
        values.flags.writeable = False
        return values

    @property
    def timed(self) -> bool:
        """Whether messages TIME say when those after them were written, as in PX4's sdlog2."""
        return _TIMES in self and self._layout(_TIMES).clock is not None

    @cached_property
    def begins(self) -> float:
        """The first stamp of any type, s; 0 without a clock."""
        stamps = [time[0] for time in self._times.values() if time.size]
        return float(min((one for one in stamps if one == one), default=0.0))

    @property
    def damaged(self) -> bool:
        """Whether bytes were changed, not only cut off at the end."""
        return self.skipped > self.cut_off or self.strays.total() > 0 or bool(self._contradicting)

    @property
    def damage(self) -> str:
        """What can't be read, as a sentence; empty of a sound log, and of one that was cut off."""
        most = [f"{count} of {name}" for name, count in self.strays.most_common() if count]
        said = (
            f"{100.0 * self.skipped / self.size:.3g} % of the log ({self.skipped} of {self.size} "
            "bytes) is no whole message" * (self.skipped > 0),
            f"the formats (FMT) of {_some(self._contradicting)} contradict themselves"
            * bool(self._contradicting),
            f"the format (FMT), which a log has once, of {self.formless} of its types is lost"
            * (self.formless > 0),
            f"{self.strays.total()} messages ({_some(most)}) have stamps that don't fit"
            * bool(most),
            "the log is damaged: these are left out, numbers that can't be are missing, and "
            "parameters may be wrong; copy it anew",
        )
        return "; ".join(filter(None, said)) if self.damaged else ""

    @property
    def named(self) -> str:
        """Its path and most of what can't be read, ahead of a refusal."""
        return f"{self.path}: " + "".join(
            f"{one}; " for one in (*self.damage.split("; ")[:2], "copy it anew") if self.damage
        )

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

    def _joints(self) -> dict[int, str]:
        """Return where each of several joined logs begins -> why it is left out, "" if it isn't.

        The FMT message of FMT itself is the first of a log.
        """
        fmts = self._types["FMT"][1] if "FMT" in self else np.zeros(0, np.int64)
        data, first = self._bytes(), min(int(places[0]) for _, places in self._types.values())
        begins = fmts[(data[fmts + _HEADER] == _FMT_NUMBER) & (fmts > first)].tolist()
        joints, forms, seen = {first: ""}, dict[int, bytes](), dict[int, int]()
        most = _HIT * (self.skipped > 0)
        for start, stop in pairwise([first, *begins, self.size] if begins else ()):
            texts = [
                data[at : at + _FMT.size].tobytes() for at in fmts[(fmts >= start) & (fmts < stop)]
            ]
            count = Counter(text[_HEADER] for text in set(texts))  # a number twice is a wrong one
            other = [
                _text(one[5:9])
                for one in texts
                if count[one[_HEADER]] == 1 and (found := _layout(one)) and not found.lost
                if sum(map(ne, one, forms.setdefault(one[_HEADER], one))) > most
            ]
            joints[start] = (
                "the same as one before"
                if seen.setdefault(hash(data[start:stop].tobytes()), start) != start
                else f"its {other[0]} has other fields"
                if other[most:]
                else ""
            )
        return joints

    def _put_in_order(self) -> None:
        """Leave out messages whose stamps can't be; let joined logs go on one after the other."""
        raw = {name: self.time(name, places) for name, (_, places) in self._types.items()}
        found: dict[str, list[tuple[_Places, _Times]]] = {name: [] for name in raw}
        end = -np.inf
        for start, stop in pairwise([*self.joints, self.size]):
            part = dict[str, tuple[_Places, _Times]]()
            for name, (_, places) in self._types.items():
                mine = slice(
                    *np.searchsorted(places, (start, start if self.joints[start] else stop))
                )
                back = np.any(np.diff(raw[name][mine]) < 0.0)
                part[name] = places[mine], raw[name][mine]
                if back:  # else nothing is copied: a log has millions of messages
                    which = self._which(name)
                    kept = _in_order(raw[name][mine], None if which is None else which[mine])
                    self.strays[name] += int(mine.stop - mine.start - kept.size)
                    part[name] = places[mine][kept], raw[name][mine][kept]
            long = [time[time == time] for _, time in part.values()]
            long = [time for time in long if time.size >= _FEW]
            first = min((float(np.median(time[:_FEW])) for time in long), default=-np.inf)
            last = max((float(np.median(time[-_FEW:])) for time in long), default=np.inf)
            later = max(end + _REST - first, 0.0) if long else 0.0
            end = last + later
            for name, (places, time) in part.items():
                near = ~((time < first - _APART) | (time > last + _APART))
                self.strays[name] += int(np.count_nonzero(~near))
                kept = slice(None) if near.all() else near
                found[name].append((places[kept], time[kept] + later if later else time[kept]))
        for name, parts in found.items():
            places, time = parts[0] if len(parts) == 1 else map(np.concatenate, zip(*parts))
            self._types[name], self._times[name] = (self._types[name][0], places), time
        self._types = {name: one for name, one in self._types.items() if one[1].size}

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
        corrupt = self.damage or (
            f"its last {self.cut_off} of {self.size} bytes are no whole message"
            * (self.skipped > 0)
        )
        logs = [f"byte {at}{why and f' ({why}: left out)'}" for at, why in self.joints.items()]
        joined = (
            f"{self.path}: {len(logs)} logs are joined, one after the other, from {', '.join(logs)}"
        )
        own = sorted(_AUTOTUNE & self._types.keys())
        ends = [self.time(name, self._types[name][1][[0, -1]]) - self.begins for name in own]
        tested = (
            f"AutoTune tested from {np.min(ends, initial=np.inf):.1f} to "
            f"{np.max(ends, initial=0.0):.1f} s ({', '.join(own)}), and wrote RATE and PIDs twice "
            "a tick: of those the last is taken"
        )
        return [
            *(
                [LogFinding("corruption" if self.damage else "cut off", f"{self.path}: {corrupt}")]
                if corrupt
                else ()
            ),
            *([LogFinding("joined", joined)] if len(self.joints) > 1 else ()),
            *(LogFinding("format", text) for text in lost if not self.damaged),
            *(
                [LogFinding("dropped", _FEWER.format(dropped), count=dropped)]
                if dropped and not self.damaged
                else ()
            ),
            *([LogFinding("autotune", tested)] if own else ()),
        ]


@lru_cache(maxsize=1)
def open_dataflash(path: Path, digest: str) -> DataFlash:
    """Return a log, the last one from a cache by its digest."""
    return DataFlash(path)
