"""ArduPilot's JSON backend over UDP: frames of pulses come, an aircraft's readings go back.

Source: ArduPilot, libraries/SITL/examples/JSON/readme.md.
"""

import json
import logging
import math
import select
import socket
import struct
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.physics.native import installed

# Magic number -> layout: magic number, frame rate, frame count, pulses.
_LAYOUTS = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}
_HAIR = 1.0 + 1e-6  # Factor on time: ArduPilot cuts each difference of two times to whole us
_MODEL, _OUT = (f"--{name}" for name in ("model", "sim-port-out"))  # Options of ArduPilot's program
PORT = 9002  # Port that model JSON sends to; instance I is 10 I higher
SILENT = 1.0  # s without a frame after which another autopilot may take over
_LOOK = 0.1  # s between two calls while no frame comes
_AT_ONCE = 0.5  # s, within which any lower count is a late packet; a new start counts from 0
_COUNTS = 1 << 32  # Frame counts begin again at 0 from here

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Frame:
    """A frame of the autopilot: pulses of its 16 or 32 outputs, us, 0 where an output is off."""

    rate_hz: int
    count: int
    pulses: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Sensed:
    """Readings of the sensors in SI, north-east-down and forward-right-down; each is (3,).

    `force` is specific, at the IMU: 0, 0, -g on the ground. Position and velocity are the IMU's;
    `quaternion`, (4,), is from body to earth, scalar first.
    """

    time: float
    gyro: NDArray[np.float64]
    force: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    quaternion: NDArray[np.float64]


def read_frame(packet: bytes) -> Frame | None:
    """Return a packet's frame; None if it is cut. Raises InputError for another protocol."""
    if len(packet) < 2:
        return None
    magic = int.from_bytes(packet[:2], "little")
    layout = _LAYOUTS.get(magic)
    if layout is None:
        raise InputError(
            f"a packet of {len(packet)} bytes with the magic number {magic}; expected 18458 or "
            f"29569: start ArduPilot with {_MODEL} JSON, and MAVLink has a port of its own"
        )
    if len(packet) != layout.size:
        return None
    _, rate_hz, count, *pulses = layout.unpack(packet)
    return Frame(rate_hz, count, tuple(pulses))


def answer(sensed: Sensed) -> bytes:
    """Return the readings as a line of JSON without spaces, as ArduPilot's parser needs."""
    told = {
        "timestamp": sensed.time * _HAIR,
        "imu": {"gyro": sensed.gyro.tolist(), "accel_body": sensed.force.tolist()},
        "position": sensed.position.tolist(),
        "velocity": sensed.velocity.tolist(),
        "quaternion": sensed.quaternion.tolist(),
    }
    return f"\n{json.dumps(told, separators=(',', ':'))}\n".encode()


@dataclass
class Served:
    """Counts of frames so far, of which `seconds` were flown in `clock` s.

    `repeated` frames came again, `dropped` ones never; `ignored` packets were late, cut or of
    others.
    """

    frames: int = 0
    seconds: float = 0.0
    clock: float = 0.0
    starts: int = 0
    repeated: int = 0
    dropped: int = 0
    ignored: int = 0

    def __str__(self) -> str:
        factor = self.seconds / self.clock if self.clock > 0.0 else 0.0
        return (
            f"{self.seconds:.1f} s in {self.clock:.3g} s, {factor:.2f} times real time, "
            f"{self.frames} frames; {self.starts} starts of the autopilot, {self.repeated} came "
            f"again, {self.dropped} never came, {self.ignored} packets were of no use"
        )


class Link:
    """A bound UDP port that hears one autopilot, its `peer`, at a time; a context manager.

    `served` counts what `serve` has flown so far; `stranger` tells of a packet of another protocol
    that came before any autopilot's.
    """

    def __init__(
        self, port: int = PORT, *, address: str = "127.0.0.1", timeout: float = 60.0
    ) -> None:
        """Bind a port, 0 for any free one; `timeout` is in s. Raises InputError if it is taken."""
        if not 0 <= port <= 65535:
            raise InputError(f"a UDP port is 1 to 65535, got {port}")
        if not timeout > 0.0:
            raise InputError(f"the wait for a frame must be above 0 s, got {timeout:g}")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((address, port))
        except OSError as error:
            self._socket.close()
            raise InputError(
                f"UDP port {port} of {address} can't be bound: {error.strerror or error}; another "
                f"backend may run: end it, or take another port and give it to ArduPilot as {_OUT}"
            ) from None
        self.address, self.port = self._socket.getsockname()
        self.timeout, self.served = timeout, Served()
        self.peer: tuple[str, int] | None = None
        self.stranger = ""
        self._heard = -math.inf

    def __enter__(self) -> "Link":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def receive(
        self, timeout: float | None = None, *, on_wait: "OnWait" = lambda: None
    ) -> Frame | None:
        """Return the next frame; None if none came in `timeout` s, or `on_wait` said True."""
        end = time.monotonic() + (self.timeout if timeout is None else timeout)
        left = 0.0
        while left >= 0.0:
            left = end - time.monotonic()
            if select.select([self._socket], [], [], min(max(left, 0.0), _LOOK))[0]:
                frame = self._taken(*self._socket.recvfrom(1024))
                if frame is not None:
                    return frame
                self.served.ignored += 1
            elif on_wait():
                return None
        return None

    def answer(self, line: bytes) -> None:
        """Send an answer to the last frame's sender."""
        if self.peer is not None:
            with suppress(OSError):  # it has gone, and will ask again
                self._socket.sendto(line, self.peer)

    def _taken(self, packet: bytes, peer: tuple[str, int]) -> Frame | None:
        now = time.monotonic()
        if self.peer not in (None, peer) and now - self._heard < SILENT:
            return None
        try:
            frame = read_frame(packet)
        except InputError as error:
            if self.peer is None and not self.stranger:
                self.stranger = str(error)
                _log.warning("ignored, while no autopilot is there: %s", error)
            return None
        if frame is not None:
            self.peer, self._heard = peer, now
        return frame


# Called with each frame and what is sensed after it; True ends the flight.
OnFrame = Callable[[Frame, Sensed], bool | None]

OnWait = Callable[[], bool | None]  # Called while no frame comes; True ends the flight


class Flown(Protocol):
    """The lock step's protocol of an aircraft."""

    def step(self, pulses: Sequence[int]) -> Sensed:
        """Fly on by one frame and return what is sensed."""
        ...

    def reset(self) -> None:
        """Stand on the ground at time 0."""
        ...


@installed()  # once: each block that is opened examines the model anew
def serve(
    aircraft: Flown,
    link: Link,
    *,
    on_frame: OnFrame = lambda frame, sensed: None,
    on_wait: OnWait = lambda: None,
    on_restart: Callable[[], object] = lambda: None,
) -> Served:
    """Fly an aircraft by the frames that come, until none comes in the link's timeout.

    `on_frame` is called before each answer, `on_wait` ten times a second while no frame comes;
    either ends the flight by True. `on_restart` is called before the aircraft is reset for a new
    start. Raises InputError if no autopilot sends a frame in time.
    """
    told, begun = link.served, time.monotonic()
    frame, last, line, before = link.receive(on_wait=on_wait), None, b"", 0.0
    flown = link.peer
    began = came = time.monotonic()
    if frame is not None:
        heard = (*(link.peer or ()), len(frame.pulses), frame.rate_hz)
        _log.info("ArduPilot at %s:%d: %d channels, %d Hz wanted", *heard)
        told.starts = 1
    elif began - begun >= link.timeout:
        out = "" if link.port == PORT else f" {_OUT} {link.port}"
        raise InputError(
            f"no autopilot sent a frame to UDP port {link.port} in {link.timeout:g} s; start "
            f"ArduPilot with: arducopter-heli {_MODEL} JSON:{link.address}{out}, and a ground "
            "station on its TCP port 5760, for which it waits"
            + f"; what came was {link.stranger}"
            * bool(link.stranger)
        )
    while frame is not None:
        ahead = 1 if last is None else _ahead(frame, last)
        late = (frame.count and link.peer == flown) or time.monotonic() - came < _AT_ONCE
        if ahead < 0 and late:
            told.ignored += 1
            frame = link.receive(on_wait=on_wait)
            continue
        if ahead < 0:
            _log.info("the autopilot starts anew: back on the ground, at time 0")
            before = told.seconds
            told.starts += 1
            on_restart()
            aircraft.reset()
        if ahead == 0:
            told.repeated += 1
        else:
            sensed = aircraft.step(frame.pulses)
            line, last, came, flown = answer(sensed), frame, time.monotonic(), link.peer
            told.frames += 1
            told.dropped += max(ahead - 1, 0)
            told.seconds, told.clock = before + sensed.time, came - began
            if on_frame(frame, sensed):
                break
        frame = _newer(link, frame)
        if frame is None:
            link.answer(line)
            frame = link.receive(on_wait=on_wait)
    return told


def _newer(link: Link, frame: Frame) -> Frame | None:
    """Return a frame that came before the last one's answer, which is then one too many."""
    while (newer := link.receive(0.0)) is not None:
        ahead = _ahead(newer, frame)
        if ahead > 0:
            return newer
        link.served.repeated += ahead == 0
    return None


def _ahead(frame: Frame, last: Frame) -> int:
    ahead = (frame.count - last.count) % _COUNTS
    return ahead - _COUNTS if ahead >= _COUNTS // 2 else ahead
