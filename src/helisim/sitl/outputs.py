"""What an autopilot's outputs move: pulses of so many microseconds to servos and rotor speed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Output:
    """One servo's output.

    Attributes:
        channel: of the autopilot, from 1.
        trim_us: pulse at which the servo stands in its middle, us.
        travel_us: by which it moves one unit, us; negative where the servo is reversed.
    """

    channel: int
    trim_us: float = 1500.0
    travel_us: float = 500.0

    def position(self, pulses: Sequence[int]) -> float:
        """Return where the servo is asked to be, unitised; its middle while the output is off."""
        pulse = pulses[self.channel - 1]
        return (pulse - self.trim_us) / self.travel_us if pulse else 0.0


@dataclass(frozen=True)
class Outputs:
    """All outputs of a vehicle.

    Attributes:
        servos: of the front, left, right and tail servo.
        rotor: of the speed controller: 0 at its trim, the nominal speed one travel above.
    """

    servos: tuple[Output, ...] = (Output(1), Output(2), Output(3), Output(4))
    rotor: Output = Output(8, 1000.0, 1000.0)

    def commands(self, pulses: Sequence[int]) -> NDArray[np.float64]:
        """Return the commands of the four servos, and the rotor's speed over the nominal, (5,)."""
        servos = [servo.position(pulses) for servo in self.servos]
        return np.array([*servos, max(0.0, self.rotor.position(pulses))])
