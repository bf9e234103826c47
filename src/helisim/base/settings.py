"""Settings: checked value objects that JSON, TOML and NAME=VALUE text hold.

A value object is a frozen dataclass; its fields may say units and limits:

    >>> from dataclasses import dataclass
    >>> from helisim.base.settings import Checked, from_plain, parse_notation, setting, to_plain
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Bump(Checked):
    ...     axis: str = setting(choices=("lat", "lon"))
    ...     band: tuple[float, float] | None = None
    ...     height: float = setting(0.1, unit="m", above=0.0)
    >>> to_plain(from_plain(Bump, {"axis": "lat", "height": 2}, "plan.bump"))
    {'axis': 'lat', 'band': None, 'height': 2}
    >>> parse_notation("bump,axis=lon,band=3:42", {"Bump": Bump})
    Bump(axis='lon', band=(3.0, 42.0), height=0.1)

A field of several classes is a union of them, or their base with `kinds`, a mapping of names to
classes; its table has the key "kind".
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import lru_cache, partial
from os import PathLike
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from helisim.base.errors import InputError, UnknownNameError, check_known, shown
from helisim.base.files import toml_key, toml_value

Key = TypeVar("Key")
Item = TypeVar("Item")


def grouped(items: Iterable[Item], by: Callable[[Item], Key]) -> dict[Key, list[Item]]:
    """Return items by what `by` returns of them, in their order."""
    found: dict[Key, list[Item]] = {}
    for one in items:
        found.setdefault(by(one), []).append(one)
    return found


class FrozenMap(Mapping[Key, Item]):
    """An immutable, hashable mapping."""

    __slots__ = ("_items",)

    def __init__(self, items: Mapping[Key, Item]) -> None:
        self._items = dict(items)

    def __getitem__(self, key: Key) -> Item:
        return self._items[key]

    def __iter__(self) -> Iterator[Key]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __repr__(self) -> str:
        return repr(self._items)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Mapping) and same(self, other)

    def __hash__(self) -> int:
        return hash(_hashable(self._items))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._items,)


class Value:
    """Base of dataclasses with arrays: compared, hashed, copied, pickled by fields of `compare`."""

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other) or not isinstance(other, Value):
            return NotImplemented
        return same(self._compared(), other._compared())

    def __hash__(self) -> int:
        return hash((type(self).__qualname__, _hashable(self._compared())))

    def __reduce__(self) -> tuple[Any, ...]:
        given = {one.name: getattr(self, one.name) for one in _fields(self) if one.init}
        return partial(type(self), **given), ()

    def __repr__(self) -> str:
        parts = ((one.name, getattr(self, one.name)) for one in _fields(self) if one.repr)
        said = (
            f"{name}=<array {item.shape}>" if isinstance(item, np.ndarray) else f"{name}={item!r}"
            for name, item in parts
        )
        return f"{type(self).__name__}({', '.join(said)})"

    def _compared(self) -> tuple[Any, ...]:
        return tuple(getattr(self, one.name) for one in _fields(self) if one.compare)


def same(one: Any, other: Any) -> bool:
    """Return whether two values are equal, arrays of any shape by element; nan equals nan."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        if not (isinstance(one, np.ndarray) and isinstance(other, np.ndarray)):
            return False
        number = one.dtype.kind in "fc" and other.dtype.kind in "fc"
        return one is other or np.array_equal(one, other, equal_nan=number)
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, tuple | list) and isinstance(other, tuple | list):
        alike = isinstance(one, tuple) == isinstance(other, tuple)
        return alike and len(one) == len(other) and all(map(same, one, other))
    return one is other or bool(one == other) or (is_number(one) and one != one and other != other)


def _hashable(item: Any) -> Any:
    if isinstance(item, np.ndarray):
        return item.shape
    if isinstance(item, Mapping):
        return frozenset((key, _hashable(one)) for key, one in item.items())
    if isinstance(item, tuple | list):
        return tuple(map(_hashable, item))
    return None if item != item else item  # a NaN hashes by its place in memory


def _fields(value: Any) -> tuple[Field[Any], ...]:
    return fields(value)


T = TypeVar("T")

OFF = "off"  # None in TOML and text, where the default isn't None
INFINITE = "inf"  # infinity in JSON; "-inf" for the other one
# _WHOLE: integers up to it are floats without loss
# _LARGEST: integers as NumPy and Parquet hold them
_WHOLE, _LARGEST = 2**53, 2**63 - 1
_TRUTH = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}


@dataclass(frozen=True)
class Limits:
    """Limits of a setting's values: of each number or text in a list or table."""

    unit: str = ""
    low: float | None = None
    above: float | None = None
    high: float | None = None
    below: float | None = None
    choices: Iterable[Any] | Callable[[], Iterable[Any]] | None = None
    finite: bool = True
    unsaid: bool = False

    @property
    def known(self) -> tuple[Any, ...]:
        """Choices, computed where they are a function; empty if there are none."""
        found = self.choices() if callable(self.choices) else self.choices
        return () if found is None else tuple(found)

    def holds(self, number: Any) -> bool:
        """Return whether a number, or each of an array, is finite and within the limits."""
        return bool(
            (not self.finite or np.all(np.isfinite(number)))
            and (self.low is None or np.all(number >= self.low))
            and (self.above is None or np.all(number > self.above))
            and (self.high is None or np.all(number <= self.high))
            and (self.below is None or np.all(number < self.below))
        )

    def words(self, noun: str) -> str:
        """Return the limits behind a noun such as "a number"."""
        edges = ((self.above, "above {:g}"), (self.low, "{:g} or more"))
        edges += ((self.high, "at most {:g}"), (self.below, "below {:g}"))
        said = " and ".join(text.format(edge) for edge, text in edges if edge is not None)
        unit = "" if self.unit in ("", "1") else f" {self.unit}" if said else f" in {self.unit}"
        return f"{noun}{' ' if said else ''}{said}{unit}"


FREE = Limits()


def setting(
    default: Any = MISSING,
    *,
    factory: Any = MISSING,
    unit: str = "",
    low: float | None = None,
    above: float | None = None,
    high: float | None = None,
    below: float | None = None,
    choices: Iterable[Any] | Callable[[], Iterable[Any]] | None = None,
    finite: bool = True,
    unsaid: bool = False,
    **more: Any,
) -> Any:
    """Return a field of a dataclass with limits of its values; `unit` is SI.

    `choices` are all values, or a function of them; `finite=False` permits infinity; `unsaid` omits
    the default from plain data; `more` is for `dataclasses.field`.
    """
    limits = Limits(unit, low, above, high, below, choices, finite, unsaid)
    made = {"default": default} if factory is MISSING else {"default_factory": factory}
    return field(**made, metadata={"limits": limits}, **more)


def limits_of(one: Field[Any]) -> Limits:
    """Return the limits of a dataclass's field."""
    return one.metadata.get("limits", FREE)


def default_of(one: Field[Any]) -> Any:
    """Return a field's default, MISSING if it has none."""
    return one.default if one.default_factory is MISSING else one.default_factory()


@lru_cache(maxsize=1024)
def _settings(kind: Any) -> dict[str, tuple[Field[Any], Any]]:
    try:
        hints = get_type_hints(kind)
    except NameError:  # a type that only a type checker imports
        hints = {}
    return {one.name: (one, hints.get(one.name, Any)) for one in fields(kind) if one.init}


def setting_names(value: Any) -> tuple[str, ...]:
    """Return the names of a dataclass's settings, in order."""
    return tuple(_settings(value if isinstance(value, type) else type(value)))


def is_number(value: Any) -> bool:
    """Return whether a value is a real number, of Python or NumPy; True and False are none."""
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def kinds_of(hint: Any) -> Mapping[str, Any]:
    """Return the dataclasses that a field may hold by the name of their kind; {} if but one."""
    parts: list[Any] = [one for one in _alternatives(hint) if is_dataclass(one)]
    if len(parts) == 1:
        return vars(parts[0]).get("kinds", {})
    return {
        name: one
        for part in parts
        for name, one in (kinds_of(part) or {part.__name__: part}).items()
    }


def value_object(hint: Any) -> Any:
    """Return the dataclass of a field that may hold one, else None."""
    return next((one for one in _alternatives(hint) if is_dataclass(one)), None)


def check(value: Any, place: str = "") -> None:
    """Check a frozen dataclass's fields in its `__post_init__`. Raises InputError.

    NumPy's numbers, and arrays in other fields, become Python's, lists tuples, mappings
    `FrozenMap`.
    """
    where = place or type(value).__name__
    for name, (one, hint) in _settings(type(value)).items():
        old = getattr(value, name)
        new = convert(hint, old, f"{where}.{name}", limits_of(one))
        if new is not old:
            object.__setattr__(value, name, new)


class Checked:
    """Base of frozen dataclasses that are checked as they are made; see `check`."""

    def __post_init__(self) -> None:
        check(self)


def convert(
    hint: Any, value: Any, place: str, limits: Limits = FREE, *, lenient: bool = False
) -> Any:
    """Return a value, of Python or plain data, as a type hint's. Raises InputError.

    `place` begins messages; `lenient` ignores unknown names of a dataclass.
    """
    if hint is Any or hint is object:
        return value
    options = _alternatives(hint)
    if value is None and NoneType in options:
        return None
    arrays = any(get_origin(o) is np.ndarray for o in options)
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and not arrays):
        value = value.tolist()
    if isinstance(value, Mapping) and any(map(is_dataclass, options)):
        return from_plain(hint, value, place, lenient=lenient)
    faults = []
    for option in options:
        try:
            return _converted(option, value, place, limits, lenient)
        except _NoneSuch:
            continue
        except InputError as error:  # right in kind, at fault inside
            faults.append(error)
    if isinstance(value, str) and value == OFF and NoneType in options:
        return None
    if faults:
        raise faults[0]
    raise InputError(f"{place} must be {_words(hint, limits)}, got {value_words(value)}")


def value_words(value: Any) -> str:
    """Return a value as a message quotes it; of an array its shape."""
    array = isinstance(value, np.ndarray)
    return shown(f"an array of shape {value.shape}" if array else repr(value))


class _NoneSuch(Exception):
    """A value is of another kind than a type."""


def _converted(hint: Any, value: Any, place: str, limits: Limits, lenient: bool) -> Any:
    origin, parts = get_origin(hint), get_args(hint)
    if hint is float:
        return _number(value, place, limits)
    if origin is np.ndarray or hint is np.ndarray:
        return _array(parts, value, place, limits)
    if hint is Path and isinstance(value, str | PathLike):
        return Path(value)
    kind = list | tuple if _is_list(origin) else origin or hint
    if origin is Literal:
        kind = tuple(map(type, parts))
    truth = isinstance(value, bool) and hint is int
    if truth or (isinstance(kind, type | tuple | UnionType) and not isinstance(value, kind)):
        raise _NoneSuch
    if hint is int:
        if abs(value) > _LARGEST:
            raise _NoneSuch
        return _within(value, place, "an integer", limits)
    if hint is str or hint is bool or origin is Literal:
        choices = [one for one in parts or limits.known if isinstance(one, type(value))]
        if choices and value not in choices:
            raise UnknownNameError(place, value, map(str, choices))
    if _is_list(origin):
        return _sequence(origin, parts, value, place, limits, lenient)
    if isinstance(value, Mapping) and isinstance(kind, type) and issubclass(kind, Mapping):
        inner = parts[1] if len(parts) == 2 else Any
        return FrozenMap(
            {
                key: convert(inner, one, f"{place}.{shown(str(key), 40)}", limits, lenient=lenient)
                for key, one in value.items()
            }
        )
    return value


def _number(value: Any, place: str, limits: Limits) -> Any:
    if isinstance(value, str) and not limits.finite:
        value = {INFINITE: math.inf, f"-{INFINITE}": -math.inf}.get(value, value)
    if not is_number(value):
        raise _NoneSuch
    if isinstance(value, int) and abs(value) > _WHOLE:
        value = float(value) if abs(value) < 1e300 else math.inf
    return _within(value, place, "a number", limits)


def _within(value: Any, place: str, noun: str, limits: Limits) -> Any:
    if value != value or not limits.holds(value):
        finite = "a finite number" if not math.isfinite(value) and noun == "a number" else noun
        raise InputError(f"{place} must be {limits.words(finite)}, got {value_words(value)}")
    known = [one for one in limits.known if is_number(one)]
    if known and value not in known:
        raise InputError(
            f"{place} must be one of {', '.join(map(str, known))}, got {value_words(value)}"
        )
    return value


def _array(parts: tuple[Any, ...], value: Any, place: str, limits: Limits) -> Any:
    """Return numbers as a read-only array of the hint's type, of any shape."""
    dtype = np.dtype((get_args(parts[1]) or (np.float64,))[0]) if len(parts) == 2 else None
    try:
        if isinstance(value, Mapping) and set(value) == {"real", "imag"}:
            real, imag = (_array((), value[part], place, limits) for part in ("real", "imag"))
            value = np.stack([real, imag], -1).astype(np.float64).view(np.complex128)[..., 0]
        array = np.array(value)
        if _truths(value) or array.dtype.kind not in ("b" if dtype == np.bool_ else "fiuc"):
            raise TypeError
        array = array.astype(dtype or array.dtype, casting="same_kind")
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{place} must be an array of numbers, got {value_words(value)}") from None
    if np.isnan(array).any() or not limits.holds(array):
        raise InputError(f"{place} must hold {limits.words('numbers')}, each finite")
    array.setflags(write=False)
    return array


def _truths(value: Any) -> bool:
    return any(map(_truths, value)) if isinstance(value, list | tuple) else isinstance(value, bool)


def _sequence(
    origin: Any, parts: tuple[Any, ...], value: Any, place: str, limits: Limits, lenient: bool
) -> Any:
    many = origin is not tuple or Ellipsis in parts
    each = parts[:1] * len(value) if many else parts
    if len(each) != len(value):
        raise _NoneSuch
    made = tuple(
        convert(part, one, f"{place}[{k}]", limits, lenient=lenient)
        for k, (part, one) in enumerate(zip(each, value))
    )
    kept = isinstance(value, tuple) and all(a is b for a, b in zip(made, value))
    return value if kept else made


def _is_list(origin: Any) -> bool:
    return isinstance(origin, type) and issubclass(origin, Sequence)


def _alternatives(hint: Any) -> tuple[Any, ...]:
    parts = get_args(hint) if get_origin(hint) in (Union, UnionType) else ()
    return tuple(one for part in parts for one in _alternatives(part)) or (_unaliased(hint),)


def _unaliased(hint: Any) -> Any:
    """Return what an alias of a type stands for: `NDArray` is one from NumPy 2.5 on."""
    meant, parts = getattr(get_origin(hint) or hint, "__value__", hint), get_args(hint)
    return meant if meant is hint else _unaliased(meant[parts] if parts else meant)


def _words(hint: Any, limits: Limits = FREE) -> str:
    origin, parts = get_origin(hint := _unaliased(hint)), get_args(hint)
    if origin in (Union, UnionType):
        kinds = _kinds_in_words(kinds_of(hint))
        plain = [one for one in _alternatives(hint) if one is not NoneType]
        said = [_words(one, limits) for one in plain if not (kinds and is_dataclass(one))]
        return " or ".join(dict.fromkeys([*said, *filter(None, [kinds])]))
    if origin is Literal or (hint in (str, bool) and limits.known):
        return f"one of {', '.join(map(repr, parts or limits.known))}"
    if _is_list(origin):
        count = "" if origin is not tuple or Ellipsis in parts else f"{len(parts)} "
        nouns = {float: limits.words("numbers"), int: limits.words("integers"), str: "names"}
        return f"a list of {count}" + nouns.get(
            parts[0], "lists" if _is_list(get_origin(parts[0])) else "tables"
        )
    kind = origin or hint
    if isinstance(kind, type) and issubclass(kind, Mapping):
        return f"a table of {limits.words('numbers')}" if parts[1:] == (float,) else "a table"
    name = getattr(kind, "__name__", kind)
    if is_dataclass(hint):
        return _kinds_in_words(kinds_of(hint)) or f"a table ({name})"
    words = {bool: "true or false", str: "text", Path: "a path", np.ndarray: "an array of numbers"}
    words |= {float: limits.words("a number"), int: limits.words("an integer")}
    return words.get(kind) or f"a {name}"


def _kinds_in_words(kinds: Mapping[str, Any]) -> str:
    return f"a table with a kind, one of {', '.join(kinds)}" if kinds else ""


def from_plain(
    kind: type[T] | Any,
    table: Any,
    place: str,
    *,
    lenient: bool = False,
) -> T:
    """Return the value object of a table's fields; missing ones have their default.

    `kind` is a dataclass, a union, or a base with `kinds`, chosen by the table's "kind" (or the
    class's `kind_key`); `place` and `lenient` as for `convert`. Raises InputError.
    """
    if not isinstance(table, Mapping):
        raise InputError(f"{place} must be {_words(kind)}, got {value_words(table)}")
    made, given = _kind_of(kind, table, place)
    known = _settings(made)
    check_known(f"setting of {place}", () if lenient else given, known)
    missing = [
        name
        for name, (one, _) in known.items()
        if one.default is one.default_factory is MISSING and name not in given
    ]
    if missing:
        others = ", ".join(name for name in known if name not in missing)
        beside = f"; it may have {others}" if others else ""
        raise InputError(f"{place} needs {' and '.join(missing)}{beside}")
    settings = {
        name: convert(
            known[name][1], value, f"{place}.{name}", limits_of(known[name][0]), lenient=lenient
        )
        for name, value in given.items()
        if name in known
    }
    with placed(place):
        return cast(T, made(**settings))


@contextmanager
def placed(place: object) -> Iterator[None]:
    """Put a place, such as a file's path, before the message of an InputError of the block."""
    try:
        yield
    except InputError as error:
        error.args = (f"{place}: {error}",)
        raise


def _kind_of(kind: Any, table: Mapping[str, Any], place: str) -> tuple[Any, dict[str, Any]]:
    kinds, given = kinds_of(kind), dict(table)
    only = value_object(kind)
    key = getattr(only, "kind_key", "kind")
    if not kinds:
        if given.get(key) == only.__name__ and key not in _settings(only):
            del given[key]
        return only, given
    if key not in given:
        raise InputError(f"{place} must be {_kinds_in_words(kinds)}; got {value_words(table)}")
    name = given.pop(key)
    if not isinstance(name, str) or name not in kinds:
        own = "one of your own has to be imported first" if "kinds" in vars(only) else ""
        raise UnknownNameError(f"{key} of {place}", name, kinds, advice=own)
    return kinds[name], given


def to_plain(value: Any, *, kind: bool = False, toml: bool = False) -> Any:
    """Return a value object, or data with such in it, as JSON or TOML data.

    Arrays become lists, complex ones {"real", "imag"}, infinities "inf". `kind` adds the
    outermost's kind; `toml` omits None, or writes `OFF` where the default isn't None.
    """
    if is_dataclass(value) and not isinstance(value, type):
        named = {getattr(value, "kind_key", "kind"): _kind_name(value)} if kind else {}
        return named | dict(_said(value, toml))
    if isinstance(value, Mapping):
        return {str(key): _inside(one, Any, toml) for key, one in value.items()}
    if isinstance(value, tuple | list):
        return [_inside(one, Any, toml) for one in value]
    if isinstance(value, np.ndarray) and np.iscomplexobj(value):
        return {"real": value.real.tolist(), "imag": value.imag.tolist()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, float) and math.isinf(value) and not toml:
        return INFINITE if value > 0.0 else f"-{INFINITE}"
    return str(value) if isinstance(value, PathLike) else value


def _kind_name(value: Any) -> str:
    kinds = getattr(type(value), "kinds", {})
    return next((n for n, one in kinds.items() if one is type(value)), type(value).__name__)


def _said(value: Any, toml: bool) -> Iterator[tuple[str, Any]]:
    for name, (one, hint) in _settings(type(value)).items():
        item, default = getattr(value, name), default_of(one)
        if limits_of(one).unsaid and same(item, default):
            continue
        if item is not None or not toml:
            yield name, _inside(item, hint, toml)
        elif default is not None:
            yield name, OFF


def _inside(value: Any, hint: Any, toml: bool) -> Any:
    if isinstance(value, tuple | list):
        inner = get_args(hint)[0] if get_origin(hint) is tuple else Any
        return [_inside(one, inner, toml) for one in value]
    return to_plain(value, kind=hasattr(type(value), "kinds") or bool(kinds_of(hint)), toml=toml)


def in_brief(value: Any) -> str:
    """Return a value object as text, with only the settings that aren't defaults."""
    changes = (
        f"{one.name}={_item_in_brief(getattr(value, one.name))}"
        for one in _fields(value)
        if one.repr and getattr(value, one.name) != default_of(one)
    )
    return f"{type(value).__name__}({', '.join(changes)})"


def _item_in_brief(item: Any) -> str:
    if is_dataclass(item) and not isinstance(item, type):
        return in_brief(item)
    if isinstance(item, tuple):
        return f"({', '.join(map(_item_in_brief, item))}{',' * (len(item) == 1)})"
    return getattr(item, "__name__", type(item).__name__) if callable(item) else repr(item)


class Brief:
    """Base of dataclasses, `repr=False`, that are shown with their changed settings alone."""

    def __repr__(self) -> str:
        return in_brief(self)


class Inline(dict[str, Any]):
    """A table that TOML writes within its line, `{ a = 1 }`; a list has one a line."""


def toml_text(tables: Mapping[str, Any], *, _path: tuple[str, ...] = ()) -> str:
    """Return plain data as TOML, without None; tables become sections."""
    lines, sections = [], []
    for key, item in tables.items():
        path = (*_path, toml_key(key))
        if _is_table(item):
            sections.append((f"[{'.'.join(path)}]", path, item))
        elif isinstance(item, list | tuple) and item and all(map(_is_table, item)):
            sections += [(f"[[{'.'.join(path)}]]", path, one) for one in item]
        elif item is not None:
            lines.append(f"{toml_key(key)} = {_toml_item(item)}")
    text = "".join(f"{line}\n" for line in lines)
    for heading, path, table in sections:
        inner = toml_text(table, _path=path)
        empty = inner.startswith("\n[") and not heading.startswith("[[")
        text += inner if empty else f"\n{heading}\n{inner}"
    return text if _path else text.removeprefix("\n")


def _is_table(item: Any) -> bool:
    return isinstance(item, Mapping) and not isinstance(item, Inline)


def _toml_item(item: Any) -> str:
    if isinstance(item, Mapping):
        return f"{{ {', '.join(f'{toml_key(k)} = {_toml_item(v)}' for k, v in item.items())} }}"
    if isinstance(item, list | tuple) and any(isinstance(o, Mapping | list | tuple) for o in item):
        return "[\n" + "".join(f"    {_toml_item(one)},\n" for one in item) + "]"
    return toml_value(item)


def parse_notation(
    text: str,
    kinds: Mapping[str, Any],
    *,
    what: str = "kind",
    given: Mapping[str, Any] = FrozenMap({}),
) -> Any:
    """Return the value object of a text "KIND,NAME=VALUE,...", such as "sweep,axis=lat".

    Numbers of a list are joined by ":", names by "+"; "off" is None. `what` is for messages,
    `given` are further settings as plain data. Raises InputError.
    """
    word, *items = (one.strip() for one in text.split(","))
    found = {name.casefold(): kind for name, kind in kinds.items()}.get(word.casefold())
    if found is None:
        raise UnknownNameError(what, word, [name.lower() for name in kinds])
    settings = read_settings(found, items, f"{what} {word}")
    taken = {name: item for name, item in given.items() if name not in settings}
    return from_plain(found, {**taken, **settings}, f"{what} {shown(word)}")


def read_settings(kind: Any, items: Iterable[str], place: str) -> dict[str, Any]:
    """Return NAME=VALUE items, dotted ones nested, as data for `from_plain`. Raises InputError."""
    data: dict[str, Any] = {}
    for item in items:
        name, equals, text = (one.strip() for one in item.partition("="))
        if not (name and equals and text):
            raise InputError(f"{shown(place)} takes NAME=VALUE, got {shown(repr(item))}")
        table, hint = data, kind
        *outer, last = name.split(".")
        for part in (*outer, last):
            hint = _hint_in(hint, part, name, place)
            if part is not last:
                table = table.setdefault(part, {})
        if last in table or not isinstance(table, dict):
            raise InputError(f"{shown(place)}: {shown(name)} is given twice")
        table[last] = from_text(hint, text)
    return data


def _hint_in(hint: Any, part: str, name: str, place: str) -> Any:
    kind = value_object(hint)
    if kind is None:
        mapping = next((o for o in _alternatives(hint) if get_origin(o) is Mapping), None)
        if mapping is None:
            raise InputError(f"{shown(place)} has no {shown(name)}: it has no parts")
        return get_args(mapping)[1]
    check_known(f"setting of {shown(place)}", [part], _settings(kind))
    return _settings(kind)[part][1]


def from_text(hint: Any, text: str) -> Any:
    """Return the plain value of a text for a type; the text itself if it is none."""
    options, word = _alternatives(hint), text.casefold()
    if word in (OFF, "none") and NoneType in options and str not in options:
        return None
    if bool in options and word in _TRUTH:
        return _TRUTH[word]
    for kind in (int, float):
        with suppress(ValueError):
            if kind in options:
                return kind(text)
    for inner in (get_args(one)[0] for one in options if _is_list(get_origin(one))):
        mark = "+" if inner is str else ":"
        if mark in text or not {str, int, float}.intersection(options):
            return [from_text(inner, part.strip()) for part in text.split(mark)]
    return text
