"""The plan of a campaign: the experiment again and again, with vehicles, noise and seeds that vary.

A campaign file (TOML) has `[campaign]`, the fields of `Campaign`; `[set.SECTION]`, what is set;
and `[vary.SECTION]`, what varies. A section is the vehicle's parameters or a value object.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass, replace
from functools import cache, cached_property
from itertools import product
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeVar, get_type_hints

import numpy as np
from scipy.stats import norm, qmc

from helisim.base.errors import InputError, UnknownNameError
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
    value_object,
)
from helisim.base.text import shown
from helisim.records.record import AXES
from helisim.sim import FlightEnvelope, FlightPlan, Pilot, Recorder, Sweep, Weather
from helisim.study.models import KNOWN_MODELS, MODELS, ModelSpec
from helisim.vehicle import Vehicle, load, standard_parameters
from helisim.vehicle.assembly import Integrator
from helisim.vehicle.folder import is_shipped, model_folder
from helisim.vehicle.parameters import number_of, words_of

T = TypeVar("T")

Value = bool | int | float | str | tuple[float, ...]
"""What a setting can be: as in TOML, a list of numbers being one value."""
Point = dict[str, Value]
"""Value by the key of its variation."""
Design = Literal["grid", "latin hypercube", "monte carlo"]
"""How the points are chosen: every combination, a Latin hypercube, or independent samples."""
Method = Literal["designed", "direct", "joint"]
"""How responses are estimated: as the experiment's models say, or all by one method."""
Seeds = Literal["own", "common"]
"""Whether replicates of different points have seeds of their own, or the same."""

_CHOICE = (*MODELS, *KNOWN_MODELS)
MODEL_NAMES = tuple(model.name for model in _CHOICE)
"""The experiment's models, and those with known servos."""

OBJECTS: dict[str, type] = {
    "sweep": Sweep,
    "pilot": Pilot,
    "recorder": Recorder,
    "weather": Weather,
    "envelope": FlightEnvelope,
}
"""Section of a campaign file -> the value object whose fields it names."""
SECTIONS = ("vehicle", *OBJECTS)

_FORMS = (
    "{ value = ... }",
    "{ values = [...] } or just [...]",
    "{ low, high } with scale = 'log' or count = N if wanted",
    "{ mean, std }",
)
_KEYS = ("value", "values", "low", "high", "scale", "count", "mean", "std", "relative")

_standard = cache(standard_parameters)
"""Parameters are read-only, and a campaign asks for them once a point."""


@dataclass(frozen=True)
class Levels:
    """A few values, each as likely as the others."""

    values: tuple[Value, ...]

    def at(self, share: float) -> Value:
        """Return the value below which this share lies, in [0, 1), of all samples."""
        return self.values[int(share * len(self.values))]


@dataclass(frozen=True)
class Uniform:
    """Every value between two is as likely, or every ratio where `log`."""

    low: float
    high: float
    log: bool = False

    def at(self, share: float) -> Value:
        """Return the value below which this share of all samples lies."""
        if self.log:
            return self.low * (self.high / self.low) ** share
        return self.low + (self.high - self.low) * share


@dataclass(frozen=True)
class Normal:
    """The normal distribution."""

    mean: float
    std: float = setting(above=0.0)

    def at(self, share: float) -> Value:
        """Return the value below which this share, in (0, 1), of all samples lies."""
        return float(norm.ppf(share, self.mean, self.std))


@dataclass(frozen=True)
class _Between:
    """As a campaign file has it."""

    low: float
    high: float
    scale: Literal["linear", "log"] = "linear"
    count: int | None = setting(None, low=2)

    def law(self, where: str) -> Levels | Uniform:
        """Return the levels or the distribution between the two."""
        low, high, log = float(self.low), float(self.high), self.scale == "log"
        if not low < high or (log and low <= 0.0):
            least = "0 < low < high" if log else "low < high"
            raise InputError(f"{where} needs {least}, got {low} and {high}")
        if self.count is None:
            return Uniform(low, high, log)
        space = np.geomspace if log else np.linspace
        return Levels(tuple(space(low, high, self.count).tolist()))


@dataclass(frozen=True, kw_only=True)
class Variation:
    """How one quantity is set or varied: it, and the law of its values.

    Attributes:
        section: whose it is, such as "recorder".
        name: in that section, such as "antialias_hz"; dotted inside a mapping, such as "noise.p".
        law: of its values.
        relative: values are factors of the quantity's usual value.
    """

    section: str
    name: str
    law: Levels | Uniform | Normal
    relative: bool = False

    @property
    def key(self) -> str:
        """Section and name, dotted."""
        return f"{self.section}.{self.name}"

    @property
    def varies(self) -> bool:
        """Whether it has more than one value."""
        return not (isinstance(self.law, Levels) and len(self.law.values) == 1)


@dataclass(frozen=True)
class Change:
    """What becomes of one setting: a new value, or a factor of the old one."""

    value: Value
    relative: bool = False


@dataclass(frozen=True)
class Settings:
    """Everything that is flown with in one replicate.

    Attributes:
        vehicle: name of a shipped one, or path of a folder.
        changes: section -> setting -> change.
        integrator: "RK4" or "Euler".
    """

    vehicle: str
    changes: Mapping[str, Mapping[str, Change]] = field(default_factory=dict)
    integrator: Integrator = "RK4"

    def load(self) -> Vehicle:
        """Return the vehicle with its changed parameters. Raises as `helisim.load` does."""
        return load(self.vehicle, parameters=self.parameters(), integrator=self.integrator)

    def parameters(self) -> dict[str, float]:
        """Return the changed parameters of the vehicle. Raises UnknownNameError, InputError."""
        standard, new = _standard(self.vehicle), {}
        for name, change in self._of("vehicle").items():
            old, where = standard[name], f"vehicle.{name}"
            if words_of(name):
                new[name] = number_of(name, change.value)
            else:
                new[name] = _changed(where, old, change, convert(float, change.value, where))
        return new

    def sweep(self, axis: str, parameters: Mapping[str, float]) -> Sweep:
        """Return the sweep of one axis; a setting such as "lat.amplitude" is of that axis only.

        What isn't set is the vehicle's own, of these parameters.
        """
        general, special = {}, {}
        for name, change in self._of("sweep").items():
            first, _, rest = name.partition(".")
            if first not in AXES:
                general[name] = change
            elif first == axis:
                special[rest] = change
        return _applied("sweep", Sweep(axis=axis).on(parameters), {**general, **special})

    def plan(self, axis: str, vehicle: Vehicle) -> FlightPlan:
        """Return the plan of a sweep of one axis, complete for the vehicle."""
        return FlightPlan(
            excitation=self.sweep(axis, vehicle.parameters),
            pilot=_applied("pilot", Pilot(), self._of("pilot")),
            recorder=self.recorder(vehicle),
            weather=self.weather(),
            envelope=_applied("envelope", FlightEnvelope(), self._of("envelope")),
        )

    def recorder(self, vehicle: Vehicle) -> Recorder:
        """Return the flight computer, with the vehicle's own latencies unless they are set."""
        return _applied("recorder", Recorder.of(vehicle), self._of("recorder"))

    def weather(self) -> Weather:
        """Return the weather, calm unless it is set."""
        return _applied("weather", Weather(), self._of("weather"))

    def check(self, axes: Iterable[str]) -> None:
        """Raise InputError if a name, type or value can't be, before anything is flown."""
        parameters = {**_standard(self.vehicle), **self.parameters()}
        for axis in (*axes, *AXES):  # those that are flown first, for the clearest message
            self.sweep(axis, parameters)
        for section, kind in OBJECTS.items():
            if section != "sweep":
                _applied(section, kind(), self._of(section))

    def _of(self, section: str) -> Mapping[str, Change]:
        return self.changes.get(section, {})


def _applied(section: str, plain: T, changes: Mapping[str, Change]) -> T:
    """Return a value object with some fields changed, "gust.down" inside the one named `gust`.

    Raises:
        UnknownNameError: no such field; a sweep's axis is the campaign's to choose.
        InputError: a value is of the wrong type, or the object refuses it.
    """
    new: dict[str, Any] = {}
    for name, change in changes.items():
        top, _, inner = name.partition(".")
        known = [one for one in setting_names(plain) if (section, one) != ("sweep", "axis")]
        if top not in known:
            raise UnknownNameError(f"setting of {section}", name, known)
        where, old = f"{section}.{name}", getattr(plain, top)
        if isinstance(old, Mapping) and not inner:
            if not change.relative:
                raise InputError(
                    f"{where} is one number for each channel: name the channel, such as {where}.p, "
                    "or say relative = true to multiply all"
                )
            new |= {f"{name}.{key}": _changed(where, one, change) for key, one in old.items()}
            continue
        if inner and change.relative:
            made = value_object(get_type_hints(type(plain))[top]) if old is None else None
            old = made() if made else old
            old = old.get(inner, 0.0) if isinstance(old, Mapping) else getattr(old, inner, None)
        new[name] = _changed(where, old, change)
    table = {name: getattr(plain, name) for name in setting_names(plain)}
    for name, value in new.items():
        top, _, inner = name.partition(".")
        old = table[top] if inner else None
        if is_dataclass(old):
            old = {one: getattr(old, one) for one in setting_names(old)}
        elif not isinstance(old, Mapping | None):
            raise InputError(f"{section} has no {name}: {top} has no parts")
        table[top] = {**(old or {}), inner: value} if inner else value
    return from_plain(type(plain), table, section)


def _changed(where: str, old: Any, change: Change, value: Any = None) -> Any:
    if not change.relative:
        return change.value if value is None else value
    factor = convert(float, change.value, where)
    if isinstance(old, tuple):
        return tuple(factor * one for one in old)
    if not is_number(old):
        raise InputError(f"{where} is {old!r}, which can't be multiplied: drop relative")
    return factor * old


@dataclass(frozen=True)
class Replicate:
    """One replicate: which it is, its seed and its settings.

    Attributes:
        number: from 0, in the order of the campaign.
        point: number of its point, from 0.
        seed: of its pilots and sensors.
        values: of what varies, by key.
        settings: everything that it is flown with.
    """

    number: int
    point: int
    seed: int
    values: Point
    settings: Settings


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """What a campaign flies and identifies.

    Attributes:
        vehicle: name of a shipped one, or path of a folder.
        integrator: "RK4", or "Euler", which costs less and moves estimates by far less than
            their errors.
        design: "grid", "latin hypercube" or "monte carlo".
        points: how many points are sampled; None for a grid.
        replicates: of each point.
        seed: of the samples and of the first replicate.
        seeds: "own": every replicate has a seed of its own; "common": the k-th replicates of
            all points share one, so that differences between points stand out.
        models: to identify, names of the experiment's or of `KNOWN_MODELS`.
        sweeps: of a model, the axes whose sweeps are pooled in place of the experiment's.
        methods: by which, each in turn: "designed", as the experiment says; "direct"; or
            "joint", by the sticks as reference where the inputs are servo signals.
        flights: on each axis that the models need.
        identified_after: the first so many flights of each axis are identified, each number
            in turn; all flights if empty.
        settings: what is set and varied.
    """

    vehicle: str | PathLike[str] = "jr700"
    integrator: Integrator = "RK4"
    design: Design = "grid"
    points: int | None = setting(None, low=1)
    replicates: int = setting(1, low=1)
    seed: int = setting(1, low=0)
    seeds: Seeds = "own"
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
        if self.identified_after == ():
            object.__setattr__(self, "identified_after", (self.flights,))
        for name in self.sweeps:
            if name not in self.models:
                raise UnknownNameError("model of sweeps", name, self.models)
        lists = {name: getattr(self, name) for name in ("models", "methods", "identified_after")}
        lists |= {f"sweeps.{name}": axes for name, axes in self.sweeps.items()}
        for name, items in lists.items():
            if not items:
                raise InputError(f"{name} must be a list with one item or more, got none")
            if len(set(items)) < len(items):
                raise InputError(f"{name} names something twice: {', '.join(map(str, items))}")
        for count in self.identified_after:
            if not 1 <= count <= self.flights:
                raise InputError(
                    f"identified_after must be 1 to {self.flights} flights, got {count}"
                )
        names = [model.name for model in self.chosen]
        for model in self.chosen:
            for given in model.given.values():
                if given.source in MODEL_NAMES and given.source not in names:
                    raise InputError(
                        f"{model.name} takes values from {given.source}: add it to models"
                    )
        for number in range(len(self.design_points)):
            self.replicate(number).settings.check(self.axes)

    def __len__(self) -> int:
        return len(self.design_points) * self.replicates

    def __iter__(self) -> Iterator[Replicate]:
        return (self.replicate(number) for number in range(len(self)))

    def replicate(self, number: int) -> Replicate:
        """Return a replicate; the first of all points come before the second of any."""
        again, point = divmod(number, len(self.design_points))
        values = self.design_points[point]
        changes: dict[str, dict[str, Change]] = {}
        for one in self.settings:
            value = values[one.key] if one.varies else one.law.at(0.0)
            changes.setdefault(one.section, {})[one.name] = Change(value, one.relative)
        seed = self.seed + (number if self.seeds == "own" else again)
        flown = Settings(str(self.vehicle), changes, self.integrator)
        return Replicate(number, point, seed, values, flown)

    @cached_property
    def design_points(self) -> list[Point]:
        """The points, each the values of what varies; without variations one, which is empty."""
        return _points(self.design, self.varied, self.points, self.seed)

    @property
    def varied(self) -> tuple[Variation, ...]:
        """What varies."""
        return tuple(one for one in self.settings if one.varies)

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

    @property
    def turbulent(self) -> bool:
        """Whether any replicate is flown in turbulence."""
        numbers = range(len(self.design_points))
        return any(self.replicate(number).settings.weather().dryden for number in numbers)

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as plain data, for provenance."""
        plan = to_plain(self) | {"vehicle": Path(self.vehicle).name}  # a path is this machine's
        for one in plan["settings"]:
            del one["law"]["kind"]
        return plan


def _points(
    design: Design, variations: Sequence[Variation], count: int | None, seed: int
) -> list[Point]:
    keys = [one.key for one in variations]
    if design == "grid":
        if count is not None:
            raise InputError("a grid has as many points as combinations: leave out points")
        levels = []
        for one in variations:
            if not isinstance(one.law, Levels):
                raise InputError(
                    f"a grid needs levels for {one.key}: a list, or {{ low, high, count }}"
                )
            levels.append(one.law.values)
        return [dict(zip(keys, values)) for values in product(*levels)]
    if count is None:
        raise InputError(f"the design {design!r} needs points = N, of 1 or more, got {count}")
    if not variations:
        raise InputError(f"the design {design!r} needs something that varies, see [vary]")
    rng = np.random.default_rng(seed)
    if design == "latin hypercube":
        shares = qmc.LatinHypercube(len(keys), rng=rng).random(count)
    else:
        shares = rng.random((count, len(keys)))
    shares = np.clip(shares, np.finfo(float).tiny, 1.0 - np.finfo(float).epsneg)  # strictly inside
    return [
        {one.key: one.law.at(float(share)) for one, share in zip(variations, row)} for row in shares
    ]


def read_campaign(path: str | Path) -> Campaign:
    """Read a campaign file (TOML).

    Raises:
        StorageError: the file can't be read, or isn't TOML.
        InputError: something in it isn't known or can't be; the message names the file.
    """
    content = read_toml(path)
    if not content:
        raise InputError(f"{path}: is empty; a campaign has a table [campaign], [set] or [vary]")
    with placed(path):
        return campaign_from(content, beside=Path(path).parent)


def campaign_from(content: Mapping[str, Any], *, beside: Path | None = None) -> Campaign:
    """Return the campaign that the content of a campaign file describes.

    Args:
        content: of the file.
        beside: the file's folder, from which a vehicle's path counts; the present one if None.

    Raises:
        InputError: something in it isn't known or can't be.
    """
    _check_names("section", content, ("campaign", "set", "vary"))
    plan = dict(_table("campaign", content.get("campaign", {})))
    _check_names("key of [campaign]", plan, setting_names(Campaign)[:-1])
    settings = tuple(
        _variation(section, name, item, varied=part == "vary")
        for part in ("set", "vary")
        for section, table in _sections(part, content.get(part, {}))
        for name, item in _flat(table, f"{part}.{section}")
    )
    keys = [one.key for one in settings]
    for key in keys:
        if keys.count(key) > 1:
            raise InputError(f"{key} is both set and varied")
    if "vehicle" in plan:
        vehicle = convert(str, plan["vehicle"], "campaign.vehicle")
        plan["vehicle"] = str(model_folder(vehicle, beside=beside))
    return from_plain(Campaign, {**plan, "settings": settings}, "campaign")


def _sections(part: str, item: Any) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for section, table in _table(part, item).items():
        _check_names(f"section of [{part}]", [section], SECTIONS)
        yield section, _table(f"{part}.{section}", table)


def _flat(table: Mapping[str, Any], where: str, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield names and items, names dotted, whether TOML nested them or quoted the dots."""
    for key, item in table.items():
        if not isinstance(item, Mapping) or any(one in item for one in _KEYS):
            yield prefix + key, item
        elif not item:
            raise InputError(f"{where}.{prefix}{key} is empty; expected {', '.join(_FORMS)}")
        else:
            yield from _flat(item, where, f"{prefix}{key}.")


def _table(name: str, item: Any) -> Mapping[str, Any]:
    if not isinstance(item, Mapping):
        raise InputError(f"{name} must be a section, [{name}], got {shown(item)}")
    return item


def _check_names(what: str, given: Iterable[str], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            raise UnknownNameError(what, name, known)


def _variation(section: str, name: str, item: Any, *, varied: bool) -> Variation:
    """Return one item of a campaign file: of its part `vary`, or of `set` if not `varied`."""
    where = f"{section}.{name}"
    table = dict(item) if isinstance(item, Mapping) else {"values" if varied else "value": item}
    _check_names(f"key of {where}", table, _KEYS)
    relative = convert(bool, table.pop("relative", False), f"{where}.relative")
    found = Variation(section=section, name=name, law=_law(where, table), relative=relative)
    if found.varies != varied:
        right, least = ("set", "one value") if varied else ("vary", "several values")
        raise InputError(f"{where} has {least}: it belongs under [{right}.{section}]")
    return found


def _law(where: str, table: dict[str, Any]) -> Levels | Uniform | Normal:
    given = set(table)
    if given == {"value"}:
        return Levels((_value(where, table["value"]),))
    if given == {"values"}:
        items = table["values"] if isinstance(table["values"], list) else [table["values"]]
        return _levels(where, tuple(_value(where, item) for item in items))
    if {"low", "high"} <= given <= set(setting_names(_Between)):
        return from_plain(_Between, table, where).law(where)
    if given == {"mean", "std"}:
        law = from_plain(Normal, table, where)
        return Normal(float(law.mean), float(law.std))
    raise InputError(f"{where} is {shown(table)}; expected {', '.join(_FORMS)}")


def _levels(where: str, values: tuple[Value, ...]) -> Levels:
    if not values:
        raise InputError(f"{where} has no values")
    kinds = {bool: "true or false", str: "text", tuple: "lists"}
    mixed = {kinds.get(type(value), "numbers") for value in values}
    if len(mixed) > 1:
        raise InputError(f"{where} mixes {' and '.join(sorted(mixed))}: {shown(list(values))}")
    if len(set(values)) < len(values):
        raise InputError(f"{where} has a value twice: {shown(list(values))}")
    return Levels(values)


def _value(where: str, item: Any) -> Value:
    if isinstance(item, list):
        if not item:
            raise InputError(f"{where}: a list inside the list must hold numbers, got {item}")
        return tuple(float(one) for one in convert(tuple[float, ...], item, where))
    return item if isinstance(item, bool | str) else convert(bool | float | str, item, where)
