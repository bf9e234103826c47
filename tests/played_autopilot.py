"""Play ArduPilot's end of its JSON interface.

It does what the published protocol says (ArduPilot, libraries/SITL/examples/JSON/readme.md), with
the ways of its parser: what it looks for is found as text, wherever it stands; a value begins two
characters behind its name, so that `"gyro": [` can't be read; only what stands between the last two
line breaks is read; and it counts a frame for each answer that it can read.
"""

import re
import select
import socket
import struct
import time

import numpy as np

_NUMBER = rb"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_READ = {
    "number": re.compile(rb"\s*" + _NUMBER),
    "vector": re.compile(rb"\[\s*" + rb",\s*".join([_NUMBER] * 3)),
    "quaternion": re.compile(rb"\[\s*" + rb",\s*".join([_NUMBER] * 4)),
}
FIELDS = (
    ("", "timestamp", "number", True),
    ("imu", "gyro", "vector", True),
    ("imu", "accel_body", "vector", True),
    ("", "position", "vector", True),
    ("", "quaternion", "quaternion", False),
    ("", "velocity", "vector", True),
)
"""Section, name, what it is, and whether an answer without it is of no use."""


class PlayedAutopilot:
    """Sends frames and reads answers as ArduPilot does."""

    def __init__(self, port, *, channels=16, resend=1.0):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to, self._resend = ("127.0.0.1", port), resend
        self._magic = {16: 18458, 32: 29569}[channels]
        self._channels, self._buffer = channels, b""
        self._time = 0.0
        self.count = self.resent = self.unread = self.resets = 0

    def close(self):
        self._socket.close()

    def packet(self, pulses):
        all_pulses = [*pulses, *[1500] * (self._channels - len(pulses))]
        return struct.pack(f"<HHI{self._channels}H", self._magic, 1200, self.count, *all_pulses)

    def send(self, pulses=()):
        self._socket.sendto(self.packet(pulses), self._to)

    def receive(self, patience=10.0):
        if not select.select([self._socket], [], [], patience)[0]:
            raise TimeoutError(f"no answer to frame {self.count}")
        return self._socket.recv(65000)

    def frame(self, pulses=(), *, patience=20.0):
        self.send(pulses)
        end = time.monotonic() + patience
        while not select.select([self._socket], [], [], self._resend)[0]:
            if time.monotonic() > end:
                raise TimeoutError(f"the lock step stopped at frame {self.count}")
            self.resent += 1
            self.send(pulses)
        return self._taken(self.receive())

    def _taken(self, received):
        self._buffer += received.replace(b"\n", b"\0")
        last = self._buffer.rfind(b"\0")
        first = self._buffer.rfind(b"\0", 0, max(last, 0))
        fields = read(self._buffer, first + 1) if last > 0 and first >= 0 else None
        if fields is None:
            self.unread += 1
            return None
        self._buffer = self._buffer[last:]
        self.resets += fields["timestamp"] < self._time
        self._time = fields["timestamp"]
        self.count += 1
        return fields


def read(buffer, start):
    """Return the fields of a row that begins at an index of a buffer; None if one lacks.

    As C reads strings: each search ends at the next zero byte, also one that begins behind one.
    """

    def found(text, at):
        end = buffer.find(b"\0", at)
        return buffer.find(text.encode(), at, len(buffer) if end < 0 else end)

    fields = {}
    for section, name, kind, required in FIELDS:
        at = found(section, start) if section else start
        at = found(name, at + len(section) + 1) if at >= 0 else -1
        value = _READ[kind].match(buffer, at + len(name) + 2) if at >= 0 else None
        if value is not None:
            numbers = [float(one) for one in value.groups()]
            fields[name] = numbers[0] if kind == "number" else np.array(numbers)
        elif required:
            return None
    return fields
