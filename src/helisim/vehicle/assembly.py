"""From a model folder to a compiled MuJoCo model that carries the vehicle's parameters."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Literal, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, ModelError, UnknownNameError
from helisim.physics.layout import (
    ACTUATORS,
    INJECTION,
    MAGIC,
    PARAM,
    ROTOR,
    ROTOR_STATES,
    SENSORS,
    rotor_states,
)
from helisim.physics.memory import TICK_TOLERANCE
from helisim.vehicle.folder import (
    ROLES,
    Roles,
    mjcf_file,
    model_folder,
    read_roles,
    rig_file,
    scene_file,
)
from helisim.vehicle.force_laws import force_law_block
from helisim.vehicle.motion import addresses, root_body
from helisim.vehicle.parameters import Parameters

Integrator = Literal["RK4", "Euler"]
Around = Callable[[mujoco.MjSpec, mujoco.MjModel], None]
"""A function that adds to a specification what its vehicle can touch; it is given a model too."""
_INTEGRATORS = {
    name: getattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}") for name in get_args(Integrator)
}

_CLOSED = 1e-13
"""Relative rounding of the parts' sum of inertias."""

_LONGEST = 10.0
"""s, of the gyro's period and latencies: MuJoCo keeps what happened in all that time."""


def assemble(
    vehicle: str | PathLike[str],
    parameters: Parameters,
    *,
    timestep: float | None = None,
    integrator: Integrator | None = None,
    delays: bool = True,
    visual: bool = False,
    rig: str | None = None,
    around: Around | None = None,
    states: int = 0,
) -> mujoco.MjModel:
    """Compile a vehicle's MJCF with its parameters in place.

    To fly, the parts are fused into one body and what is only to be seen is left out: the
    dynamics are the same, a step costs less than half.

    Args:
        vehicle: name of a shipped one, or path of a folder.
        parameters: all of its parameters.
        timestep: s; the MJCF's own if None.
        integrator: "RK4" or "Euler"; the MJCF's own if None.
        delays: False takes the sticks' delays out, as a linearisation needs.
        visual: True keeps every part, and adds ground, light and sky: a model to look at.
        rig: that holds the vehicle, one of `rig_names`; none, to fly. A rig's MJCF includes
            the vehicle's and holds it by constraints, so joint and channels stay as they are.
        around: adds what is around the vehicle, such as the ground; without it, nothing can be
            touched, which makes a step cheaper.
        states: how many the control laws have, where these are more than the shipped ones'.

    Raises:
        InputError: the time step is not a positive number, or there is no such integrator.
        UnknownNameError: no such vehicle or rig.
        ModelError: the MJCF lacks what a vehicle needs, or MuJoCo refuses it.
    """
    spec = specified(
        vehicle,
        parameters,
        timestep=timestep,
        integrator=integrator,
        delays=delays,
        visual=visual,
        rig=rig,
        around=around,
    )
    folder = model_folder(vehicle)
    with _named(_mjcf(folder, read_roles(folder), visual=visual, rig=rig)):
        rotor = spec.actuator("rotor")
        rotor.actdim = max(rotor.actdim, rotor_states(states))
        model = spec.compile()
        check_interface(model)
    return model


def with_room(
    model: mujoco.MjModel,
    folder: Path,
    parameters: Parameters,
    states: int,
    around: Around | None = None,
) -> mujoco.MjModel:
    """Return a vehicle's model once more, with room for so many states of control laws.

    And with what is `around` it, to be touched.
    """
    larger = assemble(
        folder,
        parameters,
        timestep=float(model.opt.timestep),
        integrator="RK4" if model.opt.integrator == _INTEGRATORS["RK4"] else "Euler",
        around=around,
        states=states,
    )
    there, here = addresses(larger).rotor, addresses(model).rotor
    larger.actuator_user[there] = model.actuator_user[here]
    larger.opt.wind[:] = model.opt.wind
    return larger


def specified(
    vehicle: str | PathLike[str],
    parameters: Parameters,
    *,
    timestep: float | None = None,
    integrator: Integrator | None = None,
    delays: bool = True,
    visual: bool = False,
    rig: str | None = None,
    around: Around | None = None,
) -> mujoco.MjSpec:
    """Return what `assemble` compiles; arguments and errors as there."""
    if timestep is not None and not (math.isfinite(timestep) and timestep > 0.0):
        raise InputError(f"timestep must be a positive number of seconds, got {timestep}")
    if integrator not in (None, *_INTEGRATORS):
        raise InputError(f"integrator must be 'RK4' or 'Euler', got {integrator!r}")
    folder = model_folder(vehicle)
    roles = read_roles(folder)
    path = _mjcf(folder, roles, visual=visual, rig=rig)
    block = force_law_block(parameters)
    for timing in ("gyro.period", "gyro.latency", "gyro.ped_latency"):
        if not parameters[timing] <= _LONGEST:
            raise ModelError(f"{timing} is {parameters[timing]:g} s, at most {_LONGEST:g} s")
    with _named(path):
        spec = mujoco.MjSpec.from_file(str(path))
        roles.rename(spec)
        if visual and rig is None and scene_file(folder, roles) is None:
            _add_scenery(spec)
        if timestep is not None:
            spec.option.timestep = timestep
        if integrator is not None:
            spec.option.integrator = _INTEGRATORS[integrator]
        if not visual:  # MuJoCo moves them along in each evaluation
            for seen in [*spec.cameras, *spec.lights]:
                spec.delete(seen)
        spec.compiler.discardvisual = not visual
        _drop_old_states(spec)
        parts = spec.compile()
        check_channels(parts)
        _check_roles(parts, roles, visual=visual)
        _set_latency(
            spec, parameters["gyro.ped_latency"] if delays else 0.0, parameters["gyro.period"]
        )
        _set_gyro_rate(spec, parameters["gyro.period"], parameters["gyro.latency"], delays)
        _set_force_laws(spec, block)
        spec.nuserdata = max(spec.nuserdata, len(INJECTION))  # what a manoeuvre adds
        if around is not None:
            around(spec, parts)
        elif rig is None and not visual:  # alone in the air there is nothing to touch
            spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        fuselage = spec.body(roles.body("fuselage"))
        _close_inertia(fuselage, wanted_inertia(parameters), total_inertia(parts, root_body(parts)))
        spec.compiler.fusestatic = not visual
    return spec


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Say of which MJCF what MuJoCo and the checks say."""
    try:
        yield
    except (ValueError, KeyError, ModelError) as error:
        reason = " ".join(str(error).split())  # MuJoCo's run over several lines
        reason = reason.partition(" The visual elements of the spec were discarded")[0]
        raise ModelError(f"{path}: {reason}{_advice(reason)}") from None


def _drop_old_states(spec: mujoco.MjSpec) -> None:
    """Take out of keyframes what was written for another number of activations."""
    states = 0
    for actuator in spec.actuators:
        dynamic = actuator.dyntype != mujoco.mjtDyn.mjDYN_NONE
        states += actuator.actdim if actuator.actdim > 0 else int(dynamic)
    for key in spec.keys:
        if len(key.act) not in (0, states):
            key.act = []


def _mjcf(folder: Path, roles: Roles, *, visual: bool, rig: str | None) -> Path:
    if rig is not None:
        return rig_file(folder, rig)
    return (scene_file(folder, roles) if visual else None) or mjcf_file(folder, roles)


def _add_scenery(spec: mujoco.MjSpec) -> None:
    """Add ground and light to a vehicle that has no scene."""
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05], rgba=[0.37, 0.46, 0.32, 1.0]
    )
    spec.worldbody.add_light(pos=[0.0, 0.0, 5.0], dir=[0.0, 0.0, -1.0])


def _set_gyro_rate(spec: mujoco.MjSpec, period: float, latency: float, sampled: bool) -> None:
    """Let the gyro sense at its own rate; without sampling it sees the present rates."""
    sensor = spec.sensor("gyro_rate")
    if not sampled:
        sensor.interval, sensor.delay, sensor.nsample = [0.0, 0.0], 0.0, 0
        return
    steps = period / spec.option.timestep
    if abs(steps - round(steps)) > TICK_TOLERANCE or steps < 0.5:
        raise ModelError(
            f"gyro.period must be a whole number of time steps of {spec.option.timestep:g} s, "
            f"got {period:g} s"
        )
    if latency != 0.0 and latency < spec.option.timestep:
        raise ModelError(
            f"gyro.latency must be 0 or at least a time step of {spec.option.timestep:g} s, "
            f"got {latency:g}"
        )
    early = 0.25 * spec.option.timestep  # so that rounding of the time never skips a sample
    sensor.interval = [period, -early]
    sensor.delay = max(0.0, latency - early)
    sensor.nsample = math.ceil(latency / period) + 2


def _advice(message: str) -> str:
    if not any(said in message for said in ("A + B >= C", "positive eigenvalues")):
        return ""
    return (
        "; the parts' inertias leave the fuselage none that a body can have: change "
        "airframe.ixx, airframe.iyy or airframe.izz (a calibration has iyy = ixx L_b / M_a and izz "
        "from N_r)"
    )


def _set_latency(spec: mujoco.MjSpec, latency: float, period: float) -> None:
    pedal = spec.actuator("PED")
    if latency != 0.0 and latency < period:
        raise ModelError(
            f"gyro.ped_latency must be 0 or at least the gyro's period of {period:g} s, "
            f"got {latency:g}"
        )
    if latency == 0.0:
        pedal.delay, pedal.nsample = 0.0, 0
        return
    pedal.delay = latency
    pedal.nsample = math.ceil((latency + period) / spec.option.timestep) + 3


def _set_force_laws(spec: mujoco.MjSpec, block: NDArray[np.float64]) -> None:
    for ordinal, label in enumerate(ACTUATORS):
        user = np.zeros(len(PARAM))
        user[PARAM.magic], user[PARAM.ordinal] = MAGIC, ordinal
        spec.actuator(label).userdata = block if ordinal == ROTOR else user


def wanted_inertia(parameters: Mapping[str, float]) -> NDArray[np.float64]:
    """Return the inertia that a vehicle's parameters ask for, MuJoCo axes, (3, 3).

    The product of inertia counts as in flight mechanics, forward and down; MuJoCo's third axis
    is up, and an inertia's element is minus the product: they are the same number.
    """
    wanted = np.diag([parameters[f"airframe.{axis}"] for axis in ("ixx", "iyy", "izz")])
    if "airframe.ixz" in parameters:
        wanted[0, 2] = wanted[2, 0] = parameters["airframe.ixz"]
    return wanted


def _close_inertia(
    fuselage: mujoco.MjsBody, wanted: NDArray[np.float64], found: NDArray[np.float64]
) -> None:
    """Give the fuselage what the parts, (3, 3), lack of what is wanted of the vehicle, (3, 3).

    An MJCF that is closed already stays as it is written.
    """
    missing = wanted - found
    if np.abs(missing).max() < _CLOSED * wanted.max():
        return
    terms = [missing[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    fuselage.fullinertia = np.asarray(fuselage.fullinertia) + terms


def mass_and_gravity(vehicle: str | PathLike[str]) -> tuple[float, float]:
    """Return a vehicle's mass, kg, and the gravity it flies in, m/s^2, of its MJCF."""
    folder = model_folder(vehicle)
    roles = read_roles(folder)
    spec = mujoco.MjSpec.from_file(str(mjcf_file(folder, roles)))
    roles.rename(spec)
    _drop_old_states(spec)
    model = spec.compile()
    return float(model.body_subtreemass[root_body(model)]), -float(model.opt.gravity[2])


def total_inertia(model: mujoco.MjModel, root: str | int) -> NDArray[np.float64]:
    """Return the inertia of the vehicle about its centre of gravity, MuJoCo axes, (3, 3)."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    body = model.body(root).id
    centre = data.subtree_com[body]
    total = np.zeros((3, 3))
    for part in range(model.nbody):
        if model.body_rootid[part] != body:
            continue
        matrix = data.ximat[part].reshape(3, 3)
        arm = data.xipos[part] - centre
        total += matrix @ np.diag(model.body_inertia[part]) @ matrix.T
        total += model.body_mass[part] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    frame = data.xmat[body].reshape(3, 3)
    return frame.T @ total @ frame


def check_interface(model: mujoco.MjModel) -> None:
    """Check that the model has what the force laws count on, in the order that they count on.

    Raises:
        ModelError: something is missing or out of order.
    """
    check_channels(model)
    rotor = model.actuator("rotor").id
    found = model.actuator_actnum[rotor - ROTOR : rotor + 1].tolist()
    if found[:ROTOR] != [0, 0, 0, 0, 2, 2, 2, 2] or found[ROTOR] < ROTOR_STATES:
        raise ModelError(
            f"actdim must be none of the sticks, 2 of the servos and {ROTOR_STATES} or more of the "
            f"rotor; the MJCF has {', '.join(map(str, found))}"
        )
    if model.nuser_actuator < len(PARAM):
        raise ModelError(f"nuser_actuator is {model.nuser_actuator}, needs {len(PARAM)} or more")
    root_body(model)


def check_channels(model: mujoco.MjModel) -> None:
    """Check that the model has a vehicle's actuators and sensors.

    Raises:
        ModelError: one is missing, out of order, or has another number of values.
    """
    actuators = [model.actuator(k).name for k in range(model.nactuator)]
    sensors = [model.sensor(k).name for k in range(model.nsensor)]
    _require_run(actuators, ACTUATORS, "actuators")
    _require_run(sensors, SENSORS, "sensors")
    for name, numbers in SENSORS.items():
        if model.sensor(name).dim[0] != numbers:
            raise ModelError(
                f"sensor {name!r} must have {numbers} numbers, it has {model.sensor(name).dim[0]}"
            )


def _check_roles(model: mujoco.MjModel, roles: Roles, *, visual: bool) -> None:
    """Check that the bodies and sites are there that are looked up; a picture needs more."""
    wanted = {"body": ROLES["body"] if visual else ("fuselage",), "site": ROLES["site"]}
    for kind, those in wanted.items():
        count, named = getattr(model, f"n{kind}"), getattr(model, kind)
        present = [named(k).name for k in range(count)]
        for role in those:
            name = roles.name(kind, role)
            if name not in present:
                unknown = UnknownNameError(kind, name, filter(None, present))
                raise ModelError(f"the vehicle's {role}: {unknown}")


def _require_run(found: list[str], expected: Iterable[str], what: str) -> None:
    names = list(expected)
    start = found.index(names[0]) if names[0] in found else -1
    if start >= 0 and found[start : start + len(names)] == names:
        return
    missing = [name for name in names if name not in found]
    lacks = f"{', '.join(missing)} missing; " if missing else ""
    raise ModelError(
        f"{what} must be, one after the other, {', '.join(names)}; {lacks}found {', '.join(found)}"
    )
