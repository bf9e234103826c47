"""Values: equal where all that they hold is equal, and read-only, also after a copy.

A frozen dataclass whose fields are plain is such a value by itself. One that holds arrays derives
from `Value`, with `eq=False`; a mapping in one is a `FrozenMap`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

Key = TypeVar("Key")
Item = TypeVar("Item")


class FrozenMap(Mapping[Key, Item]):
    """A mapping that can't be changed; it has a hash, and copies and pickles as what it is."""

    __slots__ = ("_items",)

    def __init__(self, items: Mapping[Key, Item]) -> None:
        self._items = dict(items)

    def __getitem__(self, key: Key) -> Item:
        return self._items[key]

    def __iter__(self) -> Iterator[Key]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __contains__(self, key: object) -> bool:
        return key in self._items

    def __repr__(self) -> str:
        return repr(self._items)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Mapping) and same(self, other)

    def __hash__(self) -> int:
        return stable_hash(self._items)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._items,)


class Value:
    """Base of dataclasses that hold arrays: compared, hashed, copied and pickled by their fields.

    A copy is made by the class itself, so that its arrays are read-only too. Fields with
    `compare=False` take no part in comparisons.
    """

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if type(self) is not type(other) or not isinstance(other, Value):
            return NotImplemented
        return same(self._compared(), other._compared())

    def __hash__(self) -> int:
        return hash((type(self).__qualname__, stable_hash(self._compared())))

    def __reduce__(self) -> tuple[Any, ...]:
        given = {one.name: getattr(self, one.name) for one in _fields(self) if one.init}
        return _made, (type(self), given)

    def __repr__(self) -> str:
        shown = [one.name for one in _fields(self) if one.repr]
        parts = [f"{name}={_brief(getattr(self, name))}" for name in shown]
        return f"{type(self).__name__}({', '.join(parts)})"

    def _compared(self) -> tuple[Any, ...]:
        """Return what decides whether two are equal."""
        return tuple(getattr(self, one.name) for one in _fields(self) if one.compare)


def same(one: Any, other: Any) -> bool:
    """Return whether two values are equal, arrays of any shape in them element by element.

    A number that isn't one equals itself, as in the same place of two copies.
    """
    if one is other:
        return True
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        if not (isinstance(one, np.ndarray) and isinstance(other, np.ndarray)):
            return False
        number = one.dtype.kind in "fc" and other.dtype.kind in "fc"
        return np.array_equal(one, other, equal_nan=number)
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return len(one) == len(other) and all(
            key in other and same(item, other[key]) for key, item in one.items()
        )
    if isinstance(one, tuple | list) and isinstance(other, tuple | list):
        alike = isinstance(one, tuple) == isinstance(other, tuple)
        return alike and len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) and isinstance(other, float) and one != one and other != other:
        return True
    return bool(one == other)


def stable_hash(item: Any) -> int:
    """Return a hash that is one for equal items, arrays, mappings and lists among them.

    An array, of any shape, counts by its shape and a few of its numbers: enough to tell records
    apart, at a cost that doesn't grow with them.
    """
    if isinstance(item, np.ndarray):
        some = {0, item.size // 3, item.size // 2, item.size - 1} if item.size else set()
        return hash((item.shape, *(stable_hash(item.flat[k].item()) for k in sorted(some))))
    if isinstance(item, Mapping):
        return hash(frozenset((key, stable_hash(one)) for key, one in item.items()))
    if isinstance(item, tuple | list):
        return hash((isinstance(item, tuple), *map(stable_hash, item)))
    return 0 if item != item else hash(item)  # a NaN hashes by its place in memory


def _brief(item: Any) -> str:
    """Return a field for `repr`: of an array only its shape."""
    return f"<array {item.shape}>" if isinstance(item, np.ndarray) else repr(item)


def _fields(value: Any) -> tuple[Any, ...]:
    return fields(value)


def _made(kind: type, given: dict[str, Any]) -> Any:
    return kind(**given)
