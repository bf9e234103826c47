"""The exact linearisation of a vehicle at its trim: the truth that identification must find."""

import copy
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, fields
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.display import Displayed, shower
from helisim.base.errors import ModelError
from helisim.base.linear import LinearSystem
from helisim.physics.layout import CONTROL, PARAM, ROTOR, STATE, StateIndex
from helisim.physics.native import installed
from helisim.records.record import ACCELERATIONS, ATTITUDES, IN1, RATES, VELOCITIES
from helisim.vehicle.swashplate import Swashplate
from helisim.vehicle.trim import (
    Motion,
    Trim,
    addresses,
    motion_rates,
    place,
    specific_force,
    write_motion,
)

if TYPE_CHECKING:
    from helisim.base.display import Axes, Figure

MOTION = tuple(field.name for field in fields(Motion))
RIGID_BODY = ("u", "v", "w", "p", "q", "r", "phi", "theta")
"""States that flight mechanics' derivatives are of."""
PLACE = ("psi", "north", "east", "down")
"""States that change no force in still air far from the ground."""
OUTPUTS = RATES + ATTITUDES + VELOCITIES + ACCELERATIONS
_OPTIONAL = {
    "main_dynamic_inflow": ("inflow_0", "inflow_s", "inflow_c"),
    "drive_governor": ("speed", "engine", "governor"),
}
"""States that there are where a force law has them: its number, not 0."""
_STEP = 1e-5
"""Central difference: truncation of order 1e-10 beside rounding of order 1e-11, in SI."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Linearization(LinearSystem, Displayed):
    """A linear model x' = A x + B u, y = C x + D u about a steady flight, its delays beside it.

    Attributes:
        trim: the flight it belongs to.
    """

    trim: Trim

    def derivative(self, rate: str, cause: str) -> float:
        """Return d(rate of a state)/d(state or input) by name, such as ("r", "r") for N_r."""
        row = self.states.index(rate)
        if cause in self.states:
            return float(self.a[row, self.states.index(cause)])
        return float(self.b[row, self.inputs.index(cause)])

    def plot(
        self,
        pairs: "Sequence[str] | str | None" = None,
        *,
        axes: "Sequence[Axes] | None" = None,
    ) -> "Figure":
        """Draw magnitude and phase from 0.1 to 100 rad/s, delays included.

        Args:
            pairs: such as ("p/lat", "q/lon"); by default what each
                control is for: w/col, q/lon, p/lat, r/ped.
            axes: to draw on, one a panel, pair by pair; by default those of a new figure.

        Returns:
            A matplotlib figure, which a notebook shows; nothing is kept of it.

        Raises:
            UnknownNameError: no such response.
            InputError: there are more or fewer axes than panels.
        """
        return shower().plot_linearization(self, pairs, axes)

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
        """Return six degrees of freedom: u, v, w, p, q, r, phi, theta, as textbooks print them.

        Servos, disc and inflow follow at once, so the derivatives are quasi-static: those of
        flight mechanics, such as `derivative("q", "u")` for M_u. Holds well below the rotor's
        modes. Heading and height stay.

        Raises:
            InputError: the model is sampled or has other states.
        """
        return self.residualised(RIGID_BODY, without=PLACE)


def linearize(model: mujoco.MjModel, trim: Trim) -> Linearization:
    """Linearise the base helicopter by central differences of its continuous dynamics.

    From the servos' commands (IN1) to the motion, no control law acting.

    Args:
        model: compiled without delays.
        trim: its steady flight, usually the hover.

    Raises:
        ModelError: the derivatives aren't finite.
    """
    dynamics = _Dynamics(model, trim)
    point = np.zeros(dynamics.size)
    with installed():
        columns = [
            (dynamics(point + _STEP * unit) - dynamics(point - _STEP * unit)) / (2.0 * _STEP)
            for unit in np.eye(dynamics.size)
        ]
    jacobian = np.column_stack(columns)
    if not np.all(np.isfinite(jacobian)):
        raise ModelError(
            "the linearisation isn't finite: a parameter, such as a servo's frequency, is out of "
            "all proportion"
        )
    n = len(dynamics.states)
    return Linearization(
        jacobian[:n, :n],
        jacobian[:n, n:],
        jacobian[n:, :n],
        jacobian[n:, n:],
        None,
        IN1,
        (*OUTPUTS, *IN1),
        dynamics.states,
        name="IN1_to_OUT",
        trim=trim,
    )


def driven_states(par: NDArray[np.float64]) -> tuple[str, ...]:
    """Return the states of servos and rotor that a vehicle's parameters, (n_param,), let move."""
    off = [
        name
        for law, names in _OPTIONAL.items()
        if par[getattr(PARAM, law)] == 0.0
        for name in names
    ]
    return tuple(name for name in StateIndex._fields[: STATE.air_u] if name not in off)


def plain_rotor(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a model whose rotor speed is kept, as published structures know it.

    A steady flight is the same. The model itself is returned where it is so already.
    """
    rotor = addresses(model).rotor
    if not model.actuator_user[rotor, PARAM.drive_governor]:
        return model
    plain = copy.copy(model)
    plain.actuator_user[rotor, PARAM.drive_governor] = 0.0
    return plain


class _Dynamics:
    """Deviations of states and inputs from the trim -> rates of the states, and outputs."""

    def __init__(self, model: mujoco.MjModel, trim: Trim) -> None:
        self.model = copy.copy(model)
        self.where = addresses(self.model)
        self.model.actuator_user[self.where.rotor, PARAM.gyro_on] = 0.0
        self.model.actuator_user[self.where.rotor, PARAM.pilot_on] = 0.0
        self.plate = Swashplate.in_block(self.model.actuator_user[self.where.rotor])
        driven = driven_states(self.model.actuator_user[self.where.rotor])
        self.states = (*MOTION, *driven)
        self.driven = np.array([self.where.state + getattr(STATE, name) for name in driven])
        self.size = len(self.states) + len(IN1)
        self.data = mujoco.MjData(self.model)
        place(self.model, self.data, trim)
        self.act = self.data.act.copy()
        self.ctrl = self.data.ctrl.copy()
        self.motion = np.array(astuple(trim.motion))

    def __call__(self, deviation: NDArray[np.float64]) -> NDArray[np.float64]:
        n_motion, n = len(MOTION), len(self.states)
        motion = Motion(*(self.motion + deviation[:n_motion]))
        write_motion(self.model, self.data, motion)
        self.data.act[:] = self.act
        self.data.act[self.driven] += deviation[n_motion:n]
        self._command(deviation[n:])
        mujoco.mj_forward(self.model, self.data)
        rates = self.data.act_dot[self.driven]
        felt = specific_force(self.data, self.model, motion)
        seen = [getattr(motion, name) for name in OUTPUTS[:-3]]
        control = self.data.ctrl[self.where.control : self.where.control + ROTOR]
        *swashplate, tail = control[CONTROL.servo_front :]
        asked = [*self.plate.unmix(*swashplate), tail]
        return np.concatenate([motion_rates(self.data, motion), rates, seen, felt, asked])

    def _command(self, deviation: NDArray[np.float64]) -> None:
        control = self.data.ctrl[self.where.control : self.where.control + ROTOR + 1]
        control[:] = self.ctrl[self.where.control : self.where.control + ROTOR + 1]
        col, lon, lat, ped = deviation
        control[CONTROL.servo_front : CONTROL.servo_tail] += self.plate.mix(col, lon, lat)
        control[CONTROL.servo_tail] += ped


def stability_derivatives(base: Linearization, swashplate: Swashplate) -> dict[str, float]:
    """Return the derivatives of the base helicopter by their names in the field.

    Those of Wu and Chen's equations (1), (8) and (10), and those that their structures leave
    out; control derivatives are per unit of servo position. SI. Where the inflow has states they
    are what is left once it has followed, as those structures have none.

    Args:
        base: a linearisation with inputs IN1, of a `plain_rotor`.
        swashplate: of the vehicle, for the derivatives by what its servos do together.
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
    }


def _swash_derivatives(base: Linearization, plate: Swashplate, rate: str) -> dict[str, float]:
    servos = ("front_position", "left_position", "right_position")
    by_servo = np.array([base.derivative(rate, name) for name in servos])
    return {
        name: float(by_servo @ plate.mix(*unit))
        for name, unit in zip(("col", "lon", "lat"), np.eye(3))
    }
