"""Play ArduPilot's end of its JSON interface over a bad way, and see what a backend makes of it.

python scripts/proof/played_autopilot.py [FRAMES]      100,000 frames over a bad way, by default

The played autopilot does what the published protocol says (ArduPilot, libraries/SITL/examples/
JSON/readme.md), with the ways of its parser: what it looks for is found as text, wherever it
stands; a value begins two characters behind its name, so that `"gyro": [` can't be read; only what
stands between the last two line breaks is read; and it counts a frame for each answer that it can
read. Of a hundred packets each way one is lost, doubled or cut. What is proved: every frame is
flown once, in order; no frame gets two different answers; the lock step never stops; and the
autopilot is never left one answer behind.
"""

import random
import re
import select
import socket
import struct
import sys
import threading
import time
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from helisim.sitl import Backend, Link, Sensed

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
    ("", "rng_1", "number", False),
    ("windvane", "direction", "number", False),
    ("windvane", "speed", "number", False),
    ("", "airspeed", "number", False),
    ("", "velocity_wind", "vector", False),
    ("", "no_time_sync", "number", False),
)
"""Section, name, what it is, and whether an answer without it is of no use."""


class PlayedAutopilot:
    """Sends frames and reads answers as ArduPilot does.

    Attributes:
        count: of frames, one for each answer that could be read.
        resent: how often no answer came in time.
        unread: how many answers could not be read.
        resets: how often time went back.
    """

    def __init__(self, port, *, channels=16, resend=1.0):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to, self._resend = ("127.0.0.1", port), resend
        self._magic = {16: 18458, 32: 29569}[channels]
        self._channels, self._buffer = channels, b""
        self._time = 0.0
        self.count = self.resent = self.unread = self.resets = 0

    def close(self):
        """Send and hear nothing more."""
        self._socket.close()

    def packet(self, pulses):
        """Return the packet of the present frame."""
        all_pulses = [*pulses, *[1500] * (self._channels - len(pulses))]
        return struct.pack(f"<HHI{self._channels}H", self._magic, 1200, self.count, *all_pulses)

    def send(self, pulses=()):
        """Send the present frame."""
        self._socket.sendto(self.packet(pulses), self._to)

    def receive(self, patience=10.0):
        """Return the bytes of an answer. Raises TimeoutError."""
        if not select.select([self._socket], [], [], patience)[0]:
            raise TimeoutError(f"no answer to frame {self.count}")
        return self._socket.recv(65000)

    def frame(self, pulses=(), *, patience=20.0):
        """Send a frame, wait for an answer, and return its fields; None if it can't be read."""
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


@dataclass
class BadWay:
    """A proxy on the loopback that loses, doubles and cuts packets both ways.

    Attributes:
        backend: UDP port behind it.
        share: of packets that something is done to.
        seed: of what is done to which.
        kinds: of what is done, equally often.
        did: what was done, counted.
    """

    backend: int
    share: float
    seed: int = 1
    kinds: tuple = ("lost", "doubled", "cut")
    did: Counter = field(default_factory=Counter)

    def __post_init__(self):
        self._front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._front.bind(("127.0.0.1", 0))
        self.port = self._front.getsockname()[1]
        self._random, self._stop = random.Random(self.seed), threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()
        self._front.close()
        self._back.close()

    def _run(self):
        client = None
        while not self._stop.is_set():
            for ready in select.select([self._front, self._back], [], [], 0.05)[0]:
                packet, peer = ready.recvfrom(65000)
                if ready is self._front:
                    client = peer
                    for one in self._passed(packet, "frame"):
                        self._back.sendto(one, ("127.0.0.1", self.backend))
                else:
                    for one in self._passed(packet, "answer"):
                        self._front.sendto(one, client)

    def _passed(self, packet, kind):
        if self._random.random() >= self.share:
            return [packet]
        what = self._random.choice(self.kinds)
        self.did[f"{kind} {what}"] += 1
        cut = packet[: self._random.randrange(len(packet))]
        return {"lost": [], "doubled": [packet, packet], "cut": [cut]}[what]


class Notes(Link):
    """A link that notes which answers each frame got.

    Attributes:
        answers: frame count -> the answers.
    """

    def __init__(self, **options):
        super().__init__(0, **options)
        self.answers, self._count = {}, None

    def waiting(self):
        """Return the next frame that is here, and note its count."""
        frame = super().waiting()
        self._count = self._count if frame is None else frame.count
        return frame

    def answer(self, line):
        """Send an answer, and note it."""
        self.answers.setdefault(self._count, set()).add(line)
        super().answer(line)


class Counting:
    """An aircraft that only counts: each frame is a millisecond."""

    crashed = ""

    def __init__(self):
        self.time = 0.0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def reset(self):
        """Begin at time 0."""
        self.time = 0.0

    def step(self, pulses):
        """Fly a frame, which takes a while; what is sensed tells its time and its first pulse."""
        time.sleep(1e-4)
        self.time += 1e-3
        still = np.zeros(3)
        force = np.array([1e-3 * pulses[0], 0.0, -9.81])
        return Sensed(self.time, still, force, still, still, np.array([1.0, 0.0, 0.0, 0.0]))


@dataclass
class Proof:
    """What a number of frames over a bad way came to.

    Attributes:
        served: what the backend says.
        did: what the way did to packets.
        flown: frame counts, as they were flown.
        most_answers: different answers that a frame got, at most.
        behind: (n,) by how many frames each answer that was read was older than the frame.
        resent: how often the autopilot waited in vain.
    """

    served: object
    did: Counter
    flown: list
    most_answers: int
    behind: np.ndarray
    resent: int

    @property
    def faults(self):
        """What is wrong, in words."""
        rising = all(a < b for a, b in zip(self.flown, self.flown[1:]))
        found = {
            "a frame was flown twice, or out of order": not rising,
            "a frame is in no count": self.flown[-1] + 1 != len(self.flown) + self.served.dropped,
            "a frame got different answers": self.most_answers != 1,
            "the autopilot was left behind": _longest(self.behind > 0) > _HEALED,
        }
        return [text for text, wrong in found.items() if wrong]

    def __str__(self):
        did = ", ".join(f"{number} {what}" for what, number in sorted(self.did.items()))
        return (
            f"the way: {did}\nthe backend: {self.served}\n"
            f"the autopilot: waited in vain {self.resent} times; one answer behind in "
            f"{np.mean(self.behind > 0):.2%} of its frames, {_longest(self.behind > 0)} in a row "
            f"at most, {self.behind.max()} answers at most\n"
            f"{'; '.join(self.faults) or 'every frame flown once, in order, one answer each'}"
        )


HAIR = 1.0 + 1e-6
"""By which a backend's time may be too fast, so that ArduPilot's cutting loses no microsecond."""
_HEALED = 20
"""Frames in a row within which an answer too many must be healed: a fiftieth of a second."""


def _longest(flags):
    """Return how many in a row are true at most."""
    longest = row = 0
    for flag in flags:
        row = row + 1 if flag else 0
        longest = max(longest, row)
    return longest


def prove(frames, *, resend=0.05, pulses=(), aircraft=None, **way):
    """Fly a number of frames over a `BadWay` and return the `Proof`."""
    flown, count_at, read_at, over = [], {}, [], []

    def on_frame(frame, sensed):
        flown.append(frame.count)
        count_at[round(1e3 * sensed.time)] = frame.count
        return bool(over)

    with Notes() as link, BadWay(link.port, **{"share": 0.01, **way}) as bad_way:
        backend = Backend(aircraft or Counting(), link, on_frame=on_frame)
        thread = threading.Thread(target=backend.run)
        thread.start()
        autopilot = PlayedAutopilot(bad_way.port, resend=resend)
        while autopilot.count < frames:
            count = autopilot.count
            fields = autopilot.frame(pulses)
            if fields is not None:
                read_at.append((count, round(1e3 * fields["timestamp"] / HAIR)))
        over.append(True)
        while thread.is_alive():
            autopilot.send(pulses)
            thread.join(0.05)
        autopilot.close()
    behind = np.array([count - count_at[at] for count, at in read_at])
    most = max(map(len, link.answers.values()))
    return Proof(backend.served, bad_way.did, flown, most, behind, autopilot.resent)


if __name__ == "__main__":
    done = prove(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
    print(done)
    sys.exit(bool(done.faults))
