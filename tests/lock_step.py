"""A bad way between autopilot and backend, and what a number of frames over it comes to.

Packets each way are lost, doubled or cut. Every frame must be flown once, in order; no frame gets
two different answers; the lock step never stops; and the autopilot is not left one answer behind.
"""

import random
import select
import socket
import threading
import time
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from helisim.sitl import Link, Sensed, serve
from played_autopilot import PlayedAutopilot


@contextmanager
def bad_way(backend, share=0.01, seed=1, kinds=("lost", "doubled", "cut")):
    """Lose, double and cut packets both ways of a proxy; yields its port, and what it did."""
    front, back = (socket.socket(type=socket.SOCK_DGRAM) for _ in range(2))
    front.bind(("127.0.0.1", 0))
    dice, stop, did = random.Random(seed), threading.Event(), Counter()

    def passed(packet, kind):
        if dice.random() >= share:
            return [packet]
        what = dice.choice(kinds)
        did[f"{kind} {what}"] += 1
        cut = packet[: dice.randrange(len(packet))]
        return {"lost": [], "doubled": [packet, packet], "cut": [cut]}[what]

    def run():
        client = None
        while not stop.is_set():
            for ready in select.select([front, back], [], [], 0.05)[0]:
                packet, peer = ready.recvfrom(65000)
                if ready is front:
                    client, to, out, kind = peer, ("127.0.0.1", backend), back, "frame"
                else:
                    to, out, kind = client, front, "answer"
                for one in passed(packet, kind):
                    out.sendto(one, to)

    with front, back:
        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield front.getsockname()[1], did
        finally:
            stop.set()
            thread.join()


class Notes(Link):
    """A link that notes which answers each frame got."""

    def __init__(self, **options):
        super().__init__(0, **options)
        self.answers, self._count = {}, None

    @property
    def most(self):
        return max(map(len, self.answers.values()))

    def receive(self, timeout=None, **more):
        frame = super().receive(timeout, **more)
        self._count = self._count if frame is None else frame.count
        return frame

    def answer(self, line):
        self.answers.setdefault(self._count, set()).add(line)
        super().answer(line)


class Counting:
    """An aircraft that only counts: each frame is a millisecond."""

    crashed, time = "", 0.0

    def reset(self):
        self.time = 0.0

    def step(self, pulses):
        time.sleep(1e-4)
        self.time += 1e-3
        still = np.zeros(3)
        force = np.array([1e-3 * pulses[0], 0.0, -9.81])
        return Sensed(self.time, still, force, still, still, np.array([1.0, 0.0, 0.0, 0.0]))


@dataclass
class Proof:
    """What a number of frames over a bad way came to."""

    served: object
    did: Counter
    flown: list
    most_answers: int
    behind: np.ndarray

    @property
    def faults(self):
        rising = all(a < b for a, b in zip(self.flown, self.flown[1:]))
        found = {
            "a frame was flown twice, or out of order": not rising,
            "a frame is in no count": self.flown[-1] + 1 != len(self.flown) + self.served.dropped,
            "a frame got different answers": self.most_answers != 1,
            "the autopilot was left behind": _longest(self.behind > 0) > _HEALED,
        }
        return [text for text, wrong in found.items() if wrong]


HAIR = 1.0 + 1e-6
"""By which a backend's time may be too fast, so that ArduPilot's cutting loses no microsecond."""
_HEALED = 20
"""Frames in a row within which an answer too many must be healed: a fiftieth of a second."""


def _longest(flags):
    return max((len(list(row)) for flag, row in groupby(flags) if flag), default=0)


def prove(frames, *, resend=0.05, pulses=(), aircraft=None, **way):
    flown, count_at, read_at, over = [], {}, [], []

    def on_frame(frame, sensed):
        flown.append(frame.count)
        count_at[round(1e3 * sensed.time)] = frame.count
        return bool(over)

    with Notes() as link, bad_way(link.port, **way) as (port, did):
        flight = {"aircraft": aircraft or Counting(), "link": link, "on_frame": on_frame}
        thread = threading.Thread(target=serve, kwargs=flight)
        thread.start()
        autopilot = PlayedAutopilot(port, resend=resend)
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
    return Proof(link.served, did, flown, link.most, behind)
