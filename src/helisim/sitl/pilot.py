"""A script's pilot: speaks MAVLink to the autopilot, moves the sticks, and waits by simulated time.

A script is a generator. Each `yield` lets a hundredth of a second of simulated time go by; the
autopilot waits meanwhile for its answer, so that all that the script sends arrives at the same
simulated time in each run.
"""

import math
import socket
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from helisim.base.errors import AutopilotError, InputError, UnknownNameError
from helisim.base.units import STANDARD_GRAVITY
from helisim.sitl.aircraft import Aircraft
from helisim.sitl.link import Sensed

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


_VEHICLE = (1, 1)
"""System and component of the autopilot."""
_GROUND = (255, 190)
"""Of a ground station, which alone may move the sticks."""
_ARMED = 128
_WARNING = 4
"""Severity of a warning; what is worse has a lower one."""
_RATES_HZ = {0: 10.0, 193: 5.0, 32: 20.0, 30: 20.0, 83: 20.0}
"""How often messages are asked for, Hz: HEARTBEAT, EKF_STATUS_REPORT, LOCAL_POSITION_NED, ATTITUDE,
ATTITUDE_TARGET."""


def mavlink() -> ModuleType:
    """Return pymavlink's messages of ArduPilot. Raises InputError if it is not installed."""
    try:
        from pymavlink.dialects.v20 import ardupilotmega
    except ImportError:
        raise InputError(
            "flights by a script need pymavlink; install it with: pip install 'helisim[sitl]'"
        ) from None
    return ardupilotmega


class Telemetry:
    """Both ways of MAVLink over a UDP socket that the autopilot sends to.

    Attributes:
        mode: number of the flight mode; None as long as none is known.
        armed: whether it is armed.
        aligned: flags of its EKF.
        position: (north, east, down) of its EKF, m from where it was switched on.
        velocity: likewise, m/s.
        attitude: (roll, pitch, heading), rad.
        thrust: that it commands, 0 to 1.
        parameters: name -> value, as it last said.
        acknowledged: command -> its last result, 0 being accepted.
        said: all of its texts so far.
        warned: those of them that warn.
    """

    def __init__(self, channel: socket.socket) -> None:
        """Listen on a socket that doesn't block."""
        self._socket = channel
        self._peer: tuple[str, int] | None = None
        self.messages = mavlink()
        system, component = _GROUND
        self.send = self.messages.MAVLink(self, srcSystem=system, srcComponent=component)
        self.send.robust_parsing = True
        self.mode: int | None = None
        self.armed, self.aligned, self.thrust = False, 0, math.nan
        self.position = self.velocity = self.attitude = (math.nan,) * 3
        self.parameters: dict[str, float] = {}
        self.acknowledged: dict[int, int] = {}
        self.said: list[str] = []
        self.warned: list[str] = []

    def write(self, data: bytes) -> None:
        """Send bytes to the autopilot, once it was heard."""
        if self._peer is not None:
            with suppress(OSError):  # it has ended: what waits for its answer says so
                self._socket.sendto(data, self._peer)

    def ask_for_messages(self) -> None:
        """Ask the autopilot for what is read here, often enough."""
        for number, rate in _RATES_HZ.items():
            self.command("MAV_CMD_SET_MESSAGE_INTERVAL", number, 1e6 / rate)

    def command(self, name: str, *numbers: float) -> int:
        """Send a command with up to seven numbers and return its own number."""
        number = int(getattr(self.messages, name))
        self.acknowledged.pop(number, None)
        seven = [*numbers, *([0.0] * (7 - len(numbers)))]
        self.send.command_long_send(*_VEHICLE, number, 0, *seven)
        return number

    def ask_mode(self, number: int) -> None:
        """Ask for a flight mode."""
        self.send.set_mode_send(_VEHICLE[0], 1, number)

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter; `parameters` has it once the autopilot has confirmed it."""
        self.parameters.pop(name, None)
        self.send.param_set_send(*_VEHICLE, name.encode(), value, 9)

    def ask_parameter(self, name: str) -> None:
        """Ask for a parameter's value."""
        self.parameters.pop(name, None)
        self.send.param_request_read_send(*_VEHICLE, name.encode(), -1)

    def move_sticks(self, pulses: list[int]) -> None:
        """Send where the sticks stand, us each of eight channels."""
        self.send.rc_channels_override_send(*_VEHICLE, *pulses)

    def go_to(self, north: float, east: float, down: float, heading: float) -> None:
        """Ask for a position in the mode GUIDED, m and rad."""
        ignored = 0b1001_1111_1000  # all but position and heading
        self.send.set_position_target_local_ned_send(
            *(0, *_VEHICLE, 1, ignored, north, east, down, 0, 0, 0, 0, 0, 0, heading, 0)
        )

    def beat(self) -> None:
        """Say that a ground station is there."""
        self.send.heartbeat_send(6, 8, 0, 0, 0)

    def hear(self) -> None:
        """Take in whatever has come."""
        while True:
            try:
                data, self._peer = self._socket.recvfrom(65536)
            except (BlockingIOError, ConnectionRefusedError):
                return
            for message in self.send.parse_buffer(data) or ():
                if message.get_srcComponent() == 1:
                    self._take(message)

    def _take(self, message: Any) -> None:
        match message.get_type():
            case "HEARTBEAT":
                self.mode, self.armed = message.custom_mode, bool(message.base_mode & _ARMED)
            case "EKF_STATUS_REPORT":
                self.aligned = message.flags
            case "LOCAL_POSITION_NED":
                self.position = (message.x, message.y, message.z)
                self.velocity = (message.vx, message.vy, message.vz)
            case "ATTITUDE":
                self.attitude = (message.roll, message.pitch, message.yaw)
            case "ATTITUDE_TARGET":
                self.thrust = message.thrust
            case "PARAM_VALUE":
                self.parameters[message.param_id] = message.param_value
            case "COMMAND_ACK":
                self.acknowledged[message.command] = message.result
            case "STATUSTEXT":
                self.said.append(message.text)
                if message.severity <= _WARNING:
                    self.warned.append(message.text)


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
