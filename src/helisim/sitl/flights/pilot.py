"""A script's pilot: speaks to the autopilot, moves the sticks, and waits, by simulated time.

A script is a generator. Each `yield` lets a hundredth of a second of simulated time go by; the
autopilot waits meanwhile for its answer, so that whatever the script sends arrives at the same
simulated time in each run.
"""

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np

from helisim.base.errors import AutopilotError, UnknownNameError
from helisim.sitl.aircraft import Aircraft
from helisim.sitl.flights.telemetry import Telemetry
from helisim.sitl.packet import Sensed

Steps = Generator[None, None, None]
"""What a script is, and each manoeuvre of a pilot: `yield from pilot.land()`."""
MODES = {
    "stabilize": 0,
    "acro": 1,
    "alt_hold": 2,
    "auto": 3,
    "guided": 4,
    "loiter": 5,
    "rtl": 6,
    "land": 9,
    "systemid": 25,
}
"""Flight mode -> ArduCopter's number."""
_BOOTS = 5.0
"""s after its first heartbeat before the autopilot listens for sure."""
_STILL, _WINDMILLS = 0.02, 0.3
"""Of the rotor's nominal speed: it creeps on below the first, and gusts turn it up to the other."""
_ALIGNED = 0b10_0001_1111
"""Flags of the EKF: attitude, velocity, position, and that it will have them in flight."""


@dataclass
class Sticks:
    """Where the sticks stand.

    Attributes:
        roll, pitch, yaw: -1 to 1; positive rolls right, pitches up (pulls), yaws right.
        throttle: 0 to 1.
        rotor: whether the rotor is switched on, by channel 8.
    """

    roll: float = 0.0
    pitch: float = 0.0
    throttle: float = 0.0
    yaw: float = 0.0
    rotor: bool = False

    @property
    def pulses(self) -> list[int]:
        """Of channels 1 to 8, us, in ArduPilot's usual order."""
        angles = [round(1500.0 + 500.0 * one) for one in (self.roll, self.pitch, self.yaw)]
        throttle = round(1000.0 + 1000.0 * self.throttle)
        return [*angles[:2], throttle, angles[2], 1000, 1000, 1000, 2000 if self.rotor else 1000]


class Pilot:
    """What a script flies with.

    Attributes:
        aircraft: that flies.
        sticks: moved by setting its attributes.
        telemetry: what the autopilot says of itself.
        sensed: what the aircraft's sensors say.
        ground: (north, east, down) where it stood at the start, m.
    """

    def __init__(
        self, aircraft: Aircraft, telemetry: Telemetry, say: Callable[[str], None]
    ) -> None:
        self.aircraft, self.telemetry, self.sticks = aircraft, telemetry, Sticks()
        self._say = say
        self.sensed: Sensed = aircraft.sensed
        self.ground = aircraft.sensed.position.copy()

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.sensed.time

    @property
    def height(self) -> float:
        """Above where it stood, m."""
        return float(self.ground[2] - self.sensed.position[2])

    @property
    def speed(self) -> float:
        """Over the ground and upwards together, m/s."""
        return math.hypot(*self.sensed.velocity)

    def distance(self, north: float, east: float, height: float) -> float:
        """Return how far away a place is, m, counted from where the aircraft stood."""
        place = self.ground + np.array((north, east, -height))
        return math.dist(self.sensed.position, place)

    def say(self, text: str) -> None:
        """Tell the user how far the flight is."""
        self._say(text)

    def wait(self, seconds: float) -> Steps:
        """Let simulated time go by."""
        end = self.time + seconds - 1e-9
        while self.time < end:
            yield

    def until(self, condition: Callable[[], bool], what: str, within: float) -> Steps:
        """Wait until something is so.

        Args:
            condition: asked each hundredth of a second.
            what: should happen, for the error: "the rotor turns".
            within: s of simulated time.

        Raises:
            AutopilotError: it did not come in time.
        """
        end, heard = self.time + within, len(self.telemetry.said)
        while not condition():
            if self.time >= end:
                said = "; ".join(self.telemetry.said[heard:][-3:]) or "nothing"
                raise AutopilotError(
                    f"{what}: not so within {within:g} s, at {self.time:.1f} s of flight; the "
                    f"autopilot said: {said}"
                )
            yield

    def mode(self, name: str) -> Steps:
        """Change the flight mode. Raises UnknownNameError, or AutopilotError if it is refused."""
        if name not in MODES:
            raise UnknownNameError("flight mode", name, MODES)
        self.telemetry.ask_mode(MODES[name])
        changed = lambda: self.telemetry.mode == MODES[name]  # noqa: E731
        yield from self.until(changed, f"flight mode {name}", 3.0)

    def command(self, name: str, *numbers: float) -> Steps:
        """Give a command of MAVLink by its name, such as MAV_CMD_NAV_TAKEOFF.

        Raises:
            AutopilotError: it is refused.
        """
        number = self.telemetry.command(name, *numbers)
        results = self.telemetry.acknowledged
        yield from self.until(lambda: number in results, f"an answer to {name}", 3.0)
        if results[number] != 0:
            said = "; ".join(self.telemetry.said[-3:]) or "nothing"
            raise AutopilotError(f"{name} is refused with result {results[number]}: {said}")

    def set(self, **parameters: float) -> Steps:
        """Set parameters by their names. Raises AutopilotError if one doesn't exist."""
        for name, value in parameters.items():
            self.telemetry.set_parameter(name, value)
            confirmed = lambda name=name: name in self.telemetry.parameters  # noqa: E731
            yield from self.until(confirmed, f"parameter {name} is set", 3.0)

    def read(self, name: str) -> Generator[None, None, float]:
        """Return a parameter's value: `value = yield from pilot.read("H_RSC_RUNUP_TIME")`."""
        self.telemetry.ask_parameter(name)
        told = lambda: name in self.telemetry.parameters  # noqa: E731
        yield from self.until(told, f"the value of parameter {name}", 3.0)
        return self.telemetry.parameters[name]

    def ready(self) -> Steps:
        """Wait until the autopilot knows where it is."""
        self.say("waiting for the EKF")
        spoken = lambda: self.telemetry.mode is not None  # noqa: E731
        yield from self.until(spoken, "a heartbeat of the autopilot", 30.0)
        yield from self.wait(_BOOTS)
        self.telemetry.ask_for_messages()
        aligned = lambda: self.telemetry.aligned & _ALIGNED == _ALIGNED  # noqa: E731
        yield from self.until(aligned, "the EKF knows its position", 120.0)
        yield from self.wait(5.0)

    def start(self) -> Steps:
        """Arm on the ground and spin the rotor up."""
        yield from self.ready()
        self.say("arming")
        yield from self.set(LOG_DISARMED=1)
        yield from self.wait(3.0)  # its log begins now: arming would wait for it by the clock
        yield from self.mode("stabilize")
        yield from self.command("MAV_CMD_COMPONENT_ARM_DISARM", 1)
        yield from self.until(lambda: self.telemetry.armed, "armed", 5.0)
        self.say("rotor on")
        takes = yield from self.read("H_RSC_RUNUP_TIME")
        self.sticks.rotor = True
        turns = lambda: self.aircraft.rotor_speed > 0.9  # noqa: E731
        yield from self.wait(takes + 2.0)
        yield from self.until(turns, "the rotor turns", 60.0)

    def take_off(self, height: float) -> Steps:
        """Start if that isn't done, and climb to a height above the ground, m."""
        if not self.telemetry.armed:
            yield from self.start()
        self.say(f"taking off to {height:g} m")
        self.sticks.throttle = 0.5
        yield from self.mode("guided")
        yield from self.command("MAV_CMD_NAV_TAKEOFF", *[0.0] * 6, height)
        here = lambda: abs(self.height - height) < 0.3 and self.speed < 0.3  # noqa: E731
        yield from self.until(here, f"{height:g} m above the ground", 20.0 + 2.0 * height)

    def go_to(
        self, north: float, east: float, height: float, *, heading: float = 0.0, within: float = 0.3
    ) -> Steps:
        """Fly to a place, counted from where the aircraft stood, and stay there.

        Args:
            north: m.
            east: m.
            height: m.
            heading: rad.
            within: m, from where on it is there.
        """
        yield from self.mode("guided")
        far = self.distance(north, east, height)
        place = (north + float(self.ground[0]), east + float(self.ground[1]))
        self.telemetry.go_to(*place, -height, heading)
        there = lambda: (  # noqa: E731
            self.distance(north, east, height) < within and self.speed < 0.3
        )
        what = f"{north:g} m north, {east:g} m east, {height:g} m high"
        yield from self.until(there, what, 30.0 + 2.0 * far)

    def land(self) -> Steps:
        """Land where it is, stop the rotor, and disarm."""
        self.say("landing")
        yield from self.mode("land")
        yield from self.until(
            lambda: self.aircraft.stands and self.speed < 0.05, "landed", 60.0 + 4.0 * self.height
        )
        self.sticks.throttle = 0.0
        yield from self.wait(3.0)
        self.say("rotor off")
        self.sticks.rotor = False
        yield from self.wait(2.0)
        if self.telemetry.armed:
            yield from self.command("MAV_CMD_COMPONENT_ARM_DISARM", 0)
            yield from self.until(lambda: not self.telemetry.armed, "disarmed", 10.0)
        yield from self.set(LOG_DISARMED=0)
        still = _STILL if self.aircraft.weather.dryden is None else _WINDMILLS
        yield from self.until(
            lambda: self.aircraft.rotor_speed < still, "the rotor stands still", 120.0
        )
