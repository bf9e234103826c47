"""The numbers that the compiled force laws read, from a vehicle's parameters."""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import ModelError
from helisim.physics.flow import lift_slope
from helisim.physics.gyro import filter_mean, filter_share, filter_through, held_lag
from helisim.physics.layout import (
    LAYOUT,
    MAGIC,
    NEVER,
    PARAM,
    ROTOR,
    SHIPPED_LAW,
    SWASH_STATES,
    TAIL_STATES,
    WASH,
)
from helisim.vehicle.blade import TipPathPlane, with_both
from helisim.vehicle.parameters import Parameters, check_settings, completed, glossary
from helisim.vehicle.swashplate import Swashplate

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
