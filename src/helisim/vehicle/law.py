"""The linear model of a control law about a steady flight: the law itself, differentiated."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import ModelError
from helisim.physics.gyro import CYCLIC, YAW, Seen, cyclic_law, yaw_law
from helisim.physics.laws import Called
from helisim.physics.layout import CONTROL, FIRST_LAW_STATE, PARAM, ROTOR
from helisim.records.record import IN1, IN2, RATES
from helisim.vehicle.controller import SHIPPED, Controller
from helisim.vehicle.swashplate import Swashplate
from helisim.vehicle.trim import Trim, addresses, place, steady_force

if TYPE_CHECKING:
    import control

_STEP = 1e-5
"""Central difference, unitised or SI, as of the base helicopter."""
_TRIES = 20
_SETTLED = 1e-9
"""By which commands may be off a trim's, unitised, and a state's step be more than rounding."""


def linearize_law(
    controller: Controller, model: mujoco.MjModel, trim: Trim
) -> "control.StateSpace":
    """Return the linear model of a controller in a steady flight, sampled at its ticks.

    controller: that moves at least one servo; model: of the vehicle, with it; trim: the steady
    flight.

    Returns:
        Discrete StateSpace from what the law sees to col, lon, lat and ped. What changes nothing
        is left out, but rates and sticks.

    Raises:
        ModelError: the law can't hold the flight.
    """
    import control  # which brings pyplot, that no flight needs

    law = _Stepper(controller, model, trim)
    seen, state = law.seen, law.state
    if not controller.is_shipped:
        seen, state = _settled(law, str(controller.name))
    inputs = [name for name in Seen._fields if name != "time"]
    swashplate, n = Swashplate.in_block(law.par), state.size

    def acted(at: NDArray[np.float64]) -> NDArray[np.float64]:
        after = at[:n].copy()
        *swash, tail = law(seen._replace(**dict(zip(inputs, at[n:].tolist()))), after)
        return np.array([*after, *swashplate.unmix(*swash), tail])

    jacobian = _jacobian(acted, np.array([*state, *(getattr(seen, name) for name in inputs)]))
    always = (*RATES, *IN2)
    kept = [k for k, name in enumerate(inputs) if name in always or jacobian[:, n + k].any()]
    jacobian = jacobian[:, [*range(n), *(n + k for k in kept)]]
    return control.StateSpace(
        jacobian[:n, :n],
        jacobian[:n, n:],
        jacobian[n:, :n],
        jacobian[n:, n:],
        float(law.par[PARAM.gyro_period]),
        states=list(controller.state_names),
        inputs=[inputs[k] for k in kept],
        outputs=list(IN1),
        name="gyro",
    )


class _Stepper:
    """A controller called from Python, in a steady flight."""

    def __init__(self, controller: Controller, model: mujoco.MjModel, trim: Trim) -> None:
        where, data = addresses(model), mujoco.MjData(model)
        place(model, data, trim)
        ctrl = data.ctrl[where.control : where.control + ROTOR]
        first = where.state + FIRST_LAW_STATE
        angles, felt = (trim.phi, trim.theta, 0.0), steady_force(model, trim)
        self.par = model.actuator_user[where.rotor].copy()
        self.commands = ctrl[CONTROL.servo_front :].copy()
        sticks = ctrl[: CONTROL.servo_front]
        self.seen = Seen(0.0, 0.0, 0.0, 0.0, *angles, *felt.tolist(), *self.commands, *sticks)
        self.state = data.act[first : first + sum(controller.state_counts)].copy()
        self._controller = controller
        self._own = {law.place: Called(law) for law in controller.laws}
        self._split = controller.state_counts[0]
        for at, law in self._own.items():
            law.start(self.seen, self.state[self._split :] if at == "tail" else self.state)

    def __call__(self, seen: Seen, state: NDArray[np.float64]) -> tuple[float, ...]:
        """Return the commands of the four servos; the state, (n_state,), moves on."""
        if "all" in self._own:
            return self._own["all"](seen, state)
        cyclic, yaw = state[: self._split], state[self._split :]
        swash, tail = tuple(self.commands[:3]), tuple(self.commands[3:])
        if "swash" in self._own:
            swash = self._own["swash"](seen, cyclic)
        elif self._controller.swash == SHIPPED:
            swash = cyclic_law(seen, cyclic[: len(CYCLIC)], self.par)
        if "tail" in self._own:
            tail = self._own["tail"](seen, yaw)
        elif self._controller.tail == SHIPPED:
            tail = (yaw_law(seen, yaw[: len(YAW)], self.par),)
        return (*swash, *tail)


def _settled(law: _Stepper, name: str) -> tuple[Seen, NDArray[np.float64]]:
    """Return what a law sees in a flight that it commands, and its state, (n_state,).

    The sticks are what it needs to command the flight, as near the middle as may be.
    """
    n = law.state.size
    sticks = [getattr(law.seen, stick) for stick in IN2]
    at = np.array([*law.state, *sticks], dtype=np.float64)

    def seen(at: NDArray[np.float64]) -> Seen:
        return law.seen._replace(**dict(zip(IN2, at[n:].tolist())))

    def off(at: NDArray[np.float64]) -> NDArray[np.float64]:
        after = at[:n].copy()
        given = law(seen(at), after)
        return np.array([*(after - at[:n]), *(np.array(given) - law.commands)])

    for _ in range(_TRIES):
        left = off(at)
        if np.max(np.abs(left)) < _SETTLED:
            break
        step = np.linalg.lstsq(_jacobian(off, at), -left, rcond=1e-9)[0]
        at = np.asarray(at + step, dtype=np.float64)
        if not np.all(np.isfinite(at)) or np.max(np.abs(step)) < _SETTLED:
            break
    wrong = off(at)[n:]
    if not np.max(np.abs(wrong)) < 1e3 * _SETTLED:
        raise ModelError(
            f"controller {name!r} can't hold this flight with any state and sticks: its commands "
            f"of front, left, right and tail stay off by {', '.join(f'{one:.2g}' for one in wrong)}"
        )
    return seen(at), at[:n]


def _jacobian(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]], at: NDArray[np.float64]
) -> NDArray[np.float64]:
    columns: Sequence[NDArray[np.float64]] = [
        (function(at + _STEP * unit) - function(at - _STEP * unit)) / (2.0 * _STEP)
        for unit in np.eye(at.size)
    ]
    return np.column_stack(columns)
