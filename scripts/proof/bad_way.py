"""A way between an autopilot and its backend that loses, doubles and cuts packets."""

import random
import select
import socket
import threading
from collections import Counter
from dataclasses import dataclass, field


@dataclass
class BadWay:
    """A proxy on the loopback that loses, doubles and cuts packets both ways.

    Attributes:
        backend: UDP port behind it.
        share: of packets that something is done to.
        seed: of what is done to which.
        kinds: of what is done, equally often.
        front: bound UDP socket to which the autopilot sends; one of its own if None.
        did: what was done, counted.
    """

    backend: int
    share: float
    seed: int = 1
    kinds: tuple = ("lost", "doubled", "cut")
    front: socket.socket | None = None
    did: Counter = field(default_factory=Counter)

    def __post_init__(self):
        if self.front is None:
            self.front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self.front.bind(("127.0.0.1", 0))
        self._back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.port = self.front.getsockname()[1]
        self._random, self._stop = random.Random(self.seed), threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()
        self.front.close()
        self._back.close()

    def _run(self):
        client = None
        while not self._stop.is_set():
            for ready in select.select([self.front, self._back], [], [], 0.05)[0]:
                packet, peer = ready.recvfrom(65000)
                if ready is self.front:
                    client = peer
                    for one in self._passed(packet, "frame"):
                        self._back.sendto(one, ("127.0.0.1", self.backend))
                else:
                    for one in self._passed(packet, "answer"):
                        self.front.sendto(one, client)

    def _passed(self, packet, kind):
        if self._random.random() >= self.share:
            return [packet]
        what = self._random.choice(self.kinds)
        self.did[f"{kind} {what}"] += 1
        cut = packet[: self._random.randrange(len(packet))]
        return {"lost": [], "doubled": [packet, packet], "cut": [cut]}[what]
