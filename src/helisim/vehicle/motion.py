"""Rigid-body motion in the field's axes, to and from MuJoCo's."""

from dataclasses import astuple, dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.base.errors import ModelError, UnknownNameError
from helisim.physics.layout import MAGIC, PARAM, ROTOR, STATE
from helisim.physics.motion import flip


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
