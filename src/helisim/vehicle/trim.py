"""The steady state in the air: attitude and controls at which nothing accelerates."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from helisim.errors import TrimError
from helisim.physics import gyro, servo
from helisim.physics.layout import PARAM, ROTOR, STATE
from helisim.physics.native import installed
from helisim.vehicle.motion import Motion, addresses, write_motion

_RESIDUAL = 1e-9
"""Greatest acceleration left, m/s^2 and rad/s^2: far below any sensor, above rounding."""


@dataclass(frozen=True)
class Trim:
    """A hover: attitude (rad), controls of the base helicopter (unitised), tilt (rad)."""

    phi: float
    theta: float
    col: float
    lon: float
    lat: float
    ped: float
    a: float
    b: float


def find_hover(model: mujoco.MjModel) -> Trim:
    """Solve for the hover of a model by root finding on the nonlinear force laws.

    Raises:
        TrimError: no equilibrium within the controls' range.
    """
    data = mujoco.MjData(model)
    with installed():
        # about one, because the solver's differences are relative to the unknowns
        solution = root(
            lambda near_one: _imbalance(near_one - 1.0, model, data), np.ones(8), tol=1e-14
        )
    trim = Trim(*(float(value) for value in solution.x - 1.0))
    worst = float(np.max(np.abs(solution.fun)))
    if not worst < _RESIDUAL:
        raise TrimError(
            f"no hover found: {worst:.3g} m/s^2 or rad/s^2 is left with {trim}; "
            "check mass, rotor speed and lift slope"
        )
    controls = {"col": trim.col, "lon": trim.lon, "lat": trim.lat, "ped": trim.ped}
    controls["COL"] = collective_stick(model, trim)
    for name, value in controls.items():
        if abs(value) > 0.5:
            raise TrimError(
                f"the hover needs {name} = {value:.3f}, outside [-0.5, 0.5]; "
                "change pitch_trim, pitch_range or gyro.pitch_rate"
            )
    return trim


def _imbalance(
    unknown: NDArray[np.float64], model: mujoco.MjModel, data: mujoco.MjData
) -> NDArray[np.float64]:
    place(model, data, Trim(*unknown))
    mujoco.mj_forward(model, data)
    first = addresses(model).state
    tilt = data.act_dot[first + STATE.flap_a : first + STATE.flap_b + 1]
    return np.concatenate([data.qacc[:6], tilt])


def place(model: mujoco.MjModel, data: mujoco.MjData, trim: Trim, *, height: float = 10.0) -> None:
    """Set a vehicle's state and controls to a hover, its gyro settled, all sticks centred.

    Args:
        model: of the vehicle.
        data: written; time and histories are reset.
        trim: the hover.
        height: m above the ground.
    """
    mujoco.mj_resetData(model, data)
    where = addresses(model)
    motion = Motion(phi=trim.phi, theta=trim.theta, down=-height)
    write_motion(model, data, motion)
    swash = servo.mix.py_func(trim.col, trim.lon, trim.lat)
    act = data.act[where.state : where.state + len(STATE)]
    act[STATE.front_position : STATE.tail_rate + 1 : 2] = [*swash, trim.ped]
    act[STATE.flap_a], act[STATE.flap_b] = trim.a, trim.b
    _settle_gyro(act, model.actuator_user[where.rotor], trim)
    control = data.ctrl[where.control : where.control + ROTOR + 1]
    control[:] = [collective_stick(model, trim), 0.0, 0.0, 0.0, *swash, trim.ped, 1.0]


def collective_stick(model: mujoco.MjModel, trim: Trim) -> float:
    """Return where the collective stick stands in a hover, unitised."""
    return trim.col / float(model.actuator_user[addresses(model).rotor, PARAM.gyro_collective])


def _settle_gyro(act: NDArray[np.float64], par: NDArray[np.float64], trim: Trim) -> None:
    cosine, sine = par[PARAM.gyro_phase_cosine], par[PARAM.gyro_phase_sine]
    lat, lon = gyro.rotate.py_func(cosine, -sine, trim.lat, trim.lon)
    act[STATE.gyro_p_integral] = lat / par[PARAM.gyro_ki_lat]
    act[STATE.gyro_q_integral] = lon / par[PARAM.gyro_ki_lon]
    act[STATE.gyro_r_integral] = trim.ped / par[PARAM.gyro_k_i]
