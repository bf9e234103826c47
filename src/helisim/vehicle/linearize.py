"""The exact linearisation of a vehicle at its trim: the truth that identification must find."""

import copy
from collections.abc import Callable
from dataclasses import asdict, astuple, dataclass, fields
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Real
from helisim.base.display import Displayed
from helisim.base.errors import ModelError
from helisim.base.linear import LinearSystem
from helisim.physics.drive import IDEAL, TURBINE
from helisim.physics.layout import CONTROL, PARAM, ROTOR, STATE, StateIndex
from helisim.physics.native import installed
from helisim.records.record import ACCELERATIONS, ATTITUDES, IN1, RATES, VELOCITIES
from helisim.vehicle.addresses import SLUNG, addresses, slung_dofs
from helisim.vehicle.swashplate import Swashplate
from helisim.vehicle.trim import (
    Motion,
    Trim,
    motion_rates,
    place,
    set_governor,
    specific_force,
    write_motion,
)

MOTION = tuple(field.name for field in fields(Motion))
RIGID_BODY = ("u", "v", "w", "p", "q", "r", "phi", "theta")
"""States that flight mechanics' derivatives are of."""
PLACE = ("psi", "north", "east", "down")  # no force in still air far from ground
OUTPUTS = RATES + ATTITUDES + VELOCITIES + ACCELERATIONS
_OPTIONAL = {  # states of optional force laws: the number, not 0
    "main_dynamic_inflow": ("inflow_0", "inflow_s", "inflow_c"),
    "drive_governor": ("speed", "engine", "governor"),
}
_HELD = ("discharge", "polarisation", "warming")  # the battery's are slow
_STEP = 1e-5  # central difference: truncation of 1e-10, rounding of 1e-11, SI


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Linearization(LinearSystem, Displayed):
    """A linear model x' = A x + B u, y = C x + D u, with delays, about the steady flight `trim`."""

    trim: Trim

    def derivative(self, rate: str, cause: str) -> float:
        """Return a derivative by names: of the rate of a state by a state or an input.

        An example is ("r", "r"), which is N_r. Raises ValueError if there is no such name.
        """
        row = self.states.index(rate)
        return (
            float(self.a[row, self.states.index(cause)])
            if cause in self.states
            else float(self.b[row, self.inputs.index(cause)])
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data: matrices, names, delays and the trim."""
        return {
            "name": self.name,
            "states": list(self.states),
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            **{name.upper(): getattr(self, name).tolist() for name in "abcd"},
            "delays_s": dict(self.delays),
            "trim": asdict(self.trim),
        }

    def rigid_body(self) -> "Linearization":
        """Return the model of u, v, w, p, q, r, phi, theta and a slung load's states alone.

        Servos, disc and inflow follow at once in it, so it holds well below their frequencies.
        Raises InputError if the model is sampled or lacks one of the states.
        """
        slung = (name for name in self.states if name.startswith(SLUNG))
        return self.residualised((*RIGID_BODY, *slung), without=PLACE)


def linearize(model: mujoco.MjModel, trim: Trim) -> Linearization:
    """Return the linear model of the helicopter from IN1, without a control law.

    Delays of sensors and sticks are not in it. Raises ModelError if a derivative isn't finite.
    """
    dynamics = _Dynamics(model, trim)
    with installed():
        slopes = jacobian(dynamics, np.zeros(dynamics.size))
    if not np.all(np.isfinite(slopes)):
        raise ModelError(
            "the linearisation isn't finite: a parameter, such as a servo's frequency, is out of "
            "all proportion"
        )
    n = len(dynamics.states)
    return Linearization(
        slopes[:n, :n],
        slopes[:n, n:],
        slopes[n:, :n],
        slopes[n:, n:],
        None,
        IN1,
        (*OUTPUTS, *IN1),
        dynamics.states,
        name="IN1_to_OUT",
        trim=trim,
    )


def jacobian(function: Callable[[Real], Real], at: Real) -> Real:
    """Return a function's central differences, (n_out, n_in), at a point, (n_in,)."""
    steps = _STEP * np.eye(at.size)
    return np.column_stack([(function(at + h) - function(at - h)) / (2.0 * _STEP) for h in steps])


def plain_rotor(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a model with constant rotor speed; itself if it has that already."""
    if not model.actuator_user[addresses(model).rotor, PARAM.drive_governor]:
        return model
    plain = copy.copy(model)
    set_governor(plain, IDEAL)
    return plain


def _dof_name(model: mujoco.MjModel, dof: int) -> str:
    joint = model.joint(model.dof_jntid[dof])
    many = joint.type[0] == mujoco.mjtJoint.mjJNT_BALL
    name = joint.name or f"{SLUNG}joint_{joint.id}"
    return f"{name}_{'xyz'[dof - joint.dofadr[0]]}" if many else name


class _Dynamics:
    def __init__(self, model: mujoco.MjModel, trim: Trim) -> None:
        self.model = copy.copy(model)
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4  # else rates are of a step
        self.where = addresses(self.model)
        par = self.model.actuator_user[self.where.rotor]
        par[PARAM.gyro_on] = par[PARAM.pilot_on] = 0.0
        self.plate = Swashplate.in_block(par)
        off = [n for law, names in _OPTIONAL.items() if not par[getattr(PARAM, law)] for n in names]
        turbine = par[PARAM.drive_governor] * par[PARAM.drive_engine] == TURBINE
        off += _HELD if turbine else ("fuel", *_HELD)
        driven = [name for name in StateIndex._fields[: STATE.air_u] if name not in off]
        self.slung = slung_dofs(self.model)
        hung = [_dof_name(self.model, dof) for dof in self.slung]
        self.states = (*MOTION, *driven, *hung, *(f"{name}_rate" for name in hung))
        self.driven = np.array([self.where.state + getattr(STATE, name) for name in driven])
        self.size = len(self.states) + len(IN1)
        self.data = mujoco.MjData(self.model)
        place(self.model, self.data, trim)
        self.act, self.ctrl = self.data.act.copy(), self.data.ctrl.copy()
        self.motion, self.rest = np.array(astuple(trim.motion)), self.data.qpos.copy()

    def __call__(self, deviation: NDArray[np.float64]) -> NDArray[np.float64]:
        n_motion, n = len(MOTION), len(self.states)
        motion = Motion(*(self.motion + deviation[:n_motion]))
        driven, hung = np.split(deviation[n_motion:n], [len(self.driven)])
        self.data.qpos[:], step = self.rest, np.zeros(self.model.nv)
        step[self.slung], self.data.qvel[self.slung] = np.split(hung, 2)
        mujoco.mj_integratePos(self.model, self.data.qpos, step, 1.0)
        write_motion(self.model, self.data, motion)
        self.data.act[:] = self.act
        self.data.act[self.driven] += driven
        *axes, ped = deviation[n:]
        control = self.data.ctrl[self.where.control : self.where.control + ROTOR + 1]
        control[:] = self.ctrl[self.where.control : self.where.control + ROTOR + 1]
        control[CONTROL.servo_front : CONTROL.servo_tail] += self.plate.mix(*axes)
        control[CONTROL.servo_tail] += ped
        mujoco.mj_forward(self.model, self.data)
        seen = [getattr(motion, name) for name in OUTPUTS[:-3]]
        felt = specific_force(self.data, self.model, motion)
        *swashplate, tail, _ = control[CONTROL.servo_front :]
        asked = [*self.plate.unmix(*swashplate), tail]
        rates = motion_rates(self.data, motion), self.data.act_dot[self.driven]
        swing = self.data.qvel[self.slung], self.data.qacc[self.slung]
        return np.concatenate([*rates, *swing, seen, felt, asked])


def stability_derivatives(base: Linearization, swashplate: Swashplate) -> dict[str, float]:
    """Return the derivatives of the base helicopter by name, SI; of controls, per servo position.

    Wu and Chen's equations (1), (8), (10), and more; inflow residualised; base: IN1, `plain_rotor`.
    """
    inflow = _OPTIONAL["main_dynamic_inflow"]
    base = base.residualised([name for name in base.states if name not in inflow])
    swash = {name: _swash_derivatives(base, swashplate, name) for name in ("w", "flap_a", "flap_b")}
    tau_a = -1.0 / base.derivative("flap_a", "flap_a")
    tau_b = -1.0 / base.derivative("flap_b", "flap_b")
    return {
        "N_r": base.derivative("r", "r"),
        "N_ped": base.derivative("r", "tail_position"),
        "N_v": base.derivative("r", "v"),
        "Y_v": base.derivative("v", "v"),
        "Y_ped": base.derivative("v", "tail_position"),
        "P_v": base.derivative("flap_b", "v"),
        "tau_f": tau_a,
        "L_b": base.derivative("p", "flap_b"),
        "M_a": base.derivative("q", "flap_a"),
        "A_b": tau_a * base.derivative("flap_a", "flap_b"),
        "B_a": tau_b * base.derivative("flap_b", "flap_a"),
        "A_lat": tau_a * swash["flap_a"]["lat"],
        "A_lon": tau_a * swash["flap_a"]["lon"],
        "B_lat": tau_b * swash["flap_b"]["lat"],
        "B_lon": tau_b * swash["flap_b"]["lon"],
        "Z_w": base.derivative("w", "w"),
        "Z_col": swash["w"]["col"],
        "X_u": base.derivative("u", "u"),
        "Q_u": base.derivative("flap_a", "u"),
        "Q_v": base.derivative("flap_a", "v"),
    }


def _swash_derivatives(base: Linearization, plate: Swashplate, rate: str) -> dict[str, float]:
    servos = ("front_position", "left_position", "right_position")
    by_servo = np.array([base.derivative(rate, name) for name in servos])
    return {
        name: float(by_servo @ plate.mix(*unit))
        for name, unit in zip(("col", "lon", "lat"), np.eye(3))
    }
