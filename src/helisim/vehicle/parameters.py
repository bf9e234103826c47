"""A vehicle's folder: its files, and its parameters, of a glossary of all that there are."""

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

from helisim.base.errors import InputError, ModelError, StorageError, UnknownNameError
from helisim.base.files import read_toml
from helisim.base.settings import is_number

BODIES = ("fuselage", "rotor", "tail_rotor")
SITES = ("imu", "hub", "tail_hub")
"""Bodies and sites of a vehicle's MJCF that are looked up by name."""

PARAMETER_FILES = ("parameters.toml", "calibrated.toml", "tuned.toml")  # given, calibrated, tuned

_NEEDED = (
    "a vehicle of one's own is a folder with parameters.toml, calibrated.toml, tuned.toml and its "
    "MJCF, which `helisim vehicle new NAME` makes"
)


def models_folder() -> Path:
    """Return the folder of the shipped vehicles: in the package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside, beside = package / "models", package.parents[1] / "models"
    return inside if inside.is_dir() else beside


def vehicle_names() -> tuple[str, ...]:
    """Return the names of the shipped vehicles."""
    return tuple(
        sorted(path.parent.name for path in models_folder().glob(f"*/{PARAMETER_FILES[0]}"))
    )


def model_folder(vehicle: str | os.PathLike[str], *, beside: Path | None = None) -> Path:
    """Return the folder of a shipped vehicle or of a path (from `beside`); or UnknownNameError."""
    if isinstance(vehicle, str) and vehicle in vehicle_names():
        return models_folder() / vehicle
    try:
        path = Path(beside or "") / vehicle
        if vehicle and (path / PARAMETER_FILES[0]).is_file():
            return path.resolve()
    except (OSError, TypeError, ValueError):
        pass  # a name that no file can have, or no name at all
    raise UnknownNameError("vehicle", str(vehicle), vehicle_names(), advice=_NEEDED)


def is_shipped(folder: Path) -> bool:
    """Return whether a vehicle's folder is one of helisim's own."""
    return folder.parent == models_folder()


def mjcf_file(folder: Path) -> Path:
    """Return the vehicle's MJCF, named as its folder or the only one but scenes; or ModelError."""
    own = folder / f"{folder.name}.xml"
    if own.is_file():
        return own
    found = [p for p in folder.glob("*.xml") if p.name not in ("scene.xml", "scenery.xml")]
    if len(found) == 1:
        return found[0]
    raise ModelError(
        f"{folder}: which file is the vehicle's MJCF? {own.name} isn't there, and there are "
        f"{len(found)} others; give it that name"
    )


def rig_names(vehicle: str | os.PathLike[str]) -> tuple[str, ...]:
    """Return the names of the rigs that can hold a vehicle on the ground."""
    return tuple(sorted(path.stem for path in (model_folder(vehicle) / "rigs").glob("*.xml")))


def rig_file(folder: Path, rig: str) -> Path:
    """Return the MJCF of a rig with the vehicle in it; UnknownNameError if there is no such rig."""
    if rig not in rig_names(folder):
        advice = f"a rig is an MJCF in the vehicle's folder {folder.name}/rigs"
        raise UnknownNameError("rig", rig, rig_names(folder), advice=advice)
    return folder / "rigs" / f"{rig}.xml"


_NOT_GIVEN = "not given: "
_RULES: dict[str, Callable[[float], bool]] = {
    "positive": lambda value: value > 0.0,
    "negative": lambda value: value < 0.0,
    "0 or more": lambda value: value >= 0.0,
    "from 0 to 1": lambda value: 0.0 <= value <= 1.0,
    "above 0 and at most 1": lambda value: 0.0 < value <= 1.0,
}


@dataclass(frozen=True, kw_only=True)
class Term:
    """One parameter of a vehicle, as the glossary has it; low, high: plausible range.

    Attributes:
        default: where it is left out, None for none; `because` says why.
        like: the parameter that it follows where it is left out.
        untuned: its value before the gyro is tuned.
        sign: what the force laws need, one of `_RULES`.
        slot: its name in `PARAM`.
    """

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    origin: str
    optional: bool = False
    default: float | None = None
    because: str = ""
    like: str = ""
    untuned: float | None = None
    sign: str = ""
    choices: tuple[Any, ...] = ()
    slot: str = ""

    @property
    def words(self) -> tuple[str, ...]:
        """The words that it is chosen from, none of most."""
        return tuple(one for one in self.choices if isinstance(one, str))

    def fault(self, value: float) -> str:
        """Return what is wrong with a value for the force laws, "" if nothing is."""
        rule = "" if not self.sign or _RULES[self.sign](value) else self.sign
        if self.choices and not self.words and value not in self.choices:
            rule = f"one of {', '.join(map(str, self.choices))}"
        return f"parameter {self.name!r} must be {rule}, got {value:g}" if rule else ""


@cache
def glossary() -> Mapping[str, Term]:
    """Return every parameter that a vehicle can have, by name, in the order of its files."""
    terms = {}
    path = files("helisim.vehicle").joinpath("glossary.toml")
    for section, entries in read_toml(str(path)).items():
        for names, (unit, (low, high), meaning, origin, *more) in entries.items():
            rules = dict(*more)
            rules["choices"] = tuple(rules.get("choices", ()))
            for name in (f"{section}.{key}" for key in names.split()):
                terms[name] = Term(
                    name=name,
                    unit=unit,
                    low=low,
                    high=high,
                    meaning=meaning,
                    origin=origin,
                    **rules,
                )
    return MappingProxyType(terms)


def sections() -> tuple[str, ...]:
    """Return the sections of the glossary."""
    return tuple(dict.fromkeys(name.split(".")[0] for name in glossary()))


def term(name: str) -> Term | None:
    """Return what a parameter is, None if no vehicle has one of that name."""
    return glossary().get(name) or glossary().get(f"{name.split('.')[0]}.*")


def words_of(name: str) -> tuple[str, ...]:
    """Return the words that a parameter is chosen from, none if it is a number."""
    known = term(name)
    return known.words if known else ()


def number_of(name: str, value: Any) -> float:
    """Return a value as a number, of a word its place from 0 on; InputError if neither."""
    words = words_of(name)
    if words and isinstance(value, str) and value in words:
        return float(words.index(value))
    is_finite = is_number(value) and abs(cast(float, value)) <= sys.float_info.max
    if is_finite and (not words or value in range(len(words))):
        return float(value)
    if words:
        raise InputError(f"{name} must be {' or '.join(words)}, got {value!r:.60}")
    raise InputError(f"parameter {name!r} must be a finite number, got {value!r:.60}")


@dataclass(frozen=True)
class PhysicalParameter:
    """One physical parameter: dotted name, value, unit (SI) and source."""

    name: str
    value: float
    unit: str
    source: str


def entry_of(name: str, item: Any) -> PhysicalParameter:
    """Return a parameter from its table of value, unit and source; InputError if it is none.

    Sections that the glossary doesn't have are allowed.
    """
    known, (section, _, key) = term(name), name.partition(".")
    if not known and (
        keys := [one.split(".")[1] for one in glossary() if one.startswith(f"{section}.")]
    ):
        raise UnknownNameError(f"parameter of [{section}]", key, keys)
    if not isinstance(item, Mapping) or not {"value", "unit", "source"} <= set(item):
        unit = known.unit if known else "1"
        example = f'{{ value = 1.0, unit = "{unit}", source = "measured" }}'
        raise InputError(f"{name} needs value (a number), unit and source: {example}, got {item!r}")
    value, unit = number_of(name, item["value"]), str(item["unit"])
    if known and unit != known.unit:
        raise InputError(f"{name} is in {known.unit!r}, not in {unit!r}")
    return PhysicalParameter(name, value, unit, str(item["source"]))


class Parameters(Mapping[str, float]):
    """Values by dotted name, such as `main_rotor.lift_slope`; read-only."""

    def __init__(self, entries: Mapping[str, PhysicalParameter]) -> None:
        self._entries = dict(entries)

    def __getitem__(self, name: str) -> float:
        return self.entry(name).value

    def get(self, name: str, default: Any = None) -> Any:
        """Return a value, or the default where a vehicle leaves the parameter out."""
        return self._entries[name].value if name in self._entries else default

    def __repr__(self) -> str:
        sections = dict.fromkeys(name.split(".")[0] for name in self)
        return f"Parameters({len(self)} of {', '.join(sections)})"

    def __hash__(self) -> int:
        return hash(frozenset(self.items()))

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def entries(self) -> dict[str, PhysicalParameter]:
        """Return value, unit and source of each parameter by name."""
        return dict(self._entries)

    def entry(self, name: str) -> PhysicalParameter:
        """Return value, unit and source of one parameter."""
        if name not in self._entries:
            raise UnknownNameError("parameter", name, sorted(self._entries))
        return self._entries[name]

    def word(self, name: str) -> str | float:
        """Return the word that is chosen of a parameter, such as "ideal"; else its number."""
        words = words_of(name)
        return words[int(self[name])] if words else self[name]

    def replace(self, changes: Mapping[str, float | str]) -> "Parameters":
        """Return a copy with changed values; parameters that follow one of them change too.

        Raises UnknownNameError, or InputError if a value is no finite number or known word.
        """
        entries = dict(self._entries)
        for name, value in changes.items():
            entries[name] = replace(
                self.entry(name), value=number_of(name, value), source="set by the user"
            )
        for name, known in glossary().items():
            follows = name in entries and entries[name].source == f"{_NOT_GIVEN}as {known.like}"
            if follows and known.like in changes:
                entries[name] = replace(entries[name], value=entries[known.like].value)
        return Parameters(entries)


def solved(values: Mapping[str, float], own: Parameters, source: str) -> Parameters:
    """Return new values of a vehicle's own parameters, by name, from one source."""
    return Parameters(
        {
            name: PhysicalParameter(name, value, own.entry(name).unit, source)
            for name, value in values.items()
        }
    )


def read_entries(path: Path, entries: dict[str, PhysicalParameter]) -> Iterator[str]:
    """Add a TOML file's parameters to `entries`; yield each fault in words. Raises StorageError."""
    for section, members in read_toml(path).items():
        if not isinstance(members, dict):
            yield f"{section} must stand in a section, such as [air]"
            continue
        for key, item in members.items():
            name = f"{section}.{key}"
            if name in entries:
                yield f"parameter {name!r} is already defined"
            try:
                entries[name] = entry_of(name, item)
            except InputError as error:
                yield str(error)


def read_parameters(*paths: Path) -> Parameters:
    """Return the parameters of all these TOML files together.

    Raises ModelError if a file is missing or malformed, or if a parameter stands in two.
    """
    entries: dict[str, PhysicalParameter] = {}
    for path in paths:
        try:
            for fault in read_entries(path, entries):
                raise ModelError(f"{path}: {fault}")
        except StorageError as error:
            raise ModelError(f"can't read parameters: {error}") from None
    return Parameters(entries)


def check_values(parameters: Mapping[str, float]) -> None:
    """Raise ModelError on a value that the force laws can't have."""
    for name, known in glossary().items():
        if name in parameters and (fault := known.fault(parameters[name])):
            raise ModelError(fault)


def untuned(parameters: Parameters) -> Parameters:
    """Return the parameters with plain values for missing settings of the gyro, not fit to fly."""
    return Parameters(
        {
            name: PhysicalParameter(name, known.untuned, known.unit, "not tuned yet")
            for name, known in glossary().items()
            if known.untuned is not None
        }
        | parameters.entries()
    )


def completed(parameters: Parameters) -> Parameters:
    """Return the parameters with those that a vehicle may leave out."""
    given = parameters.entries()
    for name, known in glossary().items():
        if known.default is not None and name not in given:
            source = f"{_NOT_GIVEN}{known.because}"
            given[name] = PhysicalParameter(name, known.default, known.unit, source)
    for name, known in glossary().items():
        if known.like in given and name not in given:
            source = f"{_NOT_GIVEN}as {known.like}"
            given[name] = replace(given[known.like], name=name, source=source)
    return Parameters(given)


def to_toml(
    parameters: Parameters,
    header: str,
    *,
    comment: Callable[[str], Iterable[str]] = lambda _: (),
) -> str:
    """Return parameters as a file's text; comment: returns the comment above one, by its name."""
    lines = [f"# {line}".rstrip() for line in header.splitlines()]
    for section in dict.fromkeys(name.split(".")[0] for name in parameters):
        lines += ["", f"[{section}]"]
        for name in (name for name in parameters if name.split(".")[0] == section):
            entry, value = parameters.entry(name), parameters.word(name)
            written = json.dumps(value) if isinstance(value, str) else repr(value)
            lines += [f"# {line}" for line in comment(name)]
            lines.append(
                f"{name.split('.')[1]} = {{ value = {written}, unit = {json.dumps(entry.unit)}, "
                f"source = {json.dumps(entry.source)} }}"
            )
    return "\n".join(lines) + "\n"
