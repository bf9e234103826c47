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
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from os import PathLike
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.display import Displayed
from helisim.base.errors import InputError
from helisim.base.files import atomic_write, read_toml
from helisim.base.settings import (
    check,
    from_plain,
    in_brief,
    setting,
    setting_names,
    to_plain,
    toml_text,
)
from helisim.physics.layout import PARAM
from helisim.records.record import FlightRecord
from helisim.sim.excitation import Excitation, check_excitation
from helisim.sim.faults import Fault, FlightFault, check_faults, parse_fault
from helisim.sim.ground import Ground
from helisim.sim.limits import FlightEnvelope
from helisim.sim.manoeuvres import Manoeuvre
from helisim.sim.missions.mission import Mission, check_mission
from helisim.sim.recorder import Recorder
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.trim import collective_stick

_AIR = 0.9  # m of air under a helicopter that hovers to be watched: a sweep sinks by up to 0.8 m


def hover_height(model: mujoco.MjModel) -> float:
    """Return how high a helicopter hovers to be seen, m; half its extent hangs below."""
    return _AIR + 0.5 * model.stat.extent


@dataclass(frozen=True, kw_only=True)
class Pilot:
    """A pilot who holds the hover at the place where the flight starts.

    Attributes:
        remnant: its level: rms of the stick movement that no purpose explains, unitised, each
            axis.
        remnant_interval: s between its knots; it is flat up to about 1/interval rad/s.
    """

    remnant: float = setting(0.003, low=0.0, high=0.5)
    remnant_interval: float = setting(0.1, unit="s", above=0.0)

    def __post_init__(self) -> None:
        check(self)

    def write(
        self, par: NDArray[np.float64], vehicle: Vehicle, *, seed: int, height: float
    ) -> None:
        """Put the pilot into a vehicle's parameters (n_param,) for the force laws."""
        par[PARAM.pilot_on] = 1.0
        par[PARAM.pilot_north : PARAM.pilot_psi + 1] = [0.0, 0.0, -height, 0.0]
        par[PARAM.pilot_phi], par[PARAM.pilot_theta] = vehicle.trim.phi, vehicle.trim.theta
        par[PARAM.pilot_col] = collective_stick(vehicle.model, vehicle.trim)
        par[PARAM.pilot_lon : PARAM.pilot_ped + 1] = 0.0
        par[PARAM.pilot_seed] = seed
        par[PARAM.remnant_col : PARAM.remnant_ped + 1] = self.remnant
        par[PARAM.remnant_interval] = self.remnant_interval


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
        envelope: limits beyond which a flight is terminated early.
        faults: of servos, gyro and recorder, in each flight; a recorder's, in this order.

    Raises:
        InputError: a part is of another kind, or a fault can't be in this flight.
    """

    excitation: Excitation | None = setting(None, unsaid=True)
    mission: Mission | None = setting(None, unsaid=True)
    pilot: Pilot = field(default_factory=Pilot)
    recorder: Recorder | None = None
    weather: Weather = field(default_factory=Weather)
    ground: Ground | None = setting(None, unsaid=True)
    envelope: FlightEnvelope = field(default_factory=FlightEnvelope)
    faults: tuple[Fault, ...] = ()

    def __post_init__(self) -> None:
        if self.excitation is not None or self.mission is None:
            check_excitation(self.excitation)
        if self.mission is not None:
            check_mission(self.mission)
            if self.ground is None:
                object.__setattr__(self, "ground", self.mission.ground)
        object.__setattr__(self, "faults", tuple(self.faults))
        check_faults(self.faults, self.duration)
        check(self, "plan")

    def __repr__(self) -> str:
        return in_brief(self)

    @property
    def name(self) -> str:
        """What its records are named after: the mission, the excitation's axis, or both."""
        named = [] if self.mission is None else [self.mission.name]
        return "_".join(named if self.excitation is None else [*named, self.excitation.axis])

    @property
    def duration(self) -> float:
        """The longest that a flight of it lasts, s."""
        flown = self.mission or self.excitation
        assert flown is not None
        return flown.duration

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

    def to_dict(self, *, toml: bool = False) -> dict[str, Any]:
        """Return the plan as data of JSON or TOML, of which `from_dict` makes an equal plan.

        Raises:
            InputError: the manoeuvre is a function, which `on` samples first.
        """
        if not self.written:
            raise InputError(
                "a function of time can't be written down: the plan's on(vehicle) samples it"
            )
        return to_plain(self, toml=toml)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "FlightPlan":
        """Return the plan that plain data describe, of `to_dict` or a plan file.

        Raises:
            InputError: there is no excitation, or something isn't known or can't be.
        """
        given = dict(data)
        flown = given.get("excitation") is not None or given.get("mission") is not None
        if not flown and set(given) <= set(setting_names(cls)):
            raise InputError(
                'a flight plan needs an excitation, such as excitation = {kind = "Sweep", '
                'axis = "lat"}, or a mission, such as mission = {kind = "Forward"}'
            )
        if isinstance(recorder := given.get("recorder"), Mapping) and "latency" not in recorder:
            given["recorder"] = {**recorder, "latency": None}  # the vehicle's own
        if isinstance(faults := given.get("faults"), list | tuple):
            given["faults"] = [parse_fault(o) if isinstance(o, str) else o for o in faults]
        return from_plain(cls, given, "plan")

    @classmethod
    def of_record(cls, record: FlightRecord) -> "FlightPlan":
        """Return the plan that a record was flown by, as its provenance has it.

        Raises:
            InputError: it wasn't flown by helisim, or its plan can't be flown any more.
        """
        kept = dict(record.provenance)
        if "excitation" not in kept and "mission" not in kept:
            raise InputError("the record's provenance has no flight plan: helisim didn't fly it")
        if "watch" in kept:  # of records that name no plan_digest
            kept["envelope"] = kept.pop("watch")
        plan = {name: kept[name] for name in setting_names(cls) if name in kept}
        if "weather" in plan:
            plan["weather"] = {k: v for k, v in plan["weather"].items() if k != "dryden"}
        return cls.from_dict(plan)

    def to_toml(self) -> str:
        """Return the plan as the text of a plan file; errors as for `to_dict`."""
        tables = self.to_dict(toml=True)
        return toml_text(tables if self.faults else {**tables, "faults": None})

    def in_words(self) -> tuple[tuple[str, str], ...]:
        """Return each part's name, and the part in brief: its settings that aren't the defaults."""
        parts = {one.name: getattr(self, one.name) for one in fields(self)}
        faults = "; ".join(map(in_brief, parts.pop("faults"))) or "none"
        said = [(name, in_brief(part)) for name, part in parts.items() if part is not None]
        own = [("recorder", "the vehicle's own")] if self.recorder is None else []
        return (*said, *own, ("faults", faults))

    def __str__(self) -> str:
        lines = [f"  {name:<12}{words}" for name, words in self.in_words()]
        title = f"flight plan {self.digest[:8]}" if self.written else "flight plan"
        return "\n".join([title, *lines])


Flyable = FlightPlan | Excitation | Mission | Callable[[float], Any]
"""What can be flown: a plan, a bare manoeuvre or mission, or a bare function of time."""


def as_plan(flown: Flyable) -> FlightPlan:
    """Return a plan as it is, and a bare manoeuvre or mission as a plan with all else default.

    A function of time in s gives what is added to the four sticks COL, LON, LAT and PED, for
    10 s; `Manoeuvre` says which and for how long.
    """
    if isinstance(flown, FlightPlan):
        return flown
    if isinstance(flown, Mission):
        return FlightPlan(mission=flown)
    if not isinstance(flown, Excitation) and callable(flown) and not isinstance(flown, type):
        flown = Manoeuvre(flown)
    return FlightPlan(excitation=flown)  # pyright: ignore[reportArgumentType]


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


def _as_floats(data: Any) -> Any:
    """Return data whose numbers are all floats, as equal numbers have to look alike."""
    if isinstance(data, dict):
        return {key: _as_floats(value) for key, value in data.items()}
    if isinstance(data, list):
        return list(map(_as_floats, data))
    return float(data) if isinstance(data, int) and not isinstance(data, bool) else data
