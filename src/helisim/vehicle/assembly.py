"""A vehicle's model with its parameters applied: parts, force laws' numbers, checks."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Literal, get_args

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import InputError, ModelError, UnknownNameError
from helisim.base.settings import is_number
from helisim.physics.gyro import filter_mean, filter_share, filter_through, held_lag
from helisim.physics.layout import (
    ACTUATORS,
    INJECTION,
    LAYOUT,
    MAGIC,
    NEVER,
    PARAM,
    ROTOR,
    SENSORS,
    SHIPPED_LAW,
    SWASH_STATES,
    TAIL_STATES,
    WASH,
    WITHOUT_LAWS,
)
from helisim.physics.memory import TICK_TOLERANCE, examine
from helisim.vehicle.addresses import addresses, root_body, sling, write_named
from helisim.vehicle.parameters import (
    BODIES,
    SITES,
    Parameters,
    completed,
    glossary,
    mjcf_file,
    model_folder,
    rig_file,
)
from helisim.vehicle.swashplate import Swashplate, TipPathPlane, with_both
from helisim.vehicle.trim import set_governor

_MOTOR = ("inertia", "gear", "lag", "spool_up", "bail_out")
_ENGINE = {  # [drive] > 0 with a motor, and with which engine
    "electric": ("k_i", "voltage", "speed_constant", "resistance", "current_limit"),
    "combustion": ("k_i", "power", "power_speed"),
    "turbine": ("droop", "power", "power_speed", "fuel_lag"),
}
_BATTERY = ("cells", "capacity", "charge", "resistance", "polarisation", "lag", "heat_capacity")


def force_law_block(parameters: Parameters) -> NDArray[np.float64]:
    """Return the force laws' numbers, (n_param,) by `PARAM`; ModelError on an impossible value."""
    parameters = with_both(completed(parameters))
    for timing in ("gyro.period", "gyro.latency", "gyro.ped_latency"):
        if not parameters[timing] <= _LONGEST:
            raise ModelError(f"{timing} is {parameters[timing]:g} s, at most {_LONGEST:g} s")
    if parameters.word("drive.governor") == "motor":
        check_motor(parameters, "drive.governor is 'motor'")
    block = np.zeros(len(PARAM))
    slots = {known.slot: parameters[name] for name, known in glossary().items() if known.slot}
    write_named(block, **slots)
    if parameters.word("drive.supply") == "battery":
        block[PARAM.drive_resistance] -= parameters["battery.resistance"]
    _write_surfaces(parameters, block)
    for rotor in ("main", "tail"):
        blade, chord, radius = (
            parameters[f"{rotor}_rotor.{key}"] for key in ("blades", "chord", "radius")
        )
        block[getattr(PARAM, f"{rotor}_solidity")] = blade * chord / (math.pi * radius)
        if sound := parameters["air.sound_speed"]:
            block[getattr(PARAM, f"{rotor}_mach")] = (
                parameters[f"{rotor}_rotor.speed"] * radius / sound
            )
    blades = parameters["main_rotor.blades"] * parameters["main_rotor.blade_inertia"]
    tilt, phase = parameters["main_rotor.shaft_tilt"], parameters["gyro.phase"]
    disc = TipPathPlane.of(parameters)
    springs = disc.share * parameters["main_rotor.speed"] * disc.springs
    cross = 0.5 * (disc.springs[1, 0] - disc.springs[0, 1])
    # how far sticks reach, as a multiple of what they do where the gains hold
    col, lat, lon = (
        parameters[f"gyro.{rate}"] / parameters[f"gyro_tuned.{rate}"]
        for rate in ("pitch_rate", "aileron_rate", "elevator_rate")
    )
    write_gyro_filters(
        block,
        period=parameters["gyro.period"],
        lead=parameters["gyro.lead_filter"],
        fast=parameters["gyro.filter"],
        slow=parameters["gyro.derivative_filter"],
    )
    write_named(
        block,
        magic=(MAGIC, ROTOR, LAYOUT),
        drive_mast_inertia=min(blades, parameters["drive.inertia"]),
        shaft_cosine=(math.cos(tilt), math.sin(tilt)),
        hub_x=_in_shaft(parameters, parameters["main_rotor.hub_x"], parameters["main_rotor.hub_z"]),
        flap_hold=16.0 * disc.share / parameters["air.density"],
        flap_reduction=parameters["flapping.lock_reduction"],
        flap_stiffness=2.0 * disc.share * abs(cross),
        spring_aa=springs.ravel()[:3],
        cyclic_a_lat=disc.cyclic.ravel(),
        mix_front_col=Swashplate.of(parameters).numbers,
        gyro_phase_cosine=(math.cos(phase), math.sin(phase)),
        gyro_attitude_lock=0.5 * (parameters["gyro.flight_mode"] - 1.0),
        gyro_hold_above=0.5 if parameters["gyro.anti_windup"] else NEVER,
        gyro_collective=col,
        gyro_p_per_lat=(parameters["gyro.p_per_lat"] * lat, parameters["gyro.p_per_lon"] * lon),
        gyro_q_per_lat=(parameters["gyro.q_per_lat"] * lat, parameters["gyro.q_per_lon"] * lon),
        swash_law=(SHIPPED_LAW, SHIPPED_LAW),
        swash_states=(SWASH_STATES, TAIL_STATES),
        **dict.fromkeys(("gyro_on", "remnant_interval", "excitation_duration", "sweep_fade"), 1.0),
    )
    return block


def check_motor(parameters: Parameters, why: str) -> None:
    """Raise ModelError if a parameter of [drive] that a motor needs isn't positive."""
    parameters = completed(parameters)
    engine = str(parameters.word("drive.engine"))
    needed = [f"drive.{name}" for name in (*_MOTOR, *_ENGINE[engine])]
    if parameters.word("drive.supply") == "battery":
        if engine != "electric":
            raise ModelError(f"a battery needs drive.engine 'electric', got {engine!r}")
        needed += [f"battery.{name}" for name in _BATTERY]
        if parameters["battery.resistance"] >= parameters["drive.resistance"]:
            raise ModelError(
                "drive.resistance is that of motor, speed controller, leads and battery together: "
                f"it must be above battery.resistance, got {parameters['drive.resistance']:g} and "
                f"{parameters['battery.resistance']:g} ohm"
            )
    for entry in map(parameters.entry, needed):
        if entry.value <= 0.0:
            raise ModelError(
                f"{why}, and with its {engine} engine that needs a positive "
                f"{entry.name} ({entry.unit}), got {entry.value:g}"
            )


def _in_shaft(parameters: Parameters, x: float, z: float) -> tuple[float, float]:
    tilt = parameters["main_rotor.shaft_tilt"]
    cosine, sine = math.cos(tilt), math.sin(tilt)
    return x * cosine + z * sine, z * cosine - x * sine


def _write_surfaces(parameters: Parameters, block: NDArray[np.float64]) -> None:
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
    """Write the gyro's filters for its period into a vehicle's numbers, (n_param,); all times in s.

    lead, fast, slow: time constants of the yaw rate's lead, the cyclic rates, their derivatives.
    """
    write_named(
        block,
        gyro_lead_share=filter_share(lead, period),
        gyro_lead_lag=held_lag(lead, period),
        gyro_filter_share=filter_share(fast, period),
        gyro_filter_mean=filter_mean(fast, period),
        gyro_derivative_share=filter_share(slow, period),
        gyro_derivative_through=filter_through(fast, slow, period),
        gyro_derivative_lag=held_lag(slow, period),
    )


_AZIMUTHS = (np.arange(180) + 0.5) * math.pi / 90.0
_SKEWS = np.linspace(0.0, math.pi, 91)
_SPREAD = (-0.1, 0.0, 0.1)  # radii about a tail: where its wash is averaged, x and z
_STEPS = (np.arange(10) + 0.5) / 10.0  # radii of the tubes of a load that grows outwards
# _CONTRACTION: of a hover's wake, to 0.85 radii
# _CORE: radius of the vortices' core over the rotor's
_CONTRACTION, _CORE = 0.85**-4 - 1.0, 0.05
_FAR = 100.0  # radii, beyond which no wake is felt
_DIGITS = 4  # to which the coefficients are rounded, so that they are the same on every machine


def downwash(
    x: ArrayLike, z: ArrayLike, skew: ArrayLike, *, radius: ArrayLike = 1.0, core: float = 0.0
) -> NDArray[np.float64]:
    """Return the downward velocity in a rotor's wake over that at the disc's centre, (n_place,).

    A tube of vortex rings at the skew angle (Coleman, Feingold and Stempin, NACA ARR L5E10; Castles
    and De Leeuw, NACA TR 1184). Lengths are over the rotor's radius; arguments (n_place,) each.

    x, z: ahead of and below the centre; skew: wake's axis to the disc's, rad: 0 in hover, near pi/2
    at speed, more where air passes the disc upwards; radius: of the tube; core: of the vortices.
    """
    x, z, skew, radius = (np.asarray(one, dtype=float)[..., None] for one in (x, z, skew, radius))
    cosine = np.cos(_AZIMUTHS)
    ahead = x - radius * cosine
    distance = np.sqrt(ahead**2 + (radius * np.sin(_AZIMUTHS)) ** 2 + z**2 + core**2)
    around = (radius - x * cosine) / distance - np.sin(skew) * cosine
    return np.mean(radius * around / (distance + ahead * np.sin(skew) - z * np.cos(skew)), axis=-1)


def loaded_downwash(
    x: ArrayLike, z: ArrayLike, skew: ArrayLike, *, radius: ArrayLike = 1.0, core: float = 0.0
) -> NDArray[np.float64]:
    """Return `downwash` over the disc's mean, of a load of 3/4 + 3/8 r instead of a uniform one.

    Each step of it leaves a tube (Heyson and Katzoff, NACA Rep. 1319); a quarter of the load grows
    with the radius, between what pressure in a hover and wash behind a rotor are measured to be.
    """
    inner = [downwash(x, z, skew, radius=np.multiply(radius, one), core=core) for one in _STEPS]
    return 1.125 * downwash(x, z, skew, radius=radius, core=core) - 0.375 * np.mean(inner, axis=0)


@lru_cache(maxsize=64)
def wash_coefficients(x: float, z: float) -> tuple[float, ...]:
    """Return the `WASH` numbers of the wash at a place ahead of and below the hub, over its radius.

    The tube contracts in hover to 0.85 radii, as Boatwright measured (Prouty, figure 4.6), not at
    speed; upwash beside it in hover is left out.
    """
    if not math.hypot(x, z) < _FAR:
        return (0.0,) * WASH
    cosine = np.cos(_SKEWS)
    tube = (1.0 + _CONTRACTION * np.maximum(cosine, 0.0) ** 2) ** -0.25
    places = [(x + dx, z + dz) for dx in _SPREAD for dz in _SPREAD]
    wash = np.mean([loaded_downwash(*at, _SKEWS, radius=tube, core=_CORE) for at in places], axis=0)
    hover, descent = max(0.0, float(wash[0])), float(wash[-1])
    upright = np.where(cosine > 0.0, hover, descent) * cosine**2
    powers = cosine[:, None] ** np.arange(WASH - 2)
    fitted = np.linalg.lstsq(np.sin(_SKEWS)[:, None] ** 2 * powers, wash - upright, rcond=None)[0]
    return tuple(round(float(one), _DIGITS) for one in (hover, descent, *fitted))


Integrator = Literal["RK4", "Euler"]
Around = Callable[[mujoco.MjSpec, mujoco.MjModel], None]  # adds what the vehicle can touch
_INTEGRATORS = {
    name: getattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}") for name in get_args(Integrator)
}
NEEDS_INERTIAL = 'needs <inertial pos=".." mass=".." fullinertia=".."/>'
_CLOSED = 1e-13  # relative rounding of the parts' sum of inertias
_LONGEST = 10.0  # s, of the gyro's period and latencies: MuJoCo keeps what happened in it


def assemble(
    vehicle: str | PathLike[str],
    parameters: Parameters,
    *,
    timestep: float | None = None,
    integrator: Integrator | None = None,
    visual: bool = False,
    rig: str | None = None,
    around: Around | None = None,
    states: int = 0,
    slung: str = "",
) -> mujoco.MjModel:
    """Compile a vehicle's MJCF with its parameters; to fly, its parts are fused into one body.

    timestep (s) and integrator: the MJCF's own if None; visual: keep every part, and the scene;
    rig: one of `rig_names`, None to fly; states: of the control laws; slung: MJCF of what hangs on
    it. Raises InputError, UnknownNameError (vehicle, rig), or ModelError if the MJCF is refused.
    """
    if timestep is not None and not (is_number(timestep) and 0.0 < timestep < math.inf):
        raise InputError(f"timestep must be a positive number of seconds, got {timestep!r:.60}")
    if integrator not in (None, *_INTEGRATORS):
        raise InputError(f"integrator must be 'RK4' or 'Euler', got {integrator!r}")
    folder = model_folder(vehicle)
    path, scene = mjcf_file(folder) if rig is None else rig_file(folder, rig), folder / "scene.xml"
    path = scene if visual and scene.is_file() else path
    block = force_law_block(parameters)
    with _named(path):
        spec = mujoco.MjSpec.from_file(str(path))
        if timestep is not None:
            spec.option.timestep = timestep
        if integrator is not None:
            spec.option.integrator = _INTEGRATORS[integrator]
        for seen in () if visual else [*spec.cameras, *spec.lights]:
            spec.delete(seen)  # MuJoCo moves them along in each evaluation
        spec.compiler.discardvisual = not visual
        parts = put_into(spec, parameters, block, visual=visual)
        if slung:
            sling(spec, parts, slung)
        if around is not None:
            around(spec, parts)
        elif rig is None and not visual and not slung:  # alone in the air nothing is touched
            spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        spec.compiler.fusestatic = not visual
        rotor = spec.actuator("rotor")
        rotor.actdim = max(rotor.actdim, WITHOUT_LAWS + 2 * states)
        model = spec.compile()
        for fault in examine(model):
            raise ModelError(fault)
    set_governor(model, float(block[PARAM.drive_governor]))
    return model


def put_into(
    spec: mujoco.MjSpec,
    parameters: Parameters,
    block: NDArray[np.float64],
    *,
    visual: bool = False,
) -> mujoco.MjModel:
    """Return the model compiled before parameters and `block`, (n_param,), are put into `spec`."""
    _drop_old_states(spec)
    parts = _weighed(spec, spec.compile(), parameters)
    _check_names(parts, visual=visual)
    _set_delays(spec, parameters)
    for ordinal, label in enumerate(ACTUATORS):
        user = np.zeros(len(PARAM))
        user[PARAM.magic], user[PARAM.ordinal] = MAGIC, ordinal
        spec.actuator(label).userdata = block if ordinal == ROTOR else user
    spec.nuserdata = max(spec.nuserdata, len(INJECTION))  # what a manoeuvre adds
    wanted = wanted_inertia(parameters)
    missing = wanted - total_inertia(parts, root_body(parts))
    if np.abs(missing).max() >= _CLOSED * wanted.max():  # else it is closed as it is written
        fuselage = spec.body("fuselage")
        terms = missing[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        fuselage.fullinertia = np.asarray(fuselage.fullinertia) + terms
    return parts


def _weighed(
    spec: mujoco.MjSpec, parts: mujoco.MjModel, parameters: Mapping[str, float]
) -> mujoco.MjModel:
    """Give the fuselage what the parts lack of the mass, at the centre of gravity."""
    root = root_body(parts)
    own = float(parts.body_subtreemass[root])
    wanted = parameters.get("airframe.mass", own)
    missing = wanted - own
    if abs(missing) < _CLOSED * wanted:
        return parts
    data, fuselage = mujoco.MjData(parts), spec.body("fuselage")
    mujoco.mj_kinematics(parts, data)
    mujoco.mj_comPos(parts, data)
    body, mass = data.body("fuselage"), fuselage.mass + missing
    if not fuselage.explicitinertial:
        raise ModelError(f'<body name="fuselage"> {NEEDS_INERTIAL}')
    if mass <= 0.0:
        raise ModelError(
            f"airframe.mass is {wanted:g} kg, and the parts beside the fuselage have "
            f"{wanted - mass:g} kg already"
        )
    centre = body.xmat.reshape(3, 3).T @ (data.subtree_com[root] - body.xpos)
    fuselage.ipos = (fuselage.mass * np.asarray(fuselage.ipos) + missing * centre) / mass
    fuselage.mass = mass
    return spec.compile()


def with_room(
    model: mujoco.MjModel,
    folder: Path,
    parameters: Parameters,
    states: int,
    around: Around | None = None,
    slung: str = "",
) -> mujoco.MjModel:
    """Return a vehicle's model with room for so many states of control laws, and with `around`."""
    larger = assemble(
        folder,
        parameters,
        timestep=float(model.opt.timestep),
        integrator="RK4" if model.opt.integrator == _INTEGRATORS["RK4"] else "Euler",
        around=around,
        states=states,
        slung=slung,
    )
    there, here = addresses(larger).rotor, addresses(model).rotor
    larger.actuator_user[there] = model.actuator_user[here]
    larger.opt.wind[:] = model.opt.wind
    set_governor(larger, model.actuator_user[here, PARAM.drive_governor])
    return larger


@contextmanager
def _named(path: Path) -> Iterator[None]:
    try:
        yield
    except (ValueError, KeyError, ModelError) as error:
        reason = " ".join(str(error).split())  # MuJoCo's run over several lines
        reason = reason.partition(" The visual elements of the spec were discarded")[0]
        raise ModelError(
            f"{path}: {reason}"
            + (
                "; the parts' inertias leave the fuselage none that a body can have: change "
                "airframe.ixx, airframe.iyy or airframe.izz"
                if "A + B >= C" in reason or "positive eigenvalues" in reason
                else ""
            )
        ) from None


def _drop_old_states(spec: mujoco.MjSpec) -> None:
    """Take keyframes for another number of activations out."""
    states = 0
    for actuator in spec.actuators:
        dynamic = actuator.dyntype != mujoco.mjtDyn.mjDYN_NONE
        states += actuator.actdim if actuator.actdim > 0 else int(dynamic)
    for key in spec.keys:
        if len(key.act) not in (0, states):
            key.act = []


def _set_delays(spec: mujoco.MjSpec, parameters: Parameters) -> None:
    sensor, pedal, step = spec.sensor("gyro_rate"), spec.actuator("PED"), spec.option.timestep
    period, latency, late = (
        parameters[f"gyro.{name}"] for name in ("period", "latency", "ped_latency")
    )
    steps = period / step
    if abs(steps - round(steps)) > TICK_TOLERANCE or steps < 0.5:
        raise ModelError(
            f"gyro.period must be a whole number of time steps of {step:g} s, got {period:g} s"
        )
    for name, wait, least in (("latency", latency, step), ("ped_latency", late, period)):
        if 0.0 != wait < least:
            raise ModelError(f"gyro.{name} must be 0 or at least {least:g} s, got {wait:g} s")
    early = 0.25 * step  # so that rounding of the time never skips a sample
    sensor.interval = [period, -early]
    sensor.delay = max(0.0, latency - early)
    sensor.nsample = math.ceil(latency / period) + 2
    pedal.delay = late
    pedal.nsample = math.ceil((late + period) / step) + 3 if late else 0


def wanted_inertia(parameters: Mapping[str, float]) -> NDArray[np.float64]:
    """Return the parameters' inertia, MuJoCo axes, (3, 3); ixz as in flight mechanics (FRD)."""
    wanted = np.diag([parameters[f"airframe.{axis}"] for axis in ("ixx", "iyy", "izz")])
    if "airframe.ixz" in parameters:
        wanted[0, 2] = wanted[2, 0] = parameters["airframe.ixz"]
    return wanted


def mass_and_gravity(
    vehicle: str | PathLike[str], given: Mapping[str, float]
) -> tuple[float, float]:
    """Return a vehicle's mass, kg, given or of its MJCF, and the gravity it flies in, m/s^2."""
    with _named(path := mjcf_file(model_folder(vehicle))):
        spec = mujoco.MjSpec.from_file(str(path))
        _drop_old_states(spec)
        model = spec.compile()
    own = float(model.body_subtreemass[root_body(model)])
    return given.get("airframe.mass", own), -float(model.opt.gravity[2])


def total_inertia(model: mujoco.MjModel, root: str | int) -> NDArray[np.float64]:
    """Return the inertia of the vehicle about its centre of gravity, MuJoCo axes, (3, 3)."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    body = model.body(root).id
    total = np.zeros((3, 3))
    for part in np.flatnonzero(model.body_rootid == body):
        matrix, arm = data.ximat[part].reshape(3, 3), data.xipos[part] - data.subtree_com[body]
        total += matrix @ np.diag(model.body_inertia[part]) @ matrix.T
        total += model.body_mass[part] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    frame = data.xmat[body].reshape(3, 3)
    return frame.T @ total @ frame


def _check_names(model: mujoco.MjModel, *, visual: bool) -> None:
    wanted = {"actuator": ACTUATORS, "sensor": SENSORS, "body": BODIES, "site": SITES}
    if not visual:
        wanted["body"] = BODIES[:1]
    for kind, names in wanted.items():
        present = [getattr(model, kind)(k).name for k in range(getattr(model, f"n{kind}"))]
        for name in (name for name in names if name not in present):
            raise ModelError(str(UnknownNameError(kind, name, filter(None, present))))


def lift_slope(aspect_ratio: float) -> float:
    """Return the lift slope, 1/rad, of a flat surface (Helmbold; Anderson, section 5.3)."""
    return 2.0 * math.pi * aspect_ratio / (2.0 + math.hypot(aspect_ratio, 2.0))
