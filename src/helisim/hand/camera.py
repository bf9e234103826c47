"""Where a helicopter that is flown by hand is seen from."""

import math

import mujoco

from helisim.hand import HandFlight
from helisim.show.viewer import aim
from helisim.sim.pilot import hover_height

_BEHIND, _ABOVE_DEG = 2.6, -16.0
"""Of the hover's height, how far behind; degrees, downwards."""
_FOLLOWS = 0.08
"""Share of a turn that the camera behind follows in a picture, so that a turn is seen."""
_PILOT_AWAY, _PILOT_EYES = 6.0, 1.7
"""m, behind the pad and above the ground, of a pilot who stands there."""


class Camera:
    """Looks at a flight in one of the ways of `CAMERAS`."""

    def __init__(self, flight: HandFlight, body: int) -> None:
        self.flight, self._body = flight, body
        self.view = mujoco.MjvCamera()
        self._kind = ""

    def look(self, kind: str) -> None:
        """Aim for the next picture."""
        new, self._kind = kind != self._kind, kind
        getattr(self, f"_{kind}")(new)

    def _behind(self, new: bool) -> None:
        now, view = self.flight.motion, self.view
        heading = -math.degrees(now.psi)
        view.type = mujoco.mjtCamera.mjCAMERA_FREE
        turn = (heading - view.azimuth + 180.0) % 360.0 - 180.0
        view.azimuth += turn if new else _FOLLOWS * turn
        view.elevation = _ABOVE_DEG
        view.distance = _BEHIND * hover_height(self.flight.model)
        view.lookat[:] = self.flight.data.qpos[:3]

    def _pad(self, new: bool) -> None:
        view, at = self.view, self.flight.data.qpos[:3]
        ahead, left, up = at[0] + _PILOT_AWAY, at[1], at[2] - _PILOT_EYES
        level = math.hypot(ahead, left)
        view.type = mujoco.mjtCamera.mjCAMERA_FREE
        view.azimuth = math.degrees(math.atan2(left, ahead))
        view.elevation = math.degrees(math.atan2(up, level))
        view.distance = max(1.0, math.hypot(level, up))
        view.lookat[:] = at

    def _around(self, new: bool) -> None:
        if new:
            aim(self.view, self.flight.model, self._body)
