"""`helisim fly`: sweeps, recorded."""

import argparse
import math
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.cli.common import (
    add_common,
    add_integrator,
    add_vehicle,
    named_numbers,
    parameters,
    tell_written,
    write_recording,
)
from helisim.cli.progress import Progress
from helisim.errors import DivergedError, InputError, UnknownNameError
from helisim.records.channels import AXES

if TYPE_CHECKING:
    from helisim.sim import Watch

_EPILOG = """\
examples:
  helisim fly --axis lat --duration 90 --seed 1 --out lat.parquet
  helisim fly --axis lat --count 40 --out flights
  helisim fly --axis ped --turbulence light --amplitude 0.04 --out gusty.parquet

a fault is PART:KIND[@SECONDS][,NAME=VALUE...]:
  servo_front:stuck@30                   where it is; with position=P, at P
  servo_tail:weak@30,rate_limit=1        slow; with travel=T, short
  gyro:restart@30,lasts=0.3              output=neutral or held meanwhile
  gyro:dropout@30,lasts=0.2,rates=p+q    reads=zero or held
  p:spikes,size=5,per_minute=6           of recorded channels: p, or p+q
  r:dropout@30,lasts=0.5                 reads=held or zero
  recorder:loss,share=0.01,burst=3
  recorder:gap@30,lasts=0.5
  recorder:drift,ppm=200                 channels=p+q+r: of these only

A flight is over where it leaves what the model is valid for. Its record says
so and the identification refuses it; last_second/ beside it keeps how it came.
Exit status 3. The limits of --watch are
  tilt=1.2, rate=20                      rad, rad/s
  clearance=0                            m above the ground
  flapping=1                             of the head's stop
  descent=2                              of the hover's induced velocity
  advance=0.3                            ratio of airspeed and tip speed
  saturation=1, saturation_window=10     s at a limit, out of s
"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "fly",
        help="fly sweeps and record them",
        description="Fly one frequency sweep, or many, and write what the flight computer records.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_vehicle(command)
    command.add_argument("--axis", required=True, metavar="AXIS", help="|".join(AXES))
    command.add_argument(
        "--duration", type=float, default=90.0, metavar="S", help="of the flight, s (default: 90)"
    )
    command.add_argument(
        "--amplitude",
        type=float,
        metavar="A",
        help="of the stick, unitised (default: the axis's own)",
    )
    command.add_argument(
        "--count",
        type=int,
        metavar="N",
        help="fly N sweeps into the folder DIR, or go on where an earlier run stopped",
    )
    command.add_argument("--jobs", type=int, metavar="J", help="threads (default: all processors)")
    command.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="FILE|DIR",
        help="record to write, .parquet or .csv; with --count a folder of them",
    )
    command.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="FAULT",
        help="of servo, gyro, sensor or recorder, see below; may be given again",
    )
    _add_weather(command)
    command.add_argument(
        "--watch",
        action="append",
        default=[],
        metavar="LIMIT=VALUE|off",
        help="another limit, see below, or none: tilt=off; off alone: none at all",
    )
    add_integrator(command)
    add_common(command)
    command.set_defaults(run=_run)


def _add_weather(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--turbulence",
        metavar="LEVEL|M/S",
        help="light, moderate or severe (Dryden, MIL-F-8785C), or the wind at 20 ft that makes "
        "it, m/s (default: calm)",
    )
    command.add_argument(
        "--wind", type=float, default=0.0, metavar="M/S", help="steady wind, m/s (default: 0)"
    )
    command.add_argument(
        "--wind-from-deg",
        type=float,
        default=0.0,
        metavar="DEG",
        help="where it comes from; flights head north: 0 is a headwind, 90 from the right",
    )


def _weather(options: argparse.Namespace) -> Any:
    from helisim.sim import Weather

    turbulence = options.turbulence
    with suppress(TypeError, ValueError):
        turbulence = float(turbulence)
    return Weather(
        wind=options.wind, wind_from=math.radians(options.wind_from_deg), turbulence=turbulence
    )


def _run(options: argparse.Namespace) -> int:
    from helisim.sim import Recorder, Sweep, parse_fault
    from helisim.vehicle import load

    faults = [parse_fault(text) for text in options.fault]
    sweep = Sweep(axis=options.axis, duration=options.duration, amplitude=options.amplitude)
    watch, weather = _watch(options.watch), _weather(options)
    _check(options)
    vehicle = load(options.vehicle, parameters=parameters(options), integrator=options.integrator)
    how = {
        "seed": options.seed,
        "recorder": Recorder.of(vehicle, rotor=options.rerun is not None),
        "faults": faults,
        "weather": weather,
        "watch": watch,
    }
    work = _one if options.count is None else _many
    return work(options, vehicle, sweep, how)


def _watch(items: Sequence[str]) -> "Watch":
    """Return what --watch says. Raises InputError."""
    from helisim.sim import Watch

    if "off" in items:
        if len(items) > 1:
            raise InputError("--watch off watches nothing: leave out the other limits")
        return Watch.off()
    unwatched = [item.partition("=")[0].strip() for item in items if item.endswith("=off")]
    values = named_numbers("--watch", [item for item in items if not item.endswith("=off")])
    limits = {**values, **dict.fromkeys(unwatched)}
    for name in limits:
        if name not in Watch.__dataclass_fields__:
            raise UnknownNameError("limit of --watch", name, Watch.__dataclass_fields__)
    return replace(Watch(), **limits)


def _check(options: argparse.Namespace) -> None:
    """Refuse what can't be written, before any time is spent."""
    from helisim.records.files import SUFFIXES, check_destination

    if options.count is None:
        check_destination(options.out)
        if options.rerun is not None:
            check_destination(options.rerun, (".rrd",))
        return
    if options.rerun is not None:
        raise InputError("--rerun shows one flight: leave out --count")
    if options.out.suffix.lower() in SUFFIXES:
        raise InputError(
            f"with --count, --out is a folder, and {options.out} is the name of a record"
        )


def _one(options: argparse.Namespace, vehicle: Any, sweep: Any, how: dict[str, Any]) -> int:
    from helisim.records.storage import write_record
    from helisim.sim import fly
    from helisim.sim.folder import write_flight

    try:
        with Progress(1, options.quiet) as advance:
            (record,) = fly(vehicle, sweep, **how, on_flight=lambda: advance("flight"))
    except DivergedError as error:
        if error.record is not None:
            beside = write_flight(error.record, error.last_second, options.out)
            tell_written(options, f"{options.out}, as far as the flight went, and {beside}")
            _write_recording(options, vehicle, error.record)
        raise
    write_record(record, options.out)
    tell_written(
        options,
        f"{options.out} ({record.duration:.2f} s, {len(record)} samples, "
        f"{len(record.names)} channels)",
    )
    _write_recording(options, vehicle, record)
    return 0


def _write_recording(options: argparse.Namespace, vehicle: Any, record: Any) -> None:
    if options.rerun is not None:
        flown, quiet = {options.axis: record}, options.quiet
        write_recording(options.rerun, flown, vehicle=vehicle.name, quiet=quiet)


def _many(options: argparse.Namespace, vehicle: Any, sweep: Any, how: dict[str, Any]) -> int:
    from helisim.sim import fly_to

    with Progress(options.count, options.quiet) as advance:
        flown = fly_to(
            options.out,
            vehicle,
            sweep,
            count=options.count,
            **how,
            jobs=options.jobs,
            on_flight=lambda: advance("flight"),
        )
    there = f", {flown.found} of them there before" if flown.found else ""
    tell_written(
        options, f"{options.out} ({len(flown.paths)} flights of {options.duration:g} s{there})"
    )
    for path, why in flown.ended.items():
        print(f"helisim fly: {path}: {why}, where the flight was over", file=sys.stderr)
    return 3 if flown.ended else 0
