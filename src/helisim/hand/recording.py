"""A recording of a part of a flight by hand: from sensor data to what a flight computer writes."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.physics.laws import Failure
from helisim.records.provenance import made_by
from helisim.records.record import FlightRecord
from helisim.sim.ground import Ground
from helisim.sim.limits import FlightEnvelope
from helisim.sim.recorder import Recorder
from helisim.sim.trajectory import Trajectory, read_trajectory, sound_samples
from helisim.vehicle import Vehicle

_SHORTEST = 0.1
"""s, of a recording that makes a record: ten samples."""
_ENVELOPE = FlightEnvelope(saturation=None)
"""A hand may be at a stop for as long as it likes: sticks and servos are in the record."""


class Recording:
    """Sensor data of each step, and what was switched meanwhile."""

    def __init__(self, since: float) -> None:
        self._since = since
        self._rows: list[NDArray[np.float64]] = []
        self._switched: list[tuple[float, str, Any]] = []

    def __bool__(self) -> bool:
        return bool(self._rows)

    def add(self, data: mujoco.MjData) -> None:
        """Keep the sensor data of a step that was just made."""
        self._rows.append(data.sensordata.copy())

    def note(self, time: float, what: str, value: Any) -> None:
        """Keep that something was switched at a time of the flight, s."""
        self._switched.append((time, what, value))

    def seconds(self, model: mujoco.MjModel) -> float:
        """Return how long it is, s."""
        return len(self._rows) * float(model.opt.timestep)

    def record(
        self,
        vehicle: Vehicle,
        *,
        ground: Ground,
        crashed: str,
        failed: Failure | None = None,
        rng: np.random.Generator,
        flown: Mapping[str, Any],
    ) -> FlightRecord:
        """Return the record, its time from 0.

        Args:
            vehicle: that flew.
            ground: below the flight.
            crashed: why the flight ended; "" if it goes on.
            failed: how the controller failed that ended it; None if it didn't.
            rng: of the sensors' noise.
            flown: for the provenance: how it was flown.

        Raises:
            InputError: it is too short.
        """
        trajectory = self._trajectory(vehicle)
        start = float(trajectory.time[0])
        ended = _ended(vehicle, replace(trajectory, ground=ground), crashed, failed)
        if ended is not None:
            ended["at"] -= start
        trajectory = replace(trajectory, time=trajectory.time - start)
        recorder = Recorder.of(vehicle)
        switched = [
            [max(0.0, round(at - start, 6)), what, value] for at, what, value in self._switched
        ]
        provenance = made_by(
            "flown by hand in the simulation",
            **vehicle.provenance,
            by_hand={**flown, "switched": switched, "from_s": start},
            recorder=recorder.to_dict(),
        )
        if ended is not None:
            provenance["ended"] = ended
        return recorder.record(trajectory, rng, provenance)

    def _trajectory(self, vehicle: Vehicle) -> Trajectory:
        rows = np.array(self._rows)
        count = sound_samples(vehicle.model, rows)[0] if len(rows) else 0
        seconds = count * float(vehicle.model.opt.timestep)
        if seconds < _SHORTEST:
            raise InputError(f"a recording of {seconds:g} s is no record: fly {_SHORTEST:g} s")
        return read_trajectory(vehicle, rows[:count])


def _ended(
    vehicle: Vehicle, trajectory: Trajectory, crashed: str, failed: Failure | None
) -> dict[str, Any] | None:
    """Return when and why a trajectory is no longer what the model is valid for, None if it is.

    Skids on the ground hold what no stick asks for, so a landing is such an end too.
    """
    ends = [] if (left := _ENVELOPE.end(vehicle, trajectory)) is None else [left]
    touches = trajectory.touching
    if touches.any():
        ends.append((int(np.argmax(touches)), "the helicopter touched the ground"))
    if ends:
        first, why = min(ends)
        return {"at": float(trajectory.time[first]), "why": why}
    if not crashed:
        return None
    end = {"at": float(trajectory.time[-1]), "why": crashed}
    return end if failed is None else {**end, "traceback": failed.traceback}
