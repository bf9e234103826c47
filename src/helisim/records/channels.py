"""The one list of channels that a flight record can carry, with units and meaning.

Body axes are forward-right-down, the world is north-east-down. IN1 is the helicopter's
own input, recomputed from the four servo signals; IN2 is the pilot's sticks; OUT is the
measured motion (Wu and Chen, section 2). IN1 and IN2 are unitised to [-0.5, 0.5].
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from helisim.base.errors import UnknownNameError
from helisim.base.units import CONTROL, Powers, UserUnits, parts

Kind = Literal["IN1", "IN2", "OUT", "SERVO", "OTHER"]


@dataclass(frozen=True)
class Channel:
    """One column of a record: its name, its unit (SI), its kind and its meaning."""

    name: str
    unit: str
    kind: Kind
    meaning: str = ""


IN1 = ("col", "lon", "lat", "ped")
IN2 = ("COL", "LON", "LAT", "PED")
SERVOS = ("servo_front", "servo_left", "servo_right", "servo_tail")
RATES = ("p", "q", "r")
ATTITUDES = ("phi", "theta", "psi")
VELOCITIES = ("u", "v", "w")
ACCELERATIONS = ("ax", "ay", "az")
POSITIONS = ("north", "east", "down")
ROTOR_SPEED = ("rotor_speed",)
"""Measured where a motor turns the rotor; there is none under an ideal governor, which keeps it."""
CONTACT = ("contact",)
ROTOR = ("a", "b", "thrust", "torque", "tail_thrust")
AIR = ("air_u", "air_v", "air_w", "air_p", "air_q", "air_r")
SERVO_POSITIONS = tuple(f"{servo}_position" for servo in SERVOS)
"""What only a simulation knows; a recorder writes it on request, and no fit may use it."""
IN1_ADDED = tuple(f"{name}_added" for name in IN1)
IN1_GYRO = tuple(f"{name}_gyro" for name in IN1)
"""At the servo commands: what a manoeuvre adds, and the gyro's own. The command is their sum."""
IN1_DISTURBANCE = tuple(f"{name}_disturbance" for name in IN1)
IN1_SUM = tuple(f"{name}_sum" for name in IN1)
"""At the actuators: what a manoeuvre adds to the command, and what reaches the servos."""
RATE_DISTURBANCE = tuple(f"{name}_disturbance" for name in RATES)
RATE_SUM = tuple(f"{name}_sum" for name in RATES)
"""At the gyro's sensors: what a manoeuvre adds to the rate, and what the gyro reads."""
ATTITUDE_DISTURBANCE = tuple(f"{name}_disturbance" for name in ATTITUDES)
ATTITUDE_SUM = tuple(f"{name}_sum" for name in ATTITUDES)
"""Likewise of the attitude that a controller sees; a manoeuvre that turns it turns the rate too."""
OUT = RATES + ATTITUDES + VELOCITIES + ACCELERATIONS + POSITIONS

AXES = IN1
"""Control axes, in the order of IN1: collective, longitudinal, lateral, pedal."""
_STANDARD = (
    Channel("col", "1", "IN1", "collective at the swashplate"),
    Channel("lon", "1", "IN1", "longitudinal cyclic at the swashplate, positive nose up"),
    Channel("lat", "1", "IN1", "lateral cyclic at the swashplate, positive right"),
    Channel("ped", "1", "IN1", "tail rotor collective, positive nose right"),
    Channel("COL", "1", "IN2", "collective stick"),
    Channel("LON", "1", "IN2", "longitudinal stick, positive nose up"),
    Channel("LAT", "1", "IN2", "lateral stick, positive right"),
    Channel("PED", "1", "IN2", "pedal stick, positive nose right"),
    Channel("servo_front", "1", "SERVO", "command to the front swashplate servo"),
    Channel("servo_left", "1", "SERVO", "command to the left swashplate servo"),
    Channel("servo_right", "1", "SERVO", "command to the right swashplate servo"),
    Channel("servo_tail", "1", "SERVO", "command to the tail servo"),
    Channel("p", "rad/s", "OUT", "roll rate"),
    Channel("q", "rad/s", "OUT", "pitch rate"),
    Channel("r", "rad/s", "OUT", "yaw rate"),
    Channel("phi", "rad", "OUT", "roll angle"),
    Channel("theta", "rad", "OUT", "pitch angle"),
    Channel("psi", "rad", "OUT", "yaw angle, unwrapped"),
    Channel("u", "m/s", "OUT", "forward velocity at the centre of gravity"),
    Channel("v", "m/s", "OUT", "right velocity at the centre of gravity"),
    Channel("w", "m/s", "OUT", "down velocity at the centre of gravity"),
    Channel("ax", "m/s^2", "OUT", "forward specific force at the centre of gravity"),
    Channel("ay", "m/s^2", "OUT", "right specific force at the centre of gravity"),
    Channel("az", "m/s^2", "OUT", "down specific force at the centre of gravity"),
    Channel("north", "m", "OUT", "position north of the start"),
    Channel("east", "m", "OUT", "position east of the start"),
    Channel("down", "m", "OUT", "position below the start"),
    Channel("rotor_speed", "rad/s", "OTHER", "speed of the main rotor, where a motor turns it"),
    Channel("a", "rad", "OTHER", "true rearward tilt of the tip-path plane"),
    Channel("b", "rad", "OTHER", "true rightward tilt of the tip-path plane"),
    Channel("thrust", "N", "OTHER", "true main rotor thrust"),
    Channel("torque", "N m", "OTHER", "true main rotor torque"),
    Channel("tail_thrust", "N", "OTHER", "true tail rotor thrust, against the main torque"),
    Channel("air_u", "m/s", "OTHER", "true forward velocity of the air itself, wind and gusts"),
    Channel("air_v", "m/s", "OTHER", "true right velocity of the air itself"),
    Channel("air_w", "m/s", "OTHER", "true down velocity of the air itself"),
    Channel("air_p", "rad/s", "OTHER", "true roll rate of the air itself, from its gradients"),
    Channel("air_q", "rad/s", "OTHER", "true pitch rate of the air itself"),
    Channel("air_r", "rad/s", "OTHER", "true yaw rate of the air itself"),
    Channel("contact", "N", "OTHER", "true force upwards of the ground on the landing gear"),
    *(
        Channel(f"{name}_{suffix}", unit, "OTHER", meaning.format(name))
        for names, suffix, unit, meaning in (
            (SERVOS, "position", "1", "true position of {}"),
            (IN1, "added", "1", "what a manoeuvre adds to {}"),
            (IN1, "gyro", "1", "{} as the gyro gives it, before what is added"),
            (IN1, "disturbance", "1", "what is added to {} at the actuators"),
            (IN1, "sum", "1", "{} as it reaches the actuators, disturbed"),
            (RATES, "disturbance", "rad/s", "what is added to {} at the gyro"),
            (RATES, "sum", "rad/s", "{} as the gyro reads it, disturbed"),
            (ATTITUDES, "disturbance", "rad", "what is added to the {} that is sensed"),
            (ATTITUDES, "sum", "rad", "{} as a controller sees it, disturbed"),
        )
        for name in names
    ),
)

CHANNELS: dict[str, Channel] = {channel.name: channel for channel in _STANDARD}
"""Every standard channel by name. IN1 (col) and IN2 (COL) differ by case."""
_NAMED = 30  # channels that a `repr` names, at most


def channel(name: str) -> Channel:
    """Return the standard channel of that name. Raises UnknownNameError."""
    if name not in CHANNELS:
        raise UnknownNameError("channel", name, CHANNELS)
    return CHANNELS[name]


def some_names(names: Iterable[str]) -> str:
    """Return names in one line, of many only the first."""
    known = list(names)
    return ", ".join(known if len(known) <= _NAMED else [*known[:_NAMED], "..."])


def signal_powers(name: str, unit: str, *, is_input: bool) -> Powers | None:
    """Return the powers of a channel's unit; None where it isn't known.

    Args:
        name: of the channel; a standard one's unit is known.
        unit: as recorded, "" where it isn't known.
        is_input: a unit of "1" counts a control's range, as it does of standard controls.
    """
    standard = CHANNELS.get(name)
    powers = parts(unit or (standard.unit if standard else ""))
    control = is_input or (standard is not None and standard.kind in ("IN1", "IN2", "SERVO"))
    return {CONTROL: 1} if powers == {} and control else powers


def signal_in(units: UserUnits, name: str, unit: str, *, is_input: bool) -> tuple[str, float]:
    """Return how a channel's unit is written in the given units, and how many are one in SI.

    Args:
        units: to show it in.
        name: of the channel.
        unit: SI; it stays where its powers aren't known.
        is_input: as for `signal_powers`.
    """
    powers = signal_powers(name, unit, is_input=is_input)
    return units.shown(powers) if powers else (unit, 1.0)
