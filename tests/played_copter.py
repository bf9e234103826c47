"""Play ArduCopter-heli's end of MAVLink, spoken by pymavlink, and a point that flies as it is told.

Numbers of modes and commands are MAVLink's (common.xml). The point goes where guided flight is
sent, exponentially, leans by the sticks in stabilised modes; its rotor follows channel 8.
"""

import math
import socket

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from helisim.sim.weather import Weather
from helisim.sitl.link import Sensed

STEP = 0.01
STABILIZE, GUIDED, LAND, BRAKE, SYSTEMID = 0, 4, 9, 17, 25
"""Numbers of ArduCopter's modes; BRAKE keeps its place."""


def bound():
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind(("127.0.0.1", 0))
    one.setblocking(False)
    return one


class PlayedCopter:
    """Autopilot and aircraft at once: `channel` is the telemetry's socket, `log` what was done.

    `refused` are results of commands by number. Its first heartbeat comes after 1 s, the EKF is
    aligned after 9 s.
    """

    crashed, heading, attitude, thrust, lean = "", 0.0, (0.0, 0.0), 0.5, 0.1
    frames, mode, armed, rotor_speed, target = 0, BRAKE, False, 0.0, None

    def __init__(self, *, heading=0.0, weather=None):
        self.channel, self._own = bound(), bound()
        self._mav = mavlink.MAVLink(self, srcSystem=1, srcComponent=1)
        self.heading, self.weather = heading, weather or Weather()
        self.parameters = {"H_RSC_RUNUP_TIME": 7.0, "LOG_DISARMED": 0.0}
        self.log, self.refused, self.rates, self.pulses = [], {}, {}, []
        self.place, self.velocity = np.zeros(3), np.zeros(3)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.channel.close()
        self._own.close()

    time = property(lambda self: self.frames * STEP)
    stands = property(lambda self: self.place[2] >= 0.0)

    @property
    def sensed(self):
        turn, still = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
        return Sensed(self.time, still, still, self.place.copy(), self.velocity.copy(), turn)

    def write(self, data):
        self._own.sendto(data, self.channel.getsockname())

    def say(self, text, severity=6, component=1):
        self._mav.srcComponent = component
        self._mav.statustext_send(severity, text.encode())
        self._mav.srcComponent = 1

    def fly(self, steps, pilot):
        """Run a script's steps, each in 0.01 s, as a flight does."""
        for _ in steps:
            self._step()
            pilot.sensed = self.sensed
            pilot.telemetry.hear()
            if self.frames % 5 == 0:
                pilot.telemetry.speak(pilot.sticks.pulses)

    def _step(self):
        while True:
            try:
                data = self._own.recv(65536)
            except BlockingIOError:
                break
            for message in self._mav.parse_buffer(data) or ():
                getattr(self, "_" + message.get_type().lower())(message)
        self.frames += 1
        self._move()
        if self.frames % 10 == 0 and self.time >= 1.0:
            self._mav.heartbeat_send(4, 3, 1 | 128 * self.armed, self.mode, 4)
            flags = 0b10_0001_1111 if self.time >= 9.0 else 0b1_1111
            self._mav.ekf_status_report_send(flags, *[0.0] * 5)
            self._mav.attitude_send(0, *self.attitude, self.heading, 0.0, 0.0, 0.0)
            self._mav.attitude_target_send(0, 0, [1.0, 0, 0, 0], 0.0, 0.0, 0.0, self.thrust)

    def _move(self):
        on = self.armed and self.pulses[7:8] == [2000]
        self.rotor_speed += np.clip(on - self.rotor_speed, -0.1 * STEP, 0.2 * STEP)
        if self.mode == LAND:
            self.velocity = np.array([0.0, 0.0, not self.stands])
        elif self.mode == GUIDED and self.target is not None:
            self.velocity = 0.5 * (self.target - self.place)
        elif self.mode in (STABILIZE, SYSTEMID) and not self.stands:
            roll, pitch = ((one - 1500) / 500 * self.lean for one in self.pulses[:2])
            push = 9.80665j * math.tan(roll) - 9.80665 * math.tan(pitch)
            push *= STEP * np.exp(1j * self.heading)
            self.velocity[:2] += push.real, push.imag
        self.place += STEP * self.velocity

    def _did(self, *what):
        self.log.append((self.time, *what))

    def _heartbeat(self, message):
        self.station = message.get_srcSystem(), message.get_srcComponent()

    def _set_mode(self, message):
        if message.custom_mode not in self.refused:
            self.mode = message.custom_mode
            self._did("mode", self.mode)

    def _command_long(self, message):
        number, given = message.command, [getattr(message, f"param{k}") for k in range(1, 8)]
        result = self.refused.get(number, 0)
        if number == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.rates[int(given[0])] = 1e6 / given[1]
        elif result == 0:
            self._did("command", number, *given)
            if number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self.armed = bool(given[0])
            else:
                self.target = self.place - [0.0, 0.0, given[6]]
        self._mav.command_ack_send(number, result)

    def _param_set(self, message):
        if message.param_id not in self.refused:
            self.parameters[message.param_id] = message.param_value
            self._did("set", message.param_id, message.param_value)
            self._param_request_read(message)

    def _param_request_read(self, message):
        name = message.param_id
        if name in self.parameters:
            self._mav.param_value_send(name.encode(), self.parameters[name], 9, 1, 0)

    def _set_position_target_local_ned(self, message):
        self.target = np.array([message.x, message.y, message.z])
        turns = message.vx, message.vy, message.vz, message.yaw, message.yaw_rate
        self._did("target", *self.target, message.coordinate_frame, message.type_mask, *turns)

    def _rc_channels_override(self, message):
        self.pulses = [getattr(message, f"chan{k}_raw") for k in range(1, 9)]
