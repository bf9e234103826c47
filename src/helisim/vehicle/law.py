"""What a control law is about a steady flight: its linear model, and a pilot's gains on it."""

import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import ModelError
from helisim.base.linear import LinearSystem
from helisim.physics.gyro import Seen, cyclic_law, yaw_law
from helisim.physics.laws import Called
from helisim.physics.layout import CONTROL, FIRST_LAW_STATE, PARAM, ROTOR, STATE
from helisim.records.record import IN1, IN2, RATES
from helisim.vehicle.addresses import addresses
from helisim.vehicle.controller import GYRO, SHIPPED, Controller
from helisim.vehicle.linearize import Linearization, jacobian
from helisim.vehicle.swashplate import Swashplate
from helisim.vehicle.trim import Trim, collective_stick, place, steady_force

_TRIES, _SETTLED = 20, 1e-9  # unitised: greatest error of commands, and of a state's step


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
    return LinearSystem(
        a[:n],
        b[:n],
        a[n:],
        b[n:],
        period,
        names,
        IN1,
        STATE._fields[FIRST_LAW_STATE:] if shipped else tuple(f"law_{k}" for k in range(n)),
    )


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
        shipped: dict[str, Callable[..., list[float]]] = {
            "swash": lambda seen, state, **_: [*cyclic_law(seen, state, self.par), 0.0],
            "tail": lambda seen, state, **_: [0.0, 0.0, 0.0, yaw_law(seen, state, self.par)],
        }
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


MOTIONS = ("w", "theta", "phi", "psi")
"""The motion that each of the sticks COL, LON, LAT and PED holds, body axes."""
_CYCLIC = np.array([False, True, True, False])
_SLOWEST = 0.1  # rad/s, at which loops are compared at least
_SHARES = (1.0, 1e-3)  # of the attitude's feedback, tried in turn: all, and next to nothing
_ALIKE = 0.01  # of a gain: a law that asks for no more change is taken as the gyro
_GROWTH = 0.05  # 1/s, of motion with the pilot, at most: half of the slowest loop's crossover


def on_law(
    vehicle: Any, sticks: tuple[float, ...], velocity: float, position: float, height: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return gains of COL, LON, LAT and PED on the law that flies a `Vehicle`, (4,) each.

    The first are of the motion wanted, the second of the motion itself, unitised over `MOTIONS`,
    SI, as are `sticks` on the vehicle's own gyro. velocity: attitude wanted over m/s; position and
    height: velocity wanted over m, 1/s. Each stick's loop keeps its gain at its crossover, and the
    closed loop of the attitude that at the velocity's. Warns, and returns `sticks`, if the vehicle
    would diverge or the law can't be linearised.
    """
    if vehicle.controller.laws:
        try:
            return _scaled(vehicle, sticks, velocity, position, height)
        except ModelError as error:
            if not hasattr(error, "__notes__"):  # a law that raises ends the flight, which says so
                warnings.warn(
                    f"controller {vehicle.controller.name!r}: {error}; the pilot keeps the gains "
                    f"that suit the gyro of {vehicle.name}: change the law, or [pilot]",
                    stacklevel=3,
                )
    return np.array(sticks), np.array(sticks)


@lru_cache(maxsize=8)
def _scaled(
    vehicle: Any, sticks: tuple[float, ...], velocity: float, position: float, height: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    own, law = (one.linearize("IN2") for one in (vehicle.with_controller(GYRO), vehicle))
    par = vehicle.model.actuator_user[addresses(vehicle.model).rotor]
    given, grows = np.array(sticks), np.inf
    rates = [
        par[PARAM.gyro_q_per_lon],
        par[PARAM.gyro_p_per_lat],
        par[PARAM.gyro_k_delta] / par[PARAM.gyro_k_a],
    ]
    at = [
        height,
        *np.abs(rates * given[1:]),
        velocity * float(np.linalg.norm(vehicle.model.opt.gravity)),
    ]
    (before, wanted), (after, reached) = (_responses(one, at) for one in (own, law))
    after, reached = (np.where(a == 0.0, b, a) for a, b in ((after, before), (reached, wanted)))
    turned = after / before  # an attitude leads its rate by up to 90 deg
    sign = np.where(turned.real + turned.imag < 0.0, -1.0, 1.0)
    for share in _SHARES:
        back = sign * given / np.abs(turned) * np.where(_CYCLIC, share, 1.0)
        closes = given * wanted / (1.0 + given * wanted) * (1.0 + back * reached) / reached
        ahead, back = (
            np.where(np.isclose(one, given, _ALIKE, 0.0), given, one)
            for one in (np.where(_CYCLIC, sign * np.abs(closes), back), back)
        )
        grows = _growth(law, ahead, back, velocity, position, height)
        if grows < _GROWTH or np.array_equal(back, given):
            return ahead, back
    raise ModelError(f"with gains scaled to it the motion grows at {grows:.2g} 1/s")


def _responses(
    system: Linearization, at: list[float]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return `MOTIONS` over their sticks, level speed held, at a frequency each, and at the last.

    at: (5,) rad/s; returns (4,) each.
    """
    moves = ~np.isin(system.states, ("u", "v"))[:, None]
    held = replace(system, a=system.a * moves, b=system.b * moves).select(IN2, MOTIONS)
    found = held.response(np.maximum(at, _SLOWEST))[range(len(IN2)), range(len(IN2))]
    return np.diagonal(found), found[:, -1]


def _growth(
    system: Linearization,
    ahead: NDArray[np.float64],
    back: NDArray[np.float64],
    velocity: float,
    position: float,
    height: float,
) -> float:
    """Return the fastest growth of a motion with the pilot, 1/s."""
    closed = system.with_delays_as_states()
    names = (*MOTIONS, "down", "u", "north", "v", "east")
    gains = np.zeros((len(IN2), len(closed.a)))
    gains[[0, 1, 2, 3, 0, 1, 1, 2, 2], [closed.states.index(name) for name in names]] = [
        *-back,
        -height * ahead[0],
        *(ahead[[1, 1, 2, 2]] * velocity * [1.0, position, -1.0, -position]),
    ]
    return float(replace(closed, a=closed.a + closed.b @ gains).poles.real.max())
