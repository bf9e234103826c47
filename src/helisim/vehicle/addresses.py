"""What of a MuJoCo model is a vehicle's: its numbers, its body, and a load that hangs on it."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import ModelError, TrimError, UnknownNameError
from helisim.physics.layout import PARAM, ROTOR, STATE
from helisim.physics.memory import NO_FREE_JOINT, free_body


class Addresses(NamedTuple):
    """Starts of a vehicle's numbers: rotor actuator, first activation, first control."""

    rotor: int
    state: int
    control: int


def addresses(model: mujoco.MjModel, prefix: str = "") -> Addresses:
    """Find a vehicle in a model, by prefix in a scene; may raise UnknownNameError or ModelError."""
    rotor = _rotor_actuator(model, prefix)
    if model.nuser_actuator < len(PARAM):
        raise ModelError(
            f"the scene has room for {model.nuser_actuator} numbers of an actuator, and a vehicle "
            f"has {len(PARAM)}; take nuser_actuator out of the scene's <size/>, or write them into "
            "the vehicle's MJCF with `helisim vehicle build FOLDER`"
        )
    state = int(model.actuator_actadr[rotor]) - STATE.flap_a
    return Addresses(rotor, state, int(model.actuator_ctrladr[rotor]) - ROTOR)


def write_named(par: NDArray[np.float64], **numbers: ArrayLike) -> None:
    """Write numbers into a vehicle's parameters, (n_param,), by their names in `PARAM`.

    Several numbers take the places from the named one on, as `gust_north=(0.0, 0.0, 1.0)`.
    """
    for name, number in numbers.items():
        first = getattr(PARAM, name)
        par[first : first + np.size(number)] = number


def _rotor_actuator(model: mujoco.MjModel, prefix: str) -> int:
    names = {model.actuator(k).name: k for k in range(model.nactuator)}
    rotors = [name for name in names if name.endswith("rotor")]
    exact = [name for name in rotors if name == f"{prefix}rotor"]
    meant = exact or [name for name in rotors if name.startswith(prefix)]
    if len(meant) != 1:
        advice = "there are several: give the prefix of one" if meant else ""
        raise UnknownNameError("vehicle's rotor", f"{prefix}rotor", rotors, advice=advice)
    return names[meant[0]]


def root_body(model: mujoco.MjModel) -> int:
    """Return the number of a vehicle's body; may raise UnknownNameError or ModelError."""
    body = free_body(model, _rotor_actuator(model, ""))
    if body is None:
        raise ModelError(f"actuator 'rotor' {NO_FREE_JOINT}")
    return body


SLUNG = "slung/"  # before each name of what hangs on a vehicle
LOAD, HOOK = f"{SLUNG}load", f"{SLUNG}hook"
_TURNS = 20  # Newton steps, at most, to where a load hangs at rest
_TURN, _AT_REST = 1e-5, 1e-11  # rad or m: of a difference, and of a last step
_LEFT = 1e-6  # of the greatest weight: a force that is left
_NEUTRAL = 1e-8  # least stiffness over the greatest: below, as about a cable, any place is at rest


def sling(spec: mujoco.MjSpec, parts: mujoco.MjModel, slung: str) -> None:
    """Hang an MJCF's world on a vehicle's body, and sense where its load is."""
    frame = spec.body(parts.body(root_body(parts)).name).add_frame()
    try:
        hung = mujoco.MjSpec.from_string(slung)
        for k, body in enumerate(hung.bodies):
            body.name = body.name or f"body_{k}"  # by their names they are told from the vehicle
        spec.attach(hung, prefix=SLUNG, frame=frame)
    except ValueError as error:
        raise ModelError(f"the slung load's MJCF: {error}") from None
    for kind, named, name in (("body", spec.body, LOAD), ("site", spec.site, HOOK)):
        if named(name) is None:
            raise ModelError(f"a slung load needs a {kind} {name.removeprefix(SLUNG)!r}: name it")
    for key in list(spec.keys):  # of the vehicle alone
        spec.delete(key)
    sensor = spec.add_sensor(name=LOAD, type=mujoco.mjtSensor.mjSENS_FRAMEPOS, objname=LOAD)
    sensor.objtype, sensor.reftype = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE
    sensor.refname = HOOK


def own_parts(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Return which bodies, (n_body,), are the vehicle's own and not a slung load's."""
    own = np.array([not model.body(k).name.startswith(SLUNG) for k in range(model.nbody)])
    return own | (model.body_weldid == root_body(model))


def own_centre(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.float64]:
    """Return the vehicle's own centre of gravity in the world, (3,) m, after mj_kinematics."""
    root, own = root_body(model), own_parts(model)
    if own.all():
        mujoco.mj_comPos(model, data)
        return data.subtree_com[root].copy()
    mass = model.body_mass * (own & (model.body_rootid == root))
    return mass @ data.xipos / mass.sum()


def slung_dofs(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Return the degrees of freedom, (n_slung,), of what hangs on a vehicle."""
    return np.flatnonzero(~own_parts(model)[model.dof_bodyid])


def hang(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Let what hangs on a vehicle hang still, at the vehicle's place and attitude; or TrimError.

    Forces of springs and gravity count, those of constraints don't.
    """
    if not (dofs := slung_dofs(model)).size:
        return
    trial = mujoco.MjData(model)

    def forces(by: NDArray[np.floating]) -> NDArray[np.float64]:
        trial.qpos[:], moved = data.qpos, np.zeros(model.nv)
        moved[dofs] = by
        mujoco.mj_integratePos(model, trial.qpos, moved, 1.0)
        mujoco.mj_fwdPosition(model, trial)
        mujoco.mj_fwdVelocity(model, trial)
        return (trial.qfrc_passive - trial.qfrc_bias)[dofs]

    ways = _TURN * np.eye(dofs.size)
    for _ in range(_TURNS):
        slopes = np.column_stack([forces(way) - forces(-way) for way in ways]) / (2.0 * _TURN)
        left = forces(0.0 * dofs)
        step = np.linalg.lstsq(slopes, -left, rcond=_NEUTRAL)[0]
        forces(step)
        data.qpos[:] = trial.qpos
        balanced = np.abs(left).max() < _LEFT * np.abs(trial.qfrc_bias).max()
        if balanced and np.abs(step).max() < _AT_REST:
            return
    raise TrimError(
        "the slung load finds no place where it hangs still; draw it as it hangs, its cable taut, "
        "and carry it by joints or by tendons with a stiffness"
    )
