"""The plan of a campaign, as its file says it: what varies, what is flown and identified."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import read_toml
from helisim.records.channels import AXES
from helisim.study.campaign.design import Design, Point, points
from helisim.study.campaign.settings import SECTIONS, Change, Settings
from helisim.study.campaign.variation import Variation, is_variation, parse
from helisim.study.models import KNOWN_MODELS, MODELS, ModelSpec
from helisim.vehicle.assembly import Integrator
from helisim.vehicle.folder import is_shipped, model_folder

Method = Literal["designed", "direct", "joint"]
"""How responses are estimated: as the experiment's models say, or all by one method."""

Seeds = Literal["own", "common"]
"""Whether replicates of different points have seeds of their own, or the same."""

_DEFAULT = tuple(model.name for model in MODELS)
_CHOICE = (*MODELS, *KNOWN_MODELS)
MODEL_NAMES = tuple(model.name for model in _CHOICE)
"""The experiment's models, and those with known servos."""


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
        points: how many points are drawn; None for a grid.
        replicates: of each point.
        seed: of the draws and of the first replicate.
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
    points: int | None = None
    replicates: int = 1
    seed: int = 1
    seeds: Seeds = "own"
    models: tuple[str, ...] = _DEFAULT
    sweeps: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    methods: tuple[Method, ...] = ("designed",)
    flights: int = 10
    identified_after: tuple[int, ...] = ()
    settings: tuple[Variation, ...] = field(default_factory=tuple)

    def __post_init__(self) -> None:
        folder = model_folder(self.vehicle)
        object.__setattr__(self, "vehicle", folder.name if is_shipped(folder) else str(folder))
        for name, least in (("replicates", 1), ("seed", 0), ("flights", 1)):
            _check_integer(name, getattr(self, name), least)
        if self.points is not None:
            _check_integer("points", self.points, 1)
        _check_choice("design", self.design, get_args(Design))
        _check_choice("integrator", self.integrator, get_args(Integrator))
        _check_choice("seeds", self.seeds, get_args(Seeds))
        _check_list("models", self.models, MODEL_NAMES)
        for name, axes in _table("campaign.sweeps", self.sweeps).items():
            _check_choice("model of campaign.sweeps", name, self.models)
            _check_list(f"campaign.sweeps.{name}", axes, AXES)
        _check_list("methods", self.methods, get_args(Method))
        if self.identified_after == ():
            object.__setattr__(self, "identified_after", (self.flights,))
        _check_list("identified_after", self.identified_after, range(1, self.flights + 1))
        _check_given(self.chosen)
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
        return Replicate(
            number, point, seed, values, Settings(str(self.vehicle), changes, self.integrator)
        )

    @cached_property
    def design_points(self) -> list[Point]:
        """The points, each the values of what varies."""
        return points(self.design, self.varied, self.points, self.seed)

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
        plan = asdict(self)
        plan["vehicle"] = Path(self.vehicle).name  # a path is this machine's
        if not self.sweeps:
            del plan["sweeps"]  # as in the datasets of earlier versions, which are gone on with
        return plan


def read_campaign(path: str | Path) -> Campaign:
    """Read a campaign file (TOML).

    Raises:
        StorageError: the file can't be read, or isn't TOML.
        InputError: something in it isn't known or can't be; the message names the file.
    """
    content = read_toml(path)
    if not content:
        raise InputError(f"{path}: is empty; a campaign has a table [campaign], [set] or [vary]")
    try:
        return campaign_from(content, beside=Path(path).parent)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def campaign_from(content: Mapping[str, Any], *, beside: Path | None = None) -> Campaign:
    """Return the campaign that the content of a campaign file describes.

    Args:
        content: of the file.
        beside: the file's folder, from which a vehicle's path counts; the present one if None.

    Raises:
        InputError: something in it isn't known or can't be.
    """
    _check_names("section", content, ("campaign", "set", "vary"))
    plan = _table("campaign", content.get("campaign", {}))
    _check_names("key of [campaign]", plan, _KEYS)
    settings = [
        parse(section, name, item, varied=part == "vary")
        for part in ("set", "vary")
        for section, table in _sections(part, content.get(part, {}))
        for name, item in _flat(table)
    ]
    keys = [one.key for one in settings]
    for key in keys:
        if keys.count(key) > 1:
            raise InputError(f"{key} is both set and varied")
    given: dict[str, Any] = {key: _frozen(item) for key, item in plan.items()}
    if "vehicle" in given:
        if not isinstance(given["vehicle"], str):
            raise InputError(f"vehicle must be a name or a path, got {given['vehicle']!r}")
        given["vehicle"] = str(model_folder(given["vehicle"], beside=beside))
    return Campaign(**given, settings=tuple(settings))


def _frozen(item: Any) -> Any:
    """Return lists as tuples, inside tables too."""
    if isinstance(item, Mapping):
        return {key: _frozen(inner) for key, inner in item.items()}
    return tuple(item) if isinstance(item, list) else item


_KEYS = tuple(one.name for one in fields(Campaign) if one.name != "settings")


def _sections(part: str, item: Any) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for section, table in _table(part, item).items():
        if section not in SECTIONS:
            raise UnknownNameError(f"section of [{part}]", section, SECTIONS)
        yield section, _table(f"{part}.{section}", table)


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield names and items, names dotted, whether TOML nested them or quoted the dots."""
    for key, item in table.items():
        if is_variation(item):
            yield prefix + key, item
        else:
            yield from _flat(item, f"{prefix}{key}.")


def _table(name: str, item: Any) -> Mapping[str, Any]:
    if not isinstance(item, Mapping):
        raise InputError(f"{name} must be a section, [{name}], got {item!r}")
    return item


def _check_names(what: str, given: Mapping[str, Any], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            raise UnknownNameError(what, name, known)


def _check_integer(name: str, number: Any, least: int) -> None:
    if not isinstance(number, int) or isinstance(number, bool) or number < least:
        raise InputError(f"{name} must be an integer of {least} or more, got {number!r}")


def _check_choice(name: str, value: Any, known: Sequence[Any]) -> None:
    if value not in known:
        raise UnknownNameError(name, value, map(str, known))


def _check_list(name: str, values: Any, known: Sequence[Any]) -> None:
    if not isinstance(values, tuple) or not values:
        raise InputError(f"{name} must be a list with one item or more, got {values!r}")
    for value in values:
        _check_choice(name, value, known)
    if len(set(values)) < len(values):
        raise InputError(f"{name} names something twice: {', '.join(map(str, values))}")


def _check_given(models: Sequence[ModelSpec]) -> None:
    """Refuse a model whose given values come from a model that isn't identified."""
    names = [model.name for model in models]
    for model in models:
        for given in model.given.values():
            if given.source in MODEL_NAMES and given.source not in names:
                raise InputError(f"{model.name} takes values from {given.source}: add it to models")
