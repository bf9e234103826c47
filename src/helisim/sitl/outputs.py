"""What an autopilot's outputs move: pulses of so many microseconds to servos and rotor speed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

from helisim.base.errors import InputError, ModelError

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
