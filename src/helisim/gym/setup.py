"""The settings of an environment, all that `gymnasium.make` takes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError, InputError, check_known
from helisim.base.settings import Checked, check, is_number, setting, setting_names
from helisim.gym.task import Hover, Task, Track
from helisim.physics.layout import CONTROL, HISTORY, INJECTION, PARAM
from helisim.physics.memory import TICK_TOLERANCE
from helisim.sim import FlightEnvelope, Gust, Weather
from helisim.vehicle import Vehicle, load
from helisim.vehicle.addresses import addresses, root_body
from helisim.vehicle.assembly import force_law_block, total_inertia
from helisim.vehicle.parameters import Parameters
from helisim.vehicle.swashplate import changed
from helisim.vehicle.trim import Motion


@dataclass(frozen=True, kw_only=True)
class WeatherRange:
    """The weathers of which each episode has one, SI; every strength up to these is as likely.

    Wind and gust are level, in any direction; turbulence is the wind at 20 ft that makes it. A gust
    starts within `gust_within`, s, and rises in 0.5 to 2 s.
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
            gust=blow if self.gust > 0.0 else None,
            height=self.height,
        )


@dataclass(frozen=True, kw_only=True)
class Start(Checked):
    """How far from the trim an episode starts, SI; each number up to these is as likely.

    Position and velocity are each of north, east and down, tilt of roll and pitch.
    """

    position: float = setting(1.0, unit="m", low=0.0)
    velocity: float = setting(0.5, unit="m/s", low=0.0)
    tilt: float = setting(0.1, unit="rad", low=0.0)
    heading: float = setting(0.5, unit="rad", low=0.0)
    rate: float = setting(0.1, unit="rad/s", low=0.0)

    def draw(self, random: np.random.Generator) -> dict[str, float]:
        """Return distances from the trim by name; velocities in earth axes."""
        reach = np.repeat(
            [self.velocity, self.rate, self.tilt, self.heading, self.position], [3, 3, 2, 1, 3]
        )
        return dict(zip(FIELDS, (reach * random.uniform(-1.0, 1.0, len(FIELDS))).tolist()))


FIELDS = setting_names(Motion)
TASKS: Mapping[str, type[Hover] | type[Track]] = {"hover": Hover, "track": Track}


@dataclass(frozen=True, kw_only=True, eq=False)
class Setup:
    """The settings of an environment, keywords of `gymnasium.make`. Raises InputError.

    `task` is "hover", "track" or a `Task`. `action` is "sticks" (COL, LON, LAT, PED, to the
    vehicle's controller) or "servos" (front, left, right, tail, without it); an action of 1 moves
    one by `authority` from its trim, unitised. `frame_skip` is time steps between actions, 20 ms by
    default. `spread` is parameter -> relative half width, see `Spread`; `envelope` has limits that
    terminate an episode, but for `saturation`; `threads` step a vector environment, all processors
    if None. Pictures are drawn for the `render_mode` "rgb_array", of a width and height in pixels.
    """

    task: str | Task = "hover"
    vehicle: str | PathLike[str] | Vehicle = "jr700"
    action: Literal["sticks", "servos"] = "sticks"
    authority: float = setting(0.5, above=0.0, high=1.0)
    frame_skip: int = setting(10, low=1)
    weather: Weather | WeatherRange = field(default_factory=Weather)
    spread: Mapping[str, float] = field(default_factory=dict)
    start: Start = field(default_factory=Start)
    envelope: FlightEnvelope = field(default_factory=FlightEnvelope)
    threads: int | None = setting(None, low=1)
    render_mode: Literal["rgb_array"] | None = None
    width: int = setting(640, low=1)
    height: int = setting(480, low=1)

    def __post_init__(self) -> None:
        check(self, "setting")
        if not isinstance(self.task, Task):
            check_known("task", [self.task], TASKS)

    def loaded(self) -> Vehicle:
        """Return the vehicle, trimmed for the weather where that is always the same.

        Raises UnknownNameError, TrimError or InputError: a frame isn't whole gyro periods.
        """
        given = self.vehicle
        vehicle = given if isinstance(given, Vehicle) else load(given, integrator="Euler")
        step, period = vehicle.model.opt.timestep, vehicle.parameters["gyro.period"]
        periods = self.frame_skip * step / period
        if self.action == "servos":
            vehicle = vehicle.with_controller(None)
        elif abs(periods - round(periods)) > TICK_TOLERANCE:
            raise InputError(
                f"frame_skip must make whole periods of the gyro, {period:g} s, of steps of "
                f"{step:g} s: a multiple of {round(period / step)}, got {self.frame_skip}"
            )
        return self.weather.trimmed(vehicle) if isinstance(self.weather, Weather) else vehicle


class Agent:
    """How actions reach the vehicle: sticks through `mjData.userdata`, servos as controls.

    `spec` is of the user inputs that an agent moves, `resting`, (n_input,), these in the trim.
    """

    def __init__(self, setup: Setup, vehicle: Vehicle) -> None:
        self._sticks = setup.action == "sticks"
        where, trim = addresses(vehicle.model), vehicle.hovering().ctrl
        servos = where.control + CONTROL.servo_front
        first = where.control + CONTROL.col if self._sticks else servos
        self._rotor, self._controller = where.rotor, vehicle.controller
        self._servos = trim[servos : servos + 4].tolist()
        self._limit = 0.5 if self._sticks else vehicle.parameters["servo.travel"]
        kinds = mujoco.mjtState
        self.spec = int(kinds.mjSTATE_USERDATA if self._sticks else kinds.mjSTATE_CTRL)
        self.resting = np.zeros(vehicle.model.nuserdata) if self._sticks else trim.copy()
        place = INJECTION.stick_col if self._sticks else first
        self._moved = slice(place, place + 4)
        self._centre, self._authority = trim[first : first + 4, None].copy(), setup.authority

    def write(self, model: mujoco.MjModel) -> None:
        """Let the agent fly a model of the vehicle."""
        par = model.actuator_user[self._rotor]
        if self._sticks:
            self._controller.plan_for(par, self._servos)
            par[PARAM.pilot_on], par[PARAM.excitation] = 1.0, HISTORY
            par[PARAM.pilot_col : PARAM.pilot_k_heading + 1] = 0.0  # holds nothing, from no trim

    def give(self, controls: NDArray[np.float64], actions: NDArray[np.float64]) -> None:
        """Write actions, (4, n), into each step of a frame's inputs, (n, n_step, n_input)."""
        moved = np.clip(self._centre + self._authority * actions, -self._limit, self._limit)
        controls[:, :, self._moved] = moved.T[:, None, :]


MASS = "airframe.mass"
INERTIAS = ("airframe.ixx", "airframe.iyy", "airframe.izz")
BODY = (MASS, *INERTIAS)
USUAL: dict[str, float] = {
    MASS: 0.1,
    **dict.fromkeys(INERTIAS, 0.15),
    "air.density": 0.1,
    "main_rotor.speed": 0.03,
    "main_rotor.lift_slope": 0.1,
    "main_rotor.hub_stiffness": 0.2,
    "flapping.tau_f": 0.15,
    "tail_rotor.lift_slope": 0.15,
    "servo.swash_frequency": 0.2,
    "servo.tail_frequency": 0.2,
    "servo.rate_limit": 0.2,
    "gyro.kp_lat": 0.2,
    "gyro.kp_lon": 0.2,
    "gyro.k_p": 0.2,
}  # Relative spreads that a policy should bear before it meets another helicopter


class Spread:
    """Relative spreads of parameters, "airframe.mass" too: 0.1 draws 0.9 to 1.1, all as likely.

    Raises UnknownNameError, or InputError for one without effect in flight or not in [0, 1).
    """

    def __init__(self, vehicle: Vehicle, relative: Mapping[str, float]) -> None:
        own, model = vehicle.parameters, vehicle.model
        self.names = tuple(relative)
        check_known("parameter", self.names, sorted({*own, MASS}))
        for name, width in relative.items():
            if not (is_number(width) and 0.0 <= width < 1.0):
                raise InputError(
                    f"spread of {name!r} must be relative, from 0 to below 1, got {width!r}"
                )
            if not _acts(own, name):
                raise InputError(
                    f"{name!r} can't be spread: it is 0, an episode flies without it, or the model "
                    "is built with it; give it to helisim.load(parameters=...) instead"
                )
        self._own, self._own_block = own, force_law_block(own)
        self._in_block = [name for name in self.names if name not in BODY]
        self._widths = np.array([float(width) for width in relative.values()])
        self._rotor, self._body = addresses(model).rotor, root_body(model)
        self._mass = model.body_mass.copy()
        self._frame = np.empty(9)
        mujoco.mju_quat2Mat(self._frame, model.body_iquat[self._body])
        turn = self._frame.reshape(3, 3)
        self._inertia = turn @ np.diag(model.body_inertia[self._body]) @ turn.T
        self._total = np.diag(total_inertia(model, self._body)).copy()
        self._scratch = mujoco.MjData(model)

    def draw(self, random: np.random.Generator) -> NDArray[np.float64]:
        """Return a factor for each of `names`, (n_names,)."""
        return 1.0 + self._widths * random.uniform(-1.0, 1.0, len(self.names))

    def write(self, model: mujoco.MjModel, factors: NDArray[np.float64]) -> None:
        """Put factors, (n_names,), into a copy of the vehicle's model that is as it was loaded."""
        factor = dict(zip(self.names, factors.tolist()))
        spread = {name: self._own[name] * factor[name] for name in self._in_block}
        block = force_law_block(changed(self._own, spread))
        differs = np.flatnonzero(block != self._own_block)
        model.actuator_user[self._rotor][differs] = block[differs]
        if len(self._in_block) == len(self.names):
            return
        model.body_mass[:] = self._mass * factor.get(MASS, 1.0)
        grown = [factor.get(name, 1.0) - 1.0 for name in INERTIAS]
        inertia = (self._inertia + np.diag(self._total * grown)).ravel()
        mujoco.mju_eig3(
            model.body_inertia[self._body], self._frame, model.body_iquat[self._body], inertia
        )
        model.body_sameframe[self._body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        mujoco.mj_setConst(model, self._scratch)


def _acts(own: Parameters, name: str) -> bool:
    if name in BODY:
        return True
    if name == "gyro.period" or name.startswith("pilot."):
        return False  # ticks are built into the model
    try:
        moved = force_law_block(changed(own, {name: 0.99 * own[name]}))
    except HelisimError:
        return False  # a choice among a few, of which nothing is near
    return bool(np.any(moved != force_law_block(own)))
