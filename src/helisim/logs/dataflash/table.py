"""Messages of one type as columns, which are read when they are asked for."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import UnknownNameError
from helisim.base.value import FrozenMap, Value
from helisim.logs.dataflash.layout import CLOCKS, Field, Layout, Scales, text
from helisim.logs.dataflash.store import Part, Store

Column = NDArray[np.float64] | NDArray[np.str_]


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

    def __init__(self, store: Store, parts: Sequence[Part], scales: Scales) -> None:
        self._store, self._parts, self._scales = store, tuple(parts), scales
        known = [one.name for part in parts for one in part.layout.fields]
        self._names = tuple(dict.fromkeys(name for name in known if name not in CLOCKS))
        self._kept: dict[str, Column] = {}

    def load(self, names: Sequence[str]) -> None:
        """Read several columns in one pass through the file. Raises UnknownNameError."""
        for name in names:
            if name not in self._names:
                raise UnknownNameError("field", name, self._names)
        wanted = [name for name in dict.fromkeys(names) if name not in self._kept]
        if not wanted:
            return
        of_part = [[part.layout.field(name) for name in wanted] for part in self._parts]
        asked = [[one for one in fields if one is not None] for fields in of_part]
        stored = map(iter, self._store.raw(list(zip(self._parts, asked))))
        columns = [
            [None if one is None else self._scaled(part.layout, one, next(found)) for one in fields]
            for part, fields, found in zip(self._parts, of_part, stored)
        ]
        for name, *ones in zip(wanted, *columns):
            values = in_file_order(self._parts, ones)
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

    def _scaled(self, layout: Layout, field: Field, stored: NDArray) -> Column:
        if field.is_text:
            return texts(stored)
        return numbers(stored, field.divisor, self._scales.factor(layout, field))


def in_file_order(parts: Sequence[Part], ones: Sequence[NDArray | None]) -> NDArray:
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
