"""An ArduPilot log in DataFlash's format, binary or text: messages, parameters and texts."""

from collections.abc import Sequence
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import StorageError, UnknownNameError
from helisim.base.files import file_size, first_bytes, read_bytes
from helisim.logs.dataflash.layout import CLOCKS, SNIFFED, Scales, is_text
from helisim.logs.dataflash.scan import scan
from helisim.logs.dataflash.store import BinaryStore, Part, Store, file_reader
from helisim.logs.dataflash.table import Columns, Table, in_file_order, numbers, texts
from helisim.logs.dataflash.text import TextStore


class LogText(NamedTuple):
    """What the autopilot said.

    Attributes:
        time: s since it was switched on.
        text: of the message.
    """

    time: float
    text: str


class DataFlash:
    """An ArduPilot log, of which only what is asked for is read.

    Args:
        path: the file.

    Attributes:
        path: the file.
        size: of the file, bytes.
        is_binary: whether it is binary, and not a ground station's text.
        skipped: bytes that belong to no whole message.
        notes: what of the log's format isn't understood, and left out.

    Raises:
        StorageError: the file can't be read, or holds no message.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = Path(path)
        self.size = file_size(self.path)
        self.is_binary = not is_text(first_bytes(self.path, SNIFFED))
        if self.is_binary:
            read = file_reader(self.path)
            found = scan(read, self.size)
            self._store: Store = BinaryStore(read)
            parts = [
                Part(one.layout, found.places[found.kinds == k])
                for k, one in enumerate(found.definitions)
            ]
            self.skipped = self.size - found.used
        else:
            self._store = text = TextStore(read_bytes(self.path))
            parts, self.skipped = text.parts, text.skipped
        self._parts: dict[str, list[Part]] = {}
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
        columns = Columns(self._store, parts, self._scales)
        columns.load(fields)
        return Table(name, self._time(parts), columns, self.units(name))

    def columns(self, name: str, instance: int | str = 0) -> Columns:
        """Return a type's columns without its clock, as `table` does. Raises UnknownNameError."""
        return Columns(self._store, self._parts_of(name, instance), self._scales)

    def units(self, name: str) -> dict[str, str]:
        """Return field -> unit of a type, as far as the log states them."""
        return {
            field.name: unit
            for part in self._of(name)
            for field in part.layout.fields
            if field.name not in CLOCKS and (unit := self._scales.unit(part.layout, field))
        }

    def number_fields(self, name: str) -> tuple[str, ...]:
        """Return the fields of a type that hold one number each. Raises UnknownNameError."""
        fields = [field for part in self._of(name) for field in part.layout.fields]
        known = [one.name for one in fields if one.count == 1 and not one.is_text]
        return tuple(dict.fromkeys(one for one in known if one not in CLOCKS))

    @cached_property
    def first_stamps(self) -> dict[str, float]:
        """Type of message -> the time of its first one, s; those without a clock are left out."""
        timed = [(one, one.layout.clock) for parts in self._parts.values() for one in parts]
        wanted = [(Part(one.layout, one.places[:1]), [clock]) for one, clock in timed if clock]
        found: dict[str, float] = {}
        for (part, fields), (stored,) in zip(wanted, self._store.raw(wanted)):
            stamp = float(numbers(stored, 1.0, CLOCKS[fields[0].name])[0])
            found.setdefault(part.layout.name, stamp)
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
        """What wrote the log, such as "ArduCopter V4.7.0-dev (90700977)", empty if unknown."""
        said = [row[-1] for row in self._rows("VER", FWS=True)]
        said += [one.text for one in self.messages() if one.text.startswith("Ardu")]
        return next((one for one in said if " V" in one), "")

    @cached_property
    def _scales(self) -> Scales:
        """What the log's own messages say of its units."""
        ids = self._rows("FMTU", FmtType=False, UnitIds=True, MultIds=True)
        units = self._rows("UNIT", Id=False, Label=True)
        factors = self._rows("MULT", Id=False, Mult=False)
        return Scales(
            {int(number): (unit, factor) for _, number, unit, factor in ids},
            {chr(int(letter)): label for _, letter, label in units if 0 <= letter < 128},
            # written in single precision: 0.01 isn't 0.00999999977
            {
                chr(int(letter)): float(f"{factor:.7g}")
                for _, letter, factor in factors
                if 0 <= letter < 128 and np.isfinite(factor)
            },
        )

    def _rows(self, name: str, **fields: bool) -> list[tuple]:
        """Return the rows of a type that the format itself knows, each with its time first.

        None where the type lacks a field, or has it as something else.

        Args:
            name: of the type.
            fields: whether each is a text.
        """
        parts = [
            part
            for part in self._parts.get(name, ())
            if all(
                (one := part.layout.field(field)) is not None
                and (one.is_text, one.count) == (is_text, 1)
                for field, is_text in fields.items()
            )
        ]
        if not parts:
            return []
        columns = Columns(self._store, parts, Scales({}, {}, {}))
        columns.load(tuple(fields))
        rows = zip(self._time(parts).tolist(), *(columns[one].tolist() for one in fields))
        return [row for row in rows if not any(one != one for one in row[1:])]

    def _of(self, name: str) -> list[Part]:
        if name not in self._parts:
            raise UnknownNameError("type of message", name, self.types)
        return self._parts[name]

    def _parts_of(self, name: str, instance: int | str) -> list[Part]:
        """Return the messages of one of several sensors. Raises UnknownNameError."""
        found = []
        for part in self._of(name):
            which = self._instances.get(id(part.places))
            if which is not None:
                part = Part(part.layout, part.places[which == instance])
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
            if (field := self._scales.instance(part.layout)) is not None and field.count == 1
        ]
        return {
            id(part.places): texts(stored) if fields[0].is_text else stored
            for (part, fields), (stored,) in zip(wanted, self._store.raw(wanted))
        }

    def _time(self, parts: Sequence[Part]) -> NDArray[np.float64]:
        """Return when messages were written, (n_message,) s, NaN without a clock."""
        clocks = [part.layout.clock for part in parts]
        wanted = [(part, [clock] if clock else []) for part, clock in zip(parts, clocks)]
        times = [
            numbers(found[0], 1.0, CLOCKS[clock.name])
            if clock is not None
            else np.full(part.places.size, np.nan)
            for part, clock, found in zip(parts, clocks, self._store.raw(wanted))
        ]
        return in_file_order(parts, times)
