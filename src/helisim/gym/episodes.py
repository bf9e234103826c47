"""An episode of one helicopter: how actions reach it, its spread parameters, its start."""

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError, InputError, UnknownNameError
from helisim.base.settings import is_number
from helisim.gym.settings import Setup
from helisim.physics.layout import CONTROL, HISTORY, INJECTION, PARAM, STATE
from helisim.physics.motion import flip
from helisim.sim import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.assembly import force_law_block, total_inertia
from helisim.vehicle.parameters import Parameters
from helisim.vehicle.swashplate import changed
from helisim.vehicle.trim import Motion, addresses, place, root_body, write_motion

_STICK_LIMIT = 0.5
"""Of a stick, unitised: half its travel to each side."""


class Action(NamedTuple):
    """What one number of an action moves: to centre + authority * action, within the limit.

    Attributes:
        name: of the stick or servo.
        centre: where it stands in the trim, unitised.
        authority: by how much an action of 1 moves it, unitised.
        limit: beyond which it doesn't go to either side, unitised.
    """

    name: str
    centre: float
    authority: float
    limit: float


class Agent:
    """How actions reach the vehicle.

    Sticks travel through `mjData.userdata`, as a manoeuvre's do, and a pilot that holds nothing
    moves them at the gyro's ticks; servos that the controller leaves alone stay in the trim. Servo
    commands are the servos' controls.

    Attributes:
        actions: what each of the four numbers of an action moves.
        spec: of MuJoCo's user inputs, those that `controls` are.
    """

    def __init__(self, setup: Setup, vehicle: Vehicle) -> None:
        self._sticks = setup.action == "sticks"
        self._steps = setup.frame_skip
        model, data = vehicle.model, vehicle.hovering()
        where = addresses(model)
        self._rotor = where.rotor
        resting = data.ctrl if not self._sticks else np.zeros(model.nuserdata)
        self._controller = vehicle.controller
        servos = where.control + CONTROL.servo_front
        self._servos = data.ctrl[servos : servos + 4].tolist()
        first = where.control + (CONTROL.col if self._sticks else CONTROL.servo_front)
        limit = _STICK_LIMIT if self._sticks else vehicle.parameters["servo.travel"]
        trim = data.ctrl[first : first + 4].tolist()
        self.actions = tuple(
            Action(name, centre, setup.authority, limit)
            for name, centre in zip(_names(model, first), trim)
        )
        spec = mujoco.mjtState.mjSTATE_USERDATA if self._sticks else mujoco.mjtState.mjSTATE_CTRL
        self.spec = int(spec)
        self._resting = resting.copy()
        place = INJECTION.stick_col if self._sticks else first
        self._moved = slice(place, place + 4)
        self._centre, self._limit = np.array(trim)[:, None], limit
        self._authority = setup.authority

    def write(self, model: mujoco.MjModel) -> None:
        """Let the agent fly a model of the vehicle."""
        par = model.actuator_user[self._rotor]
        if not self._sticks:
            return
        self._controller.plan_for(par, self._servos)
        par[PARAM.pilot_on], par[PARAM.excitation] = 1.0, HISTORY
        par[PARAM.pilot_col : PARAM.pilot_k_heading + 1] = 0.0  # holds nothing, from no trim

    def controls(self, count: int) -> NDArray[np.float64]:
        """Return inputs of so many helicopters in the trim, (count, n_step, n_input)."""
        return np.tile(self._resting, (count, self._steps, 1))

    def give(self, controls: NDArray[np.float64], actions: NDArray[np.float64]) -> None:
        """Write actions, (4, n), into each step of a frame's inputs, (n, n_step, n_input)."""
        moved = self._centre + self._authority * actions
        np.minimum(moved, self._limit, out=moved)
        np.maximum(moved, -self._limit, out=moved)
        controls[:, :, self._moved] = moved.T[:, None, :]


def _names(model: mujoco.MjModel, first: int) -> list[str]:
    actuators = model.actuator_ctrladr.tolist()
    return [model.actuator(actuators.index(first + k)).name for k in range(4)]


MASS = "airframe.mass"
INERTIAS = ("airframe.ixx", "airframe.iyy", "airframe.izz")
_BUILT_IN = ("gyro.period",)
"""Reaches the force laws, but the model's ticks were built with it."""

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
}
"""Relative spreads that a policy should bear before it meets another helicopter."""


class Spread:
    """How far each parameter is spread about the vehicle's own, and how to put it in a model.

    Args:
        vehicle: whose parameters are spread.
        relative: parameter -> half the width of its range, relative: 0.1 draws factors from 0.9
            to 1.1, all as likely. "airframe.mass" is one too.

    Raises:
        UnknownNameError: no such parameter.
        InputError: one that doesn't act in flight, is 0, or a spread that isn't in [0, 1).
    """

    def __init__(self, vehicle: Vehicle, relative: Mapping[str, float]) -> None:
        own = vehicle.parameters
        self.names = tuple(relative)
        for name, width in relative.items():
            _check(own, name, width)
        self._own, self._own_block = own, force_law_block(own)
        self._in_block = [name for name in self.names if name not in (MASS, *INERTIAS)]
        self._widths = np.array([float(relative[name]) for name in self.names])
        model = vehicle.model
        self._rotor = addresses(model).rotor
        self._body = root_body(model)
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
        if self._in_block:
            user = model.actuator_user[self._rotor]
            spread = {name: self._own[name] * factor[name] for name in self._in_block}
            block = force_law_block(changed(self._own, spread))
            differs = np.flatnonzero(block != self._own_block)
            user[differs] = block[differs]
        if len(self._in_block) < len(self.names):
            self._write_body(model, factor)

    def _write_body(self, model: mujoco.MjModel, factor: Mapping[str, float]) -> None:
        model.body_mass[:] = self._mass * factor.get(MASS, 1.0)
        grown = [factor.get(name, 1.0) - 1.0 for name in INERTIAS]
        inertia = (self._inertia + np.diag(self._total * grown)).ravel()
        mujoco.mju_eig3(
            model.body_inertia[self._body], self._frame, model.body_iquat[self._body], inertia
        )
        model.body_sameframe[self._body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        mujoco.mj_setConst(model, self._scratch)


def _check(own: Parameters, name: str, width: float) -> None:
    if name != MASS and name not in own:
        raise UnknownNameError("parameter", name, sorted([*own, MASS]))
    if not (isinstance(width, (int, float)) and 0.0 <= width < 1.0):
        raise InputError(f"spread of {name!r} must be relative, from 0 to below 1, got {width!r}")
    if name in (MASS, *INERTIAS):
        return
    if own[name] == 0.0:
        raise InputError(f"{name!r} is 0, which no relative spread changes; leave it out")
    if not _acts(own, name):
        raise InputError(
            f"{name!r} can't be spread: an episode flies without it, or the model is built with "
            "it; give it to helisim.load(parameters=...) instead"
        )


def _acts(own: Parameters, name: str) -> bool:
    """Return whether a parameter reaches the force laws of a flight whose pilot is the agent."""
    if name in _BUILT_IN or name.startswith("pilot."):
        return False
    try:
        moved = force_law_block(changed(own, {name: 0.99 * own[name]}))
    except HelisimError:
        return False  # a choice among a few, of which nothing is near
    return bool(np.any(moved != force_law_block(own)))


_FIELDS = tuple(field.name for field in fields(Motion))


class EpisodeStart:
    """The starts of a setup's episodes.

    Attributes:
        height: m above the ground.
        state: MuJoCo's full physics state in the trim, (n_state,).
    """

    def __init__(self, setup: Setup, vehicle: Vehicle) -> None:
        self._weather, self._vehicle = setup.weather, vehicle
        model = vehicle.model
        self.height = setup.weather.height
        self._rotor = addresses(model).rotor
        first = addresses(model).state
        self._air = slice(first + STATE.air_u, first + STATE.air_r_lag + 1)
        self._data = mujoco.MjData(model)
        place(model, self._data, vehicle.trim, height=self.height)
        self._motion = replace(vehicle.trim.motion, down=-self.height)
        size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self.state = np.empty(size)
        self._read(self.state)
        near = setup.start
        self._reach = np.array(
            [near.velocity] * 3
            + [near.rate] * 3
            + [near.tilt] * 2
            + [near.heading]
            + [near.position] * 3
        )

    def draw(self, random: np.random.Generator) -> tuple[dict[str, float], Weather, int]:
        """Return how far a motion is from the trim, by name, the weather, and a seed for its air.

        Velocities are drawn in the earth's axes, of a helicopter that is nearly level.
        """
        offsets = self._reach * random.uniform(-1.0, 1.0, len(_FIELDS))
        seed = int(random.integers(2**31))
        weather = self._weather
        drawn = weather if isinstance(weather, Weather) else weather.draw(random)
        return dict(zip(_FIELDS, offsets.tolist())), drawn, seed

    def write_weather(self, model: mujoco.MjModel, weather: Weather, seed: int) -> None:
        """Put the weather into a model of the vehicle; its turbulence has this seed."""
        model.opt.wind[:] = flip(*weather.wind_to)
        weather.write(model.actuator_user[self._rotor], self._vehicle, seed=seed)

    def state_of(
        self, offsets: Mapping[str, float], weather: Weather, seed: int
    ) -> NDArray[np.float64]:
        """Return the full physics state of a start, (n_state,).

        Args:
            offsets: field of `Motion` -> how far it is from the trim's.
            weather: whose turbulence is under way.
            seed: of its first air.

        Raises:
            UnknownNameError: no such field.
            InputError: not a finite number.
        """
        for name, value in offsets.items():
            if name not in _FIELDS:
                raise UnknownNameError("field of a motion", name, _FIELDS)
            if not (is_number(value) and math.isfinite(value)):
                raise InputError(f"motion: {name} must be a finite number, got {value!r}")
        trim = self._motion
        motion = replace(
            trim, **{name: getattr(trim, name) + value for name, value in offsets.items()}
        )
        write_motion(self._vehicle.model, self._data, motion)
        calm = weather.dryden is None
        rough = 0.0 if calm else weather.start(self._vehicle, np.random.default_rng(seed))
        self._data.act[self._air] = rough
        state = np.empty_like(self.state)
        self._read(state)
        return state

    def _read(self, state: NDArray[np.float64]) -> None:
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        mujoco.mj_getState(self._vehicle.model, self._data, state, kind)
