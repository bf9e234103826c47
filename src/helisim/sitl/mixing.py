"""Outputs of an autopilot to servos and rotor speed, and ArduPilot's mixing into them.

Its commands are lat (roll), lon (pitch) and ped (yaw), from -1 to 1, and col (throttle), from 0 to
1. Geometry, scales and limits are those that ArduPilot documents: wiki "Swashplate Setup" and the
descriptions of H_SW_TYPE, H_SW_H3_SV1_POS and those after it, H_COL_MIN, H_COL_MAX, H_CYC_MAX and
SERVOn_TRIM; a servo's azimuth goes from the nose to the right, and full cyclic moves a servo that
stands under it by 450 us.
"""

import math
from collections import ChainMap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, ModelError
from helisim.records.record import IN1
from helisim.vehicle.swashplate import Swashplate

_CHANNELS = 32
"""Of ArduPilot, at most."""
_SHORTEST, _LONGEST = 500, 2500
"""Pulses, us, that servos and speed controllers take for such."""
_MOVED = ("front", "left", "right", "tail", "rotor")


@dataclass(frozen=True)
class Output:
    """One output.

    Attributes:
        channel: of the autopilot, a whole number from 1.
        trim: pulse at which what it moves stands in its middle, or a motor is off, us.
        travel: how much longer the pulse is at the end of the travel, or of the rotor's nominal
            speed, us; negative where it is reversed.

    Raises:
        InputError: there is no such channel, or no travel.
    """

    channel: int
    trim: float = 1500.0
    travel: float = 500.0

    def __post_init__(self) -> None:
        if self.channel not in range(1, _CHANNELS + 1):
            raise InputError(
                f"an output's channel must be a whole number from 1 to {_CHANNELS}, got "
                f"{self.channel:g}"
            )
        if self.travel == 0.0:
            raise InputError("an output's travel must not be 0 us")

    def share(self, pulses: Sequence[float], off: float = 0.0) -> float:
        """Return which share of the travel a pulse asks for: 0 in the middle, 1 at its end.

        Args:
            pulses: of all outputs, us; 0 where one is off.
            off: what to return then, where there is no such output, and for a pulse that no servo
                takes for one: below 500 or above 2500 us.

        Returns:
            Not limited: what is moved has its own stops.
        """
        pulse = pulses[self.channel - 1] if self.channel <= len(pulses) else 0
        return (pulse - self.trim) / self.travel if _SHORTEST <= pulse <= _LONGEST else off

    def pulse(self, share: float) -> float:
        """Return the pulse that asks for a share of the travel, us."""
        return self.trim + self.travel * share


@dataclass(frozen=True)
class Outputs:
    """The outputs of a vehicle, by what they move.

    Attributes:
        front: servo of the swashplate.
        left: likewise.
        right: likewise.
        tail: servo of the tail rotor, or the pedals where a gyro stays between.
        rotor: the motor's speed controller: off up to its trim, the nominal speed one travel above.
        reach: farthest that a servo moves to each side, in the unit of its position.

    Raises:
        InputError: two are moved by the same channel.
    """

    front: Output = Output(1)
    left: Output = Output(2)
    right: Output = Output(3)
    tail: Output = Output(4)
    rotor: Output = Output(8, 1000.0, 700.0)
    reach: float = 0.75

    def __post_init__(self) -> None:
        found: dict[int, str] = {}
        for name in _MOVED:
            channel = getattr(self, name).channel
            if channel in found:
                raise InputError(f"output {channel:g} can't move both {found[channel]} and {name}")
            found[channel] = name

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "Outputs":
        """Return those of a vehicle, by its parameters `outputs.front_channel` and so on.

        Raises:
            ModelError: they are none.
        """

        def output(name: str) -> Output:
            channel, trim, travel = (
                parameters[f"outputs.{name}_{number}"] for number in ("channel", "trim", "travel")
            )
            whole = int(channel) if channel == int(channel) else channel
            return Output(cast(int, whole), round(1e6 * trim, 6), round(1e6 * travel, 6))

        try:
            return cls(*map(output, _MOVED), reach=parameters["servo.travel"])
        except InputError as error:
            raise ModelError(f"[outputs]: {error}") from None

    def servos(self, pulses: Sequence[float], held: Sequence[float]) -> list[float]:
        """Return the commands of the front, left, right and tail servo, unitised.

        Args:
            pulses: of all outputs, us.
            held: where the servos are asked to be now, (4,); one without pulses stays there.
        """
        return [
            self.reach * output.share(pulses, off / self.reach)
            for output, off in zip((self.front, self.left, self.right, self.tail), held)
        ]

    def speed(self, pulses: Sequence[int]) -> float:
        """Return the speed that is asked of the rotor, over the nominal one; 0 without pulses."""
        return max(0.0, self.rotor.share(pulses))

    def pedals(self, pulses: Sequence[int], held: float) -> float:
        """Return the stick PED that the tail's output asks for where a gyro stays, unitised."""
        return 0.5 * self.tail.share(pulses, 2.0 * held)


Array = NDArray[np.float64]

CYCLIC = 450.0
"""us, by which full roll or pitch moves a servo that stands right under it."""
FULL_CYCLIC = 4500.0
"""H_CYC_MAX at which roll and pitch reach their full 1."""
_LEAST, _MIDDLE, _MOST = 1000.0, 1500.0, 2000.0
"""us: ArduPilot keeps a swashplate's servos between the first and the last."""
_FIRST_FUNCTION = 33
"""SERVOn_FUNCTION of "Motor1"; those of the swashplate's other two and the tail follow."""
ROTOR_FUNCTION = 31
"""SERVOn_FUNCTION of the rotor's speed."""
_ANYWHERE, H3_140, _EQUAL = 0.0, 2.0, 3.0
"""H_SW_TYPE of three servos at places of their own, of an H3-140, and 120 degrees apart."""
MIXED_1_TO_1 = ((1.0, 1.0), (1.0, -1.0), (-1.0, 0.0))
"""Of an H3-140: how far pitch and roll move Motors 1 (left), 2 (right), 3 (behind), of 450 us."""
_AZIMUTHS = (-60.0, 60.0, 180.0)
"""Of the latter, degrees; of the former where nothing else is said."""
_SERVO, _GYRO = 0.0, 1.0
"""H_TAIL_TYPE of a servo, and of a servo behind a gyro of its own."""
_USUAL = {
    "H_SW_TYPE": _EQUAL,
    **{f"H_SW_H3_SV{k}_POS": azimuth for k, azimuth in zip((1, 2, 3), _AZIMUTHS)},
    "H_SW_H3_PHANG": 0.0,
    "H_SW_COL_DIR": 0.0,
    "H_TAIL_TYPE": 0.0,
    "H_COL_MIN": 1250.0,
    "H_COL_MAX": 1750.0,
    "H_COL_ANG_MIN": -90.0,
    "H_COL_ANG_MAX": 90.0,
    "H_COL_ZERO_THRST": 0.0,
    "H_CYC_MAX": 2500.0,
    "H_COL2YAW": 0.0,
    **{f"SERVO{k}_TRIM": 1500.0 for k in range(1, 33)},
    **{f"SERVO{k}_MIN": 1100.0 for k in range(1, 33)},
    **{f"SERVO{k}_MAX": 1900.0 for k in range(1, 33)},
    **{f"SERVO{k}_REVERSED": 0.0 for k in range(1, 33)},
}
"""What ArduPilot has where a file says nothing."""
_STEP = 1e-3


@dataclass(frozen=True)
class Servo:
    """One of ArduPilot's outputs to a servo.

    Attributes:
        channel: from 1.
        trim: us.
        low: shortest pulse, us.
        high: longest, us.
        reversed: whether a command makes the pulse shorter.
    """

    channel: int
    trim: float
    low: float
    high: float
    reversed: bool

    @classmethod
    def of(cls, parameters: Mapping[str, float], motor: int) -> "Servo":
        """Return that of a motor, 1 to 4. Raises InputError: no output has it."""
        wanted = _FIRST_FUNCTION + motor - 1
        said = {k: parameters.get(f"SERVO{k}_FUNCTION") for k in range(1, 33)}
        channels = [k for k, function in said.items() if function == wanted]
        if not channels and said[motor] is None:
            channels = [motor]
        if channels:
            own = f"SERVO{channels[0]}_"
            trim, low, high, turned = (
                parameters[own + name] for name in ("TRIM", "MIN", "MAX", "REVERSED")
            )
            return cls(channels[0], trim, low, high, bool(turned))
        raise InputError(
            f"no output has SERVOn_FUNCTION {wanted}, of ArduPilot's Motor{motor}: a helicopter's "
            "swashplate has 33, 34 and 35, its tail 36"
        )


@dataclass(frozen=True)
class Mixer:
    """ArduPilot's mixer of a single-rotor helicopter.

    Attributes:
        servos: of motors 1 to 4.
        roll: by how much full roll moves servos 1 to 3, us.
        pitch: likewise.
        lowest: pulse of no collective, us.
        highest: of all of it.
        most_cyclic: of full, that roll and pitch together may have.
        to_yaw: yaw for the collective beyond `zero`, to its power of 1.5.
        zero: collective of no thrust, a share of its range.
        up: whether collective makes the pulses longer.
    """

    servos: tuple[Servo, Servo, Servo, Servo]
    roll: tuple[float, ...]
    pitch: tuple[float, ...]
    lowest: float
    highest: float
    most_cyclic: float
    to_yaw: float
    zero: float
    up: bool = True

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "Mixer":
        """Return that which parameters say, as of a log or a .parm file; defaults where silent.

        Raises:
            InputError: they are of another swashplate or tail than this knows.
        """
        given = ChainMap(dict(parameters), _USUAL)
        if given["H_SW_TYPE"] not in (_ANYWHERE, H3_140, _EQUAL):
            raise InputError(
                f"H_SW_TYPE {given['H_SW_TYPE']:g} is not known here: expected 0 (three servos "
                "anywhere), 2 (H3-140) or 3 (120 degrees)"
            )
        if given["H_TAIL_TYPE"] not in (_SERVO, _GYRO):
            raise InputError(
                f"H_TAIL_TYPE {given['H_TAIL_TYPE']:g} is not known here: expected 0, a servo, or "
                "1, a gyro of its own"
            )
        azimuths = np.array(_AZIMUTHS)
        if given["H_SW_TYPE"] == _ANYWHERE:
            azimuths = np.array([given[f"H_SW_H3_SV{k}_POS"] for k in (1, 2, 3)])
            azimuths = azimuths - given["H_SW_H3_PHANG"]
        angles = np.radians(azimuths)
        moved = np.column_stack([np.cos(angles), -np.sin(angles)])
        if given["H_SW_TYPE"] == H3_140:
            moved = np.array(MIXED_1_TO_1)
        one, two, three, four = (Servo.of(given, motor) for motor in (1, 2, 3, 4))
        low, high = given["H_COL_ANG_MIN"], given["H_COL_ANG_MAX"]
        zero = min(max(given["H_COL_ZERO_THRST"], low), high)
        return cls(
            servos=(one, two, three, four),
            roll=tuple(CYCLIC * moved[:, 1]),
            pitch=tuple(CYCLIC * moved[:, 0]),
            lowest=given["H_COL_MIN"],
            highest=given["H_COL_MAX"],
            most_cyclic=given["H_CYC_MAX"] / FULL_CYCLIC,
            to_yaw=given["H_COL2YAW"] if given["H_TAIL_TYPE"] == _SERVO else 0.0,
            zero=(zero - low) / (high - low) if high > low else 0.0,
            up=given["H_SW_COL_DIR"] == 0.0,
        )

    def pulses(self, commands: Mapping[str, float]) -> dict[int, int]:
        """Return the pulse of each channel, whole us, as the autopilot sends them.

        The swashplate's are cut downwards, the tail's towards its trim.

        Args:
            commands: "col", "lon", "lat", "ped" in ArduPilot's units.
        """
        found = {channel: int(pulse) for channel, pulse in self.exact(commands).items()}
        tail = self.servos[3]
        share = math.trunc(self._yaw(commands) * FULL_CYCLIC) / FULL_CYCLIC
        return found | {tail.channel: int(tail.trim) + math.trunc(_tail_travel(tail, share))}

    def exact(self, commands: Mapping[str, float]) -> dict[int, float]:
        """Return the pulses before they are cut to whole microseconds; see `pulses`."""
        col, lon, lat = (commands.get(name, 0.0) for name in IN1[:3])
        cyclic = math.hypot(lat, lon)
        if cyclic > self.most_cyclic:
            lat, lon = (one * self.most_cyclic / cyclic for one in (lat, lon))
        col = min(max(col, 0.0), 1.0)
        raised = self.lowest + col * (self.highest - self.lowest) - _MIDDLE
        raised = raised if self.up else -raised
        found = {
            servo.channel: _swash_pulse(servo, roll * lat + pitch * lon + raised)
            for servo, roll, pitch in zip(self.servos, self.roll, self.pitch)
        }
        tail = self.servos[3]
        return found | {tail.channel: tail.trim + _tail_travel(tail, self._yaw(commands))}

    def _yaw(self, commands: Mapping[str, float]) -> float:
        """Return what goes to the tail, -1 to 1: yaw, and what the collective adds to it."""
        col = min(max(commands.get("col", 0.0), 0.0), 1.0)
        ped = commands.get("ped", 0.0) + self.to_yaw * abs(col - self.zero) ** 1.5
        return min(max(ped, -1.0), 1.0)


def _swash_pulse(servo: Servo, off: float) -> float:
    pulse = servo.trim + (-off if servo.reversed else off)
    return min(max(pulse, _LEAST), _MOST)


def _tail_travel(servo: Servo, share: float) -> float:
    """Return by how much the tail's pulse is off its trim, us."""
    share = -share if servo.reversed else share
    return share * (servo.high - servo.trim if share > 0.0 else servo.trim - servo.low)


@dataclass(frozen=True, eq=False)
class Controls:
    """What an autopilot's commands do to a vehicle's controls.

    Attributes:
        mixer: the autopilot's.
        outputs: the vehicle's.
        plate: its swashplate.
    """

    mixer: Mixer
    outputs: Outputs
    plate: Swashplate

    def moved(self, commands: Mapping[str, float]) -> dict[str, float]:
        """Return col, lon, lat and ped of the vehicle for commands of the autopilot.

        Args:
            commands: "col", "lon", "lat", "ped" in ArduPilot's units.
        """
        exact = self.mixer.exact(commands)
        pulses = [exact.get(channel + 1, 0.0) for channel in range(32)]
        front, left, right, tail = self.outputs.servos(pulses, (0.0, 0.0, 0.0, 0.0))
        col, lon, lat = self.plate.unmix(front, left, right)
        return dict(zip(IN1, (float(col), float(lon), float(lat), float(tail))))

    def scale(self, hover: float) -> Array:
        """Return what a unit of each command adds to each control about the hover, (4, 4).

        Rows are the vehicle's col, lon, lat, ped, columns the autopilot's.

        Args:
            hover: collective of the hover, 0 to 1.
        """
        columns = []
        for name in IN1:
            ends = [
                self.moved({"col": hover, name: (hover if name == "col" else 0.0) + step})
                for step in (_STEP, -_STEP)
            ]
            columns.append([(ends[0][row] - ends[1][row]) / (2.0 * _STEP) for row in IN1])
        return np.array(columns).T
