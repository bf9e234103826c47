"""The exact loop of a vehicle with its law: the sampled linearisation, as criteria ask of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from helisim.base.errors import InputError
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.curve import Curve
from helisim.handling.loop import GRID
from helisim.records.channels import IN1
from helisim.vehicle import Vehicle
from helisim.vehicle.sampled import sensed_base

if TYPE_CHECKING:
    import control

Array = NDArray[np.float64]
Response = NDArray[np.complex128]

_WHOLE = 1e-9
"""Of a tick, by which a latency may miss a whole number of them."""


@dataclass(frozen=True, eq=False)
class Matrices:
    """A sampled linear system, x+ = a x + b u, y = c x + d u; it is `Linear` and `Sampled`.

    Attributes:
        a: (n_state, n_state).
        b: (n_state, n_in).
        c: (n_out, n_state).
        d: (n_out, n_in).
        period: s.
        inputs: their names.
        outputs: their names.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    period: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def response(self, frequency: Array) -> Response:
        """Return the response, (n_out, n_in, n_freq), at frequencies, (n_freq,) rad/s."""
        point = np.exp(1j * np.asarray(frequency) * self.period)[:, None, None]
        states = np.linalg.solve(point * np.eye(len(self.a)) - self.a, self.b[None])
        return np.asarray(np.moveaxis(self.c @ states + self.d, 0, -1), dtype=np.complex128)


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
    plant = sensed_base(vehicle.linearize("IN1"), gyro)
    rows = np.vstack([*plant.seen.values()])
    still = np.zeros((len(rows), len(IN1)))
    airframe = Matrices(plant.a, plant.b, rows, still, gyro.period, IN1, tuple(plant.seen))
    law = _late(gyro.system, "PED", vehicle.parameters["gyro.ped_latency"] / gyro.period)
    grid = GRID if frequency is None else np.asarray(frequency, dtype=np.float64)
    return ExactLoop(airframe, law, grid)


def _late(system: "control.StateSpace", name: str, ticks: float) -> Matrices:
    """Return a law with a line of old samples before one of its inputs, linear between them.

    Args:
        system: the law, discrete.
        name: of the input.
        ticks: by which it is late.
    """
    a, b, c, d = (np.asarray(getattr(system, one), dtype=np.float64) for one in "ABCD")
    names = tuple(system.input_labels)
    whole = math.floor(ticks + _WHOLE)
    part = max(ticks - whole, 0.0)
    count = whole + (part > _WHOLE)
    period = float(system.dt)
    if not count:
        return Matrices(a, b, c, d, period, names, tuple(system.output_labels))
    column, n = names.index(name), len(a)
    weight = np.zeros(count + 1)  # of the sample now, and of those before
    weight[whole] = 1.0 - part
    weight[whole + 1 :] = part
    line = np.eye(count, k=-1)
    whole_a = block_diag(a, line)
    whole_a[:n, n:] = np.outer(b[:, column], weight[1:])
    whole_c = np.hstack([c, np.outer(d[:, column], weight[1:])])
    whole_b = np.vstack([b, np.zeros((count, len(names)))])
    whole_b[:n, column] *= weight[0]
    whole_b[n, column] = 1.0
    whole_d = d.copy()
    whole_d[:, column] *= weight[0]
    return Matrices(whole_a, whole_b, whole_c, whole_d, period, names, tuple(system.output_labels))
