"""When a helicopter that touches the ground has landed, and when it has crashed."""

import math

import mujoco
import numpy as np

from helisim.physics.frames import flip
from helisim.sim.clearance import outline
from helisim.sim.landing import HARDEST_LANDING
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import root_body


class Crash:
    """Watches a flight over a ground at height 0 for its end."""

    def __init__(self, vehicle: Vehicle, model: mujoco.MjModel) -> None:
        """Take the shape of a vehicle that flies in a model with ground."""
        shape = outline(vehicle)
        self._discs = [
            (name, np.array(flip(*centre)), np.array(flip(*axis)), radius)
            for name, (centre, axis, radius) in zip(("main", "tail"), shape.discs)
        ]
        self._points, self._radii = np.column_stack(flip(*shape.points.T)), shape.radii
        self._body = root_body(model)
        self._imu = model.site(vehicle.roles.site("imu")).id
        self.begin()

    def begin(self) -> None:
        """Forget what was: a new flight begins."""
        self._sinking = 0.0
        self._touched = False

    def found(self, data: mujoco.MjData) -> str:
        """Return why the flight has ended with the step that was just made, "" if it goes on."""
        if not np.isfinite(data.qpos).all() or any(one.number for one in data.warning):
            return "the flight has no finite state"
        sinking, touches = self._sinking, data.ncon > 0
        self._sinking = -float(data.qvel[2])
        if touches and not self._touched and sinking > HARDEST_LANDING:
            return f"the helicopter hit the ground at {sinking:.1f} m/s"
        self._touched = touches
        return self._struck(data)

    def clearance(self, data: mujoco.MjData) -> float:
        """Return the height of the lowest point of the landing gear, m."""
        level = data.xmat[self._body][6:]
        lowest = np.min(self._points @ level - self._radii, initial=np.inf)
        return float(data.site_xpos[self._imu, 2] + lowest)

    def _struck(self, data: mujoco.MjData) -> str:
        """Return which rotor's disc reaches into the ground, in words."""
        level = data.xmat[self._body][6:]  # of body axes, how far each points up
        for name, centre, axis, radius in self._discs:
            height = data.site_xpos[self._imu, 2] + level @ centre
            if height < radius and height < radius * math.sqrt(
                max(0.0, 1.0 - float(level @ axis) ** 2)
            ):
                return f"the {name} rotor struck the ground"
        return ""
