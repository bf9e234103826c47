"""The plan of a campaign, an experiment repeated over vehicles, noise and seeds.

A campaign file (TOML) has `[campaign]`, and values in `[set.SECTION]` and `[vary.SECTION]`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import product
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeVar

from helisim.base.errors import InputError, UnknownNameError, check_known, shown
from helisim.base.files import read_toml
from helisim.base.settings import (
    check,
    convert,
    from_plain,
    is_number,
    placed,
    setting,
    setting_names,
    to_plain,
)
from helisim.records.record import AXES
from helisim.sim import FlightEnvelope, FlightPlan, Pilot, Recorder, Sweep, Weather
from helisim.study.models import KNOWN_MODELS, MODELS, ModelSpec
from helisim.vehicle import Vehicle, load, standard_parameters
from helisim.vehicle.assembly import Integrator
from helisim.vehicle.parameters import is_shipped, model_folder, number_of

T = TypeVar("T")

Table = Mapping[str, Any]
Value = bool | int | float | str | tuple[float, ...]  # a list of numbers is one value
Point = dict[str, Value]  # by key of their variation
Method = Literal["designed", "direct", "joint"]
Changes = Mapping[str, Mapping[str, tuple[Value, bool]]]

_CHOICE = (*MODELS, *KNOWN_MODELS)
MODEL_NAMES = tuple(model.name for model in _CHOICE)
SECTIONS = ("vehicle", "sweep", "pilot", "recorder", "weather", "envelope")
_KEYS = ("value", "values", "relative")

_standard = cache(standard_parameters)


@dataclass(frozen=True, kw_only=True)
class Variation:
    """One quantity of a section such as "recorder", set (one value) or varied.

    Its name is dotted inside a mapping, such as "noise.p"; relative values are factors.
    """

    section: str
    name: str
    values: tuple[Value, ...]
    relative: bool = False

    @property
    def key(self) -> str:
        """Section and name, dotted."""
        return f"{self.section}.{self.name}"


@dataclass(frozen=True)
class Replicate:
    """One replicate, counted from 0, its varied values by key, and what it flies.

    The vehicle is a name or a folder; `changes` are of settings, with whether they are factors.
    """

    number: int
    point: int
    seed: int
    values: Point
    vehicle: str
    changes: Changes
    integrator: Integrator

    def load(self) -> Vehicle:
        """Return the vehicle with its changed parameters. Raises as `helisim.load` does."""
        return load(self.vehicle, parameters=self.parameters(), integrator=self.integrator)

    def parameters(self) -> dict[str, float]:
        """Return the changed parameters of the vehicle. Raises UnknownNameError, InputError."""
        standard, new = _standard(self.vehicle), {}
        for name, (value, relative) in self.changes.get("vehicle", {}).items():
            old = standard[name]
            scaled = _scaled(f"vehicle.{name}", old, value) if relative else value
            new[name] = number_of(name, scaled)
        return new

    def changed(self, section: str, usual: T) -> T:
        """Return a section's usual value object with this replicate's changes. Raises as above."""
        return _applied(section, usual, self.changes.get(section, {}))

    def sweep(self, axis: str, parameters: Mapping[str, float]) -> Sweep:
        """Return the sweep of one axis; a setting such as "lat.amplitude" is of that axis only."""
        changes = self.changes.get("sweep", {})
        general = {name: one for name, one in changes.items() if name.split(".")[0] not in AXES}
        own = {name.partition(".")[2]: changes[name] for name in changes if name[:4] == f"{axis}."}
        return _applied("sweep", Sweep(axis=axis).on(parameters), {**general, **own})

    def plan(
        self, axis: str, parameters: Mapping[str, float], recorder: Recorder | None = None
    ) -> FlightPlan:
        """Return the plan of a sweep of one axis, on a vehicle of these parameters."""
        return FlightPlan(
            excitation=self.sweep(axis, parameters),
            pilot=self.changed("pilot", Pilot()),
            recorder=self.changed("recorder", recorder or Recorder()),
            weather=self.changed("weather", Weather()),
            envelope=self.changed("envelope", FlightEnvelope()),
        )


def _applied(section: str, usual: T, changes: Mapping[str, tuple[Value, bool]]) -> T:
    table = {name: to_plain(getattr(usual, name)) for name in setting_names(usual)}
    known = [name for name in table if (section, name) != ("sweep", "axis")]
    for name, (value, relative) in changes.items():
        top, _, inner = name.partition(".")
        if top not in known:
            raise UnknownNameError(f"setting of {section}", name, known)
        held, key = table, top
        if inner:
            parts = {} if table[top] is None else table[top]
            if not isinstance(parts, dict):
                raise InputError(f"{section} has no {name}: {top} has no parts")
            held, key = parts, inner
            table[top] = parts
        held[key] = _scaled(f"{section}.{name}", held.get(key), value) if relative else value
    return from_plain(type(usual), table, section)


def _scaled(where: str, old: Any, value: Value) -> Any:
    factor = convert(float, value, where)
    if isinstance(old, dict):
        return {name: _scaled(f"{where}.{name}", one, value) for name, one in old.items()}
    if isinstance(old, list):
        return [factor * one for one in old]
    if not is_number(old):
        raise InputError(f"{where} is {old!r}, which can't be multiplied: drop relative")
    return factor * old


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """Flights and models of a campaign, at every combination of varied settings.

    The vehicle is a shipped one's name or a folder. The integrator "Euler" is faster than "RK4" and
    moves estimates by far less than errors. `seed` is the first replicate's; `seeds` are each
    replicate's "own", or "common" to the k-th replicates of all points. `models` are of
    `MODEL_NAMES`; `sweeps` pools other axes for a model. `methods`: "designed" as the model says;
    "direct"; or "joint", the joint input-output method with the sticks as reference where inputs
    are servo signals. `flights`, on each axis, are all used, or numbers of them in turn by
    `identified_after`.
    """

    vehicle: str | PathLike[str] = "jr700"
    integrator: Integrator = "RK4"
    replicates: int = setting(1, low=1)
    seed: int = setting(1, low=0)
    seeds: Literal["own", "common"] = "own"
    models: tuple[str, ...] = setting(tuple(one.name for one in MODELS), choices=MODEL_NAMES)
    sweeps: Mapping[str, tuple[str, ...]] = setting(factory=dict, choices=AXES, unsaid=True)
    methods: tuple[Method, ...] = ("designed",)
    flights: int = setting(10, low=1)
    identified_after: tuple[int, ...] = ()
    settings: tuple[Variation, ...] = ()

    def __post_init__(self) -> None:
        check(self, "campaign")
        folder = model_folder(self.vehicle)
        object.__setattr__(self, "vehicle", folder.name if is_shipped(folder) else str(folder))
        counts = self.identified_after or (self.flights,)
        object.__setattr__(self, "identified_after", counts)
        check_known("model of sweeps", self.sweeps, self.models)
        lists = {name: getattr(self, name) for name in ("models", "methods", "identified_after")}
        lists |= {f"sweeps.{name}": axes for name, axes in self.sweeps.items()}
        for name, items in lists.items():
            if not items or len(set(items)) < len(items):
                raise InputError(f"{name} needs one item or more, none twice, got {list(items)}")
        if not 1 <= min(counts) <= max(counts) <= self.flights:
            raise InputError(f"identified_after must be 1 to {self.flights}, got {list(counts)}")
        for model in self.chosen:
            for given in model.given.values():
                if given.source in MODEL_NAMES and given.source not in self.models:
                    raise InputError(
                        f"{model.name} takes values from {given.source}: add it to models"
                    )
        standard = _standard(str(self.vehicle))
        for number in range(len(self.points)):  # a mistake is told before anything is flown
            one = self.replicate(number)
            parameters = {**standard, **one.parameters()}
            for axis in dict.fromkeys((*self.axes, *AXES)):
                one.plan(axis, parameters)

    def __len__(self) -> int:
        return len(self.points) * self.replicates

    def __iter__(self) -> Iterator[Replicate]:
        return (self.replicate(number) for number in range(len(self)))

    def replicate(self, number: int) -> Replicate:
        """Return a replicate; the first ones of all points precede the second ones."""
        again, point = divmod(number, len(self.points))
        values = self.points[point]
        changes: dict[str, dict[str, tuple[Value, bool]]] = {}
        for one in self.settings:
            value = values.get(one.key, one.values[0])
            changes.setdefault(one.section, {})[one.name] = (value, one.relative)
        seed = self.seed + (number if self.seeds == "own" else again)
        return Replicate(number, point, seed, values, str(self.vehicle), changes, self.integrator)

    @cached_property
    def points(self) -> list[Point]:
        """Every combination of varied values, by key."""
        keys = [one.key for one in self.varied]
        return [dict(zip(keys, row)) for row in product(*(one.values for one in self.varied))]

    @property
    def varied(self) -> tuple[Variation, ...]:
        """Settings with more than a fixed value."""
        return tuple(one for one in self.settings if len(one.values) > 1)

    @property
    def chosen(self) -> tuple[ModelSpec, ...]:
        """The models to identify, in the experiment's order."""
        return tuple(
            replace(model, sweeps=self.sweeps.get(model.name, model.sweeps))
            for model in _CHOICE
            if model.name in self.models
        )

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that the models need sweeps of."""
        needed = {axis for model in self.chosen for axis in model.sweeps}
        return tuple(axis for axis in AXES if axis in needed)

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as plain data, for provenance."""
        return to_plain(self) | {"vehicle": Path(self.vehicle).name}  # a path is this machine's


def read_campaign(path: str | Path) -> Campaign:
    """Read a campaign file (TOML). Raises StorageError, InputError."""
    content = read_toml(path)
    with placed(path):
        if not content:
            raise InputError("it is empty; expected [campaign], [set.SECTION] or [vary.SECTION]")
        return campaign_from(content, beside=Path(path).parent)


def campaign_from(content: Mapping[str, Any], *, beside: Path | None = None) -> Campaign:
    """Return a file's campaign; a vehicle's path is relative to `beside`. Raises InputError."""
    check_known("section", content, ("campaign", "set", "vary"))
    plan = dict(convert(Table, content.get("campaign", {}), "campaign"))
    check_known("key of [campaign]", plan, setting_names(Campaign)[:-1])
    settings: dict[str, Variation] = {}
    for part in ("set", "vary"):
        for section, table in convert(Table, content.get(part, {}), part).items():
            check_known(f"section of [{part}]", [section], SECTIONS)
            for name, item in _flat(convert(Table, table, f"{part}.{section}")):
                one = _variation(part, section, name, item)
                if one.key in settings:
                    raise InputError(f"{one.key} is both set and varied")
                settings[one.key] = one
    if "vehicle" in plan:
        vehicle = convert(str, plan["vehicle"], "campaign.vehicle")
        plan["vehicle"] = str(model_folder(vehicle, beside=beside))
    return from_plain(Campaign, {**plan, "settings": tuple(settings.values())}, "campaign")


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, item in table.items():
        if isinstance(item, Mapping) and not any(one in item for one in _KEYS):
            yield from _flat(item, f"{prefix}{key}.")
        else:
            yield prefix + key, item


def _variation(part: str, section: str, name: str, item: Any) -> Variation:
    where = f"{section}.{name}"
    table = (
        dict(item) if isinstance(item, Mapping) else {"values" if part == "vary" else "value": item}
    )
    check_known(f"key of {where}", table, _KEYS)
    relative = convert(bool, table.pop("relative", False), f"{where}.relative")
    values = table.get("values", [table.get("value")])
    many = isinstance(values, list) and len(values) > 1
    if len(table) != 1 or many != (part == "vary"):
        raise InputError(
            f"{where} is {shown(item)}; expected a value under [set.{section}], two or more under "
            f"[vary.{section}]: VALUE, {{ value = ... }}, [...] or {{ values = [...] }}"
        )
    made = tuple(_value(where, one) for one in values)
    if len(set(made)) < len(made) or len({_kind(one) for one in made}) > 1:
        raise InputError(f"{where} has a value twice, or values of two kinds: {shown(values)}")
    return Variation(section=section, name=name, values=made, relative=relative)


def _kind(value: Value) -> type:
    return float if is_number(value) else type(value)


def _value(where: str, item: Any) -> Value:
    if isinstance(item, list):
        return tuple(float(one) for one in convert(tuple[float, ...], item, where))
    return item if isinstance(item, bool | str) else convert(bool | float | str, item, where)
