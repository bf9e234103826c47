"""What the autopilot says over MAVLink, and how it is spoken to."""

import math
import socket
from contextlib import suppress
from types import ModuleType
from typing import Any

from helisim.base.errors import InputError

_VEHICLE = (1, 1)
"""System and component of the autopilot."""
_GROUND = (255, 190)
"""Of a ground station, which alone may move the sticks."""
_ARMED = 128
_WARNING = 4
"""Severity of a warning; what is worse has a lower one."""
_RATES_HZ = {
    "HEARTBEAT": 10.0,
    "EKF_STATUS_REPORT": 5.0,
    "LOCAL_POSITION_NED": 20.0,
    "ATTITUDE": 20.0,
    "ATTITUDE_TARGET": 20.0,
}
"""Message -> how often it is asked for, Hz."""
_NUMBERS = {
    "HEARTBEAT": 0,
    "EKF_STATUS_REPORT": 193,
    "LOCAL_POSITION_NED": 32,
    "ATTITUDE": 30,
    "ATTITUDE_TARGET": 83,
}


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
        for name, rate in _RATES_HZ.items():
            self.command("MAV_CMD_SET_MESSAGE_INTERVAL", _NUMBERS[name], 1e6 / rate)

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
                taken = getattr(self, f"_{message.get_type().lower()}", None)
                if taken is not None and message.get_srcComponent() == 1:
                    taken(message)

    def _heartbeat(self, message: Any) -> None:
        self.mode, self.armed = message.custom_mode, bool(message.base_mode & _ARMED)

    def _ekf_status_report(self, message: Any) -> None:
        self.aligned = message.flags

    def _local_position_ned(self, message: Any) -> None:
        self.position = (message.x, message.y, message.z)
        self.velocity = (message.vx, message.vy, message.vz)

    def _attitude(self, message: Any) -> None:
        self.attitude = (message.roll, message.pitch, message.yaw)

    def _attitude_target(self, message: Any) -> None:
        self.thrust = message.thrust

    def _param_value(self, message: Any) -> None:
        self.parameters[message.param_id] = message.param_value

    def _command_ack(self, message: Any) -> None:
        self.acknowledged[message.command] = message.result

    def _statustext(self, message: Any) -> None:
        self.said.append(message.text)
        if message.severity <= _WARNING:
            self.warned.append(message.text)
