"""What becomes of a flight by frames near the ground: a landing, a rotor's strike, a fall."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.sim.clearance import outline
from helisim.sim.ground import Ground
from helisim.sim.landing import HARDEST_LANDING, rims
from helisim.sitl.link import Sensed
from helisim.vehicle import Vehicle

_FASTEST = 10.0
"""m/s, at which a rim nears the ground: until then it isn't looked for again."""


class Watch:
    """Looks where landing gear and rotors are, as seldom as their clearance allows."""

    def __init__(self, vehicle: Vehicle, ground: Ground) -> None:
        """Take the shape of a vehicle and the ground below it."""
        shape = outline(vehicle)
        self._ground = ground
        self._gear, self._radii = shape.points, shape.radii
        self._rims = dict(rims(shape))
        self.begin()

    def begin(self) -> None:
        """Forget what was: a new flight begins."""
        self._next, self._start = 0.0, np.zeros(3)
        self._seen: tuple[Sensed | None, Sensed | None] = None, None
        self._touched = False

    def found(self, now: Sensed, start: NDArray[np.float64], touches: bool) -> str:
        """Return why the flight ends with this frame, "" if it goes on.

        Args:
            now: what is sensed.
            start: (3,) where the positions are from, north-east-down, m.
            touches: whether anything touches the ground.
        """
        self._start = start
        before, self._seen = self._seen, (self._seen[1], now)
        first, self._touched = touches and not self._touched, touches
        if first and (sinking := self._sinking(*before)) > HARDEST_LANDING:
            return f"the helicopter hit the ground at {sinking:.1f} m/s"
        return self._struck(now) if now.time >= self._next else ""

    def _sinking(self, earlier: Sensed | None, later: Sensed | None) -> float:
        """Return how fast the lowest point of the landing gear came down between two frames."""
        if earlier is None or later is None:
            return 0.0
        high, low = (
            float((self._heights(at, self._gear) - self._radii).min()) for at in (earlier, later)
        )
        return (high - low) / (later.time - earlier.time)

    def _struck(self, now: Sensed) -> str:
        """Return which rotor's disc reaches into the ground, in words."""
        least = np.inf
        for name, rim in self._rims.items():
            clear = float(self._heights(now, rim).min())
            if clear < 0.0:
                return f"the {name} rotor struck the ground"
            least = min(least, clear)
        self._next = now.time + least / _FASTEST
        return ""

    def _heights(self, at: Sensed, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how high points (n, 3) from the IMU, body axes, are above the ground, (n,)."""
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, at.quaternion)
        places = self._start + at.position + points @ turn.reshape(3, 3).T
        return self._ground.heights(np.array([at.time]), places[None])[0]
