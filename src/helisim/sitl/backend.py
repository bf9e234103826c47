"""The lock step: each frame of the autopilot is flown once and answered, whatever the way does.

The autopilot waits for the answer to a frame and sends the frame again after a second without one.
It counts a frame up for each answer that it reads, wanted or not. So a frame that comes again gets
the same bytes; and an answer too many, as of a packet that was doubled, would leave the autopilot
one answer behind for good: seen by its next frame coming before the last is answered, it is healed
by leaving that answer out.
"""

import logging
import time
from collections.abc import Callable, Sequence
from typing import Protocol

from helisim.base.errors import InputError
from helisim.sitl.link import Link
from helisim.sitl.packet import Frame, Sensed, answer, check_fields
from helisim.sitl.served import Served

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
_START = (
    "start ArduPilot with: arducopter-heli --model JSON:{address}{out}, and a ground station on "
    "its TCP port 5760, for which it waits"
)

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
        out = "" if link.port == 9002 else f" --sim-port-out {link.port}"
        how = _START.format(address=link.address, out=out)
        return f"no autopilot sent a frame to UDP port {link.port} in {link.timeout:g} s; {how}"

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
