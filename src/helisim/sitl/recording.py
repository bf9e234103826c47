"""What truly happened in a flight by frames, kept sample by sample, as a flight record."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.records.provenance import made_by
from helisim.records.record import FlightRecord
from helisim.sim.ground import Ground
from helisim.sim.plain import to_plain
from helisim.sim.recorder import Recorder
from helisim.sim.trajectory import read_trajectory
from helisim.vehicle import Vehicle

RECORDER = Recorder(noise={}, resolution={}, rotor=True)
"""Of what truly happened: without noise, latency and rounding, the rotor's and the air's too."""
_INTERVAL = 0.004
"""s between two samples that are kept, at most: more than twice the recorder's rate."""
_ROOM = 4096
_FEWEST = 30


class Recording:
    """Sensor data at equal times, in blocks that are never moved: 120 kB a second of flight."""

    def __init__(self, period: float, columns: int) -> None:
        """Begin with nothing.

        Args:
            period: s, between two frames.
            columns: of the sensor data.
        """
        self._each = max(1, int(_INTERVAL / period))
        self.interval = self._each * period
        self._columns = columns
        self.begin()

    def begin(self) -> None:
        """Forget what was kept."""
        self._blocks: list[NDArray[np.float64]] = []
        self._count = 0

    def add(self, frame: int, sensordata: NDArray[np.float64]) -> None:
        """Keep a frame's sensor data where it is its turn.

        Args:
            frame: its number, from 0 on.
            sensordata: (n_sensordata,) of its end.
        """
        if frame % self._each:
            return
        row = self._count % _ROOM
        if row == 0:
            self._blocks.append(np.empty((_ROOM, self._columns)))
        self._blocks[-1][row] = sensordata
        self._count += 1

    def record(
        self,
        vehicle: Vehicle,
        ground: Ground,
        crashed: tuple[float, str] | None,
        flown: Mapping[str, Any],
    ) -> FlightRecord:
        """Return the flight so far.

        Args:
            vehicle: that flew.
            ground: below it.
            crashed: when (s) and why it flies no longer; None if it does.
            flown: for the provenance.

        Raises:
            InputError: it is too short for a record.
        """
        if self._count < _FEWEST:
            raise InputError(
                f"a flight of {self._count * self.interval:g} s is no record: fly "
                f"{_FEWEST * self.interval:g} s"
            )
        rows = np.concatenate(self._blocks)[: self._count]
        rows[:, vehicle.model.sensor("clock").adr[0]] = np.arange(self._count) * self.interval
        trajectory = replace(
            read_trajectory(vehicle, rows), timestep=self.interval, hold=0.0, ground=ground
        )
        provenance = _provenance(vehicle, ground, crashed, flown)
        return RECORDER.record(trajectory, np.random.default_rng(0), provenance)


def _provenance(
    vehicle: Vehicle,
    ground: Ground,
    crashed: tuple[float, str] | None,
    flown: Mapping[str, Any],
) -> dict[str, Any]:
    provenance = made_by(
        "flown by an outside autopilot",
        **vehicle.provenance,
        **flown,
        ground=to_plain(ground),
        recorder=RECORDER.to_dict(),
    )
    if crashed is not None:
        provenance["ended"] = {"at": crashed[0], "why": crashed[1]}
    return provenance
