"""The numbers that the compiled force laws read, from a vehicle's parameters."""

import math

import numpy as np
from numpy.typing import NDArray

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
from helisim.vehicle.blade import TipPathPlane
from helisim.vehicle.blade_inertia import with_both
from helisim.vehicle.parameters import Parameters, check_settings, completed
from helisim.vehicle.swashplate import Swashplate
from helisim.vehicle.wake import wash_coefficients

_DIRECT = {
    "air_density": "air.density",
    "ground_effect": "air.ground_effect",
    "main_direction": "main_rotor.direction",
    "main_radius": "main_rotor.radius",
    "main_speed": "main_rotor.speed",
    "main_lift_slope": "main_rotor.lift_slope",
    "main_induced_factor": "main_rotor.induced_factor",
    "main_profile_drag": "main_rotor.profile_drag",
    "main_pitch_trim": "main_rotor.pitch_trim",
    "main_pitch_range": "main_rotor.pitch_range",
    "main_twist": "main_rotor.twist",
    "main_stall": "main_rotor.stall",
    "main_dynamic_inflow": "main_rotor.inflow",
    "hub_stiffness": "main_rotor.hub_stiffness",
    "hub_cross": "main_rotor.hub_cross",
    "flap_back": "main_rotor.flap_back",
    "flap_stop": "main_rotor.flap_stop",
    "tail_radius": "tail_rotor.radius",
    "tail_speed": "tail_rotor.speed",
    "tail_lift_slope": "tail_rotor.lift_slope",
    "tail_pitch_trim": "tail_rotor.pitch_trim",
    "tail_pitch_range": "tail_rotor.pitch_range",
    "tail_stall": "tail_rotor.stall",
    "tail_induced_factor": "tail_rotor.induced_factor",
    "tail_profile_drag": "tail_rotor.profile_drag",
    "tail_direction": "tail_rotor.direction",
    "tail_x": "tail_rotor.arm_x",
    "tail_z": "tail_rotor.arm_z",
    "tail_blockage": "tail_rotor.blockage",
    "drive_governor": "drive.governor",
    "drive_engine": "drive.engine",
    "drive_inertia": "drive.inertia",
    "drive_friction": "drive.friction",
    "drive_gear": "drive.gear",
    "drive_voltage": "drive.voltage",
    "drive_speed_constant": "drive.speed_constant",
    "drive_resistance": "drive.resistance",
    "drive_no_load_current": "drive.no_load_current",
    "drive_current_limit": "drive.current_limit",
    "drive_power": "drive.power",
    "drive_power_speed": "drive.power_speed",
    "drive_lag": "drive.lag",
    "drive_k_p": "drive.k_p",
    "drive_k_i": "drive.k_i",
    "drive_collective_gain": "drive.collective_gain",
    "drive_spool_up": "drive.spool_up",
    "drive_bail_out": "drive.bail_out",
    "drag_x": "airframe.drag_area_x",
    "drag_y": "airframe.drag_area_y",
    "drag_z": "airframe.drag_area_z",
    "drag_centre_x": "airframe.drag_centre_x",
    "drag_centre_z": "airframe.drag_centre_z",
    "pitch_volume": "airframe.pitch_volume",
    "pitch_zero": "airframe.pitch_zero",
    "yaw_volume": "airframe.yaw_volume",
    "download": "airframe.download",
    "fin_area": "fin.area",
    "fin_x": "fin.x",
    "fin_z": "fin.z",
    "fin_stall": "fin.stall",
    "tailplane_area": "tailplane.area",
    "tailplane_x": "tailplane.x",
    "tailplane_z": "tailplane.z",
    "tailplane_stall": "tailplane.stall",
    "swash_frequency": "servo.swash_frequency",
    "swash_damping": "servo.swash_damping",
    "tail_frequency": "servo.tail_frequency",
    "tail_damping": "servo.tail_damping",
    "servo_rate_limit": "servo.rate_limit",
    "servo_travel": "servo.travel",
    "gyro_period": "gyro.period",
    "gyro_heading_lock": "gyro.heading_lock",
    "gyro_k_p": "gyro.k_p",
    "gyro_k_i": "gyro.k_i",
    "gyro_k_delta": "gyro.k_delta",
    "gyro_k_a": "gyro.k_a",
    "gyro_lead": "gyro.lead",
    "gyro_kp_lat": "gyro.kp_lat",
    "gyro_kp_lon": "gyro.kp_lon",
    "gyro_ki_lat": "gyro.ki_lat",
    "gyro_ki_lon": "gyro.ki_lon",
    "gyro_kd_lat": "gyro.kd_lat",
    "gyro_kd_lon": "gyro.kd_lon",
    "pilot_k_attitude": "pilot.k_attitude",
    "pilot_k_velocity": "pilot.k_velocity",
    "pilot_k_position": "pilot.k_position",
    "pilot_k_heave": "pilot.k_heave",
    "pilot_k_height": "pilot.k_height",
    "pilot_k_heading": "pilot.k_heading",
}
"""Slot of the compiled force laws -> parameter, where one is simply the other."""

_POSITIVE = (
    "air.density",
    "airframe.ixx",
    "airframe.iyy",
    "airframe.izz",
    "main_rotor.induced_factor",
    "main_rotor.radius",
    "main_rotor.chord",
    "main_rotor.blades",
    "main_rotor.speed",
    "main_rotor.lift_slope",
    "main_rotor.stall",
    "main_rotor.flap_stop",
    "main_rotor.blade_inertia",
    "flapping.tau_f",
    "flapping.lock_reduction",
    "tail_rotor.radius",
    "tail_rotor.chord",
    "tail_rotor.blades",
    "tail_rotor.speed",
    "tail_rotor.lift_slope",
    "tail_rotor.stall",
    "tail_rotor.induced_factor",
    "fin.aspect_ratio",
    "fin.stall",
    "tailplane.aspect_ratio",
    "tailplane.stall",
    "servo.swash_frequency",
    "servo.swash_damping",
    "servo.tail_frequency",
    "servo.tail_damping",
    "servo.rate_limit",
    "servo.travel",
    "gyro.period",
    "gyro.k_i",
    "gyro.ki_lat",
    "gyro.ki_lon",
    "gyro.lead_filter",
    "gyro.filter",
    "gyro.derivative_filter",
)


_NOT_NEGATIVE = (
    "air.ground_effect",
    "airframe.drag_area_x",
    "airframe.drag_area_y",
    "airframe.drag_area_z",
    "airframe.pitch_volume",
    "airframe.yaw_volume",
    "airframe.download",
    "fin.area",
    "tailplane.area",
    "tail_rotor.blockage",
    "airframe.tail_wash",
    "main_rotor.profile_drag",
    "tail_rotor.profile_drag",
    "main_rotor.hub_stiffness",
    "main_rotor.flap_back",
    "gyro.ped_latency",
    "gyro.latency",
    "gyro.lead",
)

_MOTOR = ("inertia", "gear", "lag", "k_i", "spool_up", "bail_out")
_ENGINE = {
    "electric": ("voltage", "speed_constant", "resistance", "current_limit"),
    "combustion": ("power", "power_speed"),
}
"""Of [drive], what must be positive where a motor turns the rotor, and of which engine."""


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
    for name in _POSITIVE:
        if name in parameters and parameters[name] <= 0.0:
            raise ModelError(f"parameter {name!r} must be positive, got {parameters[name]:g}")
    for name in _NOT_NEGATIVE:
        if parameters[name] < 0.0:
            raise ModelError(f"parameter {name!r} must be 0 or more, got {parameters[name]:g}")
    if parameters["air.ground_effect"] > 1.0:
        given = parameters["air.ground_effect"]
        raise ModelError(f"parameter 'air.ground_effect' must be from 0 to 1, got {given:g}")
    _check_drive(parameters)
    parameters = with_both(parameters)
    block = np.zeros(len(PARAM))
    block[PARAM.magic] = MAGIC
    block[PARAM.ordinal] = ROTOR
    block[PARAM.layout] = LAYOUT
    for slot, name in _DIRECT.items():
        block[getattr(PARAM, slot)] = parameters[name]
    _write_hub(parameters, block)
    _write_surfaces(parameters, block)
    block[PARAM.main_solidity] = _solidity(parameters, "main_rotor")
    block[PARAM.tail_solidity] = _solidity(parameters, "tail_rotor")
    _write_flapping(parameters, block)
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


def _write_flapping(parameters: Parameters, block: NDArray[np.float64]) -> None:
    disc = TipPathPlane.of(parameters)
    springs = disc.share * parameters["main_rotor.speed"] * disc.springs
    cross = 0.5 * (disc.springs[1, 0] - disc.springs[0, 1])
    block[PARAM.flap_hold] = 16.0 * disc.share / parameters["air.density"]
    block[PARAM.flap_reduction] = parameters["flapping.lock_reduction"]
    block[PARAM.flap_stiffness] = 2.0 * disc.share * abs(cross)
    block[PARAM.spring_aa : PARAM.spring_ba + 1] = springs.ravel()[:3]
    block[PARAM.cyclic_a_lat : PARAM.cyclic_b_lon + 1] = disc.cyclic.ravel()


def _check_drive(parameters: Parameters) -> None:
    for name in ("friction", "no_load_current", "k_p", "collective_gain"):
        if parameters[f"drive.{name}"] < 0.0:
            given = parameters[f"drive.{name}"]
            raise ModelError(f"parameter 'drive.{name}' must be 0 or more, got {given:g}")
    if parameters.word("drive.governor") == "motor":
        check_motor(parameters, "drive.governor is 'motor'")


def check_motor(parameters: Parameters, why: str) -> None:
    """Check what a motor needs of [drive], whether the vehicle's own governor has one or not.

    Args:
        parameters: of the vehicle.
        why: a motor turns the rotor, for the message.

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


def _write_hub(parameters: Parameters, block: NDArray[np.float64]) -> None:
    """Write how the shaft leans, and the hub in its axes."""
    tilt = parameters["main_rotor.shaft_tilt"]
    block[PARAM.shaft_cosine], block[PARAM.shaft_sine] = math.cos(tilt), math.sin(tilt)
    x, z = parameters["main_rotor.hub_x"], parameters["main_rotor.hub_z"]
    block[PARAM.hub_x], block[PARAM.hub_z] = _in_shaft(parameters, x, z)


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

    Args:
        block: a vehicle's numbers, (n_param,), written.
        period: s.
        lead: time constant of the lead of the yaw rate, s.
        fast: time constant of the filter of the cyclic rates, s.
        slow: time constant of that of their derivatives, s.
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
