"""A vehicle's model with its parameters applied: parts, force laws' numbers, checks."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Literal, get_args

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import InputError, ModelError, UnknownNameError
from helisim.physics.gyro import filter_mean, filter_share, filter_through, held_lag
from helisim.physics.layout import (
    ACTUATORS,
    INJECTION,
    LAYOUT,
    MAGIC,
    NEVER,
    PARAM,
    ROTOR,
    ROTOR_STATES,
    SENSORS,
    SHIPPED_LAW,
    SWASH_STATES,
    TAIL_STATES,
    WASH,
    WITHOUT_LAWS,
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
from helisim.vehicle.parameters import Parameters, check_settings, completed, glossary
from helisim.vehicle.swashplate import Swashplate, TipPathPlane, with_both
from helisim.vehicle.trim import addresses, root_body

_MOTOR = ("inertia", "gear", "lag", "k_i", "spool_up", "bail_out")
_ENGINE = {
    "electric": ("voltage", "speed_constant", "resistance", "current_limit"),
    "combustion": ("power", "power_speed"),
}
"""Parameters of [drive] that must be positive with a motor, and with which engine."""


def force_law_block(parameters: Parameters) -> NDArray[np.float64]:
    """Return the numbers that the compiled force laws read, (n_param,) by `PARAM`, pilot at rest.

    Raises:
        ModelError: a parameter has a sign that it can't have.
        InputError: the gyro has no such setting.
    """
    parameters = completed(parameters)
    check_settings(parameters)
    direction = parameters["main_rotor.direction"]
    if direction not in (-1.0, 1.0):
        raise ModelError(
            "main_rotor.direction must be 1 for blades that turn clockwise seen from above, or -1 "
            f"for the others, got {direction:g}"
        )
    for known in glossary().values():
        if known.name in parameters and (fault := known.fault(parameters[known.name])):
            raise ModelError(fault)
    if (share := parameters["air.ground_effect"]) > 1.0:
        raise ModelError(f"parameter 'air.ground_effect' must be from 0 to 1, got {share:g}")
    if parameters.word("drive.governor") == "motor":
        check_motor(parameters, "drive.governor is 'motor'")
    parameters = with_both(parameters)
    block = np.zeros(len(PARAM))
    block[PARAM.magic] = MAGIC
    block[PARAM.ordinal] = ROTOR
    block[PARAM.layout] = LAYOUT
    for known in glossary().values():
        if known.slot:
            block[getattr(PARAM, known.slot)] = parameters[known.name]
    tilt = parameters["main_rotor.shaft_tilt"]
    block[PARAM.shaft_cosine], block[PARAM.shaft_sine] = math.cos(tilt), math.sin(tilt)
    x, z = parameters["main_rotor.hub_x"], parameters["main_rotor.hub_z"]
    block[PARAM.hub_x], block[PARAM.hub_z] = _in_shaft(parameters, x, z)
    _write_surfaces(parameters, block)
    block[PARAM.main_solidity] = _solidity(parameters, "main_rotor")
    block[PARAM.tail_solidity] = _solidity(parameters, "tail_rotor")
    disc = TipPathPlane.of(parameters)
    springs = disc.share * parameters["main_rotor.speed"] * disc.springs
    cross = 0.5 * (disc.springs[1, 0] - disc.springs[0, 1])
    block[PARAM.flap_hold] = 16.0 * disc.share / parameters["air.density"]
    block[PARAM.flap_reduction] = parameters["flapping.lock_reduction"]
    block[PARAM.flap_stiffness] = 2.0 * disc.share * abs(cross)
    block[PARAM.spring_aa : PARAM.spring_ba + 1] = springs.ravel()[:3]
    block[PARAM.cyclic_a_lat : PARAM.cyclic_b_lon + 1] = disc.cyclic.ravel()
    Swashplate.of(parameters).write(block)
    block[PARAM.gyro_phase_cosine] = math.cos(parameters["gyro.phase"])
    block[PARAM.gyro_phase_sine] = math.sin(parameters["gyro.phase"])
    block[PARAM.gyro_attitude_lock] = 0.5 * (parameters["gyro.flight_mode"] - 1.0)
    block[PARAM.gyro_hold_above] = 0.5 if parameters["gyro.anti_windup"] else NEVER
    block[PARAM.gyro_collective] = _travel(parameters, "pitch_rate")
    for stick, rate in (("lat", "aileron_rate"), ("lon", "elevator_rate")):
        for answer in ("p", "q"):
            commanded = parameters[f"gyro.{answer}_per_{stick}"] * _travel(parameters, rate)
            block[getattr(PARAM, f"gyro_{answer}_per_{stick}")] = commanded
    write_gyro_filters(
        block,
        period=parameters["gyro.period"],
        lead=parameters["gyro.lead_filter"],
        fast=parameters["gyro.filter"],
        slow=parameters["gyro.derivative_filter"],
    )
    block[PARAM.gyro_on] = 1.0
    block[PARAM.swash_law] = block[PARAM.tail_law] = SHIPPED_LAW
    block[PARAM.swash_states], block[PARAM.tail_states] = SWASH_STATES, TAIL_STATES
    block[PARAM.remnant_interval] = 1.0
    block[PARAM.excitation_duration] = 1.0
    block[PARAM.sweep_fade] = 1.0
    return block


def check_motor(parameters: Parameters, why: str) -> None:
    """Check what a motor needs of [drive], whether the vehicle's own governor has one or not.

    parameters: of the vehicle; why: a motor turns the rotor, for the message.

    Raises:
        ModelError: a parameter is not positive.
    """
    parameters = completed(parameters)
    engine = str(parameters.word("drive.engine"))
    for name in (*_MOTOR, *_ENGINE[engine]):
        entry = parameters.entry(f"drive.{name}")
        if entry.value <= 0.0:
            raise ModelError(
                f"{why}, and with its {engine} engine that needs a positive "
                f"{entry.name} ({entry.unit}), got {entry.value:g}"
            )


def _in_shaft(parameters: Parameters, x: float, z: float) -> tuple[float, float]:
    """Return what is ahead and below in shaft axes."""
    tilt = parameters["main_rotor.shaft_tilt"]
    cosine, sine = math.cos(tilt), math.sin(tilt)
    return x * cosine + z * sine, z * cosine - x * sine


def _write_surfaces(parameters: Parameters, block: NDArray[np.float64]) -> None:
    """Write shape and incidence of fin and tailplane, and the rotor's wash at the tail."""
    for surface, first in (("fin", PARAM.fin_slope), ("tailplane", PARAM.tailplane_slope)):
        incidence = parameters[f"{surface}.incidence"]
        slope = lift_slope(parameters[f"{surface}.aspect_ratio"])
        block[first : first + 3] = slope, math.cos(incidence), math.sin(incidence)
    radius = parameters["main_rotor.radius"]
    for first, x, z in (
        (PARAM.tail_wash, "tail_rotor.arm_x", "tail_rotor.arm_z"),
        (PARAM.tailplane_wash, "tailplane.x", "tailplane.z"),
    ):
        ahead = (parameters[x] - parameters["main_rotor.hub_x"]) / radius
        below = (parameters[z] - parameters["main_rotor.hub_z"]) / radius
        coefficients = np.array(wash_coefficients(*_in_shaft(parameters, ahead, below)))
        block[first : first + WASH] = parameters["airframe.tail_wash"] * coefficients


def write_gyro_filters(
    block: NDArray[np.float64], *, period: float, lead: float, fast: float, slow: float
) -> None:
    """Write what the gyro's filters are at its ticks.

    block: a vehicle's numbers, (n_param,), written; period: s; lead: time constant of the lead of
    the yaw rate, s; fast: time constant of the filter of the cyclic rates, s; slow: time constant
    of that of their derivatives, s.
    """
    block[PARAM.gyro_lead_share] = filter_share(lead, period)
    block[PARAM.gyro_lead_lag] = held_lag(lead, period)
    block[PARAM.gyro_filter_share] = filter_share(fast, period)
    block[PARAM.gyro_filter_mean] = filter_mean(fast, period)
    block[PARAM.gyro_derivative_share] = filter_share(slow, period)
    block[PARAM.gyro_derivative_through] = filter_through(fast, slow, period)
    block[PARAM.gyro_derivative_lag] = held_lag(slow, period)


def _travel(parameters: Parameters, rate: str) -> float:
    """Return how far a stick reaches, as a multiple of what it does where the gains hold."""
    return parameters[f"gyro.{rate}"] / parameters[f"gyro_tuned.{rate}"]


def _solidity(parameters: Parameters, rotor: str) -> float:
    blade_area = parameters[f"{rotor}.blades"] * parameters[f"{rotor}.chord"]
    return blade_area / (math.pi * parameters[f"{rotor}.radius"])


_AZIMUTHS = (np.arange(180) + 0.5) * math.pi / 90.0
_SKEWS = np.linspace(0.0, math.pi, 91)
_SPREAD = np.array([-0.1, 0.0, 0.1])
"""Over how many radii about its place the wash of a tail is averaged, along x and z."""
_CORE = 0.05
"""Radius of the vortices' core over the rotor's: a place may lie on the wake's edge."""
_FAR = 100.0
"""Radii, beyond which no wake is felt."""
_DIGITS = 4
"""To which the coefficients are rounded, so that they are the same on every machine."""


def downwash(
    x: ArrayLike, z: ArrayLike, skew: ArrayLike, *, radius: ArrayLike = 1.0, core: float = 0.0
) -> NDArray[np.float64]:
    """Return the velocity down, over that at the disc's centre, in a rotor's wake.

    The wake of a uniformly loaded disc is a tube of vortex rings that drift off at the skew angle
    (Coleman, Feingold and Stempin, NACA ARR L5E10; Castles and De Leeuw, NACA TR 1184). Along
    the tube the integral is closed, around it a sum. An array, (n_place,), of
    each gives one.

    x: ahead of the centre, over the rotor's radius; z: below the centre, likewise; skew: angle
    between the wake's axis and the disc's, rad: 0 in hover, near pi/2 at speed, more where the air
    passes the disc upwards; radius: of the tube, over the rotor's; core: of the vortices, likewise.
    """
    x, z, skew, radius = (np.asarray(one, dtype=float)[..., None] for one in (x, z, skew, radius))
    cosine = np.cos(_AZIMUTHS)
    ahead = x - radius * cosine
    distance = np.sqrt(ahead**2 + (radius * np.sin(_AZIMUTHS)) ** 2 + z**2 + core**2)
    around = (radius - x * cosine) / distance - np.sin(skew) * cosine
    along = distance + ahead * np.sin(skew) - z * np.cos(skew)
    return np.mean(radius * around / along, axis=-1)


@lru_cache(maxsize=64)
def wash_coefficients(x: float, z: float) -> tuple[float, ...]:
    """Return the `WASH` numbers of the wash at a place, over the rotor's radius from its hub.

    The tube contracts as momentum theory has it: to 0.71 radii in hover, not at all at speed.
    Beside it the air of a hover rises at less than a tenth of what falls within: that is left out.

    x: ahead of the hub; z: below it.
    """
    if not math.hypot(x, z) < _FAR:
        return (0.0,) * WASH
    cosine = np.cos(_SKEWS)
    down = np.maximum(cosine, 0.0)
    wash = _mean_wash(x, z, _SKEWS, (1.0 + 3.0 * down**2) ** -0.25)
    hover, descent = max(0.0, float(wash[0])), float(wash[-1])
    upright = np.where(cosine > 0.0, hover, descent) * cosine**2
    powers = cosine[:, None] ** np.arange(WASH - 2)
    basis = np.sin(_SKEWS)[:, None] ** 2 * powers
    fitted = np.linalg.lstsq(basis, wash - upright, rcond=None)[0]
    return tuple(round(float(one), _DIGITS) for one in (hover, descent, *fitted))


def _mean_wash(
    x: float, z: float, skew: NDArray[np.float64], radius: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the downwash about a place, (n_skew,)."""
    around = [
        downwash(x + dx, z + dz, skew, radius=radius, core=_CORE)
        for dx in _SPREAD
        for dz in _SPREAD
    ]
    return np.mean(around, axis=0)


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
        rotor.actdim = max(rotor.actdim, WITHOUT_LAWS + 2 * states)
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


def lift_slope(aspect_ratio):
    """Return the lift slope, 1/rad, of a flat surface (Helmbold's formula).

    From 2 pi of an endless one to pi A / 2 of a slender one (Anderson, Fundamentals of
    Aerodynamics, section 5.3).

    Args:
        aspect_ratio: A, span squared over area.
    """
    return 2.0 * math.pi * aspect_ratio / (2.0 + math.hypot(aspect_ratio, 2.0))
