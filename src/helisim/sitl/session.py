"""A scripted flight from start to end: process, lock step, script, log; and scripts by name."""

import inspect
import os
import runpy
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from helisim.base.errors import AutopilotError, InputError, UnknownNameError
from helisim.logs.dataflash import DataFlash
from helisim.sitl.aircraft import Aircraft
from helisim.sitl.link import Frame, Link, OnFrame, OnWait, Sensed, Served, serve
from helisim.sitl.pilot import Pilot, Steps, Telemetry, mavlink
from helisim.sitl.process import Autopilot

Script = Callable[[Pilot], Steps]  # A generator function of a pilot
_STEP = 0.01  # s of simulated time between two steps of a script
_SPEAKS = 0.05  # s between two messages of where the sticks stand
# s of simulated time without growth after which a log is whole; it is written each 2 s.
_QUIET = 4.0
_LONGEST_TAIL = 300.0  # s that a log may go on after the flight
_LAST_PART = 4.0  # s that are flown on after a crash or refusal, for a log that has it
_PATIENCE = 30.0  # s of the clock without a frame after which the autopilot has failed
# Parameters that a script relies on.
_OWN = {
    "LOG_FILE_BUFSIZE": 30_000,  # kB, for many times real time
    "LOG_FILE_MB_FREE": 10,
    "LOG_DISARMED": 0,
    "FLTMODE_CH": 0,  # the script changes the mode
    **{f"RC{k}_{name}": value for k in range(1, 9) for name, value in (
        ("MIN", 1000), ("MAX", 2000), ("TRIM", 1500), ("DZ", 0), ("REVERSED", 0))},
}  # fmt: skip
_FUNCTION = "fly"
SYSID = "sysid"  # The script that has options of its own, see `sweeps`


@dataclass(frozen=True)
class Flight:
    """A scripted flight's result; `lost` are messages that its log lacks by its own count."""

    served: Served
    said: tuple[str, ...]
    lost: int = 0


def fly_script(
    script: Script,
    aircraft: Aircraft,
    program: Path,
    parameters: str,
    *,
    log: str | os.PathLike[str] | None = None,
    speed: float = 1000.0,
    say: Callable[[str], None] = lambda text: None,
    on_frame: OnFrame = lambda frame, sensed: None,
    on_wait: OnWait = lambda: None,
) -> Flight:
    """Fly an aircraft by ArduPilot, and ArduPilot by a script.

    Flights are the same to the last bit unless a frame was repeated. `parameters` is a file's text,
    `log` the log's path, `speed` the most times real time. `say` is called with what happens,
    `on_frame` with each frame, `on_wait` while none comes; True of either ends the flight. The log
    is kept however the flight ends, by KeyboardInterrupt too. Raises AutopilotError if it refused,
    was late, ended or crashed; InputError if it can't be started or pymavlink is missing;
    StorageError.
    """
    mavlink()
    text = parameters.rstrip("\n") + "\n" + "".join(f"{k} {value}\n" for k, value in _OWN.items())
    with (
        Link(0, timeout=_PATIENCE) as link,
        Autopilot(program, text, link.port, speed=speed) as autopilot,
    ):
        pilot = Pilot(aircraft, Telemetry(autopilot.telemetry, say), say)
        flown = _Flown(pilot, _whole(script, pilot, autopilot), on_frame)

        def alive() -> bool:
            autopilot.check(pilot.telemetry.said)
            return bool(on_wait())

        def anew() -> None:
            raise AutopilotError(f"ArduPilot started anew at {aircraft.time:.1f} s of flight")

        try:
            served = serve(aircraft, link, on_frame=flown, on_wait=alive, on_restart=anew)
            if not flown.done:
                alive()
                raise AutopilotError(
                    f"ArduPilot sent no frame for {_PATIENCE:g} s"
                    + "".join(f"; it said last: {text}" for text in pilot.telemetry.said[-1:])
                )
        except BaseException:
            if log is not None and autopilot.log is not None:
                autopilot.keep_log(log)
                say(f"its log until then is kept: {log}")
            elif log is not None:
                say("it had begun no log: it does when it is armed")
            raise
        lost = 0
        if log is not None:
            autopilot.keep_log(log)
            written = DataFlash(Path(log))
            lost = int(written.table("DSF")["Dp"][-1]) if "DSF" in written else 0
        return Flight(served, tuple(pilot.telemetry.said), lost)


class _Flown:
    def __init__(self, pilot: Pilot, steps: Steps, on_frame: OnFrame) -> None:
        self._pilot, self._steps, self._on_frame = pilot, steps, on_frame
        self._next = self._speaks = 0.0
        self.done = False

    def __call__(self, frame: Frame, sensed: Sensed) -> bool:
        pilot = self._pilot
        if self._on_frame(frame, sensed):
            raise AutopilotError(f"ended from outside at {sensed.time:.1f} s of flight")
        if sensed.time < self._next - 1e-9:
            return False
        self._next += _STEP
        pilot.sensed = sensed
        pilot.telemetry.hear()
        self.done = next(self._steps, self) is self
        if sensed.time >= self._speaks:
            self._speaks += _SPEAKS
            pilot.telemetry.speak(pilot.sticks.pulses)
        return self.done


def _whole(script: Script, pilot: Pilot, autopilot: Autopilot) -> Steps:
    """Fly a script to its end or a crash, and wait until the log of it is written."""
    failed, longest = None, _LONGEST_TAIL
    try:
        for _ in script(pilot):
            yield
            if crash := pilot.aircraft.crashed:
                raise AutopilotError(f"crashed at {pilot.time:.1f} s: {crash}")
    except AutopilotError as error:
        failed, longest = error, _LAST_PART
    end = pilot.time + longest
    size, since = -1, pilot.time
    while pilot.time < end and pilot.time - since < _QUIET:
        log = autopilot.log
        now = log.stat().st_size if log is not None else 0
        if now != size:
            size, since = now, pilot.time
        yield
    if failed is not None:
        raise AutopilotError(
            str(failed) + "".join(f"; it said last: {text}" for text in pilot.telemetry.said[-1:]),
            remedy=failed.remedy,
        ) from failed


def hover(pilot: Pilot) -> Steps:
    """Take off to 5 m, hover for five minutes, and land."""
    yield from pilot.take_off(5.0)
    pilot.say("hovering for 300 s")
    yield from pilot.wait(300.0)
    yield from pilot.land()


def script_of(name: str) -> Script:
    """Return the script "hover", or `fly` of a .py file. Raises UnknownNameError, InputError."""
    if name == hover.__name__:
        return hover
    if not name.endswith(".py"):
        raise UnknownNameError(
            "script",
            name,
            [hover.__name__, SYSID],
            advice="or a file of your own, whose name ends in .py",
        )
    path = Path(name)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    found = runpy.run_path(str(path)).get(_FUNCTION)
    if not inspect.isgeneratorfunction(found):
        raise InputError(
            f"{path}: expected a function `def {_FUNCTION}(pilot):` with `yield from` in it, as "
            "`yield from pilot.take_off(5.0)`"
        )
    return found
