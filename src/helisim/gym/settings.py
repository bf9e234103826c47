"""The settings of an environment, all that `gymnasium.make` takes, checked."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import Any, Literal

import numpy as np

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import check, setting, setting_names
from helisim.gym.task import Hover, Task, Track
from helisim.physics.memory import TICK_TOLERANCE
from helisim.sim import FlightEnvelope, Gust, Weather
from helisim.sim.flight import thread_count
from helisim.vehicle import Vehicle, load
from helisim.vehicle.assembly import Integrator


@dataclass(frozen=True, kw_only=True)
class WeatherRange:
    """The weathers of which each episode has one; every strength up to these is as likely.

    Attributes:
        wind: m/s, steady, from any direction.
        turbulence: m/s of wind at 20 ft above the ground, which makes it (see `Weather`).
        gust: m/s at its full strength, level, to any direction; it starts within the first
            `gust_within` seconds and rises in 0.5 to 2 s.
        gust_within: s.
        height: m above the ground, of the flight.
    """

    wind: float = setting(0.0, unit="m/s", low=0.0)
    turbulence: float = setting(0.0, unit="m/s", low=0.0)
    gust: float = setting(0.0, unit="m/s", low=0.0)
    gust_within: float = setting(8.0, unit="s", low=0.0)
    height: float = setting(20.0, unit="m", low=0.0)

    def __post_init__(self) -> None:
        check(self, "weather")
        Weather(turbulence=self.turbulence, height=self.height)  # which says if it can't be

    def draw(self, random: np.random.Generator) -> Weather:
        """Return one of the weathers."""
        wind, turbulence, gust, start, rise = random.uniform(size=5)
        wind_from, gust_to = random.uniform(-math.pi, math.pi, 2)
        blow = None
        if self.gust > 0.0:
            blow = Gust(
                north=gust * self.gust * math.cos(gust_to),
                east=gust * self.gust * math.sin(gust_to),
                start=start * self.gust_within,
                rise=0.5 + 1.5 * rise,
                hold=1.0,
            )
        return Weather(
            wind=wind * self.wind,
            wind_from=wind_from,
            turbulence=turbulence * self.turbulence,
            gust=blow,
            height=self.height,
        )


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

    position: float = setting(1.0, unit="m", low=0.0)
    velocity: float = setting(0.5, unit="m/s", low=0.0)
    tilt: float = setting(0.1, unit="rad", low=0.0)
    heading: float = setting(0.5, unit="rad", low=0.0)
    rate: float = setting(0.1, unit="rad/s", low=0.0)

    def __post_init__(self) -> None:
        check(self, "start")


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
    authority: float = setting(0.5, above=0.0, high=1.0)
    frame_skip: int = setting(10, low=1)
    integrator: Integrator | None = None
    timestep: float | None = None
    weather: Weather | WeatherRange = field(default_factory=Weather)
    spread: Mapping[str, float] = field(default_factory=dict)
    start: Start = field(default_factory=Start)
    envelope: FlightEnvelope = field(default_factory=FlightEnvelope)
    threads: int | None = None

    def __post_init__(self) -> None:
        check(self, "setting")
        if not isinstance(self.task, Task) and self.task not in TASKS:
            raise UnknownNameError("task", self.task, TASKS)
        thread_count(self.threads, "threads")

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> "Setup":
        """Return the setup that keywords describe.

        Raises:
            UnknownNameError: no such setting.
            InputError: a setting that can't be.
        """
        names = setting_names(cls)
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
