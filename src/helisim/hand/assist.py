"""Help for whoever flies by hand, done by the compiled pilot: what the sticks mean to it."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import UnknownNameError
from helisim.hand.sticks import Deflection
from helisim.physics.layout import PARAM
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import Motion
from helisim.vehicle.trim import Trim

AssistName = Literal["hover", "level", "none"]
ASSISTS: tuple[AssistName, ...] = get_args(AssistName)

_TILT = 0.45
"""rad, that a full deflection commands where attitude is commanded."""
_SPEED, _CLIMB = 6.0, 2.0
"""m/s, that a full deflection commands where velocity is commanded; a climb of 2 m/s is below
what the landing gear stands."""
_HURRY = 3.0
"""m/s^2, at which the commanded velocity changes: a tilt of 0.3 rad."""
_STILL, _STILL_CLIMB, _STILL_TURN = 0.4, 0.2, 0.15
"""m/s and rad/s, below which a helicopter whose stick is in the middle is held where it is."""
_MIDDLE = 0.05
"""Deflection of a collective that is in the middle: a throttle stick has no spring."""
_ATTITUDE, _VELOCITY, _POSITION = 3.0, 1.0, 0.35
"""rad/s, at which the loops of attitude, velocity and position cross over, each well inside the
next."""
_HEAVE, _HEIGHT, _HEADING = 4.0, 1.0, 1.5
"""rad/s, of the loops of vertical speed, height and heading."""


def check_assist(name: str) -> AssistName:
    """Return the name of an assistance. Raises UnknownNameError."""
    for known in ASSISTS:
        if name == known:
            return known
    raise UnknownNameError("assist", name, ASSISTS)


@dataclass(frozen=True)
class _Gains:
    """What the compiled pilot flies with: sticks per rad or per m/s, and 1/s."""

    attitude: float
    velocity: float
    position: float
    heave: float
    height: float
    heading: float

    @classmethod
    def of(cls, vehicle: Vehicle, par: NDArray[np.float64]) -> "_Gains":
        gravity = float(np.linalg.norm(vehicle.model.opt.gravity))
        roll_rate, yaw_rate = (
            abs(par[PARAM.gyro_p_per_lat]),
            abs(par[PARAM.gyro_k_delta] / par[PARAM.gyro_k_a]),
        )
        return cls(
            attitude=_ATTITUDE / roll_rate,
            velocity=_VELOCITY / gravity,
            position=_POSITION,
            heave=_HEAVE / abs(vehicle.derivatives["Z_col"]),
            height=_HEIGHT,
            heading=_HEADING / yaw_rate,
        )


class Assistance:
    """Tells the compiled pilot, through a vehicle's parameters (n_param,), what the sticks ask for.

    hover: the sticks command velocities, a climb and a turn; let go, it stays where it is.
    level: the cyclic stick commands roll and pitch angle; collective and pedals are direct.
    none: all four sticks go to the gyro as they are.
    """

    def __init__(self, vehicle: Vehicle, par: NDArray[np.float64]) -> None:
        """Take gains and trim from a vehicle whose pilot is in its parameters."""
        self.trim: Trim = vehicle.trim
        self.gains = _Gains.of(vehicle, par)
        self.collective = float(par[PARAM.pilot_col])
        self.begin()

    def begin(self) -> None:
        """Start anew, from however the helicopter moves."""
        self.velocity = np.zeros(2)
        self.holds_place = self.holds_height = self.holds_heading = False

    def ask(
        self,
        par: NDArray[np.float64],
        name: AssistName,
        felt: Deflection,
        now: Motion,
        seconds: float,
    ) -> None:
        """Write what the pilot is to do until it is asked again.

        Args:
            par: parameters of the vehicle, (n_param,), written.
            name: of the assistance.
            felt: where the sticks are, behind rates and expo.
            now: how the helicopter moves.
            seconds: since the last time.
        """
        sticks = 0.5 * np.array(felt)
        par[PARAM.pilot_col : PARAM.pilot_ped + 1] = sticks
        par[PARAM.pilot_k_attitude : PARAM.pilot_k_heading + 1] = 0.0
        if name == "none":
            return
        par[PARAM.pilot_k_attitude] = self.gains.attitude
        par[PARAM.pilot_lon] = par[PARAM.pilot_lat] = 0.0
        par[PARAM.pilot_theta], par[PARAM.pilot_phi] = self.trim.theta, self.trim.phi
        if name == "level":
            par[PARAM.pilot_theta] += _TILT * felt.lon
            par[PARAM.pilot_phi] += _TILT * felt.lat
            return
        self._hold_place(par, felt, now, seconds)
        self._hold_height(par, felt, now)
        self._hold_heading(par, felt, now)

    def _hold_place(
        self, par: NDArray[np.float64], felt: Deflection, now: Motion, seconds: float
    ) -> None:
        gains = self.gains
        par[PARAM.pilot_k_velocity], par[PARAM.pilot_k_position] = gains.velocity, gains.position
        wanted = _SPEED * np.array([-felt.lon, felt.lat])
        most = _HURRY * seconds
        self.velocity = self.velocity + np.clip(wanted - self.velocity, -most, most)
        moves = self.velocity.any()
        if not moves and (self.holds_place or math.hypot(now.u, now.v) < _STILL):
            if not self.holds_place:
                par[PARAM.pilot_north], par[PARAM.pilot_east] = now.north, now.east
            self.holds_place = True
            return
        self.holds_place = False
        ahead, right = self.velocity / gains.position  # so far away that it flies there as fast
        cosine, sine = math.cos(now.psi), math.sin(now.psi)
        par[PARAM.pilot_north] = now.north + cosine * ahead - sine * right
        par[PARAM.pilot_east] = now.east + sine * ahead + cosine * right

    def _hold_height(self, par: NDArray[np.float64], felt: Deflection, now: Motion) -> None:
        gains = self.gains
        par[PARAM.pilot_col] = self.collective
        par[PARAM.pilot_k_heave], par[PARAM.pilot_k_height] = gains.heave, gains.height
        climb = 0.0 if abs(felt.col) < _MIDDLE else _CLIMB * felt.col
        if climb == 0.0 and (self.holds_height or abs(now.w) < _STILL_CLIMB):
            if not self.holds_height:
                par[PARAM.pilot_down] = now.down
            self.holds_height = True
            return
        self.holds_height = False
        par[PARAM.pilot_down] = now.down - climb / gains.height

    def _hold_heading(self, par: NDArray[np.float64], felt: Deflection, now: Motion) -> None:
        if felt.ped == 0.0 and (self.holds_heading or abs(now.r) < _STILL_TURN):
            if not self.holds_heading:
                par[PARAM.pilot_psi] = now.psi
            self.holds_heading = True
            par[PARAM.pilot_k_heading] = self.gains.heading
            return
        self.holds_heading = False
