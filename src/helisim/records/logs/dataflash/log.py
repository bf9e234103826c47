"""An ArduPilot log in DataFlash's binary format: its messages by type, parameters and texts."""

from collections.abc import Sequence
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.errors import StorageError, UnknownNameError
from helisim.records.logs.dataflash.layout import CLOCKS, Scales
from helisim.records.logs.dataflash.scan import file_reader, scan
from helisim.records.logs.dataflash.table import Columns, Part, Table, numbers, raw, texts


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
        skipped: bytes that belong to no whole message.

    Raises:
        StorageError: the file can't be read, or holds no message.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = Path(path)
        try:
            self.size = self.path.stat().st_size
        except (OSError, ValueError) as error:
            raise StorageError(f"{path}: can't read it: {error}") from None
        self._read = file_reader(self.path, self.size)
        found = scan(self._read, self.size)
        self.skipped = self.size - found.used
        if not found.places.size:
            raise StorageError(f"{path}: no DataFlash message in its {self.size} bytes")
        order = np.argsort(found.kinds, kind="stable")
        edges = np.searchsorted(found.kinds[order], np.arange(len(found.definitions) + 1))
        places = found.places[order]
        self._parts: dict[str, list[Part]] = {}
        for k, one in enumerate(found.definitions):
            here = places[edges[k] : edges[k + 1]]
            if here.size:
                self._parts.setdefault(one.layout.name, []).append(Part(one.layout, here))
        self._lost = tuple(one.layout.lost for one in found.definitions if one.layout.lost)

    def __repr__(self) -> str:
        return f"DataFlash({str(self.path)!r}: {', '.join(self.types)})"

    @property
    def types(self) -> tuple[str, ...]:
        """Names of the types of messages that the log has, such as "RATE"."""
        return tuple(self._parts)

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the log's format isn't understood, and left out."""
        return self._lost

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
            which = self._which(part)
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
        parts = []
        for part in self._of(name):
            which = self._which(part)
            keep = slice(None) if which is None else which == instance
            if which is not None or instance == 0:
                parts.append(Part(part.layout, part.places[keep]))
        parts = [part for part in parts if part.places.size]
        if not parts:
            known = [str(one) for one in self.instances(name)]
            raise UnknownNameError(f"instance of {name}", instance, known)
        columns = Columns(self._read, parts, self._scales)
        columns.load(fields)
        units = {
            field.name: unit
            for part in parts
            for field in part.layout.fields
            if field.name in columns and (unit := self._scales.unit(part.layout, field))
        }
        return Table(name, self._time(parts), columns, units)

    def parameters(self, at: float | None = None) -> dict[str, float]:
        """Return the autopilot's parameters by name.

        Args:
            at: s since it was switched on: as they were then; by default as they were at last.
                One that was logged later only has its first value, so -inf gives those at the
                start.
        """
        found: dict[str, float] = {}
        if "PARM" not in self:
            return found
        table = self.table("PARM", fields=("Name", "Value"))
        for time, name, value in zip(table.time, table["Name"].tolist(), table["Value"].tolist()):
            if name not in found or at is None or time <= at:
                found[name] = value
        return found

    def messages(self) -> tuple[LogText, ...]:
        """Return what the autopilot said, in its order."""
        if "MSG" not in self:
            return ()
        table = self.table("MSG")
        return tuple(map(LogText, table.time.tolist(), table["Message"].tolist()))

    @property
    def version(self) -> str:
        """What wrote the log, such as "ArduCopter V4.7.0-dev (90700977)", empty if unknown."""
        if "VER" in self:
            table = self.table("VER")
            if "FWS" in table.columns:
                return str(table["FWS"][0])
        said = (one.text for one in self.messages())
        return next((one for one in said if one.startswith("Ardu") and " V" in one), "")

    @cached_property
    def _scales(self) -> Scales:
        """What the log's own messages say of its units."""
        nothing = Scales({}, {}, {})

        def rows(name: str, *fields: str) -> list[tuple]:
            parts = self._parts.get(name, [])
            columns = Columns(self._read, parts, nothing)
            if not parts or not set(fields) <= set(columns):
                return []
            columns.load(fields)
            return list(zip(*(columns[one].tolist() for one in fields)))

        return Scales(
            {int(k): (u, m) for k, u, m in rows("FMTU", "FmtType", "UnitIds", "MultIds")},
            {chr(int(k)): label for k, label in rows("UNIT", "Id", "Label")},
            # written in single precision: 0.01 isn't 0.00999999977
            {chr(int(k)): float(f"{one:.7g}") for k, one in rows("MULT", "Id", "Mult")},
        )

    def _of(self, name: str) -> list[Part]:
        if name not in self._parts:
            raise UnknownNameError("type of message", name, self.types)
        return self._parts[name]

    def _which(self, part: Part) -> NDArray | None:
        """Return the instance of each message, (n_message,), None if the type has none."""
        field = self._scales.instance(part.layout)
        if field is None or field.count > 1:
            return None
        (stored,) = raw(self._read, part, [field])
        return texts(stored) if field.is_text else stored

    def _time(self, parts: Sequence[Part]) -> NDArray[np.float64]:
        """Return when messages were written, (n_message,) s."""
        times = []
        for part in parts:
            clock = part.layout.clock
            times.append(np.full(part.places.size, np.nan))
            if clock is not None:
                (stored,) = raw(self._read, part, [clock])
                times[-1] = numbers(stored, 1.0, CLOCKS[clock.name])
        if len(parts) == 1:
            return times[0]
        order = np.argsort(np.concatenate([part.places for part in parts]), kind="stable")
        return np.concatenate(times)[order]
