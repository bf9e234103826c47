"""The exact loop of a vehicle with its law: the sampled linearisation, as criteria ask of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.linear import Response
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.loop import GRID, Curve
from helisim.vehicle import Vehicle
from helisim.vehicle.sampled import sensed_base

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ExactLoop(ClosedLoop):
    """The `Loop` of a vehicle's sampled linearisation, poles and steps included."""

    def at(self, frequency: Array) -> "ExactLoop":
        """Return the same loop at other frequencies, (n_freq,) rad/s."""
        return replace(self, frequency=np.asarray(frequency, dtype=np.float64))

    def reached(self, place: str, axis: str) -> dict[str, Curve]:
        """Return what an oscillation that is added somewhere moves, by channel.

        Commands as they reach the actuators, and all that the vehicle shows.

        Args:
            place: "actuators", "sensors" (the attitude is turned) or "sticks".
            axis: of control.

        Raises:
            InputError: there is no such place.
        """
        given: Response
        if place == "actuators":
            given = self._follows[:, :, self._place(axis)]
        elif place == "sensors":
            given = self._by_sensors(self._turned(axis))
        elif place == "sticks":
            given = self._by_stick(axis)[:, :, 0]
        else:
            raise InputError(f"add at actuators, sensors or sticks, not at {place!r}")
        moved = (self._plant @ given[:, :, None])[:, :, 0]
        found = {name: self._curve(given[:, k]) for k, name in enumerate(self.axes)}
        outputs = self.plant.outputs
        return found | {name: self._curve(moved[:, k]) for k, name in enumerate(outputs)}


def exact_loop(vehicle: Vehicle, frequency: Sequence[float] | Array | None = None) -> ExactLoop:
    """Return the exact linear loop of a vehicle with its controller, sampled at the gyro's ticks.

    Nothing is approximated but the linearisation about the trim itself: the airframe with its
    servos is sampled exactly between ticks, the law is differentiated, the latencies of the gyro
    and of the pedal are theirs. The pilot is not part of it.

    Args:
        vehicle: with its controller.
        frequency: (n_freq,) rad/s; `helisim.handling.loop.GRID` if None.

    Raises:
        InputError: no law moves any servo.
        ModelError: the law can't hold the trim, or the gyro's latency is no whole number of ticks.
    """
    gyro = vehicle.gyro
    sensed = sensed_base(vehicle.linearize("IN1"), gyro, imu=vehicle.imu_offset)
    airframe = sensed.select(outputs=[name for name in sensed.outputs if " " not in name])
    airframe = replace(airframe, d=0.0 * airframe.d)
    pedal = {name: late for name, late in gyro.delays.items() if name == "PED"}
    law = replace(gyro, delays=pedal).with_delays_as_states()
    grid = GRID if frequency is None else np.asarray(frequency, dtype=np.float64)
    return ExactLoop(airframe, law, grid)
