"""ArduPilot's JSON backend: frames of pulses come by UDP, an aircraft flies them, answers go back.

Source: ArduPilot, libraries/SITL/examples/JSON/readme.md.
"""

import logging
import math
import select
import socket
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError

_LAYOUTS = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}
"""Magic number -> layout of the packet: magic number, frame rate, frame count, pulses."""
_GAZEBO = struct.calcsize("<16f")
_HAIR = 1.0 + 1e-6
"""By which time is told too fast: ArduPilot cuts each difference of two times to whole us, and
loses one wherever rounding leaves it a hair below."""
_STILL = np.zeros(3)
_STILL.flags.writeable = False


@dataclass(frozen=True)
class Frame:
    """What the autopilot sends once a frame.

    Attributes:
        rate_hz: frames a second that it would like.
        count: of frames since it started.
        pulses: of its 16 or 32 outputs, us; 0 where an output is off.
    """

    rate_hz: int
    count: int
    pulses: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Sensed:
    """What the vehicle's sensors say, north-east-down and forward-right-down.

    Attributes:
        time: s, since the vehicle was placed.
        gyro: (3,) rates, rad/s.
        force: (3,) specific force at the IMU, m/s^2; on the ground 0, 0, -g.
        position: (3,) of the IMU, m.
        velocity: (3,) of the IMU over the ground, m/s.
        quaternion: (4,) from body to earth, scalar first.
        wind: (3,) of the air over the ground, m/s.
        clearance: from the IMU straight down to the ground, m; nan if not known.
    """

    time: float
    gyro: NDArray[np.float64]
    force: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    wind: NDArray[np.float64] = field(default_factory=lambda: _STILL)
    clearance: float = math.nan


def read_frame(packet: bytes) -> Frame | None:
    """Return the frame that a packet holds; None if the packet was cut on its way.

    Raises:
        InputError: the packet is of another protocol.
    """
    if len(packet) < 2:
        return None
    magic = int.from_bytes(packet[:2], "little")
    layout = _LAYOUTS.get(magic)
    if layout is None:
        raise InputError(
            f"a packet of {len(packet)} bytes with the magic number {magic}{_sender(packet)}; "
            f"expected 18458 or 29569: start ArduPilot with {_MODEL} JSON"
        )
    if len(packet) != layout.size:
        return None
    _, rate_hz, count, *pulses = layout.unpack(packet)
    return Frame(rate_hz, count, tuple(pulses))


def _sender(packet: bytes) -> str:
    """Return what a packet of another protocol may be."""
    if len(packet) == _GAZEBO:
        return ", as ArduPilot's model gazebo sends"
    if packet[0] in (0xFD, 0xFE):
        return ", which looks like MAVLink: that is for the autopilot's own port"
    return ""


def answer(sensed: Sensed, also: Sequence[str] = ()) -> bytes:
    """Return what was sensed as a line of JSON without spaces, which ArduPilot's parser needs.

    Args:
        sensed: after the frame.
        also: names of further fields, of `FIELDS`; one that isn't known is left out.
    """
    gx, gy, gz = sensed.gyro.tolist()
    ax, ay, az = sensed.force.tolist()
    x, y, z = sensed.position.tolist()
    u, v, w = sensed.velocity.tolist()
    q1, q2, q3, q4 = sensed.quaternion.tolist()
    further = "".join([FIELDS[name](sensed) for name in also])
    return (
        f'\n{{"timestamp":{sensed.time * _HAIR:.12f},"imu":{{"gyro":[{gx:.9g},{gy:.9g},{gz:.9g}],'
        f'"accel_body":[{ax:.9g},{ay:.9g},{az:.9g}]}},"position":[{x:.12g},{y:.12g},{z:.12g}],'
        f'"velocity":[{u:.9g},{v:.9g},{w:.9g}],'
        f'"quaternion":[{q1:.9g},{q2:.9g},{q3:.9g},{q4:.9g}]{further}}}\n'
    ).encode()


def check_fields(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of further fields of an answer. Raises UnknownNameError."""
    for name in names:
        if name not in FIELDS:
            raise UnknownNameError("field of an answer", name, FIELDS)
    return tuple(names)


def _airspeed(sensed: Sensed) -> str:
    through = (sensed.velocity - sensed.wind).tolist()
    return f',"airspeed":{math.hypot(*through):.9g}'


def _wind(sensed: Sensed) -> str:
    north, east, down = sensed.wind.tolist()
    return f',"velocity_wind":[{north:.9g},{east:.9g},{down:.9g}]'


def _wind_vane(sensed: Sensed) -> str:
    """Return the apparent wind in the horizontal plane, from ahead where the direction is 0."""
    north, east, _ = (sensed.velocity - sensed.wind).tolist()
    a, b, c, d = sensed.quaternion.tolist()
    heading = math.atan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d))
    speed, direction = math.hypot(north, east), math.atan2(east, north) - heading
    return f',"windvane":{{"direction":{direction % math.tau:.9g},"speed":{speed:.9g}}}'


def _range(sensed: Sensed) -> str:
    """Return what a range finder that looks down along the body's axis says."""
    _, b, c, _ = sensed.quaternion.tolist()
    down = 1.0 - 2.0 * (b * b + c * c)
    far = sensed.clearance / down if down > 0.0 else math.nan
    return "" if math.isnan(far) else f',"rng_1":{far:.9g}'


def _fixed(text: str, _sensed: Sensed) -> str:
    return text


FIELDS: dict[str, Callable[[Sensed], str]] = {
    "airspeed": _airspeed,
    "wind": _wind,
    "windvane": _wind_vane,
    "rng": _range,
    "no_time_sync": partial(_fixed, ',"no_time_sync":1'),
}
"""Name -> what it adds to an answer. Older versions of ArduPilot leave out what they don't know, as
`wind`. To their parser the word true is zero, and the first "velocity" is the velocity."""


_MODEL, _OUT = (f"--{name}" for name in ("model", "sim-port-out"))
"""Options of ArduPilot's program."""
PORT = 9002
"""Where ArduPilot's model JSON sends to; its instance I to a port higher by ten times I."""
SILENT = 1.0
"""s without a frame after which another autopilot may take over: one that waits sends each s."""


class Link:
    """A bound port that hears one autopilot at a time; a context manager.

    Attributes:
        port: UDP.
        address: that it is bound to.
        peer: (address, port) of the autopilot; None as long as there is none.
        cut: how many of its packets were cut short on their way.
        strangers: how many packets came from others meanwhile.
    """

    def __init__(
        self, port: int = PORT, *, address: str = "127.0.0.1", timeout: float = 60.0
    ) -> None:
        """Bind the port.

        Args:
            port: UDP, 1 to 65535; 0 takes any that is free.
            address: of this machine; 0.0.0.0 hears other machines too.
            timeout: s, to wait for a frame; inf waits on.

        Raises:
            InputError: the port is taken, or there is no such port or address.
        """
        if not 0 <= port <= 65535:
            raise InputError(f"a UDP port is 1 to 65535, got {port}")
        bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            bound.bind((address, port))
        except OSError as error:
            bound.close()
            raise InputError(
                f"UDP port {port} of {address} can't be bound: {error.strerror or error}; another "
                f"backend may run: end it, or take another port and give it to ArduPilot as {_OUT}"
            ) from None
        self._over(bound, timeout)

    @classmethod
    def over(cls, bound: socket.socket, *, timeout: float = 60.0) -> "Link":
        """Return a link over a UDP socket that is bound already, which it closes at its end."""
        link = cls.__new__(cls)
        link._over(bound, timeout)
        return link

    def _over(self, bound: socket.socket, timeout: float) -> None:
        if not timeout > 0.0:
            bound.close()
            raise InputError(f"timeout must be above 0 s, got {timeout:g}")
        bound.setblocking(False)
        self._socket = bound
        self.address, self.port = bound.getsockname()
        self.timeout = timeout
        self.peer: tuple[str, int] | None = None
        self.cut = self.strangers = 0
        self._heard = -math.inf

    def __enter__(self) -> "Link":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def receive(self, timeout: float | None = None) -> Frame | None:
        """Return the autopilot's next frame; None if none came in time.

        Args:
            timeout: s; that of the link if None.

        Raises:
            InputError: before there is an autopilot, a packet of another protocol came.
        """
        end = time.monotonic() + (self.timeout if timeout is None else timeout)
        while (left := end - time.monotonic()) > 0.0:
            ready, _, _ = select.select([self._socket], [], [], min(left, _LONGEST))
            if ready and (frame := self.waiting()) is not None:
                return frame
        return None

    def waiting(self) -> Frame | None:
        """Return the next frame if one is here already, else None. Raises InputError."""
        while True:
            try:
                packet, peer = self._socket.recvfrom(1024)
            except BlockingIOError:
                return None
            except ConnectionResetError:  # Windows: an answer found no one
                continue
            frame = self._taken(packet, peer)
            if frame is not None:
                return frame

    def answer(self, line: bytes) -> None:
        """Send an answer to where the last frame came from."""
        if self.peer is not None:
            try:
                self._socket.sendto(line, self.peer)
            except OSError:  # it has gone, or its network: it will ask again
                return

    def _taken(self, packet: bytes, peer: tuple[str, int]) -> Frame | None:
        """Return the frame of a packet; None if it is cut, or not of the autopilot that flies."""
        now = time.monotonic()
        stranger = self.peer is not None and peer != self.peer
        if stranger and now - self._heard < SILENT:
            self.strangers += 1
            return None
        try:
            frame = read_frame(packet)
        except InputError:
            if self.peer is None:
                raise
            frame = None
        if frame is not None:
            self.peer, self._heard = peer, now
        elif stranger:
            self.strangers += 1
        else:
            self.cut += 1
        return frame


_LONGEST = 3600.0
"""s that the system is asked to wait at once."""


@dataclass(frozen=True)
class Served:
    """The frames of an autopilot, as they came.

    Attributes:
        frames: that were flown.
        seconds: that were flown, all starts of the autopilot together, s.
        clock: that it took from the first frame to the last, s.
        starts: of the autopilot.
        answers: that were sent.
        repeated: frames that came again, answered with the same bytes.
        dropped: frames that never came.
        late: frames that came after their successor, not answered.
        ahead: frames without an answer of their own, as the autopilot was ahead of its answers.
        cut: packets of which a part was missing.
        strangers: packets of others than the autopilot.
        silences: how often no frame came for seconds.
    """

    frames: int = 0
    seconds: float = 0.0
    clock: float = 0.0
    starts: int = 0
    answers: int = 0
    repeated: int = 0
    dropped: int = 0
    late: int = 0
    ahead: int = 0
    cut: int = 0
    strangers: int = 0
    silences: int = 0

    @property
    def factor(self) -> float:
        """How many times real time it flew."""
        return self.seconds / self.clock if self.clock > 0.0 else 0.0

    def __str__(self) -> str:
        flown = (
            f"{self.seconds:.1f} s in {self.clock:.3g} s, {self.factor:.2g} times real time, "
            f"{self.frames} frames"
        )
        trouble = ((getattr(self, name), what) for name, what in _TROUBLE.items())
        seen = [what.format(number) for number, what in trouble if number]
        again = [f"{self.starts} starts of the autopilot"] if self.starts > 1 else []
        return "; ".join([flown, ", ".join([*again, *seen]) or "none lost, none repeated"])


_TROUBLE = {
    "repeated": "{} came again and got the same answer",
    "dropped": "{} never came",
    "late": "{} came late",
    "ahead": "{} came before the answer of the one before",
    "cut": "{} packets cut short",
    "strangers": "{} packets of others",
    "silences": "silent for seconds: {}",
}
"""Attribute -> how it is said."""


OnFrame = Callable[[Frame, Sensed], bool | None]
"""Called with each frame that is flown and what is sensed after it; True ends the flight."""

OnWait = Callable[[], bool | None]
"""Called while no frame comes; True ends the flight."""

_LOOK = 0.1
"""s between two calls while no frame comes."""
_SILENCE = 5.0
"""s without a frame that are told."""
_AT_ONCE = 0.5
"""s, within which a lower count is a late packet, not another start: a start's is sent again."""
_COUNTS = 1 << 32
"""Frame counts begin again at 0 from here."""

_COUNTED = ("frames", "starts", "answers", "repeated", "dropped", "late", "ahead", "silences")

_log = logging.getLogger(__name__)


class Flown(Protocol):
    """What the lock step asks of an aircraft."""

    def step(self, pulses: Sequence[int]) -> Sensed:
        """Fly on by one frame, the outputs where they are, and return what is sensed."""
        ...

    def reset(self) -> None:
        """Stand on the ground as at the start, at time 0."""
        ...


class Backend:
    """An aircraft flown by an autopilot; `run` it, and ask what was `served` at any time."""

    def __init__(
        self,
        aircraft: Flown,
        link: Link,
        *,
        on_frame: OnFrame | None = None,
        on_wait: OnWait | None = None,
        on_restart: Callable[[], None] | None = None,
        also: Sequence[str] = (),
    ) -> None:
        """Take what flies and what it is flown over; arguments are those of `serve`."""
        self._aircraft, self._link = aircraft, link
        self._on_frame, self._on_wait, self._on_restart = on_frame, on_wait, on_restart
        self._also = check_fields(also)
        self._counts: dict[str, int] = dict.fromkeys(_COUNTED, 0)
        self._told: set[str] = set()
        self._last: Frame | None = None
        self._line = b""
        self._seconds = self._time = 0.0
        self._began = self._came = 0.0
        self._over = False

    @property
    def served(self) -> Served:
        """What was served so far."""
        return Served(
            **self._counts,
            seconds=self._seconds + self._time,
            clock=self._came - self._began,
            cut=self._link.cut,
            strangers=self._link.strangers,
        )

    def run(self) -> Served:
        """Serve until a call ends it or no frame comes for the link's timeout."""
        frame = self._first()
        while frame is not None:
            if self._last is not None and frame.count == self._last.count:
                self._count("repeated", f"frame {frame.count} came again: the same answer")
            elif self._is_late(frame):
                self._late(frame)
                frame = self._next()
                continue
            elif self._fly(frame):
                break
            newer = self._newer(frame)
            if newer is None:
                self._link.answer(self._line)
                self._counts["answers"] += 1
                newer = self._next()
            frame = newer
        return self.served

    def _first(self) -> Frame | None:
        frame = self._receive(self._link.timeout)
        if self._over:
            return None
        if frame is None:
            raise InputError(self._no_one())
        channels = len(frame.pulses)
        peer = "{}:{}".format(*(self._link.peer or ("", 0)))
        _log.info("ArduPilot at %s: %d channels, %d Hz wanted", peer, channels, frame.rate_hz)
        if frame.count:
            _log.info("it ran before: its frame %d is the first here, at time 0", frame.count)
        self._began = self._came = time.monotonic()
        self._counts["starts"] = 1
        return frame

    def _no_one(self) -> str:
        link = self._link
        out = "" if link.port == PORT else f" {_OUT} {link.port}"
        return (
            f"no autopilot sent a frame to UDP port {link.port} in {link.timeout:g} s; start "
            f"ArduPilot with: arducopter-heli {_MODEL} JSON:{link.address}{out}, and a ground "
            "station on its TCP port 5760, for which it waits"
        )

    def _next(self) -> Frame | None:
        """Return the next frame; None if none comes for the link's timeout."""
        frame = self._receive(min(_SILENCE, self._link.timeout))
        if frame is None and not self._over and self._link.timeout > _SILENCE:
            self._counts["silences"] += 1
            _log.info("no frame for %g s, at %.1f s of flight: waiting", _SILENCE, self._time)
            frame = self._receive(self._link.timeout - _SILENCE)
            if frame is not None:
                _log.info("frames again")
        return frame

    def _receive(self, timeout: float) -> Frame | None:
        """Return the next frame; None if none comes in time or nobody waits for one any more."""
        if self._on_wait is None:
            return self._link.receive(timeout)
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0.0:
            frame = self._link.receive(min(left, _LOOK))
            if frame is not None:
                return frame
            self._over = bool(self._on_wait())
            if self._over:
                return None
        return None

    def _newer(self, frame: Frame) -> Frame | None:
        """Return a frame that came while its forerunner was flown."""
        while (newer := self._link.waiting()) is not None:
            ahead = _ahead(newer, frame)
            if ahead > 0:
                self._count("ahead", f"frame {newer.count} came before {frame.count} was answered")
                return newer
            if ahead == 0:
                self._count("repeated", f"frame {frame.count} came twice: one answer")
            else:
                self._late(newer)
        return None

    def _is_late(self, frame: Frame) -> bool:
        soon = time.monotonic() - self._came < _AT_ONCE
        return self._last is not None and _ahead(frame, self._last) < 0 and soon

    def _late(self, frame: Frame) -> None:
        self._count("late", f"frame {frame.count} came after its successor: not answered")

    def _fly(self, frame: Frame) -> bool:
        """Fly on by a frame, from the start if the autopilot starts; return whether to end."""
        ahead = 1 if self._last is None else _ahead(frame, self._last)
        if ahead < 0:
            self._start_anew(frame)
        elif ahead > 1:
            self._counts["dropped"] += ahead - 2
            self._count("dropped", f"frame {frame.count} came after {frame.count - ahead}")
        sensed = self._aircraft.step(frame.pulses)
        self._line, self._last = answer(sensed, self._also), frame
        self._time, self._came = sensed.time, time.monotonic()
        self._counts["frames"] += 1
        return self._on_frame is not None and bool(self._on_frame(frame, sensed))

    def _start_anew(self, frame: Frame) -> None:
        _log.info(
            "the autopilot starts anew, frame %d, after %.1f s: back on the ground, at time 0",
            frame.count,
            self._time,
        )
        self._seconds += self._time
        self._time = 0.0
        self._counts["starts"] += 1
        if self._on_restart is not None:
            self._on_restart()
        self._aircraft.reset()

    def _count(self, name: str, text: str) -> None:
        """Count something, and tell it the first time."""
        self._counts[name] += 1
        if name not in self._told:
            self._told.add(name)
            _log.info("%s (told once; the summary counts them)", text)


def _ahead(frame: Frame, last: Frame) -> int:
    """Return by how many a frame's count is above another's, across the end of all counts."""
    ahead = (frame.count - last.count) % _COUNTS
    return ahead - _COUNTS if ahead >= _COUNTS // 2 else ahead


def serve(
    aircraft: Flown,
    link: Link,
    *,
    on_frame: OnFrame | None = None,
    on_wait: OnWait | None = None,
    on_restart: Callable[[], None] | None = None,
    also: Sequence[str] = (),
) -> Served:
    """Fly an aircraft by the frames that come, until none comes for long.

    Args:
        aircraft: that is flown.
        link: to the autopilot.
        on_frame: called with each frame and what is sensed after it, while the autopilot waits
            for the answer; True ends the flight. What a script sends to the autopilot in it
            arrives at the same simulated time in each run.
        on_wait: called ten times a second while no frame comes; True ends the flight.
        on_restart: called when the autopilot starts anew, before the aircraft is on the ground
            again.
        also: further fields of the answers: "airspeed", "wind", "windvane", "rng" or
            "no_time_sync".

    Returns:
        What was served.

    Raises:
        InputError: no autopilot sent a frame in the link's time, or something else did.
        UnknownNameError: there is no such field.
    """
    calls = {"on_frame": on_frame, "on_wait": on_wait, "on_restart": on_restart}
    return Backend(aircraft, link, also=also, **calls).run()
