"""The flight plan: all that a flight is flown with, as one value.

A plan file is TOML; every key but the excitation, or a mission, is optional:

    [excitation]
    kind = "Sweep"
    axis = "lat"

    [weather]
    wind = 4.0

    [envelope]
    descent = "off"

    [[faults]]
    kind = "ServoStuck"
    servo = "servo_tail"
    at = 30.0
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from os import PathLike
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.display import Displayed
from helisim.base.errors import InputError
from helisim.base.files import read_toml, write_text
from helisim.base.settings import (
    Brief,
    Checked,
    check,
    from_plain,
    in_brief,
    placed,
    setting,
    setting_names,
    to_plain,
    toml_text,
)
from helisim.physics.layout import PARAM, ROLL_ATTITUDE, ROLL_VELOCITY
from helisim.records.record import AXES, FlightRecord
from helisim.sim.excitation import Excitation, check_excitation
from helisim.sim.faults import Fault, check_faults
from helisim.sim.gains import on_law
from helisim.sim.ground import Ground
from helisim.sim.limits import FlightEnvelope
from helisim.sim.missions.mission import Mission, check_mission
from helisim.sim.recorder import Recorder
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import root_body, write_named
from helisim.vehicle.law import trimmed_sticks
from helisim.vehicle.slung import own_parts

_AIR = 0.9  # m of air under a helicopter that hovers to be watched: a sweep sinks by up to 0.8 m


def hover_height(model: mujoco.MjModel) -> float:
    """Return how high a helicopter hovers to be seen, m; half its extent is below, or its load."""
    below, root = 0.5 * model.stat.extent, root_body(model)
    if (hung := ~own_parts(model)).any():
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        below += float(data.xpos[root, 2] - data.xipos[hung, 2].min())
    return _AIR + below


@dataclass(frozen=True, kw_only=True)
class Pilot(Checked):
    """A pilot who holds the place of the start, with a remnant: small random stick movements.

    `remnant` is their rms at each stick, unitised. Their spectrum is flat up to about
    1/`remnant_interval` in rad/s, an interval in s.
    """

    remnant: float = setting(0.003, low=0.0, high=0.5)
    remnant_interval: float = setting(0.1, unit="s", above=0.0)

    def write(
        self, par: NDArray[np.float64], vehicle: Vehicle, *, seed: int, height: float
    ) -> None:
        """Put the pilot into a vehicle's parameters (n_param,) for the force laws."""
        attitude, velocity, position, heave, climb, heading = (
            float(one) for one in par[PARAM.pilot_k_attitude : PARAM.pilot_k_heading + 1]
        )
        ahead, back = on_law(
            vehicle, (-heave, attitude, attitude, heading), velocity, position, climb
        )
        tilts = velocity * (ahead / np.where(back, back, 1.0))
        par[ROLL_ATTITUDE], par[ROLL_VELOCITY] = (one[2] - one[1] for one in (back, tilts))
        write_named(
            par,
            pilot_on=1.0,
            pilot_north=(0.0, 0.0, -height, 0.0),
            pilot_phi=(vehicle.trim.phi, vehicle.trim.theta),
            pilot_col=trimmed_sticks(vehicle.controller, vehicle.model, vehicle.trim),
            pilot_k_attitude=(back[1], tilts[1]),
            pilot_k_heave=-back[0],
            pilot_k_heading=back[3],
            pilot_seed=seed,
            remnant_col=(self.remnant,) * len(AXES),
            remnant_interval=self.remnant_interval,
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class FlightPlan(Brief, Displayed):
    """All that a flight is flown with, beside the vehicle and the seed. Raises InputError.

    A mission replaces holding the hover. The recorder is the vehicle's own if None. Without a
    ground the flight is in the air alone, and ends at height 0. Faults of the recorder act on the
    record one after the other.
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
        check(self, "plan")
        check_faults(self.faults, self.duration)

    @property
    def name(self) -> str:
        """The name of its records: the mission, the excitation's axis, or both."""
        named = [] if self.mission is None else [self.mission.name]
        return "_".join(named if self.excitation is None else [*named, self.excitation.axis])

    @property
    def duration(self) -> float:
        """The longest that a flight of it lasts, s."""
        flown = self.mission or self.excitation
        assert flown is not None
        return flown.duration

    @cached_property
    def digest(self) -> str:
        """Digest of every setting: equal plans have one."""
        plain = json.loads(json.dumps(self.to_dict()), parse_int=float)  # 2 is 2.0
        text = json.dumps(plain, sort_keys=True)
        return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()

    def on(self, vehicle: Vehicle) -> "FlightPlan":
        """Return the plan with what is left open filled in by a vehicle's own parameters."""
        recorder = Recorder.of(vehicle) if self.recorder is None else self.recorder.on(vehicle)
        excitation = self.excitation
        complete = None if excitation is None else excitation.on(vehicle.parameters)
        return replace(self, excitation=complete, recorder=recorder)

    def to_dict(self, *, toml: bool = False) -> dict[str, Any]:
        """Return the plan as data of JSON or TOML, of which `from_dict` makes an equal plan."""
        return to_plain(self, toml=toml)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "FlightPlan":
        """Return the plan of `to_dict`'s data or a plan file's. Raises InputError."""
        given = dict(data)
        if isinstance(recorder := given.get("recorder"), Mapping) and "latency" not in recorder:
            given["recorder"] = {**recorder, "latency": None}  # the vehicle's own
        return from_plain(cls, given, "plan")

    @classmethod
    def of_record(cls, record: FlightRecord) -> "FlightPlan":
        """Return the plan in a record's provenance. Raises InputError: it can't be flown."""
        kept = dict(record.provenance)
        if "excitation" not in kept and "mission" not in kept:
            raise InputError("the record's provenance has no flight plan: helisim didn't fly it")
        return cls.from_dict({name: kept[name] for name in setting_names(cls) if name in kept})

    def to_toml(self) -> str:
        """Return the plan as the text of a plan file."""
        tables = self.to_dict(toml=True)
        return toml_text(tables if self.faults else {**tables, "faults": None})

    def __str__(self) -> str:
        """Return each part, and its settings that aren't the defaults."""
        parts = {one.name: getattr(self, one.name) for one in fields(self)}
        said = {name: in_brief(part) for name, part in parts.items() if part is not None}
        said["recorder"] = said.get("recorder", "the vehicle's own")
        said["faults"] = "; ".join(map(in_brief, self.faults)) or "none"
        lines = [f"  {name:<12}{words}" for name, words in said.items()]
        return "\n".join([f"flight plan {self.digest[:8]}", *lines])


Flyable = FlightPlan | Excitation | Mission


def as_plan(flown: Flyable) -> FlightPlan:
    """Return a plan as it is, a bare manoeuvre or mission as a plan with all else default."""
    if isinstance(flown, FlightPlan):
        return flown
    return FlightPlan(mission=flown) if isinstance(flown, Mission) else FlightPlan(excitation=flown)


def read_plan(path: str | PathLike[str]) -> FlightPlan:
    """Read a plan file (TOML); see `helisim.sim.plan`. Raises StorageError or InputError."""
    with placed(path):
        return FlightPlan.from_dict(read_toml(path))


def write_plan(plan: FlightPlan, path: str | PathLike[str]) -> None:
    """Write a plan as TOML, from which `read_plan` reads an equal one. Raises StorageError."""
    write_text(path, plan.to_toml())
