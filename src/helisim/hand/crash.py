"""When a helicopter that touches the ground has landed, and when it has crashed."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.physics.motion import flip
from helisim.sim.clearance import outline
from helisim.sim.ground import Ground
from helisim.sim.landing import HARDEST_LANDING, rims
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import root_body

_LOW = 0.5
"""m of clearance, below which it is watched how fast that shrinks."""


class Crash:
    """Watches a flight over a ground for its end."""

    def __init__(self, vehicle: Vehicle, model: mujoco.MjModel, ground: Ground) -> None:
        """Take the shape of a vehicle that flies in a model with a ground."""
        shape = outline(vehicle)
        self._ground, self._step = ground, model.opt.timestep
        self._points, self._radii = np.column_stack(flip(*shape.points.T)), shape.radii
        self._rims = [(name, np.column_stack(flip(*rim.T))) for name, rim in rims(shape)]
        self._reach = shape.reach
        self._body = root_body(model)
        self._imu = model.site(vehicle.roles.site("imu")).id
        self.begin()

    def begin(self) -> None:
        """Forget what was: a new flight begins."""
        self._before = (np.inf, np.inf)
        self._touched = False

    def found(self, data: mujoco.MjData) -> str:
        """Return why the flight has ended with the step that was just made, "" if it goes on."""
        if not np.isfinite(data.qpos).all() or any(one.number for one in data.warning):
            return "the flight has no finite state"
        touches, high = data.ncon > 0, self._heights(data, np.zeros((1, 3)))[0] > self._reach + _LOW
        if high:
            self.begin()
            return ""
        sinking = (self._before[0] - self._before[1]) / self._step
        self._before = self._before[1], self.clearance(data)
        if touches and not self._touched and HARDEST_LANDING < sinking < np.inf:
            return f"the helicopter hit the ground at {sinking:.1f} m/s"
        self._touched = touches
        return self._struck(data)

    def clearance(self, data: mujoco.MjData) -> float:
        """Return the height of the lowest point of the landing gear, m."""
        return float(np.min(self._heights(data, self._points) - self._radii, initial=np.inf))

    def _heights(self, data: mujoco.MjData, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how high points (n, 3) from the IMU, MuJoCo's axes, are above the ground, (n,)."""
        turn = data.xmat[self._body].reshape(3, 3)
        world = data.site_xpos[self._imu] + points @ turn.T
        earth = np.column_stack(flip(*world.T))
        return self._ground.heights(np.array([data.time]), earth[None])[0]

    def _struck(self, data: mujoco.MjData) -> str:
        """Return which rotor's disc reaches into the ground, in words."""
        for name, rim in self._rims:
            if self._heights(data, rim).min() < 0.0:
                return f"the {name} rotor struck the ground"
        return ""
