"""Read plain JSON data back into the value objects that it was written from."""

import math
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from helisim.errors import InputError

T = TypeVar("T")

INFINITE = "inf"
"""How an infinite number is written: JSON has none."""


def json_number(value: float | None) -> float | str | None:
    """Return a size as JSON can hold it; one that is not a number becomes None."""
    if value is None or math.isnan(value):
        return None
    return value if math.isfinite(value) else INFINITE


def read_as(kind: type[T], data: Any, place: str) -> T:
    """Return a dataclass from the keys of an object; other keys are passed over.

    Args:
        kind: the dataclass; each field is checked by its type.
        data: what JSON gave.
        place: of the data, for messages.

    Raises:
        InputError: a field is missing, or of another type, or the dataclass refuses it.
    """
    if not isinstance(data, Mapping):
        raise InputError(f"{place} must be an object, got {data!r:.60}")
    hints, given = get_type_hints(kind), {}
    for one in fields(cast(Any, kind)):
        if one.name in data:
            given[one.name] = _read(hints[one.name], data[one.name], f"{place}.{one.name}")
        elif one.default is MISSING and one.default_factory is MISSING:
            raise InputError(f"{place} has no {one.name!r}")
    try:
        return kind(**given)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def _read(hint: Any, value: Any, place: str) -> Any:
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        if value is None and NoneType in parts:
            return None
        (hint,) = (part for part in parts if part is not NoneType)
        return _read(hint, value, place)
    if is_dataclass(hint):
        return read_as(cast(Any, hint), value, place)
    if origin is tuple and isinstance(value, list):
        each = parts[:1] * len(value) if Ellipsis in parts else parts
        if len(value) == len(each):
            items = enumerate(zip(each, value))
            return tuple(_read(part, item, f"{place}[{k}]") for k, (part, item) in items)
    if origin is Mapping and isinstance(value, dict):
        return {key: _read(parts[1], item, f"{place}.{key}") for key, item in value.items()}
    if hint is float and value == INFINITE:
        return math.inf
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if hint is Any or (origin is Literal and value in parts):
        return value
    if hint in (int, str, bool) and type(value) is hint:
        return value
    raise InputError(f"{place} is {value!r:.60}, expected {getattr(hint, '__name__', hint)}")
