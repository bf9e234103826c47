"""Messages of one type as columns, which are read when they are asked for."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from helisim.errors import UnknownNameError
from helisim.records.logs.dataflash.layout import CLOCKS, Field, Layout, Scales, text
from helisim.records.logs.dataflash.scan import Read, windows
from helisim.records.value import FrozenMap, Value

Column = NDArray[np.float64] | NDArray[np.str_]


class Part(NamedTuple):
    """Messages of one layout.

    Attributes:
        layout: that they have.
        places: (n_message,) bytes from the file's start, increasing.
    """

    layout: Layout
    places: NDArray[np.int64]


def raw(read: Read, part: Part, fields: Sequence[Field]) -> list[NDArray]:
    """Return fields of messages as they are stored, each (n_message,) or (n_message, n_number)."""
    found = [np.empty((part.places.size, one.count), one.kind) for one in fields]
    for which, at, data in windows(read, part.places, part.layout.length):
        for field, values in zip(fields, found):
            stored = sliding_window_view(data, field.size)[at + field.offset]
            values[which] = stored.view(field.kind)
    return [values if one.count > 1 else values[:, 0] for one, values in zip(fields, found)]


def numbers(stored: NDArray, divisor: float, factor: float) -> NDArray[np.float64]:
    """Return stored numbers, (n_message,) or (n_message, n_number), in their unit."""
    if 0.0 < factor < 1.0:  # 1e-2 isn't exact in binary, 100 is
        divisor, factor = divisor * float(f"{1.0 / factor:.15g}"), 1.0
    values = stored.astype(np.float64)
    if divisor != 1.0:
        values /= divisor
    if factor != 1.0:
        values *= factor
    return values


def texts(stored: NDArray) -> NDArray[np.str_]:
    """Return stored characters, (n_message,), as texts, (n_message,)."""
    distinct, which = np.unique(stored, return_inverse=True)
    return np.array([text(one) for one in distinct.tolist()], dtype=np.str_)[which]


class Columns(Mapping[str, Column]):
    """Columns of a table, each read from the file when it is asked for, and then kept."""

    def __init__(self, read: Read, parts: Sequence[Part], scales: Scales) -> None:
        self._read, self._parts, self._scales = read, tuple(parts), scales
        known = [one.name for part in parts for one in part.layout.fields]
        self._names = tuple(dict.fromkeys(name for name in known if name not in CLOCKS))
        self._kept: dict[str, Column] = {}

    def load(self, names: Sequence[str]) -> None:
        """Read several columns in one pass through the file. Raises UnknownNameError."""
        for name in names:
            if name not in self._names:
                raise UnknownNameError("field", name, self._names)
        wanted = [name for name in names if name not in self._kept]
        found = _merged(self._parts, [self._part(part, wanted) for part in self._parts])
        for name, values in zip(wanted, found):
            values.flags.writeable = False
            self._kept[name] = values

    def __getitem__(self, name: str) -> Column:
        if name not in self._kept:
            self.load([name])
        return self._kept[name]

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

    def _part(self, part: Part, names: Sequence[str]) -> list[Column]:
        """Return columns of messages of one layout, those that it lacks without numbers."""
        fields = [part.layout.field(name) for name in names]
        there = [field for field in fields if field is not None]
        stored = iter(raw(self._read, part, there)) if there else iter(())
        missing = np.full(part.places.size, np.nan)
        return [
            missing if field is None else self._scaled(part.layout, field, next(stored))
            for field in fields
        ]

    def _scaled(self, layout: Layout, field: Field, stored: NDArray) -> Column:
        if field.is_text:
            return texts(stored)
        return numbers(stored, field.divisor, self._scales.factor(layout, field))


def _merged(parts: Sequence[Part], columns: Sequence[Sequence[Column]]) -> list[Column]:
    """Return the columns of all layouts, in the file's order."""
    if len(parts) == 1:
        return list(columns[0])
    order = np.argsort(np.concatenate([part.places for part in parts]), kind="stable")
    return [np.concatenate(ones)[order] for ones in zip(*columns)]


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
