"""Specifications: criteria with what each is in a design, as a TOML file that people write.

    scale = 10.7

    [[spec]]
    criterion = "stability_margins"
    axis = "lat"
    kind = "hard"
    gain = [6.0, 3.0]
    phase_deg = [45.0, 22.5]

A limit is a pair, where Level 1 and where Level 2 ends. An angle in degrees ends in `_deg`;
without it, it is in radians. `scale`, at the top or in a specification, is N of `froude`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from os import PathLike
from typing import Any, get_args

from helisim.base.errors import HelisimError, InputError, UnknownNameError
from helisim.base.files import atomic_write, read_toml, toml_value
from helisim.base.units import RAD_PER_DEG
from helisim.handling.criteria import Border, Criterion, Limit

KINDS = ("hard", "soft", "objective", "check")
"""What a criterion is in a design: kept whatever it costs; brought to Level 1; made as good as
the others let it be; looked at only."""

_DEGREES = "_deg"
_BORDER = ("along", "level1", "level2")


@dataclass(frozen=True)
class Spec:
    """A criterion, and what it is in a design.

    Attributes:
        criterion: what is asked.
        kind: "hard", "soft", "objective" or "check".

    Raises:
        InputError: the criterion is none, or there is no such kind.
    """

    criterion: Criterion
    kind: str = "soft"

    def __post_init__(self) -> None:
        if not isinstance(self.criterion, Criterion):
            raise InputError(f"a specification is of a criterion, got {self.criterion!r:.60}")
        if self.kind not in KINDS:
            raise UnknownNameError("kind of specification", self.kind, KINDS)

    def scaled(self, scale: float) -> "Spec":
        """Return it for a vehicle that is smaller by a ratio of lengths; see `froude`."""
        return replace(self, criterion=replace(self.criterion, scale=scale))


def known_criteria() -> dict[str, type[Criterion]]:
    """Return criteria by the name that files call them: all that are defined, own ones too."""
    found: dict[str, type[Criterion]] = {}
    ahead: list[type[Criterion]] = [Criterion]
    while ahead:
        one = ahead.pop()
        ahead += one.__subclasses__()
        if "name" in vars(one):
            found[one.name] = one
    return dict(sorted(found.items()))


def read_specs(path: str | PathLike[str]) -> tuple[Spec, ...]:
    """Read specifications from a TOML file.

    Raises:
        StorageError: it can't be read, or isn't TOML.
        InputError: a specification is not as it must be: which, what was read, what is expected.
    """
    try:
        return specs_from(read_toml(path))
    except InputError as error:
        error.args = (f"{path}: {error}",)
        raise


def write_specs(specs: Iterable[Spec], path: str | PathLike[str]) -> None:
    """Write specifications as a TOML file that `read_specs` reads. Raises StorageError."""
    text = specs_to_toml(specs)
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def specs_from(data: Mapping[str, Any]) -> tuple[Spec, ...]:
    """Return specifications from the content of a file. Raises InputError."""
    known = ("scale", "spec")
    for name in data:
        if name not in known:
            raise UnknownNameError("entry", name, known)
    tables = data.get("spec")
    if not (isinstance(tables, list) and tables and all(isinstance(t, dict) for t in tables)):
        raise InputError("no specification: each is a table [[spec]] with a criterion and an axis")
    scale = _number(data.get("scale", 1.0), "scale")
    return tuple(_spec(k, dict(table), scale) for k, table in enumerate(tables, start=1))


def specs_to_toml(specs: Iterable[Spec]) -> str:
    """Return specifications as TOML, numbers that are as they would be anyway left out."""
    return "\n".join(_table(one) for one in specs)


def _spec(number: int, table: dict[str, Any], scale: float) -> Spec:
    """Return one specification, and say which it is if it can't be."""
    called = f"spec {number}"
    try:
        name = table.pop("criterion", None)
        known = known_criteria()
        if name is None:
            raise InputError(f"it says no criterion; there are {', '.join(known)}")
        if name not in known:
            raise UnknownNameError("criterion", name, known)
        called = f"spec {number}, {name}"
        kind = table.pop("kind", "soft")
        made = known[name](**_values(known[name], {"scale": scale, **table}))
        return Spec(made, kind)
    except HelisimError as error:
        error.args = (f"{called}: {error}",)
        raise


def _values(kind: type[Criterion], table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a criterion. Raises InputError."""
    own = {one.name: one for one in fields(kind)}
    names = {name: name for name in own} | {f"{one}{_DEGREES}": one for one in kind.angles}
    found: dict[str, Any] = {}
    for key, item in table.items():
        if key not in names:
            raise UnknownNameError("number", key, names)
        name = names[key]
        if name in found:
            raise InputError(f"{name} and {name}{_DEGREES} say the same: give one of them")
        found[name] = _value(item, own[name].type, key, RAD_PER_DEG if key != name else 1.0)
    needed = [one.name for one in own.values() if one.default is MISSING]
    missing = [name for name in needed if name not in found]
    if missing:
        raise InputError(f"it needs {' and '.join(missing)}")
    return found


def _value(item: Any, kind: Any, key: str, unit: float) -> Any:
    """Return a field's value from what a file says, as the kind of the field asks."""
    kinds = get_args(kind) or (kind,)
    if Border in kinds:
        return _border(item, key)
    if Limit in kinds:
        return _limit(item, key, unit)
    for plain, expected in _PLAIN.items():
        if plain in kinds:
            return _checked(item, plain, key, expected)
    return _number(item, key) * unit


_PLAIN = {str: "a text", bool: "true or false", int: "a whole number"}


def _limit(item: Any, key: str, unit: float) -> Limit:
    if not (isinstance(item, list) and len(item) == 2):
        raise InputError(f"{key} = {item!r}: expected two numbers, where Levels 1 and 2 end")
    return Limit(*(_number(one, key) * unit for one in item))


def _border(item: Any, key: str) -> Border:
    if not (isinstance(item, Mapping) and set(item) == set(_BORDER)):
        raise InputError(
            f"{key} = {item!r}: expected a table of {', '.join(_BORDER)}, lists of numbers"
        )
    corners = (tuple(_number(one, key) for one in item[name]) for name in _BORDER)
    return Border(*corners)


def _number(item: Any, key: str) -> float:
    if isinstance(item, bool) or not isinstance(item, int | float):
        raise InputError(f"{key} = {item!r}: expected a number")
    return float(item)


def _checked(item: Any, kind: type, key: str, expected: str) -> Any:
    if not isinstance(item, kind) or (kind is int and isinstance(item, bool)):
        raise InputError(f"{key} = {item!r}: expected {expected}")
    return item


def _table(spec: Spec) -> str:
    """Return a specification as a table of TOML."""
    one = spec.criterion
    lines = ["[[spec]]", f"criterion = {toml_value(one.name)}", f"kind = {toml_value(spec.kind)}"]
    for field in fields(one):
        value = getattr(one, field.name)
        if field.name == "axis" or value != field.default:
            lines.append(f"{field.name} = {_written(value)}")
    return "\n".join(lines) + "\n"


def _written(value: Any) -> str:
    if isinstance(value, Limit):
        return toml_value([value.level1, value.level2])
    if isinstance(value, Border):
        return f"{{ {', '.join(f'{n} = {toml_value(getattr(value, n))}' for n in _BORDER)} }}"
    return toml_value(value)
