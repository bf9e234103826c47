"""The linear model of a control law about a steady flight: the law itself, differentiated."""

from collections.abc import Callable
from contextlib import suppress

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import ModelError
from helisim.base.linear import LinearSystem
from helisim.physics.gyro import Seen, cyclic_law, yaw_law
from helisim.physics.laws import Called
from helisim.physics.layout import CONTROL, FIRST_LAW_STATE, PARAM, ROTOR
from helisim.records.record import IN1, IN2, RATES
from helisim.vehicle.addresses import addresses
from helisim.vehicle.controller import SHIPPED, Controller
from helisim.vehicle.linearize import jacobian
from helisim.vehicle.swashplate import Swashplate
from helisim.vehicle.trim import Trim, collective_stick, place, steady_force

_TRIES = 20
_SETTLED = 1e-9  # unitised: greatest error of commands, and of a state's step


def linearize_law(controller: Controller, model: mujoco.MjModel, trim: Trim) -> LinearSystem:
    """Return a law's sampled linear model, what it sees to col, lon, lat, ped; or ModelError."""
    law = _Stepper(controller, model, trim)
    shipped = controller.is_shipped
    seen, state = (law.seen, law.state) if shipped else _settled(law, str(controller.name))
    inputs = [name for name in Seen._fields if name != "time"]
    swashplate, n = Swashplate.in_block(law.par), state.size

    def acted(at: NDArray[np.float64]) -> NDArray[np.float64]:
        after = at[:n].copy()
        *swash, tail = law(seen._replace(**dict(zip(inputs, at[n:].tolist()))), after)
        return np.array([*after, *swashplate.unmix(*swash), tail])

    slopes = jacobian(acted, np.array([*state, *(getattr(seen, name) for name in inputs)]))
    always = (*RATES, *IN2)
    kept = [k for k, name in enumerate(inputs) if name in always or slopes[:, n + k].any()]
    a, b = slopes[:, :n], slopes[:, [n + k for k in kept]]
    period, names = float(law.par[PARAM.gyro_period]), tuple(inputs[k] for k in kept)
    return LinearSystem(a[:n], b[:n], a[n:], b[n:], period, names, IN1, controller.state_names)


def trimmed_sticks(controller: Controller, model: mujoco.MjModel, trim: Trim) -> tuple[float, ...]:
    """Return COL, LON, LAT, PED, unitised, that hold a steady flight; if none do, the gyro's."""
    if controller.laws:
        with suppress(ModelError):
            seen, _ = _settled(_Stepper(controller, model, trim), str(controller.name))
            return tuple(getattr(seen, stick) for stick in IN2)
    return collective_stick(model, trim), 0.0, 0.0, 0.0


class _Stepper:
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
        split = controller.state_counts[0]
        parts = {
            "all": (slice(None), slice(4)),
            "swash": (slice(split), slice(3)),
            "tail": (slice(split, None), slice(3, 4)),
        }
        own = [(Called(law), *parts[law.place]) for law in controller.laws]
        self._parts: list[tuple[Callable[..., list[float]], slice, slice]] = [*own]
        shipped = {"swash": self._cyclic, "tail": self._yaw}
        for name, law in shipped.items() if controller.law is None else ():
            if getattr(controller, name) == SHIPPED:
                self._parts.append((law, *parts[name]))
        if controller.laws:
            self(self.seen, self.state, starts=True)

    def __call__(
        self, seen: Seen, state: NDArray[np.float64], *, starts: bool = False
    ) -> list[float]:
        """Return the commands of the four servos; the state, (n_state,), moves on."""
        commands = self.commands.tolist()
        for law, states, servos in self._parts:
            commands[servos] = law(seen, state[states], starts=starts)[servos]
        return commands

    def _cyclic(self, seen: Seen, state: NDArray[np.float64], **_: bool) -> list[float]:
        return [*cyclic_law(seen, state, self.par), 0.0]

    def _yaw(self, seen: Seen, state: NDArray[np.float64], **_: bool) -> list[float]:
        return [0.0, 0.0, 0.0, yaw_law(seen, state, self.par)]


def _settled(law: _Stepper, name: str) -> tuple[Seen, NDArray[np.float64]]:
    n = law.state.size
    at = np.array([*law.state, *(getattr(law.seen, stick) for stick in IN2)], dtype=np.float64)

    def seen(at: NDArray[np.float64]) -> Seen:
        return law.seen._replace(**dict(zip(IN2, at[n:].tolist())))

    def off(at: NDArray[np.float64]) -> NDArray[np.float64]:
        after = at[:n].copy()
        given = law(seen(at), after)  # which moves the state on
        return np.array([*(after - at[:n]), *(np.array(given) - law.commands)])

    for _ in range(_TRIES):
        left = off(at)
        if not np.max(np.abs(left)) >= _SETTLED:  # or it is no number
            break
        at = at + np.linalg.lstsq(jacobian(off, at), -left, rcond=1e-9)[0]
    wrong = off(at)[n:]
    if not np.max(np.abs(wrong)) < 1e3 * _SETTLED:
        raise ModelError(
            f"controller {name!r} can't hold this flight with any state and sticks: its commands "
            f"of front, left, right and tail stay off by {', '.join(f'{one:.2g}' for one in wrong)}"
        )
    return seen(at), at[:n]
