"""Outputs of an autopilot to servos and rotor speed, and ArduPilot's mixing into them.

Commands lat (roll), lon (pitch), ped (yaw) are -1 to 1, col (throttle) 0 to 1. Azimuths go from the
nose to the right. Source: ArduPilot's wiki "Swashplate Setup" and parameters.
"""

import math
from collections import ChainMap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from helisim.base.arrays import Real
from helisim.base.errors import InputError, ModelError
from helisim.records.record import IN1
from helisim.vehicle.swashplate import Swashplate

_CHANNELS = 32  # ArduPilot's, at most
_SHORTEST, _LONGEST = 500, 2500  # us: shorter and longer pulses are none
_MOVED = ("front", "left", "right", "tail", "rotor")


@dataclass(frozen=True)
class Output:
    """One output, on a channel from 1, in us.

    `trim` is the middle of the travel, or the motor off; `travel` is from there to the end or to
    the nominal speed, negative if reversed.
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
        """Return a pulse's share of the travel, not limited, or `off` beyond 500 to 2500 us."""
        pulse = pulses[self.channel - 1] if self.channel <= len(pulses) else 0
        return (pulse - self.trim) / self.travel if _SHORTEST <= pulse <= _LONGEST else off


@dataclass(frozen=True)
class Outputs:
    """The outputs of a vehicle, by what they move; no two on one channel.

    The rotor is off up to its trim, nominal one travel above; `reach` is a servo's largest travel.
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
        """Return outputs by parameters as `outputs.front_channel`. Raises ModelError."""

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
        """Return commands of the front, left, right and tail servo; without pulse as `held`."""
        return [
            self.reach * output.share(pulses, off / self.reach)
            for output, off in zip((self.front, self.left, self.right, self.tail), held)
        ]

    def speed(self, pulses: Sequence[int]) -> float:
        """Return the rotor speed asked for, over the nominal one; 0 without pulses."""
        return max(0.0, self.rotor.share(pulses))


CYCLIC = 450.0  # us, by which full roll or pitch moves a servo that stands right under it
FULL_CYCLIC = 4500.0  # H_CYC_MAX at which roll and pitch reach their full 1
# us: ArduPilot's limits and middle of a swashplate's servos.
_LEAST, _MIDDLE, _MOST = 1000.0, 1500.0, 2000.0
_FIRST_FUNCTION = 33  # SERVOn_FUNCTION of "Motor1"; those of Motors 2, 3 and 4 (tail) follow
ROTOR_FUNCTION = 31  # SERVOn_FUNCTION of the rotor's speed
_ANYWHERE, _EQUAL = 0.0, 3.0  # H_SW_TYPE: three servos anywhere, and 120 degrees apart
_AZIMUTHS = (-60.0, 60.0, 180.0)  # Degrees, of servos 120 degrees apart, and the default
_USUAL = {
    "H_SW_TYPE": _EQUAL,
    **{f"H_SW_H3_SV{k}_POS": azimuth for k, azimuth in zip((1, 2, 3), _AZIMUTHS)},
    "H_SW_H3_PHANG": 0.0,
    "H_SW_COL_DIR": 0.0,
    "H_TAIL_TYPE": 0.0,
    "H_COL_MIN": 1250.0,
    "H_COL_MAX": 1750.0,
    "H_CYC_MAX": 2500.0,
    "H_COL2YAW": 0.0,
    **{f"SERVO{k}_TRIM": 1500.0 for k in range(1, 33)},
    **{f"SERVO{k}_MIN": 1100.0 for k in range(1, 33)},
    **{f"SERVO{k}_MAX": 1900.0 for k in range(1, 33)},
    **{f"SERVO{k}_REVERSED": 0.0 for k in range(1, 33)},
}  # ArduPilot's defaults
_STEP = 1e-3


class Mixer:
    """ArduPilot's mixer of a helicopter with three swashplate servos and a servo at the tail."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        """Take a log's or file's parameters. Raises InputError for another type."""
        given = self._given = ChainMap(dict(parameters), _USUAL)
        for name, known in (
            ("H_SW_TYPE", (_ANYWHERE, _EQUAL)),
            ("H_TAIL_TYPE", (0.0,)),
            ("H_COL2YAW", (0.0,)),
        ):
            if given[name] not in known:
                expected = " or ".join(f"{one:g}" for one in known)
                raise InputError(f"{name} {given[name]:g} is not known here: expected {expected}")
        azimuths = np.array(_AZIMUTHS)
        if given["H_SW_TYPE"] == _ANYWHERE:
            own = [given[f"H_SW_H3_SV{k}_POS"] for k in (1, 2, 3)]
            azimuths = np.array(own) - given["H_SW_H3_PHANG"]
        angles = np.radians(azimuths)
        self._moved = CYCLIC * np.column_stack([np.cos(angles), -np.sin(angles)])
        self._channels = [self._channel(motor) for motor in (1, 2, 3, 4)]

    def _channel(self, motor: int) -> int:
        wanted = _FIRST_FUNCTION + motor - 1
        said = [self._given.get(f"SERVO{k}_FUNCTION") for k in range(1, _CHANNELS + 1)]
        if wanted in said:
            return said.index(wanted) + 1
        if said[motor - 1] is not None:
            raise InputError(
                f"no output has SERVOn_FUNCTION {wanted}, of ArduPilot's Motor{motor}: a "
                "helicopter's swashplate has 33, 34 and 35, its tail 36"
            )
        return motor

    def exact(self, commands: Mapping[str, float]) -> dict[int, float]:
        """Return the pulse of each channel, us, not yet whole, for "col", "lon", "lat", "ped"."""
        given = self._given
        col, lon, lat, ped = (commands.get(name, 0.0) for name in IN1)
        cyclic, most = math.hypot(lat, lon), given["H_CYC_MAX"] / FULL_CYCLIC
        if cyclic > most:
            lat, lon = (one * most / cyclic for one in (lat, lon))
        col = min(max(col, 0.0), 1.0)
        raised = given["H_COL_MIN"] + col * (given["H_COL_MAX"] - given["H_COL_MIN"]) - _MIDDLE
        raised = raised if given["H_SW_COL_DIR"] == 0.0 else -raised
        found = {}
        for channel, (pitch, roll) in zip(self._channels, self._moved.tolist()):
            off = roll * lat + pitch * lon + raised
            pulse = given[f"SERVO{channel}_TRIM"]
            pulse += -off if given[f"SERVO{channel}_REVERSED"] else off
            found[channel] = min(max(pulse, _LEAST), _MOST)
        own = f"SERVO{self._channels[3]}_"
        trim, least, longest = (given[own + name] for name in ("TRIM", "MIN", "MAX"))
        yaw = min(max(ped, -1.0), 1.0) * (-1.0 if given[own + "REVERSED"] else 1.0)
        travel = longest - trim if yaw > 0.0 else trim - least
        return found | {self._channels[3]: trim + yaw * travel}


def command_scale(mixer: Mixer, outputs: Outputs, plate: Swashplate, hover: float) -> Real:
    """Return (4, 4): a unit of each command on each control (rows), of col, lon, lat, ped."""

    def moved(commands: Mapping[str, float]) -> Real:
        exact = mixer.exact(commands)
        pulses = [exact.get(channel + 1, 0.0) for channel in range(_CHANNELS)]
        *swash, tail = outputs.servos(pulses, (0.0, 0.0, 0.0, 0.0))
        return np.array((*map(float, plate.unmix(*swash)), tail))

    def slope(name: str) -> Real:
        at = hover if name == "col" else 0.0
        above, below = (moved({"col": hover, name: at + step}) for step in (_STEP, -_STEP))
        return (above - below) / (2.0 * _STEP)

    return np.array([slope(name) for name in IN1]).T
