"""What an environment is made of: every setting that `gymnasium.make` takes, checked."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from os import PathLike
from typing import Any, Literal, get_args

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import is_number
from helisim.gym.task import Hover, Task, Track
from helisim.gym.weather import WeatherRange
from helisim.physics.memory import TICK_TOLERANCE
from helisim.sim import FlightEnvelope, Weather
from helisim.sim.flight import thread_count
from helisim.vehicle import Vehicle, load
from helisim.vehicle.assembly import Integrator

ActionKind = Literal["sticks", "servos"]

TASKS: Mapping[str, type[Hover] | type[Track]] = {"hover": Hover, "track": Track}


@dataclass(frozen=True, kw_only=True)
class Start:
    """How far from the trim an episode starts; each number up to these is as likely.

    Attributes:
        position: m north, east and down.
        velocity: m/s north, east and down.
        tilt: rad of roll and of pitch.
        heading: rad.
        rate: rad/s about each axis.
    """

    position: float = 1.0
    velocity: float = 0.5
    tilt: float = 0.1
    heading: float = 0.5
    rate: float = 0.1

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (is_number(value) and 0.0 <= value < math.inf):
                raise InputError(f"start: {name} must be 0 or more, got {value!r}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Setup:
    """The settings of an environment; `gymnasium.make` takes each as a keyword.

    Attributes:
        task: "hover", "track", or a `Task` of your own.
        vehicle: a name, the path of a folder, or a `Vehicle` that is loaded.
        action: "sticks" moves COL, LON, LAT, PED, and the vehicle's controller, its
            gyro say, flies the servos; "servos" moves these: front, left, right and tail, and
            there is no controller.
        authority: by how much an action of 1 moves a stick or servo from its trim, unitised.
        frame_skip: time steps from one action to the next, 20 ms by default.
        integrator: "Euler", staggered to second order and the default here, or "RK4", three times
            as dear; the vehicle's own if one is given that is loaded.
        timestep: s, of the physics; the vehicle's own if None.
        weather: one `Weather` for every episode, or a `WeatherRange` that each draws from. The
            flight is at its height.
        spread: parameter -> relative half width of what each episode draws (see `Spread`).
        start: how far from the trim an episode starts.
        envelope: limits that terminate an episode: tilt, rate, clearance, flapping, descent and
            advance. Its `saturation` isn't watched: an agent may hold a stick at its stop.
        threads: that step a vector environment; all processors if None. No number depends on it.

    Raises:
        InputError: a setting that can't be.
    """

    task: str | Task = "hover"
    vehicle: str | PathLike[str] | Vehicle = "jr700"
    action: ActionKind = "sticks"
    authority: float = 0.5
    frame_skip: int = 10
    integrator: Integrator | None = None
    timestep: float | None = None
    weather: Weather | WeatherRange = field(default_factory=Weather)
    spread: Mapping[str, float] = field(default_factory=dict)
    start: Start = field(default_factory=Start)
    envelope: FlightEnvelope = field(default_factory=FlightEnvelope)
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.action not in get_args(ActionKind):
            raise UnknownNameError("action", self.action, get_args(ActionKind))
        if not (is_number(self.authority) and 0.0 < self.authority <= 1.0):
            raise InputError(f"authority must be above 0 and at most 1, got {self.authority!r}")
        if not isinstance(self.frame_skip, int) or self.frame_skip < 1:
            raise InputError(
                f"frame_skip must be a whole number of time steps, 1 or more, got {self.frame_skip}"
            )
        if not isinstance(self.task, Task) and self.task not in TASKS:
            raise UnknownNameError("task", self.task, TASKS)
        for name, kinds in _KINDS.items():
            if not isinstance(getattr(self, name), kinds):
                wanted = " or ".join(kind.__name__ for kind in kinds)
                raise InputError(f"{name} must be a {wanted}, got {getattr(self, name)!r}")
        thread_count(self.threads, "threads")

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> "Setup":
        """Return the setup that keywords describe.

        Raises:
            UnknownNameError: no such setting.
            InputError: a setting that can't be.
        """
        names = [one.name for one in fields(cls)]
        for name in settings:
            if name not in names:
                raise UnknownNameError("setting of the environment", name, names)
        return cls(**settings)

    @property
    def asked(self) -> Task:
        """The task."""
        return self.task if isinstance(self.task, Task) else TASKS[self.task]()

    def loaded(self) -> Vehicle:
        """Return the vehicle, trimmed for the weather where that is always the same.

        Where the agent moves the servos, it has no controller.

        Raises:
            UnknownNameError: no such vehicle.
            InputError: an integrator or time step for a vehicle that has its own, or a frame
                that isn't whole periods of the gyro.
            TrimError: it can't hover in the weather.
        """
        if not isinstance(self.vehicle, Vehicle):
            integrator = self.integrator or "Euler"
            vehicle = load(self.vehicle, timestep=self.timestep, integrator=integrator)
        elif self.integrator is not None or self.timestep is not None:
            raise InputError(
                "integrator and timestep belong to a vehicle that is loaded already: give them to "
                "helisim.load, or the vehicle's name to the environment"
            )
        else:
            vehicle = self.vehicle
        self._check_frame(vehicle)
        if self.action == "servos":
            vehicle = vehicle.with_controller(None)
        return self.weather.trimmed(vehicle) if isinstance(self.weather, Weather) else vehicle

    def _check_frame(self, vehicle: Vehicle) -> None:
        step, period = vehicle.model.opt.timestep, vehicle.parameters["gyro.period"]
        periods = self.frame_skip * step / period
        if self.action == "sticks" and abs(periods - round(periods)) > TICK_TOLERANCE:
            raise InputError(
                f"frame_skip must make whole periods of the gyro, {period:g} s, of steps of "
                f"{step:g} s: a multiple of {round(period / step)}, got {self.frame_skip}"
            )


_KINDS: Mapping[str, tuple[type, ...]] = {
    "weather": (Weather, WeatherRange),
    "spread": (Mapping,),
    "start": (Start,),
    "envelope": (FlightEnvelope,),
}
