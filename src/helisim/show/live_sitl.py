"""Watch an autopilot fly, in MuJoCo's viewer, while it does."""

import time
from collections.abc import Callable

import mujoco
import numpy as np

from helisim.show.viewer import LiveFlight, Rotors, Window
from helisim.sitl.aircraft import Aircraft
from helisim.sitl.packet import Frame, Sensed

_BETWEEN = 1.0 / 60.0
"""s of the clock between two pictures."""
_STATE = ("qpos", "qvel", "act", "sensordata", "time")


def seen(aircraft: Aircraft) -> LiveFlight:
    """Return an aircraft with every part to be seen, where it is; it is shown, not flown."""
    model = aircraft.vehicle.visual_model(aircraft.ground.put_into)
    flight = LiveFlight(model, mujoco.MjData(model), None, aircraft.vehicle.roles)
    _follow(flight, aircraft)
    return flight


class Watched:
    """Shows an aircraft in a window while a `Backend` flies it: its `on_frame` and `on_wait`."""

    def __init__(
        self,
        aircraft: Aircraft,
        flight: LiveFlight,
        window: Window,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Show the aircraft as it stands.

        Args:
            aircraft: that is flown.
            flight: `seen` of it, which the window shows.
            window: that shows it.
            clock: s, rising.
        """
        self._aircraft, self._flight, self._window = aircraft, flight, window
        self._rotors = Rotors(flight.model, flight.roles)
        self._clock, self._next = clock, -np.inf
        self._turned = self._time = 0.0
        self._show()

    def on_frame(self, _frame: Frame, sensed: Sensed) -> bool:
        """Show a picture when it is time for one; return whether the window was closed."""
        if self._clock() < self._next:
            return False
        self._turned += self._aircraft.rotor_speed * max(0.0, sensed.time - self._time)
        self._time = sensed.time
        return self._show()

    def on_wait(self) -> bool:
        """Return whether the window was closed."""
        return not self._window.is_running()

    def _show(self) -> bool:
        if not self._window.is_running():
            return True
        with self._window.lock():
            _follow(self._flight, self._aircraft)
            self._rotors.draw(self._flight.data, self._window.user_scn, self._turned)
        self._window.sync()
        self._next = self._clock() + _BETWEEN
        return False


def _follow(flight: LiveFlight, aircraft: Aircraft) -> None:
    """Put what is seen where an aircraft is."""
    model, data = flight.model, flight.data
    for name in _STATE:
        setattr(data, name, getattr(aircraft.data, name))
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
