"""What a campaign can vary: the vehicle's parameters and the fields of the value objects."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import Any, TypeVar, cast, get_type_hints

from helisim.base.errors import HelisimError, InputError, UnknownNameError
from helisim.base.settings import convert, value_object
from helisim.records.channels import AXES
from helisim.sim import FlightEnvelope, FlightPlan, Pilot, Recorder, Sweep, Weather
from helisim.study.campaign.variation import Value
from helisim.vehicle import Vehicle, load, standard_parameters
from helisim.vehicle.assembly import Integrator
from helisim.vehicle.parameters import number_of, words_of

T = TypeVar("T")

OBJECTS: dict[str, type] = {
    "sweep": Sweep,
    "pilot": Pilot,
    "recorder": Recorder,
    "weather": Weather,
    "envelope": FlightEnvelope,
}
"""Section of a campaign file -> the value object whose fields it names."""

SECTIONS = ("vehicle", *OBJECTS)

_standard = cache(standard_parameters)
"""Parameters are read-only, and a campaign asks for them once a point."""

_GIVEN = {"sweep": ("axis",)}
"""Fields that the campaign itself chooses."""


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
        standard = _standard(self.vehicle)
        changed = {}
        for name, change in self._of("vehicle").items():
            old = standard[name]
            if words_of(name):
                changed[name] = number_of(name, change.value)
                continue
            convert(float, change.value, f"vehicle.{name}")
            changed[name] = _changed(f"vehicle.{name}", old, change)
        return changed

    def sweep(self, axis: str, parameters: Mapping[str, float]) -> Sweep:
        """Return the sweep of one axis; a setting such as "lat.amplitude" is of that axis only.

        What isn't set is the vehicle's own, of these parameters.
        """
        own = Sweep(axis=axis).on(parameters)
        general = {n: c for n, c in self._of("sweep").items() if n.partition(".")[0] not in AXES}
        special = {
            name.removeprefix(f"{axis}."): change
            for name, change in self._of("sweep").items()
            if name.startswith(f"{axis}.")
        }
        return applied("sweep", own, {**general, **special})

    def plan(self, axis: str, vehicle: Vehicle) -> FlightPlan:
        """Return the plan of a sweep of one axis, complete for the vehicle."""
        return FlightPlan(
            excitation=self.sweep(axis, vehicle.parameters),
            pilot=applied("pilot", Pilot(), self._of("pilot")),
            recorder=self.recorder(vehicle),
            weather=self.weather(),
            envelope=applied("envelope", FlightEnvelope(), self._of("envelope")),
        )

    def recorder(self, vehicle: Vehicle) -> Recorder:
        """Return the flight computer, with the vehicle's own latencies unless they are set."""
        return applied("recorder", Recorder.of(vehicle), self._of("recorder"))

    def weather(self) -> Weather:
        """Return the weather, calm unless it is set."""
        return applied("weather", Weather(), self._of("weather"))

    def check(self, axes: Iterable[str]) -> None:
        """Raise InputError if a name, type or value can't be, before anything is flown."""
        parameters = {**_standard(self.vehicle), **self.parameters()}
        for axis in (*axes, *AXES):  # those that are flown first, for the clearest message
            self.sweep(axis, parameters)
        for section, kind in OBJECTS.items():
            if section != "sweep":
                applied(section, kind(), self._of(section))

    def _of(self, section: str) -> Mapping[str, Change]:
        return self.changes.get(section, {})


def applied(section: str, plain: T, changes: Mapping[str, Change]) -> T:
    """Return a value object with some of its fields changed.

    Args:
        section: of the campaign file, for messages.
        plain: a dataclass instance.
        changes: by field; "noise.p" is the entry "p" of the mapping `noise`, "gust.down" the
            field `down` of the value object `gust`.

    Raises:
        UnknownNameError: no such field.
        InputError: a value is of the wrong type, or the object refuses it.
    """
    hints = get_type_hints(type(plain))
    names = [one.name for one in fields(plain) if one.name not in _GIVEN.get(section, ())]  # pyright: ignore[reportArgumentType]
    new: dict[str, Any] = {}
    for name, change in changes.items():
        top, _, key = name.partition(".")
        if top not in names:
            raise UnknownNameError(f"setting of {section}", name, names)
        where, old = f"{section}.{name}", new.get(top, getattr(plain, top))
        if isinstance(old, Mapping):
            new[top] = _in_mapping(where, old, key, change)
            continue
        inner = value_object(hints[top])
        if inner is not None:
            if not key:
                first = fields(inner)[0].name
                raise InputError(f"{where} has fields: name one, such as {where}.{first}")
            new[top] = applied(f"{section}.{top}", inner() if old is None else old, {key: change})
            continue
        if key:
            raise InputError(f"{where}: {section}.{top} has no parts")
        expected = float if change.relative else hints[top]
        convert(expected, change.value, where)
        new[top] = _changed(where, old, change)
    try:
        return replace(plain, **new)  # pyright: ignore[reportArgumentType, reportCallIssue]
    except HelisimError as error:
        raise InputError(f"[{section}] {error}") from None


def _in_mapping(where: str, old: Mapping[str, Any], key: str, change: Change) -> dict[str, Any]:
    convert(float, change.value, where)
    if key:
        return {**old, key: _changed(where, old.get(key, 0.0), change)}
    if change.relative:
        return {name: _changed(where, value, change) for name, value in old.items()}
    raise InputError(
        f"{where} is one number for each channel: name the channel, such as {where}.p, "
        "or say relative = true to multiply all"
    )


def _changed(where: str, old: Any, change: Change) -> Any:
    if not change.relative:
        return change.value
    factor = cast(float, change.value)  # checked before
    if isinstance(old, tuple):
        return tuple(factor * one for one in old)
    if isinstance(old, bool) or not isinstance(old, (int, float)):
        raise InputError(f"{where} is {old!r}, which can't be multiplied: drop relative")
    return factor * old
