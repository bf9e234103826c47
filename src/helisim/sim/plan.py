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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from os import PathLike
from typing import Any, ClassVar

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
from helisim.physics.layout import NEVER, PARAM, ROLL_ATTITUDE, ROLL_VELOCITY
from helisim.records.record import AXES, SERVOS, FlightRecord
from helisim.sim.excitation import Excitation, check_excitation
from helisim.sim.ground import Ground
from helisim.sim.limits import FlightEnvelope
from helisim.sim.missions.mission import Mission, check_mission
from helisim.sim.recorder import Recorder
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import own_parts, root_body, write_named
from helisim.vehicle.law import on_law, trimmed_sticks


@dataclass(frozen=True, kw_only=True)
class ServoStuck(Checked):
    """A servo that runs to a position at a time, s, and sticks there; its commands go on.

    The position is unitised; None is where the servo is at that time.
    """

    servo: str = setting(choices=SERVOS)
    at: float = setting(unit="s", low=0.0)
    position: float | None = setting(None, low=-1.0, high=1.0)


@dataclass(frozen=True, kw_only=True)
class SampleLoss(Checked):
    """A recorder that now and then writes nothing.

    It loses a share of all samples, between 0 and 1, in bursts of so many in a row.
    """

    share: float = setting(above=0.0, below=1.0)
    burst: int = setting(1, low=1)

    at: ClassVar[float] = 0.0

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        # bursts may overlap: a sample stays if none of the `burst` places before it starts one
        starts = rng.random(len(record)) < 1.0 - (1.0 - self.share) ** (1.0 / self.burst)
        return _without(record, np.convolve(starts, np.ones(self.burst))[: len(record)] > 0.0)


@dataclass(frozen=True, kw_only=True)
class RecordGap(Checked):
    """A recorder that writes nothing from a time on, s, for as long as it `lasts`, s."""

    at: float = setting(unit="s", low=0.0)
    lasts: float = setting(unit="s", above=0.0)

    def apply(self, record: FlightRecord, _: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        return _without(record, (record.time >= self.at) & (record.time < self.at + self.lasts))


def _without(record: FlightRecord, lost: NDArray[np.bool_]) -> FlightRecord:
    if np.count_nonzero(~lost) < 2:
        raise InputError("the recorder loses every sample: lose less")
    return replace(record, time=record.time[~lost], values=record.values[~lost])


Fault = ServoStuck | SampleLoss | RecordGap
FAULTS = {kind.__name__: kind for kind in (ServoStuck, SampleLoss, RecordGap)}


def check_faults(faults: Sequence[Fault], duration: float) -> None:
    """Raise InputError unless all faults can come in one flight of that many seconds."""
    for fault in faults:
        if fault.at >= duration:
            raise InputError(
                f"{type(fault).__name__} at {fault.at:g} s: the flight is over at {duration:g} s"
            )
    servos = [fault.servo for fault in faults if isinstance(fault, ServoStuck)]
    for servo in servos:
        if servos.count(servo) > 1:
            raise InputError(f"{servo}: a flight has one fault of a servo, got several")


def write_faults(par: NDArray[np.float64], faults: Sequence[Fault]) -> None:
    """Put the servos' faults into a vehicle's parameters (n_param,) for the force laws."""
    stuck = [fault for fault in faults if isinstance(fault, ServoStuck)]
    par[PARAM.faults] = float(bool(stuck))
    par[PARAM.faults + 1 : PARAM.tail_fault_high + 1] = NEVER
    for one in stuck:
        first, at = PARAM.front_fault_at + 4 * SERVOS.index(one.servo), one.position
        limits = (0.0, -NEVER, NEVER) if at is None else (NEVER, at, at)
        par[first : first + 4] = one.at, *limits


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
        return hashlib.blake2b(
            json.dumps(plain, sort_keys=True).encode(), digest_size=16
        ).hexdigest()

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
