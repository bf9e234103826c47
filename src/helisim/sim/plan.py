"""The flight plan: all that a flight is flown with, as one value.

A plan file is TOML; every key but the excitation, or a mission, is optional:

    [excitation]
    kind = "Sweep"
    axis = "lat"
    duration = 90.0

    [weather]
    wind = 4.0
    turbulence = "light"

    [ground]
    slope = 0.1

    [envelope]
    tilt = 0.8
    descent = "off"

    [[faults]]
    kind = "ServoWeak"
    servo = "servo_tail"
    at = 30.0
    rate_limit = 1.0

Faults may stand as on the command line too: `faults = ["servo_tail:weak@30,rate_limit=1"]`.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from functools import cached_property
from os import PathLike
from typing import Any

from helisim.base.display import Displayed
from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import atomic_write, read_toml
from helisim.records.record import FlightRecord
from helisim.sim.envelope import FlightEnvelope
from helisim.sim.excitation import EXCITATIONS, Excitation, check_excitation
from helisim.sim.faults import FAULTS, Fault, FlightFault, check_faults, parse_fault
from helisim.sim.ground import Ground
from helisim.sim.manoeuvres.history import Manoeuvre
from helisim.sim.missions.mission import MISSIONS, Mission, check_mission
from helisim.sim.pilot import Pilot
from helisim.sim.plain import (
    from_plain,
    in_brief,
    of_kind,
    to_plain,
    toml_settings,
    toml_text,
    with_kind,
)
from helisim.sim.recorder import Recorder
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class FlightPlan(Displayed):
    """All that a flight is flown with, beside the vehicle and the seed.

    Plans are values: equal plans are one in a set, and have one `digest`.

    Attributes:
        excitation: what is flown on purpose, such as a `Sweep`; None where a mission is flown, or
            what is flown on top of it, from its start.
        mission: a flight by a script, such as `missions.Forward()`, in place of holding the hover.
        pilot: who flies.
        recorder: the flight computer; the vehicle's own if None.
        weather: that is flown through; each flight has its own turbulence.
        ground: to land on; None: the flight is in the air alone.
        faults: of servos, gyro and recorder, in each flight; a recorder's, in this order.
        envelope: limits beyond which a flight is terminated early.

    Raises:
        InputError: a part is of another kind, or a fault can't be in this flight.
    """

    excitation: Excitation | None = None
    mission: Mission | None = None
    pilot: Pilot = field(default_factory=Pilot)
    recorder: Recorder | None = None
    weather: Weather = field(default_factory=Weather)
    ground: Ground | None = None
    faults: tuple[Fault, ...] = ()
    envelope: FlightEnvelope = field(default_factory=FlightEnvelope)

    def __post_init__(self) -> None:
        if self.excitation is not None or self.mission is None:
            check_excitation(self.excitation)
        if self.mission is not None:
            check_mission(self.mission)
            if self.ground is None:
                object.__setattr__(self, "ground", self.mission.ground)
        for name, kind in _PARTS.items():
            part = getattr(self, name)
            if not isinstance(part, kind) and not (name in _OPTIONAL and part is None):
                raise InputError(f"{name} must be a {kind.__name__}, got {part!r}")
        object.__setattr__(self, "faults", tuple(self.faults))
        check_faults(self.faults, self.duration)

    def __repr__(self) -> str:
        return in_brief(self)

    @property
    def name(self) -> str:
        """What its records are named after: the mission, the excitation's axis, or both."""
        named = [one.name for one in (self.mission,) if one is not None]
        return "_".join(named + [one.axis for one in (self.excitation,) if one is not None])

    @property
    def duration(self) -> float:
        """The longest that a flight of it lasts, s."""
        if self.mission is not None:
            return self.mission.duration
        assert self.excitation is not None
        return self.excitation.duration

    @property
    def written(self) -> bool:
        """Whether its settings are plain data, which a file can hold."""
        return self.excitation is None or self.excitation.written

    @property
    def flight_faults(self) -> tuple[FlightFault, ...]:
        """The faults of servos and gyro, without the recorder's."""
        return tuple(fault for fault in self.faults if isinstance(fault, FlightFault))

    @cached_property
    def digest(self) -> str:
        """Digest of every setting: equal plans have one, and hardly two others the same."""
        text = json.dumps(_as_floats(self.to_dict()), sort_keys=True)
        return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()

    def on(self, vehicle: Vehicle) -> "FlightPlan":
        """Return the plan with what is left open filled in by a vehicle's own parameters."""
        recorder = Recorder.of(vehicle) if self.recorder is None else self.recorder.on(vehicle)
        excitation = self.excitation
        complete = None if excitation is None else excitation.on(vehicle.parameters)
        return replace(self, excitation=complete, recorder=recorder)

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as JSON data, of which `from_dict` makes an equal plan.

        Raises:
            InputError: the manoeuvre is a function, which `on` samples first.
        """
        self._check_written()
        return {
            **{name: with_kind(one) for name, one in self._flown().items()},
            **{name: to_plain(getattr(self, name)) for name in self._said()},
            "faults": [with_kind(fault) for fault in self.faults],
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "FlightPlan":
        """Return the plan that plain data describe, of `to_dict` or a plan file.

        Raises:
            InputError: there is no excitation, or something isn't known or can't be.
        """
        for name in data:
            if name not in _KEYS:
                raise UnknownNameError("key of a flight plan", name, _KEYS)
        if not any(data.get(name) is not None for name in _FLOWN):
            raise InputError(
                'a flight plan needs an excitation, such as excitation = {kind = "Sweep", '
                'axis = "lat"}, or a mission, such as mission = {kind = "Forward"}'
            )
        flown: dict[str, Any] = {
            name: of_kind(data[name], kinds, name)
            for name, kinds in _FLOWN.items()
            if data.get(name) is not None
        }
        given: dict[str, Any] = {
            name: from_plain(kind, data[name], name)
            for name, kind in _PARTS.items()
            if data.get(name) is not None
        }
        recorder = data.get("recorder")
        if recorder is not None and "latency" not in recorder:
            given["recorder"] = replace(given["recorder"], latency=None)
        faults = data.get("faults", ())
        if isinstance(faults, str) or not isinstance(faults, list | tuple):
            raise InputError(f"faults must be a list, got {faults!r}")
        return cls(
            **flown,
            faults=tuple(
                parse_fault(one) if isinstance(one, str) else of_kind(one, FAULTS, "fault")
                for one in faults
            ),
            **given,
        )

    @classmethod
    def of_record(cls, record: FlightRecord) -> "FlightPlan":
        """Return the plan that a record was flown by, as its provenance has it.

        Raises:
            InputError: it wasn't flown by helisim, or its plan can't be flown any more.
        """
        kept = dict(record.provenance)
        if not any(name in kept for name in _FLOWN):
            raise InputError("the record's provenance has no flight plan: helisim didn't fly it")
        if "watch" in kept:  # of records that name no plan_digest
            kept["envelope"] = kept.pop("watch")
        plan = {name: kept[name] for name in _KEYS if name in kept}
        if "weather" in plan:
            plan["weather"] = {k: v for k, v in plan["weather"].items() if k != "dryden"}
        return cls.from_dict(plan)

    def to_toml(self) -> str:
        """Return the plan as the text of a plan file; errors as for `to_dict`."""
        self._check_written()
        tables: dict[str, Any] = {
            name: with_kind(one, toml_settings) for name, one in self._flown().items()
        }
        for name in self._said():
            part = getattr(self, name)
            if part is not None:
                tables[name] = toml_settings(part)
        if self.faults:
            tables["faults"] = [with_kind(fault, toml_settings) for fault in self.faults]
        return toml_text(tables)

    def _said(self) -> Iterator[str]:
        """Yield the names of the parts that plain data have: no ground is not spoken of."""
        return (name for name in _PARTS if name != "ground" or self.ground is not None)

    def _flown(self) -> dict[str, Excitation | Mission]:
        """Return what is flown on purpose, excitation and mission, as far as there are any."""
        both = {"excitation": self.excitation, "mission": self.mission}
        return {name: one for name, one in both.items() if one is not None}

    def _check_written(self) -> None:
        if not self.written:
            raise InputError(
                "a function of time can't be written down: the plan's on(vehicle) samples it"
            )

    def in_words(self) -> tuple[tuple[str, str], ...]:
        """Return each part's name, and its settings that aren't the defaults, in words."""
        return (
            *((name, _in_words(one)) for name, one in self._flown().items()),
            *((name, _in_words(getattr(self, name))) for name in self._said()),
            ("faults", "; ".join(map(_in_words, self.faults)) or "none"),
        )

    def __str__(self) -> str:
        lines = [f"  {name:<12}{words}" for name, words in self.in_words()]
        title = f"flight plan {self.digest[:8]}" if self.written else "flight plan"
        return "\n".join([title, *lines])


_PARTS: dict[str, type] = {
    "pilot": Pilot,
    "recorder": Recorder,
    "weather": Weather,
    "ground": Ground,
    "envelope": FlightEnvelope,
}
_FLOWN: dict[str, dict[str, Any]] = {"excitation": EXCITATIONS, "mission": MISSIONS}
_KEYS = (*_FLOWN, *_PARTS, "faults")
_OPTIONAL = ("recorder", "ground")


_LONGEST_WORD = 60
"""Characters of a setting in words: packed samples have thousands."""

Flyable = FlightPlan | Excitation | Mission | Callable[[float], Any]
"""What can be flown: a plan, a bare manoeuvre or mission, or a bare function of time."""


def as_plan(flown: Flyable) -> FlightPlan:
    """Return a plan as it is, and a bare manoeuvre or mission as a plan with all else default.

    A function of time in s gives what is added to the four sticks COL, LON, LAT and PED, for
    10 s; `Manoeuvre` says which and for how long.
    """
    if isinstance(flown, FlightPlan):
        return flown
    if isinstance(flown, Excitation):
        return FlightPlan(excitation=flown)
    if isinstance(flown, Mission):
        return FlightPlan(mission=flown)
    if not callable(flown) or isinstance(flown, type):
        check_excitation(flown)
    return FlightPlan(excitation=Manoeuvre(flown))


def read_plan(path: str | PathLike[str]) -> FlightPlan:
    """Read a plan file (TOML); see `helisim.sim.plan` for one.

    Raises:
        StorageError: the file can't be read, or isn't TOML.
        InputError: something in it isn't known or can't be; the message names the file.
    """
    content = read_toml(path)
    try:
        return FlightPlan.from_dict(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def write_plan(plan: FlightPlan, path: str | PathLike[str]) -> None:
    """Write a plan as TOML, from which `read_plan` reads an equal one. Raises StorageError."""
    with atomic_write(path) as temporary:
        temporary.write_text(plan.to_toml(), encoding="utf-8")


def _in_words(part: Any) -> str:
    """Return the settings of a part that aren't its defaults, in one line."""
    if part is None:
        return "the vehicle's own"
    changed = [
        f"{one.name} {_value_in_words(to_plain(getattr(part, one.name)))}"
        for one in fields(part)
        if getattr(part, one.name) != _default(one)
    ]
    kind = "" if type(part) in _PARTS.values() else type(part).__name__
    return ": ".join(filter(None, (kind, ", ".join(changed)))) or "as by default"


def _default(one: Field[Any]) -> Any:
    return one.default if one.default_factory is MISSING else one.default_factory()


def _value_in_words(value: Any) -> str:
    if isinstance(value, dict):
        inner = ", ".join(
            f"{key} {_value_in_words(one)}" for key, one in value.items() if one is not None
        )
        return f"({inner})"
    if isinstance(value, list):
        return f"({', '.join(map(_value_in_words, value))})"
    text = f"{value:g}" if isinstance(value, float) else getattr(value, "__name__", str(value))
    return text if len(text) <= _LONGEST_WORD else f"{text[: _LONGEST_WORD - 3]}..."


def _as_floats(data: Any) -> Any:
    """Return data whose numbers are all floats, as equal numbers have to look alike."""
    if isinstance(data, dict):
        return {key: _as_floats(value) for key, value in data.items()}
    if isinstance(data, list):
        return list(map(_as_floats, data))
    return float(data) if isinstance(data, int) and not isinstance(data, bool) else data
