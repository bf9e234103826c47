"""The steady flight of a vehicle, and its motion in the field's axes to and from MuJoCo's."""

import copy
from dataclasses import dataclass, replace
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from helisim.base.errors import TrimError
from helisim.physics import drive, gyro
from helisim.physics.battery import supply
from helisim.physics.drive import IDEAL
from helisim.physics.layout import FIRST_LAW_STATE, PARAM, ROTOR, SHIPPED_LAW, STATE
from helisim.physics.motion import flip
from helisim.physics.native import installed
from helisim.vehicle.addresses import addresses, hang
from helisim.vehicle.swashplate import Swashplate


@dataclass(frozen=True)
class Motion:
    """Position and velocity of the centre of gravity, attitude and rates. SI, FRD in NED."""

    u: float = 0.0
    v: float = 0.0
    w: float = 0.0
    p: float = 0.0
    q: float = 0.0
    r: float = 0.0
    phi: float = 0.0
    theta: float = 0.0
    psi: float = 0.0
    north: float = 0.0
    east: float = 0.0
    down: float = 0.0


@lru_cache(maxsize=4)  # what writes a motion and what reads its rates ask for the same
def rotation_matrix(phi: float, theta: float, psi: float) -> NDArray[np.float64]:
    """Return the (3, 3) rotation from body (FRD) to earth (NED) axes, read-only."""
    found = Rotation.from_euler("ZYX", [psi, theta, phi]).as_matrix()
    found.setflags(write=False)
    return found


FLIPS = np.outer(flip(1.0, 1.0, 1.0), flip(1.0, 1.0, 1.0))
"""Times a rotation (3, 3) in MuJoCo's axes: from body (FRD) to earth (NED) axes."""


def write_motion(model: mujoco.MjModel, data: mujoco.MjData, motion: Motion) -> None:
    """Put a vehicle with a free joint into a motion."""
    u, v, w, p, q, r, phi, theta, psi, north, east, down = vars(motion).values()
    earth = rotation_matrix(phi, theta, psi)
    data.qpos[:3] = flip(north, east, down)
    data.qpos[3:7] = Rotation.from_matrix(FLIPS * earth).as_quat(scalar_first=True)
    data.qvel[:3] = flip(*(earth @ [u, v, w]))
    data.qvel[3:6] = flip(p, q, r)


def read_motion(data: mujoco.MjData) -> Motion:
    """Return the motion of a vehicle with a free joint, as `write_motion` writes it."""
    earth = FLIPS * Rotation.from_quat(data.qpos[3:7], scalar_first=True).as_matrix()
    psi, theta, phi = Rotation.from_matrix(earth).as_euler("ZYX")
    u, v, w = earth.T @ flip(*data.qvel[:3])
    rest = (*flip(*data.qvel[3:6]), phi, theta, psi, *flip(*data.qpos[:3]))
    return Motion(*map(float, (u, v, w, *rest)))


def motion_rates(data: mujoco.MjData, motion: Motion) -> NDArray[np.float64]:
    """Return the time derivative of each field of `Motion`, (12,), after mj_forward."""
    u, v, w, p, q, r, phi, theta, psi, *_ = vars(motion).values()
    earth = rotation_matrix(phi, theta, psi)
    velocity, rates = np.array([u, v, w]), np.array([p, q, r])
    acceleration = earth.T @ flip(*data.qacc[:3]) - np.cross(rates, velocity)
    sine, cosine = np.sin(phi), np.cos(phi)
    turning = q * sine + r * cosine
    euler = [p + turning * np.tan(theta), q * cosine - r * sine, turning / np.cos(theta)]
    return np.concatenate([acceleration, flip(*data.qacc[3:6]), euler, earth @ velocity])


def specific_force(
    data: mujoco.MjData, model: mujoco.MjModel, motion: Motion
) -> NDArray[np.float64]:
    """Return ax, ay, az (m/s^2) at the centre of gravity, (3,), after mj_forward."""
    earth = rotation_matrix(motion.phi, motion.theta, motion.psi)
    return earth.T @ flip(*(data.qacc[:3] - model.opt.gravity))


_RESIDUAL = 1e-9  # greatest acceleration left, m/s^2 and rad/s^2
HEIGHT = 10.0  # m above the ground, by default
_UNKNOWNS = ("phi", "theta", "col", "lon", "lat", "ped", "a", "b")
_INFLOW = ("inflow_0", "inflow_s", "inflow_c")


@dataclass(frozen=True)
class Trim:
    """A steady flight, level along the heading; angles and tilts (a rearward, b right): rad.

    col, lon, lat, ped: unitised; speed: m/s over the ground; height: m above it; throttle: 0 to 1,
    0 under an ideal governor; inflow_0, inflow_s, inflow_c: mean induced velocity, and its excess
    at right and rear tip, m/s, 0 where quasi-steady.
    """

    phi: float
    theta: float
    col: float
    lon: float
    lat: float
    ped: float
    a: float
    b: float
    speed: float = 0.0
    height: float = HEIGHT
    throttle: float = 0.0
    inflow_0: float = 0.0
    inflow_s: float = 0.0
    inflow_c: float = 0.0

    def __str__(self) -> str:
        return ", ".join(f"{name} {getattr(self, name):.3g}" for name in _UNKNOWNS)

    @property
    def motion(self) -> Motion:
        """The vehicle's motion, its position above the origin."""
        level = rotation_matrix(self.phi, self.theta, 0.0)
        u, v, w = (float(part) for part in level.T @ [self.speed, 0.0, 0.0])
        return Motion(u=u, v=v, w=w, phi=self.phi, theta=self.theta, down=-self.height)


def find_trim(
    model: mujoco.MjModel, *, speed: float = 0.0, height: float = HEIGHT, near: Trim | None = None
) -> Trim:
    """Return the steady level flight of a model in its `opt.wind`.

    speed: over the ground, m/s; height: m above it; near: a trim to start the search from. Raises
    TrimError if there is none, or if a control would have to go beyond its range.
    """
    given, model = model, copy.copy(model)  # at a steady speed nothing depends on what keeps it
    where = addresses(model)
    par = model.actuator_user[where.rotor]
    par[PARAM.drive_governor] = IDEAL
    data, flight = mujoco.MjData(model), f"level flight at {speed:g} m/s" if speed else "hover"
    dynamic = par[PARAM.main_dynamic_inflow] != 0.0
    names = (*_UNKNOWNS, *(_INFLOW if dynamic else ()))
    last = where.state + (STATE.inflow_c if dynamic else STATE.flap_b)
    start = near or _level(model, par)

    def steady(near_one: NDArray[np.float64]) -> Trim:
        return Trim(**dict(zip(names, map(float, near_one - 1.0))), speed=speed, height=height)

    def imbalance(near_one: NDArray[np.float64]) -> NDArray[np.float64]:
        trim, left = steady(near_one), near_one
        if np.all(np.isfinite(near_one)):
            place(model, data, trim)
            mujoco.mj_forward(model, data)
            rates = data.act_dot[where.state + STATE.flap_a : last + 1]
            left = np.concatenate([data.qacc[:6], rates])
        if not np.all(np.isfinite(left)):
            raise TrimError(
                f"no {flight} found: the force laws give no finite acceleration at {trim}; "
                "a parameter is out of all proportion"
            )
        return left

    with installed():
        # about one, because the solver's differences are relative to the unknowns
        unknowns = np.array([getattr(start, name) for name in names])
        solution = root(imbalance, 1.0 + unknowns, tol=1e-14)
    trim, worst = steady(solution.x), float(np.max(np.abs(solution.fun)))
    if not worst < _RESIDUAL:
        raise TrimError(
            f"no {flight} found: {worst:.3g} m/s^2 or rad/s^2 is left with {trim}; "
            "check mass, rotor speed, lift slope and wind"
        )
    controls = {name: getattr(trim, name) for name in ("col", "lon", "lat", "ped")}
    for name, value in {**controls, "COL": collective_stick(model, trim)}.items():
        if abs(value) > 0.5:
            raise TrimError(
                f"the {flight} needs {name} = {value:.3f}, outside [-0.5, 0.5]; "
                "change pitch_trim, pitch_range or gyro.pitch_rate, or fly slower"
            )
    par = given.actuator_user[where.rotor]
    if par[PARAM.drive_governor] == IDEAL:
        return trim
    _, main, tail, _ = data.sensor("power").data
    torque = float(main + tail) / par[PARAM.main_speed]
    source = supply(par, 0.0, 0.0, 0.0)
    throttle = drive.throttle_for(par, torque, source)
    if throttle > 1.0:
        raise TrimError(
            f"the {flight} takes a torque of {torque:.3g} N m at the main shaft; at full throttle "
            f"the engine gives {drive.shaft_torque(par, 1.0, 1.0, source):.3g}; change [drive]"
        )
    return replace(trim, throttle=throttle)


def set_governor(model: mujoco.MjModel, governor: float) -> None:
    """Give a model a governor, `IDEAL` or `MOTOR`; a motor's rotor doesn't turn with the body."""
    rotor = addresses(model).rotor
    model.actuator_user[rotor, PARAM.drive_governor] = governor
    yaw = model.jnt_dofadr[model.actuator_trnid[rotor, 0]] + 5
    inertia = model.actuator_user[rotor, PARAM.drive_mast_inertia]
    model.dof_armature[yaw] = -inertia if governor != IDEAL else 0.0


def _level(model: mujoco.MjModel, par: NDArray[np.float64]) -> Trim:
    weight = float(np.sum(model.body_mass)) * float(np.linalg.norm(model.opt.gravity))
    disc = np.pi * par[PARAM.main_radius] ** 2
    inflow = float(np.sqrt(weight / (2.0 * par[PARAM.air_density] * disc)))
    return Trim(*[0.0] * len(_UNKNOWNS), inflow_0=inflow)


def place(
    model: mujoco.MjModel, data: mujoco.MjData, trim: Trim, *, height: float | None = None
) -> None:
    """Set a vehicle's state and controls to a trim, its gyro settled, all sticks centred.

    Another controller starts from zeros. data: written; height: m, the trim's own if None.
    """
    mujoco.mj_resetData(model, data)
    where = addresses(model)
    par, act = model.actuator_user[where.rotor], data.act[where.state :]
    write_motion(model, data, trim.motion if height is None else replace(trim.motion, down=-height))
    hang(model, data)
    swash = Swashplate.in_block(par).mix(trim.col, trim.lon, trim.lat)
    act[STATE.front_position : STATE.tail_rate + 1 : 2] = [*swash, trim.ped]
    act[STATE.flap_a], act[STATE.flap_b] = trim.a, trim.b
    if par[PARAM.drive_governor] != IDEAL:
        act[STATE.speed], act[STATE.engine], act[STATE.fuel] = 1.0, trim.throttle, trim.throttle
        act[STATE.governor] = trim.throttle - par[PARAM.drive_collective_gain] * trim.col
    act[STATE.inflow_0 : STATE.inflow_c + 1] = trim.inflow_0, trim.inflow_s, trim.inflow_c
    act[STATE.feels_x : STATE.feels_z + 1] = steady_force(model, trim)
    # the shipped laws have the integrals with which they command a trim; others start at zero
    p_integral, q_integral, r_integral = gyro_integrals(par, trim)
    swash_state, tail_state = (
        act[FIRST_LAW_STATE + k :] for k in (0, int(par[PARAM.swash_states]))
    )
    if par[PARAM.swash_law] == SHIPPED_LAW:
        swash_state[gyro.CYCLIC.p_integral] = p_integral
        swash_state[gyro.CYCLIC.q_integral] = q_integral
    if par[PARAM.tail_law] == SHIPPED_LAW:
        tail_state[gyro.YAW.r_integral] = r_integral
    control = data.ctrl[where.control : where.control + ROTOR + 1]
    control[:] = [collective_stick(model, trim), 0.0, 0.0, 0.0, *swash, trim.ped, 1.0]


def steady_force(model: mujoco.MjModel, trim: Trim) -> NDArray[np.float64]:
    """Return the specific force in a steady flight, m/s^2, body axes (FRD), (3,)."""
    return rotation_matrix(trim.phi, trim.theta, 0.0).T @ -np.array(flip(*model.opt.gravity))


def collective_stick(model: mujoco.MjModel, trim: Trim) -> float:
    """Return where the collective stick stands in a hover, unitised."""
    return trim.col / float(model.actuator_user[addresses(model).rotor, PARAM.gyro_collective])


def gyro_integrals(par: NDArray[np.float64], trim: Trim) -> tuple[float, float, float]:
    """Return the gyro's integrals of p, q and r that command a trim; par: (n_param,)."""
    cosine, sine = par[PARAM.gyro_phase_cosine], par[PARAM.gyro_phase_sine]
    lat, lon = gyro.rotate(cosine, -sine, trim.lat, trim.lon)
    return (
        float(lat) / float(par[PARAM.gyro_ki_lat]),
        float(lon) / float(par[PARAM.gyro_ki_lon]),
        trim.ped / float(par[PARAM.gyro_k_i]),
    )
