"""`helisim sitl --script`: starts ArduPilot itself and flies it by a script."""

import argparse
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from helisim.base.errors import InputError
from helisim.cli.common import names
from helisim.cli.sitl_serving import Kept, window

if TYPE_CHECKING:
    from helisim.sitl import Aircraft, Frame, Sensed
    from helisim.sitl.pilot import Pilot, Steps
    from helisim.vehicle import Vehicle

EPILOG = """\
--script starts ArduPilot itself, in a network of its own, and flies it: hover
(5 minutes at 5 m), square, sysid (sweeps by its mode SystemID), or FILE.py,
whose function fly(pilot) is a script of your own:

  def fly(pilot):
      yield from pilot.take_off(5.0)
      yield from pilot.wait(10.0)
      yield from pilot.land()

--into says where sysid adds its signal: input, recovery, rate, mixer, position,
velocity, velocity-input. Each sweep begins where the first did.

"""
_CHANGED = {
    "magnitude": ("magnitude", "of the signal: deg, deg/s, m, m/s, or of the mixer's 1"),
    "from": ("start_hz", "start frequency, Hz"),
    "to": ("stop_hz", "stop frequency, Hz"),
    "seconds": ("seconds", "of a sweep, up to 255"),
    "fade-in": ("fade_in", "s (default: 5)"),
    "fade-out": ("fade_out", "s (default: 2)"),
}
"""Option of a sweep -> its field and help."""
_USUAL = {"axes": "roll,pitch,yaw,thrust", "into": "mixer", "count": 1, "height": 50.0}
"""Other option of sweeps -> what it is unless given."""
_EACH = 10.0
"""s of the clock between two lines that say how far the flight is."""


def add_script(command: argparse.ArgumentParser) -> None:
    """Add the options of a flight by a script."""
    group = command.add_argument_group("flights by a script")
    group.add_argument(
        "--script", metavar="NAME|FILE.py", help="hover, square, sysid or your own; see below"
    )
    group.add_argument("--log", type=Path, metavar="FILE", help="keep ArduPilot's log, .bin")
    group.add_argument(
        "--ardupilot",
        metavar="FILE",
        help="the program arducopter-heli (default: what HELISIM_ARDUPILOT names)",
    )
    group.add_argument(
        "--parm",
        type=Path,
        metavar="FILE",
        help="ArduPilot's parameters (default: VEHICLE.parm of its folder, or as helisim parm "
        "makes them)",
    )
    group.add_argument(
        "--speed",
        type=float,
        default=1000.0,
        metavar="X",
        help="times real time that isn't exceeded (default: as fast as it goes)",
    )
    group.add_argument(
        "--axes",
        default=_USUAL["axes"],
        metavar="AXIS,...",
        help="of sysid (default: roll,pitch,yaw,thrust)",
    )
    group.add_argument(
        "--into",
        default=_USUAL["into"],
        metavar="WHERE,...",
        help="where sysid adds its signal (default: mixer)",
    )
    group.add_argument(
        "--count",
        type=int,
        default=_USUAL["count"],
        metavar="N",
        help="sweeps of each axis (default: 1)",
    )
    group.add_argument(
        "--height",
        type=float,
        default=_USUAL["height"],
        metavar="M",
        help="of the sweeps (default: 50)",
    )
    for option, (field, text) in _CHANGED.items():
        group.add_argument(f"--{option}", dest=f"sweep_{field}", type=float, metavar="X", help=text)


def script_of_options(options: argparse.Namespace) -> "Callable[[Pilot], Steps]":
    """Return the script that the options ask for."""
    from helisim.sitl.session import SYSID, script_of
    from helisim.sitl.systemid import fly_sweeps, sweeps

    if options.script != SYSID:
        return script_of(options.script)
    given = {field: getattr(options, f"sweep_{field}") for field, _ in _CHANGED.values()}
    changes = {field: value for field, value in given.items() if value is not None}
    wanted = sweeps(names(options.axes), names(options.into), count=options.count, **changes)
    if options.log is None:
        raise InputError("sweeps are flown for their log: say where it goes with --log FILE.bin")
    return fly_sweeps(wanted, height=options.height)


def check_no_script(options: argparse.Namespace) -> None:
    """Refuse what only a script has."""
    _check_no_sweeps(options)
    for name in ("log", "ardupilot", "parm"):
        if getattr(options, name) is not None:
            raise InputError(
                f"--{name} is of a flight that --script flies; ArduPilot that you start yourself "
                "keeps its log in its own folder, logs/"
            )


def _check_no_sweeps(options: argparse.Namespace) -> None:
    """Refuse what only the sweeps of sysid have."""
    given = [f"--{name}" for name, usual in _USUAL.items() if getattr(options, name) != usual]
    changed = {name: getattr(options, f"sweep_{field}") for name, (field, _) in _CHANGED.items()}
    given += [f"--{name}" for name, value in changed.items() if value is not None]
    if given:
        raise InputError(f"{', '.join(given)}: of the sweeps that --script sysid flies")


def check_script(options: argparse.Namespace) -> None:
    """Refuse a flight that can't be flown, or whose log can't be written, before it begins."""
    from helisim.base.files import check_destination
    from helisim.sitl.pilot import mavlink
    from helisim.sitl.process import find_program
    from helisim.sitl.session import SYSID

    if options.log is not None:
        check_destination(options.log, (".bin",))
    if not options.speed > 0.0:
        raise InputError(f"--speed must be above 0, got {options.speed:g}")
    if not 10.0 <= options.height <= 1000.0:
        raise InputError(f"--height must be 10 to 1000 m, got {options.height:g}")
    if options.parm is None and options.tail != "direct":
        raise InputError(
            "--tail gyro needs parameters that leave the tail to it: give --parm FILE, with "
            "H_TAIL_TYPE 1 and no gains of ATC_RAT_YAW but FF"
        )
    if options.script != SYSID:
        _check_no_sweeps(options)
    script_of_options(options)
    find_program(options.ardupilot)
    mavlink()


def fly(options: argparse.Namespace, aircraft: "Aircraft", also: tuple[str, ...] = ()) -> int:
    """Fly an aircraft by ArduPilot and a script; return the exit status."""
    from helisim.sitl.process import find_program
    from helisim.sitl.session import fly_script

    parameters, source = _parameters(options, aircraft.vehicle)
    told = _Told(aircraft, options.quiet)
    told(f"parameters: {source}")
    with ExitStack() as stack:
        watched = stack.enter_context(window(aircraft)) if options.view else None

        def on_frame(frame: "Frame", sensed: "Sensed") -> bool:
            told.now_and_then()
            return watched is not None and watched.on_frame(frame, sensed)

        try:
            flight = fly_script(
                script_of_options(options),
                aircraft,
                find_program(options.ardupilot),
                parameters,
                log=options.log,
                speed=options.speed,
                say=told,
                on_frame=on_frame,
                on_wait=watched.on_wait if watched else None,
                also=also,
            )
        finally:  # what led to a crash is in the record
            if aircraft.time > 0.0:
                Kept(options, aircraft).write()
    if options.log is not None:
        size = options.log.stat().st_size / 1e6
        print(f"Written: {options.log} ({size:.1f} MB)")
        if flight.lost:
            print(f"The log lacks {flight.lost} messages: fly with a lower --speed")
    print(f"Flown: {flight.served}", flush=True)
    return 0


def _parameters(options: argparse.Namespace, vehicle: "Vehicle") -> tuple[str, str]:
    """Return ArduPilot's parameters and where they are from: given, the vehicle's own, or made."""
    path = options.parm
    if path is None:
        path, gyro = vehicle.folder / f"{vehicle.name}.parm", options.tail == "gyro"
        if gyro or not path.is_file():
            from helisim.sitl.parameters import parameters_for

            made = parameters_for(vehicle, gyro=gyro)
            return made.text, f"made from {vehicle.name}, as helisim parm does"
    try:
        return path.read_text(encoding="utf-8"), str(path)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: can't read ArduPilot's parameters: {error}") from None


class _Told:
    """Says what happens, and now and then how far the flight is, on standard error."""

    def __init__(self, aircraft: "Aircraft", quiet: bool) -> None:
        self._aircraft, self._quiet, self._last = aircraft, quiet, ""
        self._start = time.monotonic()
        self._next = self._start + _EACH

    def __call__(self, text: str) -> None:
        self._last = text
        self._write(text)

    def now_and_then(self) -> None:
        """Repeat what was said last, if that is a while ago."""
        if time.monotonic() >= self._next:
            self._write(self._last)

    def _write(self, text: str) -> None:
        now, seconds = time.monotonic(), self._aircraft.time
        self._next = now + _EACH
        if not self._quiet:
            factor = seconds / max(now - self._start, 1e-3)
            line = f"{seconds:7.1f} s (x{factor:.1f})  {text}"
            print(line, file=sys.stderr, flush=True)
