"""Settings: value objects that are checked, and written as JSON, TOML or NAME=VALUE and read back.

A value object is an ordinary frozen dataclass; its fields may say their units and limits:

    >>> from dataclasses import dataclass
    >>> from helisim.base.settings import check, from_plain, parse_notation, setting, to_plain
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Bump:
    ...     axis: str = setting(choices=("lat", "lon"))
    ...     band: tuple[float, float] | None = None
    ...     height: float = setting(0.1, unit="m", above=0.0)
    ...
    ...     def __post_init__(self) -> None:
    ...         check(self)
    >>> bump = from_plain(Bump, {"axis": "lat", "height": 2}, "plan.bump")
    >>> to_plain(bump)
    {'axis': 'lat', 'band': None, 'height': 2}
    >>> parse_notation("bump,axis=lon,band=3:42", {"Bump": Bump})
    Bump(axis='lon', band=(3.0, 42.0), height=0.1)
    >>> from_plain(Bump, {"axis": "lat", "height": -1}, "plan.parts[0]")
    Traceback (most recent call last):
        ...
    helisim.base.errors.InputError: plan.parts[0].height must be a number above 0 m, got -1

A field that may hold one of several classes is a union of them, or their base with `kinds`, a
mapping of names to classes: a table of it has the key "kind".
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import lru_cache
from os import PathLike
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import toml_key, toml_value
from helisim.base.text import shown

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


T = TypeVar("T")

OFF = "off"
"""In TOML and text, which know no null: a setting that is None though its default is not."""
INFINITE = "inf"
"""In JSON, which knows no infinity; "-inf" for the other one."""
_WHOLE = 2**53
"""Integers up to it are floats without loss; a larger one in place of a float becomes one."""
_LARGEST = 2**63 - 1
"""Of integers, as NumPy and Parquet hold them."""
_TRUTH = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}


@dataclass(frozen=True)
class Limits:
    """What a setting says of its values: of a list or table, of each number or text in it."""

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
        """The choices, computed now where they are a function; empty if there are none."""
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
    """Return a field of a dataclass that says what its values may be.

    Args:
        default: of the field; it must be given where neither this nor `factory` is.
        factory: makes the default, such as a class.
        unit: SI.
        low: the least value.
        above: every value is above it.
        high: the greatest value.
        below: every value is below it.
        choices: all values that there are, or a function that returns them.
        finite: False lets a number be infinite, never NaN.
        unsaid: plain data leave the setting out where it has its default, as did data that were
            written before there was such a setting.
        more: for `dataclasses.field`, such as `compare=False`.
    """
    limits = Limits(unit, low, above, high, below, choices, finite, unsaid)
    made = {"default": default} if factory is MISSING else {"default_factory": factory}
    return field(**made, metadata={"limits": limits}, **more)


def limits_of(one: Field[Any]) -> Limits:
    """Return what a field of a dataclass says of its values."""
    return one.metadata.get("limits", FREE)


def default_of(one: Field[Any]) -> Any:
    """Return a field's default, MISSING if it has none."""
    return one.default if one.default_factory is MISSING else one.default_factory()


@lru_cache(maxsize=1024)
def _settings(kind: Any) -> dict[str, tuple[Field[Any], Any]]:
    """Return each field that a class is made with, and its type."""
    try:
        hints = get_type_hints(kind)
    except NameError:  # a type that only a type checker imports
        hints = {}
    return {one.name: (one, hints.get(one.name, Any)) for one in fields(kind) if one.init}


def setting_names(value: Any) -> tuple[str, ...]:
    """Return the names of a dataclass's settings, in their order."""
    return tuple(_settings(value if isinstance(value, type) else type(value)))


def is_number(value: Any) -> bool:
    """Return whether a value is a real number, of Python or NumPy; True and False are none."""
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def kinds_of(hint: Any) -> Mapping[str, Any]:
    """Return the dataclasses that a field may hold by the name of their kind; {} if but one."""
    parts = [one for one in _alternatives(hint) if is_dataclass(one)]
    if len(parts) == 1:
        return vars(parts[0]).get("kinds", {})
    return {name: one for part in parts for name, one in (kinds_of(part) or _own(part)).items()}


def _own(kind: Any) -> dict[str, Any]:
    return {kind.__name__: kind}


def value_object(hint: Any) -> Any:
    """Return the dataclass of a field that may hold one, None if it can't."""
    return next((one for one in _alternatives(hint) if is_dataclass(one)), None)


def check(value: Any, place: str = "") -> None:
    """Check a frozen dataclass's fields in its `__post_init__`, and make them plain.

    Numbers and arrays of NumPy become Python's where the field isn't an array, lists become
    tuples, and mappings `FrozenMap`.

    Raises:
        InputError: a field is of another type or out of its limits.
    """
    where = place or type(value).__name__
    for name, (one, hint) in _settings(type(value)).items():
        old = getattr(value, name)
        new = convert(hint, old, f"{where}.{name}", limits_of(one))
        if new is not old:
            object.__setattr__(value, name, new)


def convert(
    hint: Any, value: Any, place: str, limits: Limits = FREE, *, lenient: bool = False
) -> Any:
    """Return a value as a type hint has it, made of Python's own or of plain data.

    Args:
        hint: such as `float | None`, `tuple[str, ...]`, a dataclass, or a union of them.
        value: what is given, in Python or read from JSON or TOML.
        place: where it stands, for messages, such as "plan.weather.wind".
        limits: of its numbers or texts.
        lenient: True passes over names that a dataclass doesn't have, as another version may
            have written them, and takes infinite numbers.

    Raises:
        InputError: it is of another type, not finite, or out of its limits.
    """
    if hint is Any or hint is object:
        return value
    if isinstance(value, np.generic):
        value = value.item()
    options = _alternatives(hint)
    if value is None and NoneType in options:
        return None
    if isinstance(value, np.ndarray) and not any(get_origin(o) is np.ndarray for o in options):
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
    raise InputError(f"{place} must be {_words(hint, limits)}, got {shown(value_words(value))}")


def value_words(value: Any) -> str:
    """Return a value as a message quotes it; text in quotes."""
    return f"an array of shape {value.shape}" if isinstance(value, np.ndarray) else repr(value)


class _NoneSuch(Exception):
    """A value is of another kind than a type."""


def _converted(hint: Any, value: Any, place: str, limits: Limits, lenient: bool) -> Any:
    """Return a value as one alternative of a hint has it. Raises _NoneSuch, InputError."""
    origin, parts = get_origin(hint), get_args(hint)
    if hint is float:
        return _number(value, place, limits, lenient)
    if hint is int:
        if isinstance(value, bool) or not isinstance(value, int) or abs(value) > _LARGEST:
            raise _NoneSuch
        return _within(value, place, "an integer", limits)
    if hint is str or hint is bool:
        if not isinstance(value, hint):
            raise _NoneSuch
        return _chosen(value, place, limits.known)
    if origin is Literal:
        if not isinstance(value, tuple(type(one) for one in parts)):
            raise _NoneSuch
        return _chosen(value, place, parts)
    if origin is np.ndarray or hint is np.ndarray:
        return _array(parts, value, place, limits)
    if origin is tuple or _is(origin, Sequence):
        return _sequence(origin, parts, value, place, limits, lenient)
    if _is(origin, Mapping) or _is(hint, Mapping):
        if not isinstance(value, Mapping):
            raise _NoneSuch
        inner = parts[1] if len(parts) == 2 else Any
        return FrozenMap(
            {
                key: convert(inner, one, f"{place}.{shown(str(key), 40)}", limits, lenient=lenient)
                for key, one in value.items()
            }
        )
    if hint is Path and isinstance(value, str | PathLike):
        return Path(value)
    if origin is Callable or hint is Callable:
        if not callable(value):
            raise _NoneSuch
        return value
    kind = origin or hint
    if isinstance(kind, type) and not isinstance(value, kind):
        raise _NoneSuch
    return value


def _number(value: Any, place: str, limits: Limits, lenient: bool) -> float:
    if isinstance(value, str) and (lenient or not limits.finite):
        value = {INFINITE: math.inf, f"-{INFINITE}": -math.inf}.get(value, value)
    if not is_number(value):
        raise _NoneSuch
    if isinstance(value, int) and abs(value) > _WHOLE:
        value = float(value) if abs(value) < 1e300 else math.inf
    number: Any = value
    return number if lenient and value == value else _within(number, place, "a number", limits)


def _within(value: Any, place: str, noun: str, limits: Limits) -> Any:
    if value != value or not limits.holds(value):
        finite = "a finite number" if not math.isfinite(value) and noun == "a number" else noun
        raise InputError(f"{place} must be {limits.words(finite)}, got {shown(repr(value))}")
    known = [one for one in limits.known if is_number(one)]
    if known and value not in known:
        listed = ", ".join(map(str, known))
        raise InputError(f"{place} must be one of {listed}, got {shown(repr(value))}")
    return value


def _chosen(value: Any, place: str, known: Iterable[Any]) -> Any:
    known = [one for one in known if isinstance(one, type(value))]
    if known and value not in known:
        raise UnknownNameError(place, value, map(str, known))
    return value


def _array(parts: tuple[Any, ...], value: Any, place: str, limits: Limits) -> Any:
    """Return numbers as a read-only array of the hint's type, of any shape."""
    dtype = np.dtype((get_args(parts[1]) or (np.float64,))[0]) if len(parts) == 2 else None
    if isinstance(value, Mapping) and set(value) == {"real", "imag"}:
        real, imag = (_array((), value[part], place, limits) for part in ("real", "imag"))
        value = real + 1j * imag if real.shape == imag.shape else None
    try:
        array = np.array(value)
        if _truths(value) or array.dtype.kind not in ("b" if dtype == np.bool_ else "fiuc"):
            raise TypeError
        array = array.astype(dtype or array.dtype, casting="same_kind")
    except (TypeError, ValueError, OverflowError):
        said = shown(value_words(value))
        raise InputError(f"{place} must be an array of numbers, got {said}") from None
    if np.isnan(array).any() or not limits.holds(array):
        raise InputError(f"{place} must hold {limits.words('numbers')}, each finite")
    array.setflags(write=False)
    return array


def _truths(value: Any) -> bool:
    """Return whether a list has True or False in it, which NumPy takes for 1 and 0."""
    if isinstance(value, list | tuple):
        return any(map(_truths, value))
    return isinstance(value, bool)


def _sequence(
    origin: Any, parts: tuple[Any, ...], value: Any, place: str, limits: Limits, lenient: bool
) -> Any:
    if not isinstance(value, list | tuple):
        raise _NoneSuch
    many = origin is not tuple or Ellipsis in parts
    each = parts[:1] * len(value) if many else parts
    if len(each) != len(value):
        raise _NoneSuch
    made = tuple(
        convert(part, one, f"{place}[{k}]", limits, lenient=lenient)
        for k, (part, one) in enumerate(zip(each, value))
    )
    same = isinstance(value, tuple) and all(a is b for a, b in zip(made, value))
    return value if same else made


def _is(kind: Any, base: type) -> bool:
    return isinstance(kind, type) and issubclass(kind, base) and kind is not str


def _alternatives(hint: Any) -> tuple[Any, ...]:
    if get_origin(hint) not in (Union, UnionType):
        return (hint,)
    return tuple(one for part in get_args(hint) for one in _alternatives(part))


def _words(hint: Any, limits: Limits = FREE) -> str:
    """Return a type in the words of someone who writes a file."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        kinds = kinds_of(hint)
        plain = [one for one in _alternatives(hint) if one is not NoneType]
        if kinds:
            plain = [one for one in plain if not is_dataclass(one)]
        said = [_words(one, limits) for one in plain]
        return " or ".join(dict.fromkeys(said + [_kinds_in_words(kinds)] * bool(kinds)))
    if origin is Literal or (hint in (str, bool) and limits.known):
        return f"one of {', '.join(map(repr, parts or limits.known))}"
    if origin is tuple or _is(origin, Sequence):
        count = "" if origin is not tuple or Ellipsis in parts else f"{len(parts)} "
        nouns = {float: limits.words("numbers"), int: limits.words("integers"), str: "names"}
        return f"a list of {count}{nouns.get(parts[0], 'tables')}"
    if _is(origin, Mapping) or _is(hint, Mapping):
        return f"a table of {limits.words('numbers')}" if parts[1:] == (float,) else "a table"
    if is_dataclass(hint):
        return _kinds_in_words(kinds_of(hint)) or f"a table ({getattr(hint, '__name__', '')})"
    words = {bool: "true or false", str: "text", Path: "a path"}
    words |= {float: limits.words("a number"), int: limits.words("an integer")}
    if origin is np.ndarray or hint is np.ndarray:
        return "an array of numbers"
    return words.get(hint) or f"a {getattr(origin or hint, '__name__', hint)}"


def _kinds_in_words(kinds: Mapping[str, Any]) -> str:
    return f"a table with a kind, one of {', '.join(kinds)}" if kinds else ""


def from_plain(
    kind: type[T] | Any,
    table: Any,
    place: str,
    *,
    lenient: bool = False,
) -> T:
    """Return the value object whose fields a table holds; what it doesn't say is the default.

    Args:
        kind: a dataclass, a union of them, or their base with `kinds`, of which the table's key
            "kind" (or the class's `kind_key`) says one.
        table: fields by name, as `to_plain` or a TOML file gives them.
        place: where the table stands, for messages.
        lenient: as for `convert`.

    Raises:
        InputError: no such kind or setting, the message lists those that exist; or a setting is
            missing, of the wrong type, or refused by the object.
    """
    if not isinstance(table, Mapping):
        raise InputError(f"{place} must be {_words(kind)}, got {shown(value_words(table))}")
    made, given = _kind_of(kind, table, place)
    known = _settings(made)
    if not lenient:
        for name in given:
            if name not in known:
                raise UnknownNameError(f"setting of {place}", name, known)
    missing = [
        name
        for name, (one, _) in known.items()
        if one.default is one.default_factory is MISSING and name not in given
    ]
    if missing:
        raise InputError(f"{place} needs {' and '.join(missing)}")
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
    """Return the class that a table is of, and its settings without the kind."""
    kinds, given = kinds_of(kind), dict(table)
    only = value_object(kind)
    key = getattr(only, "kind_key", "kind")
    if not kinds:
        if given.get(key) == only.__name__ and key not in _settings(only):
            del given[key]
        return only, given
    if key not in given:
        said = shown(value_words(table))
        raise InputError(f"{place} must be {_kinds_in_words(kinds)}; got {said}")
    name = given.pop(key)
    if not isinstance(name, str) or name not in kinds:
        own = "one of your own has to be imported first" if "kinds" in vars(only) else ""
        raise UnknownNameError(f"{key} of {place}", name, kinds, advice=own)
    return kinds[name], given


def to_plain(value: Any, *, kind: bool = False, toml: bool = False) -> Any:
    """Return a value object's settings as JSON or TOML would give them back.

    Tuples and arrays become lists, complex arrays {"real", "imag"}, infinities "inf", and an
    object inside has its kind where its field may hold several.

    Args:
        value: a dataclass, or plain data with such in them.
        kind: whether the outermost has its kind too.
        toml: True leaves out what is None, or writes it `OFF` where its default isn't None.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {
            **({getattr(value, "kind_key", "kind"): kind_name(value)} if kind else {}),
            **dict(_said(value, toml)),
        }
    if isinstance(value, Mapping):
        return {str(key): _inside(one, Any, toml) for key, one in value.items()}
    if isinstance(value, tuple | list):
        return [_inside(one, Any, toml) for one in value]
    return _plain_leaf(value, toml)


def kind_name(value: Any) -> str:
    """Return the name by which a value object's class is known among its kinds."""
    kinds = getattr(type(value), "kinds", {})
    return next((n for n, one in kinds.items() if one is type(value)), type(value).__name__)


def _plain_leaf(value: Any, toml: bool) -> Any:
    if isinstance(value, np.ndarray):
        if np.iscomplexobj(value):
            return {"real": value.real.tolist(), "imag": value.imag.tolist()}
        return value.tolist()
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and math.isinf(value) and not toml:
        return INFINITE if value > 0.0 else f"-{INFINITE}"
    return str(value) if isinstance(value, PathLike) else value


def _said(value: Any, toml: bool) -> Iterator[tuple[str, Any]]:
    for name, (one, hint) in _settings(type(value)).items():
        item, default = getattr(value, name), default_of(one)
        unsaid = limits_of(one).unsaid or one.metadata.get("unsaid")
        if unsaid and default is not MISSING and same(item, default):
            continue
        if item is not None or not toml:
            yield name, _inside(item, hint, toml)
        elif default is not None:
            yield name, OFF


def _inside(value: Any, hint: Any, toml: bool) -> Any:
    """Return a part of something as plain data, with its kind where there may be several."""
    parts = get_args(hint) if hint is not Any else ()
    if isinstance(value, tuple | list):
        inner = parts[0] if parts and get_origin(hint) is tuple else Any
        return [_inside(one, inner, toml) for one in value]
    several = hasattr(type(value), "kinds") or bool(kinds_of(hint))
    return to_plain(value, kind=several, toml=toml)


def in_brief(value: Any) -> str:
    """Return a value object as one would write it: only the settings that aren't its defaults."""
    changes = (
        f"{one.name}={_item_in_brief(getattr(value, one.name))}"
        for one in fields(value)
        if one.repr and getattr(value, one.name) != default_of(one)
    )
    return f"{type(value).__name__}({', '.join(changes)})"


def _item_in_brief(item: Any) -> str:
    if is_dataclass(item) and not isinstance(item, type):
        return in_brief(item)
    if isinstance(item, tuple):
        inner = ", ".join(map(_item_in_brief, item))
        return f"({inner},)" if len(item) == 1 else f"({inner})"
    if callable(item):
        return str(getattr(item, "__name__", None) or type(item).__name__)  # without its address
    return repr(item)


class Inline(dict[str, Any]):
    """A table that TOML writes within its line, `{ a = 1 }`; a list of such one a line."""


def toml_text(tables: Mapping[str, Any], *, _path: tuple[str, ...] = ()) -> str:
    """Return plain data as TOML: plain values first, then a section for each table in them.

    Args:
        tables: as `to_plain(value, toml=True)` gives them; what is None is left out.
    """
    lines, sections = [], []
    for key, item in tables.items():
        path = (*_path, toml_key(key))
        if isinstance(item, Mapping) and not isinstance(item, Inline):
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

    Args:
        text: the kind in upper or lower case; numbers of a list are joined by a colon, "3:42",
            names by "+"; "off" is None.
        kinds: classes by name.
        what: the kind is of, for messages.
        given: settings, plain data, that the text doesn't have to say.

    Raises:
        InputError: no such kind or setting, or its value can't be.
    """
    word, *items = (one.strip() for one in text.split(","))
    found = {name.casefold(): kind for name, kind in kinds.items()}.get(word.casefold())
    if found is None:
        raise UnknownNameError(what, word, [name.lower() for name in kinds])
    settings = read_settings(found, items, f"{what} {word}")
    taken = {name: item for name, item in given.items() if name not in settings}
    return from_plain(found, {**taken, **settings}, f"{what} {shown(word)}")


def read_settings(kind: Any, items: Iterable[str], place: str) -> dict[str, Any]:
    """Return NAME=VALUE items as plain data for a dataclass's `from_plain`; dotted names nest.

    Raises:
        InputError: an item isn't NAME=VALUE, or a name is given twice or unknown.
    """
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
    """Return the type of a part of something, by the part's name."""
    kind = value_object(hint)
    if kind is None:
        mapping = next((o for o in _alternatives(hint) if _is(get_origin(o), Mapping)), None)
        if mapping is None:
            raise InputError(f"{shown(place)} has no {shown(name)}: it has no parts")
        return get_args(mapping)[1]
    if part not in _settings(kind):
        raise UnknownNameError(f"setting of {shown(place)}", part, _settings(kind))
    return _settings(kind)[part][1]


def from_text(hint: Any, text: str) -> Any:
    """Return the plain value that a text is for a type; the text itself where it is none."""
    options = _alternatives(hint)
    lists = [o for o in options if get_origin(o) is tuple or _is(get_origin(o), Sequence)]
    single = {str, int, float}.intersection(options)
    if text.casefold() in (OFF, "none") and NoneType in options and str not in options:
        return None
    if bool in options and text.casefold() in _TRUTH:
        return _TRUTH[text.casefold()]
    for kind in (int, float):
        if kind in options:
            try:
                return kind(text)
            except ValueError:
                continue
    for one in lists:
        inner = get_args(one)[0]
        mark = "+" if inner is str else ":"
        if mark in text or not single:
            return [from_text(inner, part.strip()) for part in text.split(mark)]
    return text
