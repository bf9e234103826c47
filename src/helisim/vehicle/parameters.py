"""The physical parameters of a vehicle: named values with units and where they come from."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from helisim.errors import InputError, ModelError, StorageError, UnknownNameError
from helisim.physics.gyro import held_lag
from helisim.physics.layout import MAGIC, NEVER, PARAM, ROTOR
from helisim.storage import read_toml


@dataclass(frozen=True)
class Parameter:
    """One physical parameter: dotted name, value, unit (SI) and source."""

    name: str
    value: float
    unit: str
    source: str


class Parameters(Mapping[str, float]):
    """Values by dotted name, such as `main_rotor.lift_slope`. Read-only.

    Raises:
        UnknownNameError: on a name that does not exist; the message lists those that do.
    """

    def __init__(self, entries: Mapping[str, Parameter]) -> None:
        self._entries = dict(entries)

    def __getitem__(self, name: str) -> float:
        return self.entry(name).value

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def entry(self, name: str) -> Parameter:
        """Return value, unit and source of one parameter."""
        try:
            return self._entries[name]
        except KeyError:
            raise UnknownNameError("parameter", name, sorted(self._entries)) from None

    def replace(
        self, changes: Mapping[str, float], source: str = "set by the user"
    ) -> "Parameters":
        """Return a copy with some values changed.

        Raises:
            UnknownNameError: no such parameter.
            InputError: a value is not a finite number.
        """
        entries = dict(self._entries)
        for name, value in changes.items():
            old = self.entry(name)
            number = float(value)
            if not math.isfinite(number):
                raise InputError(f"parameter {name!r} must be a finite number, got {value!r}")
            entries[name] = Parameter(name, number, old.unit, source)
        return Parameters(entries)


def read_parameters(*paths: Path) -> Parameters:
    """Read parameter files (TOML); a later file adds to the earlier ones.

    Raises:
        ModelError: a file is missing or malformed, or a name is defined twice.
    """
    entries: dict[str, Parameter] = {}
    for path in paths:
        for name, entry in _read(path).items():
            if name in entries:
                raise ModelError(f"{path}: parameter {name!r} is already defined")
            entries[name] = entry
    return Parameters(entries)


_UNTUNED = {
    "gyro.ped_latency": (0.0, "s"),
    "gyro.kp_lat": (0.0, "s/rad"),
    "gyro.kp_lon": (0.0, "s/rad"),
    "gyro.ki_lat": (1.0, "1/rad"),
    "gyro.ki_lon": (1.0, "1/rad"),
    "gyro.kd_lat": (0.0, "s^2/rad"),
    "gyro.kd_lon": (0.0, "s^2/rad"),
    "gyro.phase": (0.0, "rad"),
    "gyro.k_p": (0.0, "1"),
    "gyro.k_i": (1.0, "1/s"),
    "gyro.k_delta": (1.0, "1"),
    "gyro.k_a": (0.1, "s/rad"),
    "gyro.p_per_lat": (1.0, "rad/s"),
    "gyro.p_per_lon": (0.0, "rad/s"),
    "gyro.q_per_lat": (0.0, "rad/s"),
    "gyro.q_per_lon": (1.0, "rad/s"),
}


def untuned(parameters: Parameters) -> Parameters:
    """Return the parameters with plain values for what is missing of the gyro's settings.

    A vehicle can be calibrated and its gyro tuned with them; to fly it needs tuned ones.
    """
    plain = {
        name: Parameter(name, value, unit, "not tuned yet")
        for name, (value, unit) in _UNTUNED.items()
    }
    return Parameters({**plain, **{name: parameters.entry(name) for name in parameters}})


def _read(path: Path) -> dict[str, Parameter]:
    try:
        content = read_toml(path)
    except StorageError as error:
        raise ModelError(f"can't read parameters: {error}") from None
    entries = {}
    for section, members in content.items():
        if not isinstance(members, dict):
            raise ModelError(f"{path}: {section} must stand in a section, such as [air]")
        for key, item in members.items():
            name = f"{section}.{key}"
            try:
                entries[name] = Parameter(
                    name, float(item["value"]), str(item["unit"]), str(item["source"])
                )
            except (TypeError, KeyError, ValueError):
                raise ModelError(
                    f"{path}: {name} needs value (a number), unit and source, got {item!r}"
                ) from None
            if not math.isfinite(entries[name].value):
                raise ModelError(f"{path}: {name} must be finite, got {item['value']!r}")
    return entries


_DIRECT = {
    "air_density": "air.density",
    "ground_effect": "air.ground_effect",
    "main_radius": "main_rotor.radius",
    "main_speed": "main_rotor.speed",
    "main_lift_slope": "main_rotor.lift_slope",
    "main_induced_factor": "main_rotor.induced_factor",
    "main_profile_drag": "main_rotor.profile_drag",
    "main_pitch_trim": "main_rotor.pitch_trim",
    "main_pitch_range": "main_rotor.pitch_range",
    "main_stall": "main_rotor.stall",
    "main_inflow_floor": "main_rotor.inflow_floor",
    "hub_x": "main_rotor.hub_x",
    "hub_z": "main_rotor.hub_z",
    "hub_stiffness": "main_rotor.hub_stiffness",
    "tau_f": "flapping.tau_f",
    "a_b": "flapping.a_b",
    "b_a": "flapping.b_a",
    "a_lat": "flapping.a_lat",
    "a_lon": "flapping.a_lon",
    "b_lat": "flapping.b_lat",
    "b_lon": "flapping.b_lon",
    "flap_back": "main_rotor.flap_back",
    "flap_stop": "main_rotor.flap_stop",
    "tail_radius": "tail_rotor.radius",
    "tail_speed": "tail_rotor.speed",
    "tail_lift_slope": "tail_rotor.lift_slope",
    "tail_pitch_trim": "tail_rotor.pitch_trim",
    "tail_pitch_range": "tail_rotor.pitch_range",
    "tail_stall": "tail_rotor.stall",
    "tail_inflow_floor": "tail_rotor.inflow_floor",
    "tail_x": "tail_rotor.arm_x",
    "tail_z": "tail_rotor.arm_z",
    "drag_x": "airframe.drag_area_x",
    "drag_y": "airframe.drag_area_y",
    "drag_z": "airframe.drag_area_z",
    "fin_area": "airframe.fin_area",
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
    "gyro_lead_filter": "gyro.lead_filter",
    "gyro_kp_lat": "gyro.kp_lat",
    "gyro_kp_lon": "gyro.kp_lon",
    "gyro_ki_lat": "gyro.ki_lat",
    "gyro_ki_lon": "gyro.ki_lon",
    "gyro_kd_lat": "gyro.kd_lat",
    "gyro_kd_lon": "gyro.kd_lon",
    "gyro_filter": "gyro.filter",
    "gyro_derivative_filter": "gyro.derivative_filter",
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
    "main_rotor.inflow_floor",
    "main_rotor.flap_stop",
    "flapping.tau_f",
    "tail_rotor.radius",
    "tail_rotor.chord",
    "tail_rotor.blades",
    "tail_rotor.speed",
    "tail_rotor.lift_slope",
    "tail_rotor.stall",
    "tail_rotor.inflow_floor",
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
    "airframe.fin_area",
    "main_rotor.profile_drag",
    "main_rotor.hub_stiffness",
    "main_rotor.flap_back",
    "gyro.ped_latency",
    "gyro.latency",
    "gyro.lead",
)

_CHOICES = {
    "gyro.flight_mode": (1, 2, 3),
    "gyro.heading_lock": (0, 1),
    "gyro.anti_windup": (0, 1),
}
_RATES = tuple(
    f"{section}.{rate}"
    for section in ("gyro", "gyro_tuned")
    for rate in ("pitch_rate", "elevator_rate", "aileron_rate")
)


def check_settings(values: Mapping[str, float]) -> None:
    """Check what a pilot can set on the gyro, by dotted names; other names are not looked at.

    Raises:
        InputError: a setting that the gyro does not have.
    """
    for name, choices in _CHOICES.items():
        if name in values and values[name] not in choices:
            listed = ", ".join(map(str, choices))
            raise InputError(f"{name} must be one of {listed}, got {values[name]:g}")
    for name in _RATES:
        if name in values and not 0.0 < values[name] <= 1.0:
            raise InputError(
                f"{name} must be above 0 and at most 1, the whole travel, got {values[name]:g}"
            )


def force_law_block(parameters: Parameters) -> NDArray[np.float64]:
    """Return the numbers that the compiled force laws read, (len(PARAM),), pilot at rest.

    Raises:
        ModelError: a parameter has a sign that it can't have.
        InputError: the gyro has no such setting.
    """
    check_settings(parameters)
    for name in _POSITIVE:
        if parameters[name] <= 0.0:
            raise ModelError(f"parameter {name!r} must be positive, got {parameters[name]:g}")
    for name in _NOT_NEGATIVE:
        if parameters[name] < 0.0:
            raise ModelError(f"parameter {name!r} must be 0 or more, got {parameters[name]:g}")
    block = np.zeros(len(PARAM))
    block[PARAM.magic] = MAGIC
    block[PARAM.ordinal] = ROTOR
    for slot, name in _DIRECT.items():
        block[getattr(PARAM, slot)] = parameters[name]
    block[PARAM.main_solidity] = _solidity(parameters, "main_rotor")
    block[PARAM.tail_solidity] = _solidity(parameters, "tail_rotor")
    block[PARAM.gyro_phase_cosine] = math.cos(parameters["gyro.phase"])
    block[PARAM.gyro_phase_sine] = math.sin(parameters["gyro.phase"])
    block[PARAM.gyro_attitude_lock] = 0.5 * (parameters["gyro.flight_mode"] - 1.0)
    block[PARAM.gyro_hold_above] = 0.5 if parameters["gyro.anti_windup"] else NEVER
    block[PARAM.gyro_collective] = _travel(parameters, "pitch_rate")
    for stick, rate in (("lat", "aileron_rate"), ("lon", "elevator_rate")):
        for answer in ("p", "q"):
            commanded = parameters[f"gyro.{answer}_per_{stick}"] * _travel(parameters, rate)
            block[getattr(PARAM, f"gyro_{answer}_per_{stick}")] = commanded
    period = parameters["gyro.period"]
    block[PARAM.gyro_lead_lag] = held_lag(parameters["gyro.lead_filter"], period)
    block[PARAM.gyro_derivative_lag] = held_lag(parameters["gyro.derivative_filter"], period)
    block[PARAM.gyro_on] = 1.0
    block[PARAM.remnant_interval] = 1.0
    block[PARAM.excitation_duration] = 1.0
    block[PARAM.sweep_fade] = 1.0
    return block


def _travel(parameters: Parameters, rate: str) -> float:
    """Return how far a stick reaches, as a multiple of what it does where the gains hold."""
    return parameters[f"gyro.{rate}"] / parameters[f"gyro_tuned.{rate}"]


def _solidity(parameters: Parameters, rotor: str) -> float:
    blade_area = parameters[f"{rotor}.blades"] * parameters[f"{rotor}.chord"]
    return blade_area / (math.pi * parameters[f"{rotor}.radius"])


def to_toml(parameters: Parameters, header: str) -> str:
    """Return parameters as the text of a parameter file, sections in order of appearance."""
    lines = [f"# {line}".rstrip() for line in header.splitlines()]
    for section in dict.fromkeys(name.split(".")[0] for name in parameters):
        lines += ["", f"[{section}]"]
        for name in parameters:
            prefix, key = name.split(".")
            if prefix != section:
                continue
            entry = parameters.entry(name)
            lines.append(
                f"{key} = {{ value = {entry.value!r}, unit = {json.dumps(entry.unit)}, "
                f"source = {json.dumps(entry.source)} }}"
            )
    return "\n".join(lines) + "\n"
