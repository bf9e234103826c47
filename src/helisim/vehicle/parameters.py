"""A vehicle's parameters: what each may be, its values with units and sources, and their files.

The glossary, glossary.toml, says all of a parameter: unit, plausible range, meaning, origin,
default and bounds, and which number of the force laws it is.
"""

import json
import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any

from helisim.base.errors import InputError, ModelError, StorageError, UnknownNameError
from helisim.base.files import read_toml
from helisim.base.settings import is_number
from helisim.base.units import METRE_PER_FOOT, RAD_PER_DEG, RAD_S_PER_RPM, STANDARD_GRAVITY

_NOT_GIVEN = "not given: "


@dataclass(frozen=True, kw_only=True)
class Term:
    """One parameter of a vehicle, as the glossary has it.

    Attributes:
        name: dotted; of the recorder's latencies "recorder_latency.*".
        unit: that its value is in.
        low: least plausible value.
        high: greatest plausible value.
        meaning: what it is and does.
        origin: where to get it.
        optional: a vehicle may leave it out, and then has its default, or does without.
        default: its value where it is left out, None for none.
        because: why that.
        like: the parameter whose value it has where it is left out.
        untuned: its value before the gyro is tuned.
        sign: "positive" or "0 or more", which the force laws need.
        choices: words that it can be, each its place in the row from 0 on inside; or numbers.
        share: it is above 0 and at most 1.
        slot: the number of the force laws that it is, of `PARAM`.
        now: the name that it has got since.
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
    share: bool = False
    slot: str = ""
    now: str = ""

    @property
    def words(self) -> tuple[str, ...]:
        """The words that it is chosen from, none of most."""
        return tuple(one for one in self.choices if isinstance(one, str))

    def fault(self, value: float) -> str:
        """Return what is wrong with a value for the force laws, "" if nothing is."""
        wrong = {"positive": value <= 0.0, "0 or more": value < 0.0}.get(self.sign, False)
        return f"parameter {self.name!r} must be {self.sign}, got {value:g}" if wrong else ""


@cache
def glossary() -> Mapping[str, Term]:
    """Return every parameter that a vehicle can have, by name, in the order of its files."""
    terms = {}
    path = files("helisim.vehicle").joinpath("glossary.toml")
    for section, entries in read_toml(str(path)).items():
        for names, (unit, (low, high), meaning, origin, *more) in entries.items():
            rules = more[0] if more else {}
            rules |= {"choices": tuple(rules.get("choices", ()))}
            for key in names.split():
                terms[f"{section}.{key}"] = Term(
                    name=f"{section}.{key}",
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


_LARGEST = sys.float_info.max
"""A larger number is none that a float or a formula holds."""


def number_of(name: str, value: Any) -> float:
    """Return a parameter's value as a number: of a choice, the place of its word from 0 on.

    Args:
        name: of the parameter, dotted.
        value: a number, or one of `words_of` it.

    Raises:
        InputError: it is neither, or not finite.
    """
    words = words_of(name)
    if words:
        if isinstance(value, str) and value in words:
            return float(words.index(value))
        if is_number(value) and value in range(len(words)):
            return float(value)
        raise InputError(f"{name} must be {' or '.join(words)}, got {value!r:.60}")
    if is_number(value) and abs(value) <= _LARGEST:
        return float(value)
    raise InputError(f"parameter {name!r} must be a finite number, got {value!r:.60}")


def word_of(name: str, value: float) -> str | float:
    """Return the word that a number stands for, or the number itself where there is no choice."""
    words = words_of(name)
    return words[int(value)] if words else value


def plain_number(name: str, value: object) -> float:
    """Return the value of a parameter as its file has it.

    Raises:
        TypeError: text, or true or false.
        InputError: it is a choice, and of other words.
    """
    if words_of(name):
        return number_of(name, value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    return float(value) if abs(value) <= _LARGEST else math.inf


def name_fault(name: str) -> str:
    """Return what is wrong with a parameter's name, "" if nothing is.

    A section that no vehicle has is its author's own, and left alone.
    """
    section, key = name.split(".")
    if section not in sections() or term(name):
        return ""
    keys = [known.split(".")[1] for known in glossary() if known.startswith(f"{section}.")]
    return str(UnknownNameError(f"parameter of [{section}]", key, keys))


@dataclass(frozen=True)
class PhysicalParameter:
    """One physical parameter: dotted name, value, unit (SI) and source."""

    name: str
    value: float
    unit: str
    source: str


class Parameters(Mapping[str, float]):
    """Values by dotted name, such as `main_rotor.lift_slope`. Read-only.

    Raises:
        UnknownNameError: on a name that does not exist; the message lists those that do.
    """

    def __init__(self, entries: Mapping[str, PhysicalParameter]) -> None:
        self._entries = dict(entries)

    def __getitem__(self, name: str) -> float:
        return self.entry(name).value

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
        try:
            return self._entries[name]
        except KeyError:
            raise UnknownNameError("parameter", name, sorted(self._entries)) from None

    def word(self, name: str) -> str | float:
        """Return the word that is chosen of a parameter, such as "ideal"; else its number."""
        return word_of(name, self[name])

    def replace(
        self, changes: Mapping[str, float | str], source: str = "set by the user"
    ) -> "Parameters":
        """Return a copy with some values changed, and with them what was left out to be as they.

        Raises:
            UnknownNameError: no such parameter.
            InputError: a value is not a finite number, or not among the words that it can be.
        """
        entries = dict(self._entries)
        for name, value in changes.items():
            old = self.entry(name)
            entries[name] = PhysicalParameter(name, number_of(name, value), old.unit, source)
        for name, known in glossary().items():
            follows = name in entries and entries[name].source == f"{_NOT_GIVEN}as {known.like}"
            if follows and known.like in changes:
                entries[name] = replace(entries[name], value=entries[known.like].value)
        return Parameters(entries)


def read_parameters(*paths: Path) -> Parameters:
    """Read parameter files (TOML); a later file adds to the earlier ones.

    Raises:
        ModelError: a file is missing or malformed, or a name is defined twice.
    """
    entries: dict[str, PhysicalParameter] = {}
    for path in paths:
        for name, entry in _read(path).items():
            if name in entries:
                raise ModelError(f"{path}: parameter {name!r} is already defined")
            entries[name] = entry
    return Parameters(entries)


def untuned(parameters: Parameters) -> Parameters:
    """Return the parameters with plain values for what is missing of the gyro's settings.

    A vehicle can be calibrated and its gyro tuned with them; to fly it needs tuned ones.
    """
    plain = {
        name: PhysicalParameter(name, known.untuned, known.unit, "not tuned yet")
        for name, known in glossary().items()
        if known.untuned is not None
    }
    return Parameters(plain | parameters.entries())


def completed(parameters: Parameters) -> Parameters:
    """Return the parameters with what a vehicle may leave out, and none under a former name.

    Raises:
        ModelError: a parameter stands there under its name and its former one.
    """
    given, following = parameters.entries(), []
    for name, known in glossary().items():
        if known.now and name in given:
            if known.now in given:
                raise ModelError(f"{name} is the former name of {known.now}: leave one of them out")
            given[known.now] = replace(given.pop(name), name=known.now)
        if known.like:
            following.append((name, known.like))
        elif known.default is not None and name not in given:
            source = f"{_NOT_GIVEN}{known.because}"
            given[name] = PhysicalParameter(name, known.default, known.unit, source)
    for name, other in following:
        if name not in given and other in given:
            given[name] = replace(given[other], name=name, source=f"{_NOT_GIVEN}as {other}")
    return Parameters(given)


def _read(path: Path) -> dict[str, PhysicalParameter]:
    try:
        content = read_toml(path)
    except StorageError as error:
        raise ModelError(f"can't read parameters: {error}") from None
    entries = {}
    content.pop("roles", None)  # names, which `read_roles` reads
    for section, members in content.items():
        if not isinstance(members, dict):
            raise ModelError(f"{path}: {section} must stand in a section, such as [air]")
        for key, item in members.items():
            name = f"{section}.{key}"
            try:
                value, unit, source = item["value"], str(item["unit"]), str(item["source"])
                entry = PhysicalParameter(name, plain_number(name, value), unit, source)
            except InputError as error:
                raise ModelError(f"{path}: {error}") from None
            except (TypeError, KeyError, ValueError):
                raise ModelError(
                    f"{path}: {name} needs value (a number), unit and source, got {item!r}"
                ) from None
            if not math.isfinite(entry.value):
                raise ModelError(f"{path}: {name} must be finite, got {item['value']!r}")
            fault = name_fault(name) or unit_fault_of(entry)
            if fault:
                raise ModelError(f"{path}: {fault}")
            entries[name] = entry
    return entries


def unit_fault_of(entry: PhysicalParameter) -> str:
    """Return what is wrong with a parameter's unit, "" if nothing is."""
    known = term(entry.name)
    fault = unit_fault(entry.unit, entry.value, known.unit) if known else ""
    return f"{entry.name} {fault}" if fault else ""


def to_toml(
    parameters: Parameters,
    header: str,
    *,
    comment: Callable[[str], Iterable[str]] = lambda _: (),
) -> str:
    """Return parameters as the text of a parameter file, sections in order of appearance.

    parameters: to be written; header: lines of the comment at the head; comment: returns the lines
    of the comment above a parameter, by its name.
    """
    lines = [f"# {line}".rstrip() for line in header.splitlines()]
    for section in dict.fromkeys(name.split(".")[0] for name in parameters):
        lines += ["", f"[{section}]"]
        for name in parameters:
            prefix, key = name.split(".")
            if prefix != section:
                continue
            entry = parameters.entry(name)
            lines += [f"# {line}" for line in comment(name)]
            value = word_of(name, entry.value)
            written = json.dumps(value) if isinstance(value, str) else repr(value)
            lines.append(
                f"{key} = {{ value = {written}, unit = {json.dumps(entry.unit)}, "
                f"source = {json.dumps(entry.source)} }}"
            )
    return "\n".join(lines) + "\n"


def check_settings(values: Mapping[str, float]) -> None:
    """Check what a pilot can set on the gyro, by dotted names; other names are not looked at.

    Raises:
        InputError: a setting that the gyro does not have.
    """
    for name in values:
        known = term(name)
        if known and known.choices and not known.words and values[name] not in known.choices:
            listed = ", ".join(map(str, known.choices))
            raise InputError(f"{name} must be one of {listed}, got {values[name]:g}")
        if known and known.share and not 0.0 < values[name] <= 1.0:
            raise InputError(
                f"{name} must be above 0 and at most 1, the whole travel, got {values[name]:g}"
            )


@dataclass(frozen=True, kw_only=True)
class GyroSettings:
    """A pilot's settings of a three-axis gyro such as the CGY750; the defaults are the paper's.

    The paper (Wu and Chen, section 2) names them and gives no meaning. The CGY750's manual has
    "Swash AFR (rate)" among the basic settings of the swashplate: travel of aileron, elevator and
    pitch, as share of the whole. Its flight modes are F3C, sports and 3D; that they count 1, 2, 3
    in this order, and what they do inside, is chosen here.

    Attributes:
        flight_mode: how firmly roll and pitch attitude are kept. The cyclic integral is
            multiplied by (flight_mode - 1) / 2: 3 (3D) locks the attitude, 2 (sports) does so
            with half the gain, 1 (F3C) only damps the rates, as a stabilizer bar does, and
            keeps the swashplate's trim.
        pitch_rate: travel of the collective, above 0 to 1. Collective at the swashplate is the
            stick times pitch_rate over the rate at which the gains hold, 0.4.
        elevator_rate: travel of the longitudinal stick, above 0 to 1. The roll and pitch rates
            that it commands are multiplied by elevator_rate / 0.6.
        aileron_rate: travel of the lateral stick, above 0 to 1; likewise.
        heading_lock: True keeps the heading (AVCS), False only damps the yaw rate.

    Raises:
        InputError: a setting that the gyro does not have.
    """

    flight_mode: int = 3
    pitch_rate: float = 0.4
    elevator_rate: float = 0.6
    aileron_rate: float = 0.6
    heading_lock: bool = True

    def __post_init__(self) -> None:
        check_settings(self.as_parameters())

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "GyroSettings":
        """Return the settings that a vehicle's parameters carry."""
        return cls(
            flight_mode=int(parameters["gyro.flight_mode"]),
            pitch_rate=parameters["gyro.pitch_rate"],
            elevator_rate=parameters["gyro.elevator_rate"],
            aileron_rate=parameters["gyro.aileron_rate"],
            heading_lock=bool(parameters["gyro.heading_lock"]),
        )

    def as_parameters(self) -> dict[str, float]:
        """Return them by parameter name, such as "gyro.aileron_rate"."""
        return {f"gyro.{name}": float(value) for name, value in asdict(self).items()}


_WATT = {"kg": 1, "m": 2, "s": -3}
_UNITS: tuple[tuple[dict[str, int], dict[str, float]], ...] = (
    ({}, {"1": 1.0, "-": 1.0, "%": 0.01, "percent": 0.01}),
    ({"rad": 1}, {"rad": 1.0} | dict.fromkeys(("deg", "degree", "degrees", "°"), RAD_PER_DEG)),
    ({"rad": 1, "s": -1}, {"rpm": RAD_S_PER_RPM, "hz": 2.0 * math.pi}),
    ({"s": 1}, {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0}),
    ({"m": 1}, {"m": 1.0, "cm": 1e-2, "mm": 1e-3}),
    ({"m": 1}, {"in": METRE_PER_FOOT / 12.0, "inch": METRE_PER_FOOT / 12.0, "ft": METRE_PER_FOOT}),
    ({"kg": 1}, {"kg": 1.0, "g": 1e-3}),
    ({"kg": 1, "m": 1, "s": -2}, {"n": 1.0}),
    (_WATT, {"w": 1.0, "kw": 1e3, "hp": 745.7}),
    ({"a": 1}, {"a": 1.0}),
    (_WATT | {"a": -1}, {"v": 1.0}),
    (_WATT | {"a": -2}, {"ohm": 1.0, "ω": 1.0, "mohm": 1e-3, "mω": 1e-3}),
)
_BASE = {name: (each, powers) for powers, units in _UNITS for name, each in units.items()}
_GLUED = {"kgm": "kg m", "nm": "n m", "nmm": "n mm", "gm": "g m", "rads": "rad s"}
_FACTOR = re.compile(r"([a-zµ°%]+|1|-)(?:\^?(-?\d+))?")


@dataclass(frozen=True)
class WrittenUnit:
    """A unit that was written: one of it in SI, and the powers of what it is made of."""

    factor: float
    powers: tuple[tuple[str, int], ...]

    @classmethod
    def of(cls, text: str) -> "WrittenUnit | None":
        """Return the unit of a text such as "kg mm^2" or "N m/rad", None if it is none."""
        plain = text.strip().lower().replace("²", "^2").replace("³", "^3").replace("μ", "µ")
        over, *under = re.sub(r"[*·⋅()]", " ", plain).split("/")
        factor, powers = 1.0, Counter[str]()
        for part, sign in ((over, 1), *((part, -1) for part in under)):
            for word in part.split():
                found = _FACTOR.fullmatch(word)
                if found is None:
                    return None
                names = _GLUED.get(found[1], found[1]).split()
                exponents = [*[1] * (len(names) - 1), int(found[2] or 1)]
                for name, exponent in zip(names, exponents):
                    if name not in _BASE:
                        return None
                    each, made_of = _BASE[name]
                    factor *= each ** (sign * exponent)
                    for what, power in made_of.items():
                        powers[what] += sign * exponent * power
        return cls(factor, tuple(sorted((what, n) for what, n in powers.items() if n)))


def unit_fault(unit: str, value: float, expected: str) -> str:
    """Return what is wrong with the unit of a value, and what to write; "" if nothing is.

    unit: as it was written; value: in it; expected: the unit that is read.
    """
    if unit == expected:
        return ""
    written, wanted = WrittenUnit.of(unit), WrittenUnit.of(expected)
    if written is None or wanted is None or written.powers != wanted.powers:
        return f"is in {expected!r}, not in {unit!r}"
    factor = written.factor / wanted.factor
    if math.isclose(factor, 1.0, rel_tol=1e-12):
        return f"has its unit written {expected!r}, not {unit!r}"
    return (
        f"is in {expected!r}, not in {unit!r}: {value:g} {unit} are value = {value * factor:.6g}, "
        f'unit = "{expected}"'
    )


_SEA_LEVEL_K = 288.15
_SEA_LEVEL_PA = 101325.0
_LAPSE_K_M = 0.0065
_GAS_CONSTANT = 287.05287
"""J/(kg K), of dry air."""
_EXPONENT = STANDARD_GRAVITY / (_LAPSE_K_M * _GAS_CONSTANT)
_TOP_M = 11000.0
_ZERO_CELSIUS_K = 273.15


def isa_density(altitude: float, *, temperature: float | None = None) -> float:
    """Return the density of the air, kg/m^3 (ISO 2533, troposphere).

    The parameter `air.density` takes it: `load(parameters={"air.density": isa_density(1500.0)})`.

    Args:
        altitude: pressure altitude, m above sea level.
        temperature: of the air, K; the standard atmosphere's if None.

    Raises:
        InputError: the altitude is outside the troposphere, or the temperature out of range.
    """
    if not (math.isfinite(altitude) and -500.0 <= altitude <= _TOP_M):
        raise InputError(f"altitude must be from -500 to {_TOP_M:g} m, got {altitude}")
    standard = _SEA_LEVEL_K - _LAPSE_K_M * altitude
    kelvin = standard if temperature is None else temperature
    if not 150.0 <= kelvin <= 350.0:
        raise InputError(
            f"temperature must be from 150 to 350 K, got {kelvin:g} K; "
            f"{_ZERO_CELSIUS_K:g} K is 0 degrees Celsius"
        )
    pressure = _SEA_LEVEL_PA * (standard / _SEA_LEVEL_K) ** _EXPONENT
    return pressure / (_GAS_CONSTANT * kelvin)
