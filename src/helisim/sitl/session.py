"""A scripted flight from start to end: process, lock step, script, log; and scripts by name."""

import inspect
import os
import runpy
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from helisim.base.errors import AutopilotError, HelisimError, InputError, UnknownNameError
from helisim.logs.dataflash import DataFlash
from helisim.sitl.aircraft import Aircraft
from helisim.sitl.link import Frame, Link, OnFrame, OnWait, Sensed, Served, serve
from helisim.sitl.pilot import Pilot, Steps, Telemetry, mavlink
from helisim.sitl.process import Autopilot

Script = Callable[[Pilot], Steps]
"""What flies: a function of a pilot that is a generator."""
_STEP = 0.01
"""s of simulated time between two steps of a script."""
_STICKS, _BEATS = 0.05, 0.5
"""s between two messages of where the sticks stand, and that a ground station is there."""
_QUIET = 4.0
"""s of simulated time without growth after which a log is whole: it is written each 2 s."""
_LONGEST_TAIL = 300.0
"""s that a log may go on after the flight."""
_OWN = {
    "LOG_FILE_BUFSIZE": 30_000,  # kB: many times real time are more than its writer follows
    "LOG_FILE_MB_FREE": 10,
    "LOG_DISARMED": 0,
    "FLTMODE_CH": 0,  # the script alone changes the mode
    **{f"RC{k}_{name}": value for k in range(1, 9) for name, value in (
        ("MIN", 1000), ("MAX", 2000), ("TRIM", 1500), ("DZ", 0), ("REVERSED", 0))},
}  # fmt: skip
"""Parameters that a script relies on: the log, and sticks without play."""


@dataclass(frozen=True)
class Flight:
    """How a scripted flight went.

    Attributes:
        served: frames and time.
        said: what the autopilot told, in order.
        lost: messages that its log lacks, as it says itself; 0 without a log.
        shared: why it flew in the machine's own network, "" if it had one of its own.
    """

    served: Served
    said: tuple[str, ...]
    lost: int = 0
    shared: str = ""


def fly_script(
    script: Script,
    aircraft: Aircraft,
    program: Path,
    parameters: str,
    *,
    log: str | os.PathLike[str] | None = None,
    speed: float = 1000.0,
    say: Callable[[str], None] = lambda text: None,
    on_frame: OnFrame | None = None,
    on_wait: OnWait | None = None,
    also: Sequence[str] = (),
    more: Sequence[str] = (),
) -> Flight:
    """Fly an aircraft by ArduPilot, and ArduPilot by a script.

    Two flights of the same script, aircraft and program are the same to the last bit, unless the
    machine stood still for a second and a frame came again: `Flight.served` tells.

    Args:
        script: what is flown.
        aircraft: on its ground.
        program: ArduPilot's arducopter-heli.
        parameters: text of its parameter file.
        log: where its log goes at the end, whole or not at all; nowhere if None.
        speed: times real time that is not exceeded.
        say: called with what happens.
        on_frame: called with each frame and what is sensed after it; True ends the flight.
        on_wait: called now and then while no frame comes; True ends the flight.
        also: further fields of the answers, see `serve`.
        more: arguments of the program.

    Raises:
        AutopilotError: it refused something, something did not come in time, the aircraft
            crashed, or the program ended.
        InputError: the program can't be started, pymavlink is missing, or the script raised.
        StorageError: the log can't be written.
    """
    mavlink()
    own = "".join(f"{name} {value}\n" for name, value in _OWN.items())
    text = parameters.rstrip("\n") + "\n" + own
    with Autopilot(program, text, speed=speed, more=more) as autopilot:
        flown = _Flown(script, aircraft, autopilot, say, on_frame)

        def alive() -> bool:
            autopilot.check()
            return on_wait is not None and bool(on_wait())

        def anew() -> None:
            raise AutopilotError(f"ArduPilot started anew at {aircraft.time:.1f} s of flight")

        if autopilot.shared:
            say(f"{autopilot.shared}: ArduPilot's ports are open on this machine's network")
        with aircraft, Link.over(autopilot.frames, timeout=_PATIENCE) as link:
            calls = {"on_frame": flown, "on_wait": alive, "on_restart": anew}
            served = serve(aircraft, link, **calls, also=also)
        if not flown.done:
            autopilot.check()
            raise AutopilotError(f"ArduPilot sent no frame for {_PATIENCE:g} s")
        lost = 0
        if log is not None:
            autopilot.keep_log(log)
            lost = _lost(log)
        return Flight(served, tuple(flown.said), lost, autopilot.shared)


def _lost(log: str | os.PathLike[str]) -> int:
    """Return how many messages a log's writer did not get into it, by its statistics."""
    written = DataFlash(Path(log))
    if "DSF" not in written:
        return 0
    counts = written.table("DSF")["Dp"]
    return int(counts[-1]) if len(counts) else 0


_PATIENCE = 30.0
"""s of the clock without a frame after which the autopilot is taken for dead."""


class _Flown:
    """Called with each frame: lets the script go on."""

    def __init__(
        self,
        script: Script,
        aircraft: Aircraft,
        autopilot: Autopilot,
        say: Callable[[str], None],
        on_frame: OnFrame | None,
    ) -> None:
        self._telemetry = Telemetry(autopilot.telemetry)
        self._pilot = Pilot(aircraft, self._telemetry, say)
        self._steps = self._whole(script)
        self._autopilot, self._aircraft, self._on_frame = autopilot, aircraft, on_frame
        self._say, self._heard = say, 0
        self._next = self._sticks = self._beat = 0.0
        self.done = False

    @property
    def said(self) -> list[str]:
        """What the autopilot told."""
        return self._telemetry.said

    def __call__(self, frame: Frame, sensed: Sensed) -> bool:
        if self._on_frame is not None and self._on_frame(frame, sensed):
            raise AutopilotError(f"ended from outside at {sensed.time:.1f} s of flight")
        if sensed.time < self._next - 1e-9:
            return False
        self._next += _STEP
        self._pilot.sensed = sensed
        self._telemetry.hear()
        for text in self._telemetry.warned[self._heard :]:
            self._say(f"ArduPilot: {text}")
        self._heard = len(self._telemetry.warned)
        if self._aircraft.crashed:
            raise AutopilotError(f"crashed at {sensed.time:.1f} s: {self._aircraft.crashed}")
        try:
            next(self._steps)
        except StopIteration:
            self.done = True
        self._speak(sensed.time)
        return self.done

    def _speak(self, time: float) -> None:
        if time >= self._sticks:
            self._sticks += _STICKS
            self._telemetry.move_sticks(self._pilot.sticks.pulses)
        if time >= self._beat:
            self._beat += _BEATS
            self._telemetry.beat()

    def _whole(self, script: Script) -> Steps:
        yield from told(script, self._pilot)
        yield from self._log_written()

    def _log_written(self) -> Steps:
        """Wait until the log grows no more."""
        end = self._pilot.time + _LONGEST_TAIL
        size, since = -1, self._pilot.time
        while self._pilot.time < end and self._pilot.time - since < _QUIET:
            log = self._autopilot.log
            now = log.stat().st_size if log is not None else 0
            if now != size:
                size, since = now, self._pilot.time
            yield


_FUNCTION = "fly"
"""What a file's function is called."""
CORNERS = ((5.0, 0.0), (5.0, 5.0), (0.0, 5.0), (0.0, 0.0))
"""m north and east."""


def hover(pilot: Pilot) -> Steps:
    """Take off to 5 m, hover for five minutes, and land."""
    yield from pilot.take_off(5.0)
    pilot.say("hovering for 300 s")
    yield from pilot.wait(300.0)
    yield from pilot.land()


def square(pilot: Pilot) -> Steps:
    """Take off to 5 m, fly a square of 5 m, and land."""
    yield from pilot.take_off(5.0)
    for north, east in CORNERS:
        pilot.say(f"to {north:g} m north, {east:g} m east")
        yield from pilot.go_to(north, east, 5.0)
    yield from pilot.land()


SCRIPTS: dict[str, Callable[[Pilot], Steps]] = {"hover": hover, "square": square}
"""Name -> script; "sysid" has options of its own, see `sweeps`."""
SYSID = "sysid"


def script_of(name: str) -> Callable[[Pilot], Steps]:
    """Return a script by its name, or the function `fly` of a file.

    Args:
        name: a key of `SCRIPTS`, or a path that ends in .py.

    Raises:
        UnknownNameError: there is no such script.
        InputError: the file can't be run, or has no such function.
    """
    if name in SCRIPTS:
        return SCRIPTS[name]
    if not name.endswith(".py"):
        advice = "or a file of your own, whose name ends in .py"
        raise UnknownNameError("script", name, [*SCRIPTS, SYSID], advice=advice)
    path = Path(name)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        found = runpy.run_path(str(path)).get(_FUNCTION)
    except Exception as error:
        raise InputError(f"{path}: {type(error).__name__}: {error}") from error
    if not inspect.isgeneratorfunction(found):
        raise InputError(
            f"{path}: expected a function `def {_FUNCTION}(pilot):` with `yield from` in it, as "
            "`yield from pilot.take_off(5.0)`"
        )
    return found


def told(script: Callable[[Pilot], Steps], pilot: Pilot) -> Steps:
    """Go through a script, and tell in a line what it does wrong, and where.

    Raises:
        InputError: it raised what is no error of helisim's.
    """
    try:
        yield from script(pilot)
    except HelisimError:
        raise
    except Exception as error:
        frames = [one for one in traceback.extract_tb(error.__traceback__) if one.name == _FUNCTION]
        where = f"{frames[-1].filename}, line {frames[-1].lineno}" if frames else "the script"
        raise InputError(f"{where}: {type(error).__name__}: {error}") from error
