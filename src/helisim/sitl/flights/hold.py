"""A soft hand on the sticks, that keeps a place in a flight mode that doesn't."""

import math
from collections.abc import Generator

from helisim.base.errors import AutopilotError
from helisim.base.units import STANDARD_GRAVITY
from helisim.sitl.flights.pilot import Pilot, Steps

_LEARNS = 5.0
"""s over which the steady flight is averaged."""
_SOFT = 0.1
"""rad/s: how fast a place is held, far below what is swept."""
_LEAN = math.radians(3.0)
_CLIMB = 0.05
"""Most of lean, rad, and thrust that holding a place takes."""
_HEAVE = 0.03
"""Thrust over a velocity down, s/m."""


class Hold:
    """A pilot's soft hand on the sticks in a mode without position: it keeps a place, slowly."""

    def __init__(self, pilot: Pilot) -> None:
        self._pilot = pilot
        self._lean = (0.0, 0.0)
        self._thrust, self._most, self._curve = 0.5, math.radians(30.0), (0.0, 0.4, 0.6, 1.0)
        self._place = (0.0, 0.0, 0.0)

    def learn(self) -> Steps:
        """Average the steady flight: the sticks begin where that flies."""
        most = yield from self._most_lean()
        trim = yield from self._pilot.read("ATC_HOVR_ROL_TRM")
        curve = []
        for k in range(1, 5):
            value = yield from self._pilot.read(f"IM_STB_COL_{k}")
            curve.append(value / 100.0)
        self._most, self._curve = most, tuple(curve)
        rolls, pitches, thrusts = [], [], []
        end = self._pilot.time + _LEARNS
        while self._pilot.time < end:
            roll, pitch, _ = self._pilot.telemetry.attitude
            rolls.append(roll)
            pitches.append(pitch)
            thrusts.append(self._pilot.telemetry.thrust)
            yield
        count = len(rolls)
        added = math.radians(trim / 100.0)  # to what the stick asks
        self._lean = (sum(rolls) / count - added, sum(pitches) / count)
        self._thrust = sum(thrusts) / count
        self._place = tuple(self._pilot.sensed.position)
        self.steer()

    def _most_lean(self) -> Generator[None, None, float]:
        """Return the lean that a stick asks for at its end, rad."""
        try:
            return math.radians(0.01 * (yield from self._pilot.read("ANGLE_MAX")))
        except AutopilotError:  # its name and unit since version 4.7
            return math.radians((yield from self._pilot.read("ATC_ANGLE_MAX")))

    def fly(self, seconds: float) -> Steps:
        """Hold the place for some time."""
        end = self._pilot.time + seconds
        while self._pilot.time < end:
            self.steer()
            yield

    def steer(self) -> None:
        """Move the sticks as far as place and velocity ask."""
        pilot, sensed = self._pilot, self._pilot.sensed
        heading = pilot.telemetry.attitude[2]
        ahead, right = _turned(heading, self._asked(0), self._asked(1))
        roll = self._lean[0] + _limited(right / STANDARD_GRAVITY, _LEAN)
        pitch = self._lean[1] - _limited(ahead / STANDARD_GRAVITY, _LEAN)
        down = float(sensed.velocity[2]) + _SOFT * (float(sensed.position[2]) - self._place[2])
        thrust = self._thrust + _limited(_HEAVE * down, _CLIMB)
        pilot.sticks.roll, pilot.sticks.pitch = roll / self._most, pitch / self._most
        pilot.sticks.throttle = self._stick(thrust)

    def let_go(self) -> None:
        """Put the sticks back into the middle."""
        self._pilot.sticks.roll = self._pilot.sticks.pitch = 0.0
        self._pilot.sticks.throttle = 0.5

    def _asked(self, k: int) -> float:
        """Return the acceleration to the north or the east that is asked, m/s^2."""
        sensed = self._pilot.sensed
        away = float(sensed.position[k]) - self._place[k]
        return -2.0 * _SOFT * float(sensed.velocity[k]) - _SOFT**2 * away

    def _stick(self, thrust: float) -> float:
        """Return where the stick asks for a thrust, by the curve of its mode."""
        at, knots = self._curve, (0.0, 0.4, 0.6, 1.0)
        for low, high, begin, end in zip(at, at[1:], knots, knots[1:]):
            if thrust <= high and high > low:
                return max(0.0, begin + (end - begin) * (thrust - low) / (high - low))
        return 1.0


def _turned(heading: float, north: float, east: float) -> tuple[float, float]:
    c, s = math.cos(heading), math.sin(heading)
    return c * north + s * east, c * east - s * north


def _limited(value: float, most: float) -> float:
    return max(-most, min(most, value))
