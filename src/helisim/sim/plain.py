"""Value objects as plain data and TOML, and back, each value checked by its type."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from numbers import Real
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import toml_key, toml_value

T = TypeVar("T")

OFF = "off"
"""In TOML, which knows no null: a setting that is None though its default is not."""

UNSAID = {"unsaid": True}
"""Metadata of a setting that plain data leave out where it has its default, as before it was."""

INFINITE = "inf"
"""In JSON, which knows no infinity: an infinite number of a result."""


def to_plain(value: Any) -> Any:
    """Return a value object's settings as JSON would give them back: tuples become lists."""
    if is_dataclass(value):
        return {name: _inside(getattr(value, name)) for name in _said(value)}
    if isinstance(value, Mapping):
        return {str(key): to_plain(one) for key, one in value.items()}
    if isinstance(value, tuple | list):
        return [_inside(one) for one in value]
    return value


def in_brief(value: Any) -> str:
    """Return a value object as one would write it: only the settings that aren't its defaults."""
    changed = []
    for one in fields(value):
        item = getattr(value, one.name)
        default = one.default if one.default_factory is MISSING else one.default_factory()
        if one.repr and item != default:
            changed.append(f"{one.name}={_item_in_brief(item)}")
    return f"{type(value).__name__}({', '.join(changed)})"


def _item_in_brief(item: Any) -> str:
    if is_dataclass(item) and not isinstance(item, type):
        return in_brief(item)
    if isinstance(item, tuple):
        inner = ", ".join(map(_item_in_brief, item))
        return f"({inner},)" if len(item) == 1 else f"({inner})"
    if callable(item):
        return str(getattr(item, "__name__", None) or type(item).__name__)  # without its address
    return repr(item)


def with_kind(value: Any, settings: Callable[[Any], dict[str, Any]] = to_plain) -> dict[str, Any]:
    """Return a value object's settings behind the name of its class."""
    return {"kind": type(value).__name__, **settings(value)}


def of_kind(table: Any, kinds: Mapping[str, type], what: str, *, where: str = "") -> Any:
    """Return the value object of the kind that a table names.

    Args:
        table: `with_kind` of it.
        kinds: by name.
        what: it is, for messages.
        where: the table's name, for messages; `what` and the kind if empty.

    Raises:
        InputError: there is no such kind, or it has no such settings.
    """
    names = ", ".join(kinds)
    if not isinstance(table, Mapping) or "kind" not in table:
        raise InputError(
            f"{where or what} must be a table with a kind, one of {names}; got {table!r:.60}"
        )
    kind = table["kind"]
    if kind not in kinds:
        own = "one of your own has to be imported first" if what == "mission" else ""
        raise UnknownNameError(f"kind of {what}", kind, kinds, advice=own)
    settings = {name: value for name, value in table.items() if name != "kind"}
    return from_plain(kinds[kind], settings, where or f"{what} {kind}")


def from_plain(kind: type[T], table: Any, where: str, *, lenient: bool = False) -> T:
    """Return the value object whose fields a table holds; what it doesn't say is the default.

    Args:
        kind: a dataclass.
        table: fields by name, as `to_plain` or a TOML file gives them.
        where: the table's name, for messages.
        lenient: True passes over names that `kind` doesn't have, as another version may have
            written them, and takes `INFINITE`.

    Raises:
        UnknownNameError: no such setting; the message lists those that exist.
        InputError: a setting is missing, of the wrong type, or refused by the object.
    """
    if not isinstance(table, Mapping):
        raise InputError(f"{where} must be {_words(kind)}, got {table!r:.60}")
    allowed = {one.name: one for one in fields(cast(Any, kind)) if one.init}
    if not lenient:
        for name in table:
            if name not in allowed:
                raise UnknownNameError(f"setting of {where}", name, allowed)
    missing = [
        name
        for name, one in allowed.items()
        if one.default is MISSING and one.default_factory is MISSING and name not in table
    ]
    if missing:
        raise InputError(f"{where} needs {' and '.join(missing)}")
    hints = get_type_hints(kind)
    given = {
        name: _from_plain(hints[name], value, f"{where}.{name}", lenient)
        for name, value in table.items()
        if name in allowed
    }
    try:
        return kind(**given)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def check_type(where: str, hint: Any, value: Any) -> None:
    """Raise InputError unless a plain value is of a type, such as `float | None`."""
    if not _fits(hint, value):
        raise InputError(f"{where} must be {_words(hint)}, got {value!r:.60}")


def settle(value: Any) -> None:
    """Make a frozen value object's settings plain: numbers and tuples of Python's own.

    Raises:
        InputError: one is not of its field's type.
    """
    kind = type(value)
    hints = get_type_hints(kind)
    for name in setting_names(value):
        setting = getattr(value, name)
        if isinstance(setting, np.generic | np.ndarray):
            setting = setting.tolist()
        if isinstance(setting, list):
            setting = tuple(setting)
        check_type(f"{kind.__name__}.{name}", hints[name], setting)
        object.__setattr__(value, name, setting)


def is_number(value: Any) -> bool:
    """Return whether a value is a real number, of Python or NumPy; True and False are none."""
    return isinstance(value, Real) and not isinstance(value, bool)


def value_object(hint: Any) -> Any:
    """Return the dataclass of a field that may hold one, None if it can't."""
    return next((one for one in (hint, *get_args(hint)) if is_dataclass(one)), None)


def setting_names(value: Any) -> tuple[str, ...]:
    """Return the names of a dataclass's settings, in their order."""
    return tuple(one.name for one in fields(value) if one.init)


def _said(value: Any) -> tuple[str, ...]:
    """Return the names of the settings that plain data of a value object have."""
    unsaid = {
        one.name
        for one in fields(value)
        if one.metadata.get("unsaid") and getattr(value, one.name) == one.default
    }
    return tuple(name for name in setting_names(value) if name not in unsaid)


def _inside(value: Any, settings: Callable[[Any], Any] = to_plain) -> Any:
    """Return a part of something as plain data, with its kind where there are several."""
    return with_kind(value, settings) if hasattr(type(value), "kinds") else settings(value)


def toml_settings(value: Any) -> dict[str, Any]:
    """Return a value object's settings for a TOML file, where None is `OFF` or left out."""
    defaults = {one.name: one.default for one in fields(value)}
    settings: dict[str, Any] = {}
    for name in _said(value):
        one = getattr(value, name)
        if is_dataclass(one):
            settings[name] = _inside(one, toml_settings)
        elif isinstance(one, tuple) and one and is_dataclass(one[0]):
            settings[name] = [_inside(part, toml_settings) for part in one]
        elif one is not None:
            settings[name] = to_plain(one)
        elif defaults[name] is not None:
            settings[name] = OFF
    return settings


def toml_text(tables: Mapping[str, Any], prefix: str = "") -> str:
    """Return tables as TOML: plain values first, then a section for each table in them."""
    inner = {key: value for key, value in tables.items() if _is_section(value)}
    lines = [f"{toml_key(key)} = {toml_value(tables[key])}" for key in tables if key not in inner]
    text = "".join(f"{line}\n" for line in lines)
    for key, value in inner.items():
        name = f"{prefix}{toml_key(key)}"
        for heading, table in (
            [(f"[{name}]", value)]
            if isinstance(value, Mapping)
            else [(f"[[{name}]]", one) for one in value]
        ):
            text += f"\n{heading}\n{toml_text(table, f'{name}.')}"
    return text if prefix else text.removeprefix("\n")


def _is_section(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and isinstance(value[0], Mapping)
    return isinstance(value, Mapping)


def _from_plain(hint: Any, value: Any, where: str, lenient: bool) -> Any:
    for kind in _alternatives(hint):
        parts = get_args(kind)
        if is_dataclass(kind) and isinstance(value, Mapping):
            return _object(kind, value, where, lenient)
        if get_origin(kind) is Mapping and isinstance(value, Mapping):
            return {
                key: _from_plain(parts[1], one, f"{where}.{key}", lenient)
                for key, one in value.items()
            }
        if get_origin(kind) is tuple and isinstance(value, list) and is_dataclass(parts[0]):
            return tuple(
                _object(parts[0], one, f"{where}[{k}]", lenient) for k, one in enumerate(value)
            )
        if lenient and kind is float and value == INFINITE:
            return math.inf
    if value == OFF and not _fits(hint, value) and NoneType in get_args(hint):
        return None
    value = tuple(value) if isinstance(value, list) and hint is not Any else value
    check_type(where, hint, value)
    return value


def _object(kind: Any, table: Any, where: str, lenient: bool) -> Any:
    """Return a value object of a kind, or of the one of its `kinds` that the table names."""
    if hasattr(kind, "kinds"):
        return of_kind(table, kind.kinds, kind.__name__.lower(), where=where)
    return from_plain(kind, table, where, lenient=lenient)


def _alternatives(hint: Any) -> tuple[Any, ...]:
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def _fits(hint: Any, value: Any) -> bool:
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return any(_fits(part, value) for part in parts)
    if origin is Literal:
        return value in parts
    if origin is tuple:
        if not isinstance(value, tuple):
            return False
        each = parts[:1] * len(value) if Ellipsis in parts else parts
        return len(value) == len(each) and all(map(_fits, each, value))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return isinstance(value, Mapping) and all(_fits(parts[1], one) for one in value.values())
    if isinstance(origin, type) and issubclass(origin, Sequence):
        return isinstance(value, tuple) and all(_fits(parts[0], one) for one in value)
    if hint is Any:
        return True
    if hint is float:
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return isinstance(hint, type) and isinstance(value, hint)


def _words(hint: Any) -> str:
    """Return a type in the words of a TOML file."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(_words(part) for part in parts if part is not NoneType)
    if origin is Literal:
        return " or ".join(map(repr, parts))
    if origin is tuple:
        size = f" of {len(parts)}" if Ellipsis not in parts else " of"
        return f"a list{size} numbers" if parts[0] in (float, int) else "a list"
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return "a table of numbers" if parts[1] is float else "a table"
    if isinstance(origin, type) and issubclass(origin, Sequence):
        return "a list of names"
    if is_dataclass(hint):
        return "a table"
    words = {float: "a number", int: "an integer", bool: "true or false", str: "text"}
    return words.get(hint, str(hint))
