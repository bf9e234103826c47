"""The outer loops: position to velocity to attitude to rate sticks, and height to collective.

The gyro makes the cyclic sticks and the pedals command rates, so each loop here is near an
integrator, and its gain is the frequency at which it crosses over. They are nested well apart, so
that a vehicle whose force laws are other by a third is still flown.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.physics.layout import PARAM
from helisim.sim.missions.lift import Lift
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import Motion
from helisim.vehicle.trim import Trim, collective_stick

_ATTITUDE, _VELOCITY, _POSITION = 3.0, 1.0, 0.35
"""rad/s, at which the loops of attitude, velocity and position cross over."""
_HEAVE, _HEIGHT, _HEADING = 4.0, 1.0, 1.5
"""rad/s, of the loops of vertical speed, height and heading."""
_TRIMMING, _LIFTING = 0.2, 0.5
"""rad/s, below which the integrals take out what drag and wind leave, and what climb does."""
_CATCH_UP, _CATCH_UP_VERTICALLY = 4.0, 2.0
"""m/s, of the most with which a lost position is made up for."""
_TILT = 0.5
"""rad, that is asked for at most."""
_TURN = 1.5
"""rad/s, that is asked for at most in roll and pitch."""
_YAW_SHARE = 0.8
"""Of the yaw rate of a full pedal, that is asked for at most."""
_END = 0.5
"""Where a stick stops, unitised."""


class Sight(NamedTuple):
    """What a script's pilot sees, SI.

    Attributes:
        time: s from the flight's start.
        motion: of the helicopter, with position, attitude and rates.
        north_rate: velocity over the ground, m/s.
        east_rate: likewise.
        down_rate: likewise; positive sinks.
        clearance: m, of the landing gear above what is below; without a ground above height 0.
        touches: whether the helicopter touched anything since the last tick.
        rotor_speed: of the main rotor, over its nominal one.
    """

    time: float
    motion: Motion
    north_rate: float
    east_rate: float
    down_rate: float
    clearance: float
    touches: bool
    rotor_speed: float


@dataclass
class Wanted:
    """What a pilot's outer loops are to reach now. A script changes it as the flight goes on.

    Attributes:
        north: m; of the origin.
        east: m.
        down: m.
        north_rate: m/s, over the ground.
        east_rate: m/s.
        down_rate: m/s.
        north_acceleration: m/s^2, that is known beforehand.
        east_acceleration: m/s^2.
        heading: rad.
        turning: rad/s.
        holds_place: whether north and east count, else their rates alone.
        holds_height: whether down counts, else its rate alone.
        collective: stick, unitised, in place of what height and climb ask for; None: as they do.
        tilt: rad, of roll and pitch at most.
        cyclic: whether attitude and heading are held: not on the ground, where the gyro's integrals
            would wind up.
        rotor: commanded rotor speed over the nominal one; 0 cuts a motor's throttle. An ideal
            governor's rotor has this speed at once.
    """

    north: float = 0.0
    east: float = 0.0
    down: float = 0.0
    north_rate: float = 0.0
    east_rate: float = 0.0
    down_rate: float = 0.0
    north_acceleration: float = 0.0
    east_acceleration: float = 0.0
    heading: float = 0.0
    turning: float = 0.0
    holds_place: bool = True
    holds_height: bool = True
    collective: float | None = None
    tilt: float = _TILT
    cyclic: bool = True
    rotor: float = 1.0

    @property
    def unsound(self) -> str:
        """What is no finite number, such as "north = nan"; "" if all is."""
        said = ((name, value) for name, value in vars(self).items() if value is not None)
        return ", ".join(f"{name} = {value}" for name, value in said if not math.isfinite(value))


@dataclass
class OuterLoop:
    """Turns what is wanted into sticks; keeps the integrals of one flight.

    Attributes:
        theta: pitch angle of the trim, rad.
        phi: its roll angle.
        collective: its collective stick, unitised.
        gravity: m/s^2.
        lift: vertical acceleration that a unit of collective stick makes, m/s^2.
        rotor: by which the collective of a thrust is found far from the trim.
        to_cyclic: (2, 2) rates p, q in rad/s to sticks LAT, LON.
        yaw_rate: rad/s that a unit of pedal commands.
    """

    theta: float
    phi: float
    collective: float
    gravity: float
    lift: float
    rotor: Lift
    to_cyclic: NDArray[np.float64]
    yaw_rate: float
    _north: float = field(default=0.0, init=False)
    _east: float = field(default=0.0, init=False)
    _down: float = field(default=0.0, init=False)

    @classmethod
    def of(cls, vehicle: Vehicle, model: mujoco.MjModel, trim: Trim, rotor: int) -> "OuterLoop":
        """Return the loops for a vehicle, from what its gyro and its collective command.

        Args:
            vehicle: that flies.
            model: of the flight.
            trim: in which it begins.
            rotor: its rotor's actuator.
        """
        par = model.actuator_user[rotor]
        rates = [
            [par[PARAM.gyro_p_per_lat], par[PARAM.gyro_p_per_lon]],
            [par[PARAM.gyro_q_per_lat], par[PARAM.gyro_q_per_lon]],
        ]
        return cls(
            theta=trim.theta,
            phi=trim.phi,
            collective=collective_stick(model, trim),
            gravity=float(np.linalg.norm(model.opt.gravity)),
            lift=abs(vehicle.derivatives["Z_col"] * float(par[PARAM.gyro_collective])),
            rotor=Lift.of(vehicle, model, rotor),
            to_cyclic=np.linalg.inv(rates),
            yaw_rate=float(par[PARAM.gyro_k_delta] / par[PARAM.gyro_k_a]),
        )

    def sticks(self, seen: Sight, wanted: Wanted, seconds: float) -> tuple[float, ...]:
        """Return COL, LON, LAT, PED, unitised.

        Args:
            seen: now.
            wanted: now.
            seconds: for which the sticks are held.
        """
        col = self._col(seen, wanted, seconds) if wanted.collective is None else wanted.collective
        if not wanted.cyclic:
            return _limited(col, _END), 0.0, 0.0, 0.0
        phi, theta = self._attitude(seen, wanted, seconds)
        return _limited(col, _END), *self._cyclic_and_pedal(seen, wanted, phi, theta)

    def _col(self, seen: Sight, wanted: Wanted, seconds: float) -> float:
        catch_up = _HEIGHT * (wanted.down - seen.motion.down) if wanted.holds_height else 0.0
        off = wanted.down_rate + _limited(catch_up, _CATCH_UP_VERTICALLY) - seen.down_rate
        upright = max(0.5, math.cos(seen.motion.phi) * math.cos(seen.motion.theta))
        lift = self.gravity * (1.0 / upright - 1.0) - (_HEAVE * off + self._down) / upright
        col = self.collective + lift / self.lift
        if abs(col) < _END or off * (col - self.collective) > 0.0:  # it doesn't wind up
            self._down += seconds * _HEAVE * _LIFTING * off
        return col

    def _attitude(self, seen: Sight, wanted: Wanted, seconds: float) -> tuple[float, float]:
        """Return the roll and pitch angle that velocity and position ask for, rad."""
        north_off, east_off = wanted.north_rate - seen.north_rate, wanted.east_rate - seen.east_rate
        if wanted.holds_place:
            far = (wanted.north - seen.motion.north, wanted.east - seen.motion.east)
            share = min(1.0, _CATCH_UP / max(1e-9, _POSITION * math.hypot(*far)))
            north_off += share * _POSITION * far[0]
            east_off += share * _POSITION * far[1]
        north = wanted.north_acceleration + _VELOCITY * north_off + self._north
        east = wanted.east_acceleration + _VELOCITY * east_off + self._east
        cosine, sine = math.cos(seen.motion.psi), math.sin(seen.motion.psi)
        ahead, right = cosine * north + sine * east, cosine * east - sine * north
        most = self.gravity * math.tan(wanted.tilt)
        share = min(1.0, most / max(1e-9, math.hypot(ahead, right)))
        if share == 1.0:
            self._north += seconds * _VELOCITY * _TRIMMING * north_off
            self._east += seconds * _VELOCITY * _TRIMMING * east_off
        theta = self.theta - math.atan(share * ahead / self.gravity)
        return self.phi + math.atan(share * right / self.gravity * math.cos(theta)), theta

    def _cyclic_and_pedal(
        self, seen: Sight, wanted: Wanted, phi: float, theta: float
    ) -> tuple[float, float, float]:
        """Return LON, LAT and PED that turn to a roll and pitch angle, rad, and to the heading."""
        now = seen.motion
        psi_off = math.remainder(wanted.heading - now.psi, 2.0 * math.pi)
        fastest = _YAW_SHARE * _END * abs(self.yaw_rate)
        psi_rate = _limited(wanted.turning + _HEADING * psi_off, fastest)
        phi_rate = _limited(_ATTITUDE * (phi - now.phi), _TURN)
        theta_rate = _limited(_ATTITUDE * (theta - now.theta), _TURN)
        level, sine, cosine = math.cos(now.theta), math.sin(now.phi), math.cos(now.phi)
        p = phi_rate - psi_rate * math.sin(now.theta)
        q = theta_rate * cosine + psi_rate * level * sine
        r = psi_rate * level * cosine - theta_rate * sine
        lat, lon = (float(one) for one in self.to_cyclic @ (p, q))
        return (
            _limited(lon, _END),
            _limited(lat, _END),
            _limited(r / self.yaw_rate, _END),
        )


def _limited(value: float, most: float) -> float:
    return min(most, max(-most, value))
