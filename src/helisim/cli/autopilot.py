"""Commands about ArduPilot: it flies a vehicle, and the parameters with which it does."""

import math
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from helisim.base.errors import InputError
from helisim.base.files import numbered, read_text
from helisim.cli.flying import ground, weather
from helisim.cli.options import (
    Options,
    loaded,
    numbers_by_name,
    parameters,
    print_rows,
    print_written,
    wrapped,
    write_recording,
)

if TYPE_CHECKING:
    from helisim.sitl import Aircraft, Frame, Link, Sensed
    from helisim.sitl.pilot import Pilot, Steps

# Signals of a polite end by another program, or of the terminal, where there is one
_ENDS = (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM))
_EACH = 10.0  # s of the clock between two lines that say how far a flight is


def sitl(o: Options) -> None:
    """Let ArduPilot fly the helicopter.

    Let an unmodified ArduCopter-heli fly the helicopter by ArduPilot's JSON interface, in lock
    step, from the ground with the rotor stopped.

    Options:
        @vehicle
        --port N <=9002>  UDP, to listen on (default: 9002)
        --address IP <=127.0.0.1>  to listen on (default: 127.0.0.1; 0.0.0.0: all)
        --wait S <=60>  for first frame, after the last, s (default: 60, or inf)
        --seed N <=1>  of the turbulence (default: 1)
        --vibration  the autopilot's gyros and accelerometers shake, by [vibration] of
            the vehicle's parameters
        @weather
        @ground
        @set
        flights by a script:
        --script NAME  hover, sysid[,NAME=VALUE...] or your own FILE.py; see below
        --log FILE <.bin>  keep ArduPilot's log, .bin
        --ardupilot FILE <text>  arducopter-heli (default: HELISIM_ARDUPILOT)
        --parm FILE  parameters (default: VEHICLE.parm, or of helisim ardupilot parm)
        --axes AXIS,... <names>  of sysid (default: roll,pitch,yaw,thrust)
        options:
        --record FILE <.parquet .csv>  write the true motion, .parquet or .csv, numbered
        @rerun
        --view  show it in MuJoCo's viewer while it flies: height, mode and sticks
            of a script's flight, too; of another one height and pulses
        @quiet

    examples:
      helisim ardupilot parm --vehicle jr700 --out jr700.parm
      helisim sitl                               then, elsewhere:
        arducopter-heli --model JSON:127.0.0.1 --defaults jr700.parm
      helisim sitl --vehicle blade360 --port 9012     for ArduPilot's instance -I 1
      helisim sitl --script sysid --axes roll,pitch,yaw,thrust --log out.bin

    ArduPilot begins once a ground station is on its TCP port 5760, and sets the
    pace (its option --speedup N). Ctrl-C ends with a summary.

    --script starts ArduPilot itself and flies it: hover (5 minutes at 5 m), sysid
    (sweeps by its mode SystemID, at 50 m; their settings are magnitude, start_hz,
    stop_hz, seconds: sysid,seconds=120,start_hz=0.1), or FILE.py with fly(pilot):

      def fly(pilot):
          yield from pilot.take_off(5.0)
          yield from pilot.wait(10.0)
          yield from pilot.land()
    """
    from helisim.sitl import Aircraft, Link

    for one in _ENDS:  # are an end by Ctrl-C, so that what was flown is written
        if signal.getsignal(one) is signal.SIG_DFL:  # nohup ignores the terminal's
            signal.signal(one, signal.default_int_handler)
    given = [f"--{name}" for name in ("log", "ardupilot", "parm", "axes") if getattr(o, name)]
    if given and o.script is None:
        raise InputError(f"{', '.join(given)}: of a flight that --script flies")
    script = None if o.script is None else _script(o)
    aircraft = Aircraft(
        loaded(o),
        motor=parameters(o).get("drive.governor") != "ideal",
        ground=ground(o),
        weather=weather(o),
        seed=o.seed,
        recorded=o.record is not None or o.rerun is not None,
        vibration=o.vibration,
    )
    if script is not None:
        return _fly_script(o, script, aircraft)
    with Link(o.port, address=o.address, timeout=o.wait) as link:
        return _serve(o, aircraft, link)


def _serve(o: Options, aircraft: "Aircraft", link: "Link") -> None:
    from helisim.sitl import serve

    write = _writer(o, aircraft)
    with _watched(o, aircraft) as (_, calls):
        if not o.quiet:
            _say(_listening(o, link))
        try:
            serve(aircraft, link, on_restart=write, **calls)
        except KeyboardInterrupt:
            if not link.served.frames:
                raise
        finally:
            if link.served.frames:
                write()
    _say(f"Flown: {link.served}")


def _listening(o: Options, link: "Link") -> str:
    name = Path(o.vehicle).name
    host = "127.0.0.1" if link.address == "0.0.0.0" else link.address
    return (
        f"{name} stands on the ground, rotor stopped. Listening on UDP {link.address}:"
        f"{link.port}{f', for {o.wait:g} s' if math.isfinite(o.wait) else ''}; start ArduPilot "
        "with\n"
        f"  helisim ardupilot parm --vehicle {o.vehicle} --out {name}.parm\n"
        f"  arducopter-heli --model JSON:{host}"
        f"{'' if link.port == 9002 else f' --sim-port-out {link.port}'} --defaults {name}.parm\n"
        "and a ground station on its TCP port 5760, for which it waits. Ctrl-C ends."
    )


def _writer(o: Options, aircraft: "Aircraft") -> Callable[[], None]:
    from helisim.records.storage import write_record

    records, recordings = (None if path is None else numbered(path) for path in (o.record, o.rerun))

    def write() -> None:
        if not (records or recordings):
            return
        try:
            record = aircraft.record()
        except InputError as error:
            return _say(f"Not written: {error}")
        if records:
            path = write_record(record, next(records))
            print_written(o, f"{path} ({record.duration:.2f} s, {len(record.names)} channels)")
        if recordings:
            path = next(recordings)
            write_recording(o, path, {path.stem: record}, aircraft.vehicle.folder)

    return write


@contextmanager
def _watched(
    o: Options, aircraft: "Aircraft", pilots: "Sequence[Pilot]" = ()
) -> Iterator[tuple[Callable[[str], None], dict[str, Any]]]:
    from helisim.show.viewer import Watched, seen, shown

    start = time.monotonic()
    last, due, pulses = "waits", start, tuple[int, ...]()

    def tell(text: str) -> None:
        nonlocal last, due
        last, now = text, time.monotonic()
        due = now + _EACH
        if not o.quiet:
            factor = aircraft.time / max(now - start, 1e-3)
            _say(f"{aircraft.time:7.1f} s (x{factor:.1f})  {text}", file=sys.stderr)

    def told() -> dict[str, str]:
        return pilots[-1].shown if pilots else {"pulses": " ".join(map(str, pulses[:8]))}

    def on_frame(frame: "Frame", sensed: "Sensed") -> bool:
        nonlocal pulses
        pulses = frame.pulses
        anew = "" if pilots else "; start ArduPilot anew"
        crash = aircraft.crashed and f"crashed: {aircraft.crashed}{anew}"
        if (crash and crash != last) or time.monotonic() >= due:
            tell(crash or ("flies" if last == "waits" else last))
        return watched is not None and watched.on_frame(frame, sensed)

    def on_wait() -> bool:
        return watched is not None and watched.on_wait()

    with ExitStack() as stack:
        watched = None
        if o.view:
            flight = seen(aircraft)
            watched = Watched(aircraft, flight, stack.enter_context(shown(flight)), told=told)
        yield tell, {"on_frame": on_frame, "on_wait": on_wait}


def _say(text: str, file: TextIO | None = None) -> None:
    print(text, file=file, flush=True)


def _script(o: Options) -> "Callable[[Pilot], Steps]":
    """Return the script that the options ask for. Raises HelisimError."""
    from helisim.base.settings import read_settings
    from helisim.sitl import Sweep, fly_sweeps, sweeps
    from helisim.sitl.session import SYSID, script_of

    name, *settings = o.script.split(",")
    if name == SYSID and o.log is None:
        raise InputError("sweeps are flown for their log: say where it goes with --log FILE.bin")
    if name == SYSID:
        axes = o.axes or ("roll", "pitch", "yaw", "thrust")
        return fly_sweeps(sweeps(axes, **read_settings(Sweep, settings, f"script {SYSID}")))
    if o.axes:
        raise InputError(f"--axes: of the sweeps that --script {SYSID} flies")
    return script_of(o.script)


def _fly_script(o: Options, script: "Callable[[Pilot], Steps]", aircraft: "Aircraft") -> None:
    from helisim.sitl import find_program, fly_script

    program = find_program(o.ardupilot)
    own, source = _parameters(o)
    pilots: list[Pilot] = []

    def seen(pilot: "Pilot") -> "Steps":
        pilots.append(pilot)
        return script(pilot)

    with _watched(o, aircraft, pilots) as (tell, calls):
        tell(f"parameters: {source}")
        try:
            flight = fly_script(seen, aircraft, program, own, log=o.log, say=tell, **calls)
        finally:  # what led to a crash is in the record, which another signal doesn't lose
            heard = {one: signal.signal(one, lambda *_: None) for one in {signal.SIGINT, *_ENDS}}
            if aircraft.time > 0.0:
                _writer(o, aircraft)()
            for one, before in heard.items():
                signal.signal(one, before)
    if o.log is not None:
        print_written(o, f"{o.log} ({o.log.stat().st_size / 1e6:.1f} MB)")
        if flight.lost:
            print(f"The log lacks {flight.lost} messages")
    _say(f"Flown: {flight.served}")


def _parameters(o: Options) -> tuple[str, str]:
    """Return a file's text and where it is from; made ones are of calm air."""
    from helisim.sitl.parameters import parameters_for

    vehicle = loaded(o)
    path = o.parm or vehicle.folder / f"{vehicle.name}.parm"
    if o.parm is None and not path.is_file():
        return parameters_for(vehicle).text, f"made of {vehicle.name}, as by helisim ardupilot parm"
    return read_text(path), str(path)


def ardupilot(_: Options) -> None:
    """Write ArduPilot's parameters, or models for its simulation.

    What ArduPilot needs of a vehicle or of what was identified. It flies by helisim sitl.

    examples:
      helisim ardupilot parm --vehicle jr700 --out jr700.parm
      helisim ardupilot export model-*.json --rpm 1700 --out heli.json
    """


def ardupilot_parm(o: Options) -> None:
    """Write parameters with which ArduPilot flies a vehicle, derivation included.

    Write ArduCopter-heli's parameters: swashplate, collective, tail and rotor from the vehicle's
    files, gains from a model of it. Prints each one's origin, and the margins.

    Options:
        @vehicle
        --from/source SOURCE  of gains: folder of helisim reproduce or of sweeps, log of
            SystemID, .bin, or model, .json (default: the exact linearisation)
        --out FILE <.parm .param>  the file, .parm
        @seed: of the servos' bench test
        @quiet

    examples:
      helisim ardupilot parm --out jr700.parm           from its exact linear model
      helisim ardupilot parm --from reproduction --out jr700.parm       from models
      helisim ardupilot parm --vehicle myheli --from flight.bin --out myheli.parm
    """
    from helisim.study.tune import autopilot_parameters

    own = autopilot_parameters(o.vehicle, o.source, seed=o.seed)
    print(own.text, end="")
    if o.out is not None:
        own.write(o.out)
        print_written(o, o.out)


def ardupilot_export(o: Options) -> None:
    """Write identified models for ArduPilot's state-space simulation.

    Options:
        models MODEL <some>  of identify, .json; where two say one thing the first does
        --out FILE <must .json>  the file, .json
        --late NAME=S,... <many>  by how much a channel is recorded late, s
        what models say of their flights, unless said here:
        --rpm RPM  of the main rotor
        --lean DEG  of the hover, to the right
        --hover SHARE  collective of the hover, of its range
        --full NAME=X,... <many>  a command at ArduPilot's 1, in the model's unit
        options:
        @quiet

    examples:
      helisim ardupilot export model-*.json --rpm 1700 --out heli.json
      helisim ardupilot export yaw.json --late r=0.0405 --out heli.json

    The file is of ArduPilot's pull request 29462, frame -heli. Its servos are
    delays; what else it can't hold is printed, and where each number is from.
    """
    from helisim.base.units import RAD_S_PER_RPM
    from helisim.ident import ArduPilotModel, load_fit

    model = ArduPilotModel.of(
        [load_fit(path) for path in o.models],
        rotor_speed=o.rpm and o.rpm * RAD_S_PER_RPM,
        hover_lean=o.lean and math.radians(o.lean),
        hover=o.hover,
        full=numbers_by_name("--full", o.full),
        late=numbers_by_name("--late", o.late),
    )
    model.write(o.out)
    print_rows({name: f"{value:.6g}" for name, value in model.values.items()})
    for remark in model.remarks:
        print(wrapped(remark, indent=2))
    print_written(o, o.out)
