"""Commands about ArduPilot: it flies a vehicle, its parameters, its own model of a helicopter."""

import math
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import DivergedError, InputError, UnknownNameError
from helisim.cli.flying import ground, weather
from helisim.cli.options import Options, loaded, parameters, print_written, wrapped, write_recording

if TYPE_CHECKING:
    from helisim.ident import ArduPilotModel, Fit
    from helisim.show.viewer import Watched
    from helisim.sitl import Aircraft, Frame, Link, Sensed
    from helisim.sitl.pilot import Pilot, Steps
    from helisim.vehicle import Vehicle

_EACH = 10.0
"""s of the clock between two lines that say how far a flight is."""
_CHANGED = ("magnitude", "start_hz", "stop_hz", "seconds", "fade_in", "fade_out")
"""Fields of a sweep that options change, as `sweep_` and the field."""
_FLAGS = ("magnitude", "from", "to", "seconds", "fade-in", "fade-out")
_USUAL = {
    "axes": ("roll", "pitch", "yaw", "thrust"),
    "into": ("mixer",),
    "count": 1,
    "height": 50.0,
}
"""Other option of sweeps -> what it is unless given."""


def sitl(o: Options) -> int:
    """Let ArduPilot fly the helicopter.

    Let an unmodified ArduCopter-heli fly the helicopter: a backend for ArduPilot's JSON interface,
    lock step. The helicopter stands on the ground, its rotor stopped, until the autopilot arms and
    spins it up.

    Options:
        @vehicle
        --port N <=9002>  UDP, to listen on (default: 9002)
        --address IP <=127.0.0.1>  of this machine, to listen on (default: 127.0.0.1; 0.0.0.0 hears
            other machines)
        --wait S <=60>  for the first frame, and after the last, s (default: 60; inf: on and on)
        --send FIELD,... <names>  further fields of the answers, see below
        --tail direct|gyro <=direct>  direct: ArduPilot moves the tail servo (default); gyro: the
            helicopter's own yaw gyro does, and ArduPilot's output is its pedals (H_TAIL_TYPE 1)
        --rate HZ <=1000>  frames a second of simulated time (default: 1000, one sample of
            ArduPilot's gyro each; it does not arm below 720)
        --seed N <=1>  of the turbulence (default: 1)
        @weather
        @ground
        @set
        flights by a script:
        --script NAME|FILE.py  hover, square, sysid or your own; see below
        --log FILE <.bin>  keep ArduPilot's log, .bin
        --ardupilot FILE <text>  the program arducopter-heli (default: what HELISIM_ARDUPILOT names)
        --parm FILE  ArduPilot's parameters (default: VEHICLE.parm of its folder, or as helisim parm
            makes them)
        --speed X <=1000>  times real time that isn't exceeded (default: as fast as it goes)
        --axes AXIS,... <names =roll,pitch,yaw,thrust>  of sysid (default: roll,pitch,yaw,thrust)
        --into WHERE,... <names =mixer>  where sysid adds its signal (default: mixer)
        --count N <=1>  sweeps of each axis (default: 1)
        --height M <=50>  of the sweeps (default: 50)
        --magnitude/sweep_magnitude X  of the signal: deg, deg/s, m, m/s, or of the mixer's 1
        --from/sweep_start_hz X  start frequency, Hz
        --to/sweep_stop_hz X  stop frequency, Hz
        --seconds/sweep_seconds X  of a sweep, up to 255
        --fade-in/sweep_fade_in X  s (default: 5)
        --fade-out/sweep_fade_out X  s (default: 2)
        options:
        --record FILE <.parquet .csv>  write what truly happened, .parquet or .csv; further starts
            of the autopilot get a number
        @rerun
        --view  show it in MuJoCo's viewer while it flies
        @quiet

    examples:
      helisim parm jr700 --out jr700.parm
      helisim sitl                               then, elsewhere:
        arducopter-heli --model JSON:127.0.0.1 --defaults jr700.parm
      helisim sitl blade360 --port 9012          for ArduPilot's instance 1, -I 1
      helisim sitl --script sysid --axes roll,pitch,yaw,thrust --log out.bin

    ArduPilot begins once a ground station is on its TCP port 5760, and sets the
    pace: --speedup N is an option of its own. Ctrl-C ends with a summary.

    --send adds fields that an answer may have: airspeed, wind (its vector, read by
    newer versions), windvane, rng (a range finder that looks down), no_time_sync
    (ArduPilot keeps its own frame rate).

    --script starts ArduPilot itself, in a network of its own, and flies it: hover
    (5 minutes at 5 m), square, sysid (sweeps by its mode SystemID), or FILE.py,
    whose function fly(pilot) is a script of your own:

      def fly(pilot):
          yield from pilot.take_off(5.0)
          yield from pilot.wait(10.0)
          yield from pilot.land()

    --into says where sysid adds its signal: input, recovery, rate, mixer, position,
    velocity, velocity-input. Each sweep begins where the first did.

    @about_ground
    """
    from helisim.show.viewer import check_display
    from helisim.sitl import Link
    from helisim.sitl.link import check_fields

    if not o.wait > 0.0:
        raise InputError(f"--wait must be above 0 s, got {o.wait:g}")
    if o.view:
        check_display()
    also = check_fields(o.send or ())
    if o.script is not None:
        script = _script(o)
        return _fly_script(o, script, _aircraft(o), also)
    _refuse_sweeps(o)
    for name in ("log", "ardupilot", "parm"):
        if getattr(o, name) is not None:
            raise InputError(
                f"--{name} is of a flight that --script flies; ArduPilot that you start yourself "
                "keeps its log in its own folder, logs/"
            )
    with Link(o.port, address=o.address, timeout=o.wait) as link:
        return _serve(o, _aircraft(o), link, also)


def _aircraft(o: Options) -> "Aircraft":
    from helisim.sitl import Aircraft

    return Aircraft(
        loaded(o),
        motor=parameters(o).get("drive.governor") != "ideal",
        tail=o.tail,
        rate_hz=o.rate,
        ground=ground(o),
        weather=weather(o),
        seed=o.seed,
        recorded=o.record is not None or o.rerun is not None,
    )


def _serve(o: Options, aircraft: "Aircraft", link: "Link", also: Sequence[str]) -> int:
    """Let an autopilot fly an aircraft until it is over; return the exit status."""
    from helisim.sitl.link import Backend

    if not o.quiet:
        _say(_listening(o, link))
    written = _Written(o, aircraft)
    status = None if o.quiet else _Status(aircraft)
    with ExitStack() as stack:
        stack.enter_context(aircraft)
        watched = stack.enter_context(_window(aircraft)) if o.view else None

        def on_frame(frame: "Frame", sensed: "Sensed") -> bool:
            if status is not None:
                status(frame, sensed)
            return watched is not None and watched.on_frame(frame, sensed)

        backend = Backend(
            aircraft,
            link,
            on_frame=on_frame if status or watched else None,
            on_wait=watched.on_wait if watched else None,
            on_restart=written.write,
            also=also,
        )
        # a polite end by another program is one by Ctrl-C, so that what was flown is written
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            backend.run()
        except KeyboardInterrupt:
            if not backend.served.frames:
                raise
        except DivergedError:
            written.write()
            raise
        finally:
            signal.signal(signal.SIGTERM, before)
    if backend.served.frames:
        written.write()
    _say(f"Flown: {backend.served}")
    return 0


def _listening(o: Options, link: "Link") -> str:
    out = "" if link.port == 9002 else f" --sim-port-out {link.port}"
    host = "127.0.0.1" if link.address in ("127.0.0.1", "0.0.0.0") else link.address
    name = Path(o.vehicle).name
    how_long = f", for {o.wait:g} s" if math.isfinite(o.wait) else ""
    return (
        f"{name} stands on the ground, rotor stopped. Listening on UDP {link.address}:"
        f"{link.port}{how_long}; start ArduPilot with\n"
        f"  helisim parm {o.vehicle} --out {name}.parm\n"
        f"  arducopter-heli --model JSON:{host}{out} --defaults {name}.parm\n"
        "and a ground station on its TCP port 5760, for which it waits. Ctrl-C ends."
    )


class _Status:
    """Says where the helicopter is, now and then, and that it has crashed."""

    def __init__(self, aircraft: "Aircraft") -> None:
        self._aircraft, self._crashed = aircraft, ""
        self._next = self._clock = time.monotonic()
        self._time = 0.0

    def __call__(self, frame: "Frame", sensed: "Sensed") -> None:
        if self._aircraft.crashed != self._crashed:
            self._crashed = self._aircraft.crashed
            if self._crashed:
                crash = f"crashed: {self._crashed}; start ArduPilot anew to fly on"
                _say(f"{sensed.time:7.1f} s  {crash}")
        now = time.monotonic()
        if now >= self._next:
            factor = (sensed.time - self._time) / max(now - self._clock, 1e-3)
            north, east, down = sensed.position
            _say(
                f"{sensed.time:7.1f} s  north {north:z.2f}, east {east:z.2f}, "
                f"height {-down:z.2f} m  x{max(factor, 0.0):.1f}  "
                f"pulses {' '.join(map(str, frame.pulses[:8]))}"
            )
            self._next, self._clock, self._time = now + _EACH, now, sensed.time


class _Written:
    """Writes what was flown since the autopilot started, each time to a file of its own."""

    def __init__(self, o: Options, aircraft: "Aircraft") -> None:
        self._options, self._aircraft, self._number = o, aircraft, 0

    def write(self) -> None:
        """Write the record and the recording that are asked for."""
        from helisim.records.storage import write_record

        o = self._options
        if o.record is None and o.rerun is None:
            return
        self._number += 1
        try:
            record = self._aircraft.record()
        except InputError as error:
            _say(f"Not written: {error}")
            return
        if o.record is not None:
            path = self._numbered(o.record)
            write_record(record, path)
            print_written(o, f"{path} ({record.duration:.2f} s, {len(record.names)} channels)")
        if o.rerun is not None:
            path, folder = self._numbered(o.rerun), self._aircraft.vehicle.folder
            write_recording(path, {path.stem: record}, vehicle=folder, quiet=o.quiet)

    def _numbered(self, path: Path) -> Path:
        return path if self._number == 1 else path.with_stem(f"{path.stem}_{self._number}")


@contextmanager
def _window(aircraft: "Aircraft") -> "Iterator[Watched]":
    """Show an aircraft in MuJoCo's viewer as long as the block lasts."""
    from helisim.show.viewer import Watched, seen, shown

    flight = seen(aircraft)
    with shown(flight) as window:
        yield Watched(aircraft, flight, window)


def _say(text: str) -> None:
    """Print at once: another program waits for what is said here."""
    print(text, flush=True)


def _script(o: Options) -> "Callable[[Pilot], Steps]":
    """Return the script that the options ask for, if it can be flown. Raises HelisimError."""
    from helisim.sitl.pilot import mavlink
    from helisim.sitl.process import find_program
    from helisim.sitl.session import SYSID, script_of
    from helisim.sitl.systemid import fly_sweeps, sweeps

    if not o.speed > 0.0:
        raise InputError(f"--speed must be above 0, got {o.speed:g}")
    if not 10.0 <= o.height <= 1000.0:
        raise InputError(f"--height must be 10 to 1000 m, got {o.height:g}")
    if o.parm is None and o.tail != "direct":
        raise InputError(
            "--tail gyro needs parameters that leave the tail to it: give --parm FILE, with "
            "H_TAIL_TYPE 1 and no gains of ATC_RAT_YAW but FF"
        )
    if o.script != SYSID:
        _refuse_sweeps(o)
        script = script_of(o.script)
    else:
        given = {field: getattr(o, f"sweep_{field}") for field in _CHANGED}
        changes = {field: value for field, value in given.items() if value is not None}
        wanted = sweeps(o.axes, o.into, count=o.count, **changes)
        if o.log is None:
            raise InputError(
                "sweeps are flown for their log: say where it goes with --log FILE.bin"
            )
        script = fly_sweeps(wanted, height=o.height)
    find_program(o.ardupilot)
    mavlink()
    return script


def _refuse_sweeps(o: Options) -> None:
    """Refuse what only the sweeps of sysid have."""
    given = [f"--{name}" for name, usual in _USUAL.items() if getattr(o, name) != usual]
    parts = zip(_FLAGS, _CHANGED)
    given += [f"--{flag}" for flag, field in parts if getattr(o, f"sweep_{field}") is not None]
    if given:
        raise InputError(f"{', '.join(given)}: of the sweeps that --script sysid flies")


def _fly_script(
    o: Options, script: "Callable[[Pilot], Steps]", aircraft: "Aircraft", also: tuple[str, ...]
) -> int:
    """Fly an aircraft by ArduPilot and a script; return the exit status."""
    from helisim.sitl.process import find_program
    from helisim.sitl.session import fly_script

    own, source = _parameters(o, aircraft.vehicle)
    told = _Told(aircraft, o.quiet)
    told(f"parameters: {source}")
    with ExitStack() as stack:
        watched = stack.enter_context(_window(aircraft)) if o.view else None

        def on_frame(frame: "Frame", sensed: "Sensed") -> bool:
            told.now_and_then()
            return watched is not None and watched.on_frame(frame, sensed)

        try:
            flight = fly_script(
                script,
                aircraft,
                find_program(o.ardupilot),
                own,
                log=o.log,
                speed=o.speed,
                say=told,
                on_frame=on_frame,
                on_wait=watched.on_wait if watched else None,
                also=also,
            )
        finally:  # what led to a crash is in the record
            if aircraft.time > 0.0:
                _Written(o, aircraft).write()
    if o.log is not None:
        print(f"Written: {o.log} ({o.log.stat().st_size / 1e6:.1f} MB)")
        if flight.lost:
            print(f"The log lacks {flight.lost} messages: fly with a lower --speed")
    _say(f"Flown: {flight.served}")
    return 0


def _parameters(o: Options, vehicle: "Vehicle") -> tuple[str, str]:
    """Return ArduPilot's parameters and where they are from: given, the vehicle's own, or made."""
    path = o.parm or vehicle.folder / f"{vehicle.name}.parm"
    if o.parm is None and (o.tail == "gyro" or not path.is_file()):
        from helisim.sitl.parameters import parameters_for

        made = parameters_for(vehicle, gyro=o.tail == "gyro")
        return made.text, f"made from {vehicle.name}, as helisim parm does"
    try:
        return path.read_text(encoding="utf-8"), str(path)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: can't read ArduPilot's parameters: {error}") from None


class _Told:
    """Says what happens, and now and then how far the flight is, on standard error."""

    def __init__(self, aircraft: "Aircraft", quiet: bool) -> None:
        self._aircraft, self._quiet, self._last = aircraft, quiet, ""
        self._start = self._next = time.monotonic()

    def __call__(self, text: str) -> None:
        self._last, self._next = text, 0.0
        self.now_and_then()

    def now_and_then(self) -> None:
        """Repeat what was said last, if that is a while ago."""
        now, seconds = time.monotonic(), self._aircraft.time
        if now < self._next:
            return
        self._next = now + _EACH
        if not self._quiet:
            factor = seconds / max(now - self._start, 1e-3)
            print(f"{seconds:7.1f} s (x{factor:.1f})  {self._last}", file=sys.stderr, flush=True)


def parm(o: Options) -> int:
    """Write parameters with which ArduPilot flies a vehicle, derivation included.

    Write a parameter file with which ArduCopter-heli flies a vehicle: swashplate, collective, tail
    and rotor from its files, gains from a model of it, with the margins that they give. Prints what
    each follows from.

    Options:
        @vehicle
        --from/source SOURCE  what gains come from: a folder of helisim reproduce or of sweeps, an
            autopilot's log of SystemID's sweeps, .bin, or a model of helisim identify, .json
            (default: the exact linearisation)
        --tail direct|gyro <=direct>  direct: ArduPilot moves the tail servo (default); gyro: the
            vehicle's own yaw gyro does, as of helisim sitl --tail gyro
        --out FILE <.parm .param>  the file, .parm
        @seed: of the servos' bench test
        @quiet

    examples:
      helisim parm jr700 --out jr700.parm               from its exact linear model
      helisim parm jr700 --from reproduction --out jr700.parm
                                                        from what was identified
      helisim parm myheli --from flight.bin --out myheli.parm
                                                        from what ArduPilot logged
    """
    from helisim.sitl.aircraft import TAILS
    from helisim.study.tune import autopilot_parameters

    if o.tail not in TAILS:
        raise UnknownNameError("tail", o.tail, TAILS)
    own = autopilot_parameters(o.vehicle, o.source, gyro=o.tail == "gyro", seed=o.seed)
    print(own.text, end="")
    if o.out is not None:
        own.write(o.out)
        print_written(o, o.out)
    return 0


def ardupilot(o: Options) -> int:
    """Write identified models for ArduPilot's state-space simulation.

    Write what was identified as the JSON of ArduPilot's state-space helicopter, or show such a
    file.

    Options:
        models MODEL <many>  of identify, .json, where two say one thing the first does; a folder of
            helisim reproduce; or a file of ArduPilot's alone
        --out FILE <.json>  the file, .json
        --rpm RPM  of the main rotor
        --lean DEG <=0>  of the hover, to the right (0)
        --hover SHARE <=0.5>  collective of the hover, of its range (0.5)
        --full NAME=X,... <named>  what ArduPilot's 1 is in the records' unit
            (col=1,lon=0.5,lat=0.5,ped=0.5)
        --late NAME=S,... <named>  by how much a channel is recorded late, s (default: 0, or what a
            folder's records say)
        --set NAME=X,... <named>  further numbers of the file, in its units, such as Nv=1.7
        @quiet

    examples:
      helisim ardupilot rollpitch.json yaw.json heave.json --rpm 1700 \\
          --late r=0.0405 --out heli.json
      helisim ardupilot reproduction --rpm 1700 --out heli.json
      helisim ardupilot heli.json                  what such a file says

    The file is of ArduPilot's pull request 29462, "Add Statespace model support to
    SITL", frame -heli. Its servos are delays; what else it can't say is printed.
    """
    from helisim.base.units import RAD_S_PER_RPM
    from helisim.ident import ArduPilotModel

    if o.out is None:
        if len(o.models) > 1 or o.models[0].is_dir():
            raise InputError("--out FILE is missing; without it one file of ArduPilot's is shown")
        _print_model(ArduPilotModel.read(o.models[0]))
        return 0
    if o.rpm is None:
        raise InputError("--rpm is missing: the speed of the main rotor, 1/min")
    fits, late = _fits(o.models)
    model = ArduPilotModel.of(
        fits,
        rotor_speed=o.rpm * RAD_S_PER_RPM,
        hover_lean=math.radians(o.lean),
        hover=o.hover,
        full=o.full,
        late=late | o.late,
        others=o.set,
    )
    model.write(o.out)
    _print_model(model)
    print_written(o, o.out)
    return 0


def _fits(paths: list[Path]) -> "tuple[list[Fit], dict[str, float]]":
    """Return the models, and by how much their channels are recorded late."""
    from helisim.ident import load_fit

    if not paths[0].is_dir():
        return [load_fit(path) for path in paths], {}
    from helisim.study.design_chain import identify_for_design

    plant: Any = identify_for_design(paths[0])
    return list(plant.fits), dict(plant.late)


def _print_model(model: "ArduPilotModel") -> None:
    """Print the numbers, and what the file can't say."""
    width = max(map(len, model.values))
    for name, value in model.values.items():
        print(f"{name:<{width}}  {value:.6g}")
    for remark in model.remarks:
        print(wrapped(remark, indent=2))
