"""What an agent moves: the sticks before the gyro, or the servos behind it."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.gym.settings import Setup
from helisim.physics.layout import CONTROL, HISTORY, INJECTION, PARAM
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import addresses

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
