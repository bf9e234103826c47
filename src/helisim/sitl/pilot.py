"""A script's pilot: speaks MAVLink to the autopilot, moves the sticks, and waits by simulated time.

A script is a generator, of which each `yield` lets 0.01 s of simulated time go by.
"""

import math
import socket
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from helisim.base.errors import AutopilotError, InputError, check_known
from helisim.base.units import STANDARD_GRAVITY
from helisim.sitl.aircraft import Aircraft
from helisim.sitl.link import Sensed

# A script, and each manoeuvre of a pilot: `yield from pilot.land()`.
Steps = Generator[None, None, None]
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
}  # Flight mode -> ArduCopter's number
_BOOTS = 5.0  # s after its first heartbeat until the autopilot listens
# Of the rotor's nominal speed: it creeps below the first, gusts turn it up to the other.
_STILL, _WINDMILLS = 0.02, 0.3
_WITHIN = 0.3  # m, of a place that is reached
_ALIGNED = 0b10_0001_1111  # Flags of the EKF: attitude, velocity, position, also in flight
_VEHICLE = (1, 1)
_GROUND = (255, 190)  # System and component of a ground station, which alone may move the sticks
_ARMED, _WARNING = 128, 4  # Bit of a heartbeat; severity of a warning, worse ones are lower
# Hz: HEARTBEAT, EKF_STATUS_REPORT, LOCAL_POSITION_NED, ATTITUDE, ATTITUDE_TARGET.
_RATES_HZ = {0: 10.0, 193: 5.0, 32: 20.0, 30: 20.0, 83: 20.0}


def mavlink() -> ModuleType:
    """Return pymavlink's messages of ArduPilot. Raises InputError if it is not installed."""
    try:
        from pymavlink.dialects.v20 import ardupilotmega
    except ImportError:
        raise InputError(
            "flights by a script need pymavlink; install it in helisim's checkout with: "
            "pip install -e '.[sitl]'"
        ) from None
    return ardupilotmega


class Telemetry:
    """Both ways of MAVLink over a UDP socket; `last` is the last message of each type.

    `parameters` are values by name, `acknowledged` command -> its last result, 0 being accepted,
    `said` the autopilot's texts; `say` is called with each warning.
    """

    def __init__(
        self, channel: socket.socket, say: Callable[[str], object] = lambda text: None
    ) -> None:
        self._socket, self._say = channel, say
        self._peer: tuple[str, int] | None = None
        self.messages = mavlink()
        system, component = _GROUND
        self.send = self.messages.MAVLink(self, srcSystem=system, srcComponent=component)
        self.send.robust_parsing = True
        self.last: dict[str, Any] = {}
        self.parameters: dict[str, float] = {}
        self.acknowledged: dict[int, int] = {}
        self.said: list[str] = []

    @property
    def mode(self) -> int | None:
        """The flight mode's number, None before the first heartbeat."""
        return getattr(self.last.get("HEARTBEAT"), "custom_mode", None)

    @property
    def armed(self) -> bool:
        """Whether the rotor may turn."""
        return bool(getattr(self.last.get("HEARTBEAT"), "base_mode", 0) & _ARMED)

    def numbers(self, message: str, *fields: str) -> list[float]:
        """Return numbers of the last message of a type, as of "ATTITUDE"; nan if none came."""
        return [getattr(self.last.get(message), name, math.nan) for name in fields]

    def write(self, data: bytes) -> None:
        """Send bytes to the autopilot, once it was heard."""
        if self._peer is not None:
            with suppress(OSError):  # the autopilot has ended
                self._socket.sendto(data, self._peer)

    def ask_for_messages(self) -> None:
        """Ask the autopilot for the messages that are read here."""
        for number, rate in _RATES_HZ.items():
            self.command("MAV_CMD_SET_MESSAGE_INTERVAL", number, 1e6 / rate)

    def command(self, name: str, *numbers: float) -> int:
        """Send a command with up to seven numbers, and return its number."""
        number = int(getattr(self.messages, name))
        self.acknowledged.pop(number, None)
        self.send.command_long_send(*_VEHICLE, number, 0, *numbers, *([0.0] * (7 - len(numbers))))
        return number

    def speak(self, pulses: list[int]) -> None:
        """Send the sticks, us of eight channels, as a ground station does."""
        self.send.rc_channels_override_send(*_VEHICLE, *pulses)
        self.send.heartbeat_send(6, 8, 0, 0, 0)

    def hear(self) -> None:
        """Read all messages that have come."""
        while True:
            try:
                data, self._peer = self._socket.recvfrom(65536)
            except (BlockingIOError, ConnectionRefusedError):
                return
            for message in self.send.parse_buffer(data) or ():
                if message.get_srcComponent() == 1:
                    self._take(message)

    def _take(self, message: Any) -> None:
        kind = message.get_type()
        self.last[kind] = message
        if kind == "PARAM_VALUE":
            self.parameters[message.param_id] = message.param_value
        elif kind == "COMMAND_ACK":
            self.acknowledged[message.command] = message.result
        elif kind == "STATUSTEXT":
            self.said.append(message.text)
            if message.severity <= _WARNING:
                self._say(f"ArduPilot: {message.text}")


@dataclass
class Sticks:
    """Positions of the sticks; `rotor` is channel 8.

    Roll, pitch, yaw are -1 to 1, positive to the right and up (pulled), throttle 0 to 1.
    """

    roll: float = 0.0
    pitch: float = 0.0
    throttle: float = 0.0
    yaw: float = 0.0
    rotor: bool = False

    @property
    def pulses(self) -> list[int]:
        """Channels 1 to 8, us, in ArduPilot's usual order."""
        angles = [round(1500.0 + 500.0 * one) for one in (self.roll, self.pitch, self.yaw)]
        throttle = round(1000.0 + 1000.0 * self.throttle)
        return [*angles[:2], throttle, angles[2], 1000, 1000, 1000, 2000 if self.rotor else 1000]


class Pilot:
    """A script's pilot; set the attributes of `sticks`.

    `ground` is (north, east, down) of the start, m; `sensed` are the readings of the sensors.
    """

    def __init__(
        self, aircraft: Aircraft, telemetry: Telemetry, say: Callable[[str], None]
    ) -> None:
        self.aircraft, self.telemetry, self.sticks, self.say = aircraft, telemetry, Sticks(), say
        self.sensed: Sensed = aircraft.sensed
        self.ground = aircraft.sensed.position.copy()

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.sensed.time

    @property
    def height(self) -> float:
        """Above the start, m."""
        return float(self.ground[2] - self.sensed.position[2])

    @property
    def speed(self) -> float:
        """Over the ground and upwards together, m/s."""
        return math.hypot(*self.sensed.velocity)

    @property
    def shown(self) -> dict[str, str]:
        """What a window shows: the flight mode, and the sticks as `Sticks` has them."""
        modes, mode = {number: name for name, number in MODES.items()}, self.telemetry.mode
        sticks = {name: f"{value:+.2f}" for name, value in vars(self.sticks).items()}
        sticks["rotor"] = "on" if self.sticks.rotor else "off"
        return {"mode": modes.get(mode, f"number {mode}") if mode is not None else "", **sticks}

    def wait(self, seconds: float) -> Steps:
        """Let simulated time go by."""
        end = self.time + seconds - 1e-9
        while self.time < end:
            yield

    def until(self, condition: Callable[[], bool], what: str, within: float) -> Steps:
        """Wait for a condition, at most `within` s of simulated time. Raises AutopilotError."""
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
        """Change the flight mode. Raises UnknownNameError, AutopilotError if it is refused."""
        check_known("flight mode", [name], MODES)
        self.telemetry.send.set_mode_send(_VEHICLE[0], 1, MODES[name])
        yield from self.until(
            lambda: self.telemetry.mode == MODES[name], f"flight mode {name}", 3.0
        )

    def command(self, name: str, *numbers: float) -> Steps:
        """Give a command of MAVLink, such as MAV_CMD_NAV_TAKEOFF. Raises AutopilotError."""
        number, results = self.telemetry.command(name, *numbers), self.telemetry.acknowledged
        yield from self.until(lambda: number in results, f"an answer to {name}", 3.0)
        if results[number] != 0:
            said = "; ".join(self.telemetry.said[-3:]) or "nothing"
            raise AutopilotError(f"{name} is refused with result {results[number]}: {said}")

    def set(self, **parameters: float) -> Steps:
        """Set parameters. Raises AutopilotError if one doesn't exist."""
        known = self.telemetry.parameters
        for name, value in parameters.items():
            known.pop(name, None)
            self.telemetry.send.param_set_send(*_VEHICLE, name.encode(), value, 9)
            yield from self.until(lambda name=name: name in known, f"parameter {name} is set", 3.0)

    def read(self, name: str) -> Generator[None, None, float]:
        """Return a parameter's value: `value = yield from pilot.read("H_RSC_RUNUP_TIME")`."""
        known = self.telemetry.parameters
        known.pop(name, None)
        self.telemetry.send.param_request_read_send(*_VEHICLE, name.encode(), -1)
        yield from self.until(lambda: name in known, f"the value of parameter {name}", 3.0)
        return known[name]

    def start(self) -> Steps:
        """Wait for the autopilot's position, arm on the ground and spin the rotor up."""
        self.say("waiting for the EKF")
        own = self.telemetry
        yield from self.until(lambda: own.mode is not None, "a heartbeat of the autopilot", 30.0)
        yield from self.wait(_BOOTS)
        own.ask_for_messages()

        def aligned() -> bool:
            return getattr(own.last.get("EKF_STATUS_REPORT"), "flags", 0) & _ALIGNED == _ALIGNED

        yield from self.until(aligned, "the EKF knows its position", 120.0)
        yield from self.wait(5.0)
        self.say("arming")
        yield from self.set(LOG_DISARMED=1)
        yield from self.wait(3.0)  # the time of its log's start
        yield from self.mode("stabilize")
        yield from self.command("MAV_CMD_COMPONENT_ARM_DISARM", 1)
        yield from self.until(lambda: own.armed, "armed", 5.0)
        self.say("rotor on")
        takes = yield from self.read("H_RSC_RUNUP_TIME")
        self.sticks.rotor = True
        yield from self.wait(takes + 2.0)
        yield from self.until(lambda: self.aircraft.rotor_speed > 0.9, "the rotor turns", 60.0)

    def take_off(self, height: float) -> Steps:
        """Start if that isn't done, and climb to a height above the ground, m."""
        if not self.telemetry.armed:
            yield from self.start()
        self.say(f"taking off to {height:g} m")
        self.sticks.throttle = 0.5
        yield from self.mode("guided")
        yield from self.command("MAV_CMD_NAV_TAKEOFF", *[0.0] * 6, height)

        yield from self.until(
            lambda: abs(self.height - height) < 0.3 and self.speed < 0.3,
            f"{height:g} m above the ground",
            20.0 + 2.0 * height,
        )

    def go_to(self, north: float, east: float, height: float) -> Steps:
        """Fly to a place, m from the start, nose north, and stay there."""
        yield from self.mode("guided")
        place = self.ground + np.array((north, east, -height))

        def far() -> float:
            return math.dist(self.sensed.position, place)

        ignored = 0b1001_1111_1000  # all but position and heading
        self.telemetry.send.set_position_target_local_ned_send(
            *(0, *_VEHICLE, 1, ignored, place[0], place[1], -height, *[0.0] * 8)
        )
        yield from self.until(
            lambda: far() < _WITHIN and self.speed < 0.3,
            f"{north:g} m north, {east:g} m east, {height:g} m high",
            30.0 + 2.0 * far(),
        )

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


# _LEARNS: s over which the steady flight is averaged
# _SOFT: rad/s of holding a place, far below what is swept
_LEARNS, _SOFT = 5.0, 0.1
_LEAN, _CLIMB = math.radians(3.0), 0.05  # Most of lean, rad, and thrust for holding a place
_HEAVE = 0.03  # Thrust over a velocity down, s/m


class Hold:
    """A pilot's slow hold of a place in a mode without position; call `learn` first."""

    def __init__(self, pilot: Pilot) -> None:
        self._pilot = pilot

    def learn(self) -> Steps:
        """Average the steady flight, for the sticks' rest."""
        pilot = self._pilot
        try:
            most = 0.01 * (yield from pilot.read("ANGLE_MAX"))
        except AutopilotError:  # name and unit since version 4.7
            most = yield from pilot.read("ATC_ANGLE_MAX")
        trim = yield from pilot.read("ATC_HOVR_ROL_TRM")
        self._most, self._curve, seen = math.radians(most), list[float](), []
        for k in range(1, 5):
            self._curve.append(0.01 * (yield from pilot.read(f"IM_STB_COL_{k}")))
        end = pilot.time + _LEARNS
        while pilot.time < end:
            thrust = pilot.telemetry.numbers("ATTITUDE_TARGET", "thrust")
            seen.append(pilot.telemetry.numbers("ATTITUDE", "roll", "pitch") + thrust)
            yield
        roll, self._pitch, self._thrust = np.mean(seen, axis=0).tolist()
        self._roll = roll - math.radians(0.01 * trim)  # added by the autopilot
        self._place = pilot.sensed.position.copy()

    def fly(self, seconds: float) -> Steps:
        """Hold the place for some time, a step at least."""
        pilot = self._pilot
        end = pilot.time + seconds
        while True:
            away, velocity = pilot.sensed.position - self._place, pilot.sensed.velocity
            north, east, _ = -2.0 * _SOFT * velocity - _SOFT**2 * away
            (heading,) = pilot.telemetry.numbers("ATTITUDE", "yaw")
            cosine, sine = math.cos(heading), math.sin(heading)
            lean = np.array((cosine * north + sine * east, cosine * east - sine * north))
            ahead, right = np.clip(lean / STANDARD_GRAVITY, -_LEAN, _LEAN).tolist()
            pilot.sticks.roll = (self._roll + right) / self._most
            pilot.sticks.pitch = (self._pitch - ahead) / self._most
            climb = np.clip(_HEAVE * (velocity[2] + _SOFT * away[2]), -_CLIMB, _CLIMB)
            thrust = self._thrust + float(climb)
            pilot.sticks.throttle = float(np.interp(thrust, self._curve, (0.0, 0.4, 0.6, 1.0)))
            yield
            if pilot.time >= end:
                return
