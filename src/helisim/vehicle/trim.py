"""The steady flight of a vehicle, and its motion in the field's axes to and from MuJoCo's."""

import copy
from dataclasses import astuple, dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from helisim.base.errors import ModelError, TrimError, UnknownNameError
from helisim.physics import drive, gyro
from helisim.physics.drive import IDEAL
from helisim.physics.layout import FIRST_LAW_STATE, MAGIC, PARAM, ROTOR, SHIPPED_LAW, STATE
from helisim.physics.motion import flip
from helisim.physics.native import installed
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


@dataclass(frozen=True)
class Addresses:
    """Starts of a vehicle's numbers: rotor actuator, first activation, first control."""

    rotor: int
    state: int
    control: int


def addresses(model: mujoco.MjModel, prefix: str = "") -> Addresses:
    """Find a vehicle in a model; `prefix` names one of several in a scene.

    Raises:
        UnknownNameError: there is no such vehicle.
        ModelError: the scene has no room for the numbers of a vehicle.
    """
    rotor = rotor_actuator(model, prefix)
    if model.nuser_actuator < len(PARAM):
        raise ModelError(
            f"the scene has room for {model.nuser_actuator} numbers of an actuator, and a vehicle "
            f"has {len(PARAM)}; take nuser_actuator out of the scene's <size/>, or write them into "
            "the vehicle's MJCF with `helisim vehicle build FOLDER`"
        )
    return Addresses(
        rotor=rotor,
        state=int(model.actuator_actadr[rotor]) - STATE.flap_a,
        control=int(model.actuator_ctrladr[rotor]) - ROTOR,
    )


def rotor_actuator(model: mujoco.MjModel, prefix: str = "") -> int:
    """Return the number of a vehicle's rotor actuator, found by its name or its user numbers.

    model: with one vehicle or more; prefix: that the names of the vehicle's elements begin with.

    Raises:
        UnknownNameError: there is no such vehicle, or several could be meant.
    """
    numbered, named = {}, {}
    for actuator in range(model.nactuator):
        name = model.actuator(actuator).name
        user = model.actuator_user[actuator]
        if len(user) > PARAM.ordinal and user[PARAM.magic] == MAGIC:
            if user[PARAM.ordinal] == ROTOR:
                numbered[name] = actuator
        elif name.endswith("rotor"):
            named[name] = actuator
    rotors = numbered or named
    if f"{prefix}rotor" in rotors:
        return rotors[f"{prefix}rotor"]
    meant = [name for name in rotors if name.startswith(prefix)]
    if len(meant) != 1:
        advice = "there are several: give the prefix of one" if meant else ""
        raise UnknownNameError("vehicle's rotor", f"{prefix}rotor", rotors, advice=advice)
    return rotors[meant[0]]


def root_body(model: mujoco.MjModel, prefix: str = "") -> int:
    """Return the number of a vehicle's body: the one that the rotor actuator's joint moves.

    Raises:
        UnknownNameError: there is no such vehicle.
        ModelError: the rotor has no free joint.
    """
    rotor = rotor_actuator(model, prefix)
    joint = int(model.actuator_trnid[rotor, 0])
    moves = model.actuator_trntype[rotor] == mujoco.mjtTrn.mjTRN_JOINT
    if not moves or model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE:
        raise ModelError(
            f'actuator {prefix + "rotor"!r} must have the vehicle\'s free joint: joint="NAME" of a '
            "<freejoint/> in the body of the whole vehicle"
        )
    return int(model.jnt_bodyid[joint])


def rotation_matrix(phi: float, theta: float, psi: float) -> NDArray[np.float64]:
    """Return the (3, 3) rotation from body (FRD) to earth (NED) axes."""
    return Rotation.from_euler("ZYX", [psi, theta, phi]).as_matrix()


def _flip_matrix(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    signs = np.array(flip(1.0, 1.0, 1.0))
    return signs[:, None] * matrix * signs


def write_motion(model: mujoco.MjModel, data: mujoco.MjData, motion: Motion) -> None:
    """Put a vehicle with a free joint into a motion."""
    u, v, w, p, q, r, phi, theta, psi, north, east, down = vars(motion).values()
    earth = rotation_matrix(phi, theta, psi)
    matrix = _flip_matrix(earth)
    quaternion = Rotation.from_matrix(matrix).as_quat(scalar_first=True)
    data.qpos[:3] = flip(north, east, down)
    data.qpos[3:7] = quaternion
    data.qvel[:3] = flip(*(earth @ [u, v, w]))
    data.qvel[3:6] = flip(p, q, r)


def read_motion(data: mujoco.MjData) -> Motion:
    """Return the motion of a vehicle with a free joint, as `write_motion` writes it."""
    matrix = Rotation.from_quat(data.qpos[3:7], scalar_first=True).as_matrix()
    earth = _flip_matrix(matrix)
    psi, theta, phi = Rotation.from_matrix(earth).as_euler("ZYX")
    u, v, w = earth.T @ flip(*data.qvel[:3])
    north, east, down = flip(*data.qpos[:3])
    return Motion(
        *map(float, (u, v, w, *flip(*data.qvel[3:6]), phi, theta, psi, north, east, down))
    )


def motion_rates(data: mujoco.MjData, motion: Motion) -> NDArray[np.float64]:
    """Return the time derivative of each field of `Motion`, (12,), after mj_forward."""
    u, v, w, p, q, r, phi, theta, psi, *_ = astuple(motion)
    earth = rotation_matrix(phi, theta, psi)
    velocity, rates = np.array([u, v, w]), np.array([p, q, r])
    acceleration = earth.T @ flip(*data.qacc[:3]) - np.cross(rates, velocity)
    angular = flip(*data.qacc[3:6])
    sine, cosine, tangent = np.sin(phi), np.cos(phi), np.tan(theta)
    euler = [
        p + (q * sine + r * cosine) * tangent,
        q * cosine - r * sine,
        (q * sine + r * cosine) / np.cos(theta),
    ]
    return np.concatenate([acceleration, angular, euler, earth @ velocity])


def specific_force(
    data: mujoco.MjData, model: mujoco.MjModel, motion: Motion
) -> NDArray[np.float64]:
    """Return ax, ay, az (m/s^2) at the centre of gravity, (3,), after mj_forward."""
    earth = rotation_matrix(motion.phi, motion.theta, motion.psi)
    felt = data.qacc[:3] - model.opt.gravity
    return earth.T @ flip(*felt)


_RESIDUAL = 1e-9
"""Greatest acceleration left, m/s^2 and rad/s^2: far below any sensor, above rounding."""
HEIGHT = 10.0
"""m above the ground, where nothing else is said."""
_UNKNOWNS = ("phi", "theta", "col", "lon", "lat", "ped", "a", "b")
_INFLOW = ("inflow_0", "inflow_s", "inflow_c")
"""Unknowns besides these where the inflow is dynamic."""


@dataclass(frozen=True)
class Trim:
    """A steady flight: attitude (rad), controls of the base helicopter (unitised), tilt (rad).

    Attributes:
        phi: roll angle, rad.
        theta: pitch angle, rad.
        col: collective at the swashplate, unitised.
        lon: longitudinal cyclic.
        lat: lateral cyclic.
        ped: tail rotor collective.
        a: rearward tilt, rad.
        b: right tilt, rad.
        speed: m/s over the ground, level, in the direction of the heading.
        height: m above the ground.
        throttle: of the engine, 0 to 1; 0 under an ideal governor, which has none.
        inflow_0: induced velocity, m/s, the mean over the disc; 0 where inflow is quasi-steady.
        inflow_s: by how much it is more at the right tip, m/s; likewise.
        inflow_c: by how much it is more at the rear tip, m/s; likewise.
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
        """Return what is solved for, to three digits."""
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
    """Solve for level flight at a speed, hover by default, on the nonlinear force laws.

    The heading is the direction of flight; the wind is the model's own, `opt.wind`, so hovering
    in a wind from ahead is flying at its speed.

    Args:
        model: of the vehicle.
        speed: m/s over the ground.
        height: m above the ground.
        near: where the search starts; needed far from the hover.

    Raises:
        TrimError: no equilibrium within the controls' range.
    """
    given, model = model, copy.copy(model)  # at a steady speed nothing depends on what keeps it
    user = model.actuator_user[addresses(model).rotor]
    user[PARAM.drive_governor] = IDEAL
    data = mujoco.MjData(model)
    names = _UNKNOWNS + (_INFLOW if _inflow_moves(model) else ())
    start = near or _level(model)
    unknowns = [getattr(start, name) for name in names]

    def steady(near_one: NDArray[np.float64]) -> Trim:
        found = (float(value) for value in near_one - 1.0)
        return Trim(**dict(zip(names, found)), speed=speed, height=height)

    def imbalance(near_one: NDArray[np.float64]) -> NDArray[np.float64]:
        trim = steady(near_one)
        left = _imbalance(trim, model, data) if np.all(np.isfinite(near_one)) else near_one
        if not np.all(np.isfinite(left)):
            raise TrimError(
                f"no {_named(speed)} found: the force laws give no finite acceleration at {trim}; "
                "a parameter is out of all proportion"
            )
        return left

    with installed():
        # about one, because the solver's differences are relative to the unknowns
        solution = root(imbalance, 1.0 + np.array(unknowns), tol=1e-14)
    trim = steady(solution.x)
    worst = float(np.max(np.abs(solution.fun)))
    if not worst < _RESIDUAL:
        raise TrimError(
            f"no {_named(speed)} found: {worst:.3g} m/s^2 or rad/s^2 is left with {trim}; "
            "check mass, rotor speed, lift slope and wind"
        )
    controls = {"col": trim.col, "lon": trim.lon, "lat": trim.lat, "ped": trim.ped}
    controls["COL"] = collective_stick(model, trim)
    for name, value in controls.items():
        if abs(value) > 0.5:
            raise TrimError(
                f"the {_named(speed)} needs {name} = {value:.3f}, outside [-0.5, 0.5]; "
                "change pitch_trim, pitch_range or gyro.pitch_rate, or fly slower"
            )
    return replace(trim, throttle=_throttle(given, data, _named(speed)))


def _throttle(model: mujoco.MjModel, data: mujoco.MjData, flight: str) -> float:
    """Return the throttle of a steady flight that `data` has just been evaluated in."""
    par = model.actuator_user[addresses(model).rotor]
    if par[PARAM.drive_governor] == IDEAL:
        return 0.0
    _, main, tail, _ = data.sensor("power").data
    torque = float(main + tail) / par[PARAM.main_speed]
    throttle = drive.throttle_for(par, torque)
    if throttle > 1.0:
        raise TrimError(
            f"the {flight} takes a torque of {torque:.3g} N m at the main shaft, and at full "
            f"throttle the engine gives {drive.shaft_torque(par, 1.0, 1.0):.3g}; change [drive]"
        )
    return throttle


def _inflow_moves(model: mujoco.MjModel) -> bool:
    return bool(model.actuator_user[addresses(model).rotor, PARAM.main_dynamic_inflow])


def _level(model: mujoco.MjModel) -> Trim:
    """Return a level hover with all controls centred, its induced velocity momentum theory's."""
    par = model.actuator_user[addresses(model).rotor]
    weight = float(np.sum(model.body_mass)) * float(np.linalg.norm(model.opt.gravity))
    disc = np.pi * par[PARAM.main_radius] ** 2
    inflow = float(np.sqrt(weight / (2.0 * par[PARAM.air_density] * disc)))
    return Trim(*[0.0] * len(_UNKNOWNS), inflow_0=inflow)


def _named(speed: float) -> str:
    return "hover" if speed == 0.0 else f"level flight at {speed:g} m/s"


def _imbalance(trim: Trim, model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.float64]:
    place(model, data, trim)
    mujoco.mj_forward(model, data)
    first = addresses(model).state
    last = first + (STATE.inflow_c if _inflow_moves(model) else STATE.flap_b)
    return np.concatenate([data.qacc[:6], data.act_dot[first + STATE.flap_a : last + 1]])


def place(
    model: mujoco.MjModel, data: mujoco.MjData, trim: Trim, *, height: float | None = None
) -> None:
    """Set a vehicle's state and controls to a trim, its gyro settled, all sticks centred.

    A controller of one's own starts anew, from a state of zeros.

    model: of the vehicle; data: written; time and histories are reset; trim: the steady flight;
    height: m above the ground; the trim's own if None.
    """
    mujoco.mj_resetData(model, data)
    where = addresses(model)
    motion = trim.motion if height is None else replace(trim.motion, down=-height)
    write_motion(model, data, motion)
    plate = Swashplate.in_block(model.actuator_user[where.rotor])
    swash = plate.mix(trim.col, trim.lon, trim.lat)
    act = data.act[where.state :]
    act[STATE.front_position : STATE.tail_rate + 1 : 2] = [*swash, trim.ped]
    act[STATE.flap_a], act[STATE.flap_b] = trim.a, trim.b
    par = model.actuator_user[where.rotor]
    if par[PARAM.drive_governor] != IDEAL:
        act[STATE.speed], act[STATE.engine] = 1.0, trim.throttle
        act[STATE.governor] = trim.throttle - par[PARAM.drive_collective_gain] * trim.col
    act[STATE.inflow_0 : STATE.inflow_c + 1] = trim.inflow_0, trim.inflow_s, trim.inflow_c
    act[STATE.feels_x : STATE.feels_z + 1] = steady_force(model, trim)
    # the shipped laws have the integrals with which they command a trim; others start at zero
    p_integral, q_integral, r_integral = gyro_integrals(par, trim)
    if par[PARAM.swash_law] == SHIPPED_LAW:
        cyclic = act[FIRST_LAW_STATE:]
        cyclic[gyro.CYCLIC.p_integral] = p_integral
        cyclic[gyro.CYCLIC.q_integral] = q_integral
    if par[PARAM.tail_law] == SHIPPED_LAW:
        yaw = act[FIRST_LAW_STATE + int(par[PARAM.swash_states]) :]
        yaw[gyro.YAW.r_integral] = r_integral
    control = data.ctrl[where.control : where.control + ROTOR + 1]
    control[:] = [collective_stick(model, trim), 0.0, 0.0, 0.0, *swash, trim.ped, 1.0]


def steady_force(model: mujoco.MjModel, trim: Trim) -> NDArray[np.float64]:
    """Return the specific force in a steady flight, m/s^2, body axes (FRD), (3,)."""
    level = rotation_matrix(trim.phi, trim.theta, 0.0)
    return level.T @ -np.array(flip(*model.opt.gravity))


def collective_stick(model: mujoco.MjModel, trim: Trim) -> float:
    """Return where the collective stick stands in a hover, unitised."""
    return trim.col / float(model.actuator_user[addresses(model).rotor, PARAM.gyro_collective])


def gyro_integrals(par: NDArray[np.float64], trim: Trim) -> tuple[float, float, float]:
    """Return the gyro's integrals of p, q and r with which it commands a trim.

    par: a vehicle's numbers, (n_param,); trim: the steady flight.
    """
    cosine, sine = par[PARAM.gyro_phase_cosine], par[PARAM.gyro_phase_sine]
    lat, lon = gyro.rotate(cosine, -sine, trim.lat, trim.lon)
    return (
        float(lat) / float(par[PARAM.gyro_ki_lat]),
        float(lon) / float(par[PARAM.gyro_ki_lon]),
        trim.ped / float(par[PARAM.gyro_k_i]),
    )
