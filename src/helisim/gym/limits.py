"""Where an episode is terminated: the flight envelope, for many helicopters at one instant."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.gym.motions import Columns, Motions
from helisim.sim.clearance import outline
from helisim.sim.envelope import FlightEnvelope, hover_induced_velocity
from helisim.sim.trajectory import imu_offset
from helisim.vehicle import Vehicle


class Limits:
    """A `FlightEnvelope` held against `Motions`; saturation is not watched."""

    def __init__(self, envelope: FlightEnvelope, vehicle: Vehicle) -> None:
        own = vehicle.parameters
        self._envelope = envelope
        self._outline = outline(vehicle)
        self._imu = imu_offset(vehicle)
        self._reach = self._outline.reach + float(np.linalg.norm(self._imu))
        self._induced = hover_induced_velocity(vehicle)
        self._tip = own["main_rotor.speed"] * own["main_rotor.radius"]
        self._flap_stop = own["main_rotor.flap_stop"]

    def beyond(self, motions: Motions, air: Columns) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        """Yield the name of each limit and which helicopters are beyond it, (n,).

        Args:
            motions: of n helicopters.
            air: (3, n) velocity of the air itself, body axes, m/s.
        """
        limit = self._envelope
        if limit.tilt is not None:
            tilt = np.abs(motions.attitude[:2])
            yield "tilt", np.maximum(tilt[0], tilt[1]) > limit.tilt
        if limit.rate is not None:
            rate = np.abs(motions.rates)
            yield "rate", np.maximum(np.maximum(rate[0], rate[1]), rate[2]) > limit.rate
        if limit.clearance is not None:
            yield "clearance", self._near(motions, limit.clearance)
        if limit.flapping is not None:
            tilt = np.abs(motions.flapping)
            yield "flapping", np.maximum(tilt[0], tilt[1]) > limit.flapping * self._flap_stop
        if limit.descent is None and limit.advance is None:
            return
        through = motions.body_velocity - air
        across = np.hypot(through[0], through[1])
        if limit.descent is not None:
            sinking = through[2] > limit.descent * self._induced
            yield "descent", sinking & (across < self._induced)
        if limit.advance is not None:
            yield "advance", across > limit.advance * self._tip

    def _near(self, motions: Motions, least: float) -> NDArray[np.bool_]:
        near = -motions.position[2] < least + self._reach
        if near.any():
            attitudes = motions.attitude[:, near].T
            turns = Rotation.from_euler("ZYX", attitudes[:, ::-1])
            imu = motions.position[:, near].T + turns.apply(self._imu)
            near[near] = self._outline.closer_than(least, imu, attitudes)
        return near
