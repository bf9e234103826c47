"""`helisim fly`: fly a plan once or many times, and record."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import DivergedError, InputError, UnknownNameError
from helisim.cli.common import (
    add_common,
    add_controller,
    add_integrator,
    add_vehicle,
    controlled,
    named_numbers,
    parameters,
    print_written,
    write_recording,
)
from helisim.cli.ground import EPILOG as GROUND
from helisim.cli.ground import add_ground, ground
from helisim.cli.manoeuvres import EPILOG as MANOEUVRES
from helisim.cli.manoeuvres import add_manoeuvre, is_asked, manoeuvre
from helisim.cli.missions import EPILOG as MISSIONS
from helisim.cli.missions import add_mission, mission
from helisim.cli.progress import Progress
from helisim.cli.weather import add_weather, weather
from helisim.records.channels import AXES

if TYPE_CHECKING:
    from helisim.records.record import FlightRecord
    from helisim.sim import Excitation, FlightEnvelope, FlightPlan
    from helisim.sim.missions import Mission
    from helisim.vehicle import Vehicle

_EPILOG = """\
examples:
  helisim fly --axis lat --duration 90 --seed 1 --out lat.parquet
  helisim fly --axis lat --count 40 --out flights
  helisim fly --axis ped --turbulence light --amplitude 0.04 --out gusty.parquet
  helisim fly --axis lat --excitation doublet,width=0.5 --out doublet.parquet
  helisim fly --axis lat --turbulence light --print-plan > gusty.toml
  helisim fly --plan gusty.toml --seed 2 --out lat.parquet
  helisim fly --axis ped --controller my_laws:yaw --out ped.parquet
  helisim fly --mission forward,speed=20 --out forward.parquet

a plan is a TOML file with all that is flown: excitation, mission, pilot,
recorder, weather, ground, faults, envelope. Options beside --plan change what
it says, but --fault adds to its faults.

{manoeuvres}
{missions}
{ground}
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

A flight is terminated early where it leaves what the model is valid for. Its
record says so and the identification refuses it; last_second/ beside it keeps
how it came. Exit status 3. The limits of --envelope are
  tilt=1.2, rate=20                      rad, rad/s
  clearance=0                            m above the ground; with --ground that
                                         of the rotors alone
  touchdown=2.5                          m/s, on a ground that can be landed on
  flapping=1                             of the head's stop
  descent=2                              of the hover's induced velocity
  advance=0.3                            ratio of airspeed and tip speed
  saturation=1, saturation_window=10     s at a limit, out of s
"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "fly",
        help="fly sweeps, missions and other plans and record them",
        description="Fly one frequency sweep, a mission or another plan, once or many times, and "
        "write what the flight computer records.",
        epilog=_EPILOG.format(manoeuvres=MANOEUVRES, missions=MISSIONS, ground=GROUND),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_vehicle(command)
    command.add_argument("--plan", type=Path, metavar="FILE", help="fly this plan, .toml")
    command.add_argument(
        "--print-plan",
        action="store_true",
        help="print the whole plan as TOML, which --plan reads, and fly nothing",
    )
    add_manoeuvre(command, alone="")
    add_mission(command)
    command.add_argument(
        "--count",
        type=int,
        metavar="N",
        help="fly N times into the folder DIR, or go on where an earlier run stopped",
    )
    command.add_argument("--jobs", type=int, metavar="J", help="threads (default: all processors)")
    command.add_argument(
        "--out",
        type=Path,
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
    command.add_argument(
        "--rotor",
        action="store_true",
        help="record the rotor's true tilt and loads too, which a recording then shows as arrows "
        "and a tilting disc (implied by --rerun)",
    )
    add_controller(command)
    add_weather(command)
    add_ground(command)
    command.add_argument(
        "--envelope",
        action="append",
        default=[],
        metavar="LIMIT=VALUE|off",
        help="another limit, see below, or none: tilt=off; off alone: none at all",
    )
    add_integrator(command)
    add_common(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    plan = _plan(options)
    if not options.print_plan:
        _check(options)
    from helisim.vehicle import load

    vehicle = load(options.vehicle, parameters=parameters(options), integrator=options.integrator)
    vehicle = controlled(vehicle, options)
    plan = plan.on(vehicle)
    if (options.rotor or options.rerun is not None) and plan.recorder is not None:
        plan = replace(plan, recorder=replace(plan.recorder, rotor=True))
    if options.print_plan:
        print(plan.to_toml(), end="")
        return 0
    work = _one if options.count is None else _many
    return work(options, vehicle, plan)


def _plan(options: argparse.Namespace) -> "FlightPlan":
    """Return the plan that the options say. Raises InputError."""
    from helisim.sim import FlightPlan, parse_fault, read_plan

    faults = tuple(parse_fault(text) for text in options.fault)
    plan = None if options.plan is None else read_plan(options.plan)
    flown = mission(options, None if plan is None else plan.mission)
    if plan is None:
        if flown is None and not is_asked(options):
            raise InputError(
                f"say what is flown: --axis {'|'.join(AXES)}, --excitation KIND, --mission NAME, "
                "or --plan FILE"
            )
        plan = FlightPlan(excitation=_excitation(options, flown, None), mission=flown)
    else:
        excitation = _excitation(options, flown, plan.excitation)
        plan = replace(plan, excitation=excitation, mission=flown)
    return replace(
        plan,
        faults=(*plan.faults, *faults),
        weather=weather(options, plan.weather),
        ground=ground(options, plan.ground),
        envelope=_envelope(options.envelope, plan.envelope),
    )


def _excitation(
    options: argparse.Namespace, flown: "Mission | None", planned: "Excitation | None"
) -> "Excitation | None":
    """Return what is flown on purpose, or on top of a mission, None for nothing."""
    if flown is not None and planned is None and not is_asked(options):
        return None
    return manoeuvre(options, planned)


def _envelope(items: Sequence[str], envelope: "FlightEnvelope") -> "FlightEnvelope":
    """Return an envelope with the limits of --envelope. Raises InputError."""
    if "off" in items:
        if len(items) > 1:
            raise InputError("--envelope off has no limits: leave out the others")
        return envelope.off()
    unlimited = [item.partition("=")[0].strip() for item in items if item.endswith("=off")]
    values = named_numbers("--envelope", [item for item in items if not item.endswith("=off")])
    limits: dict[str, Any] = {**values, **dict.fromkeys(unlimited)}
    for name in limits:
        if name not in envelope.__dataclass_fields__:
            raise UnknownNameError("limit of --envelope", name, envelope.__dataclass_fields__)
    return replace(envelope, **limits)


def _check(options: argparse.Namespace) -> None:
    """Refuse what can't be written, before any time is spent."""
    from helisim.base.files import SUFFIXES, check_destination

    if options.out is None:
        raise InputError("say where to write: --out FILE, or --out DIR with --count")
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


def _one(options: argparse.Namespace, vehicle: "Vehicle", plan: "FlightPlan") -> int:
    from helisim.records.storage import write_record
    from helisim.sim import Flight, fly
    from helisim.sim.folder import write_flight

    try:
        with Progress(1, options.quiet) as advance:
            (record,) = fly(vehicle, plan, seed=options.seed, on_flight=lambda: advance("flight"))
    except DivergedError as error:
        if error.record is not None:
            beside = write_flight(Flight(error.record, error.last_second), options.out)
            print_written(options, f"{options.out}, as far as the flight went, and {beside}")
            _print_reached(options, error.record)
            _write_recording(options, vehicle, plan, error.record)
        for traceback in getattr(error, "__notes__", ()):  # of a controller that raised
            print(traceback, file=sys.stderr)
        raise
    write_record(record, options.out)
    print_written(
        options,
        f"{options.out} ({record.duration:.2f} s, {len(record)} samples, "
        f"{len(record.names)} channels)",
    )
    _print_reached(options, record)
    _write_recording(options, vehicle, plan, record)
    return 0


def _print_reached(options: argparse.Namespace, record: "FlightRecord") -> None:
    """Print what a mission reached, unless --quiet."""
    from helisim.sim.missions.reached import Reached

    if not options.quiet and "reached" in record.provenance:
        print(f"Reached: {Reached.from_dict(record.provenance['reached'])}")


def _write_recording(
    options: argparse.Namespace, vehicle: "Vehicle", plan: "FlightPlan", record: "FlightRecord"
) -> None:
    if options.rerun is not None:
        flown, quiet = {plan.name: record}, options.quiet
        write_recording(options.rerun, flown, vehicle=vehicle.folder, quiet=quiet)


def _many(options: argparse.Namespace, vehicle: "Vehicle", plan: "FlightPlan") -> int:
    from helisim.sim import fly_to

    with Progress(options.count, options.quiet) as advance:
        flown = fly_to(
            options.out,
            vehicle,
            plan,
            count=options.count,
            seed=options.seed,
            jobs=options.jobs,
            on_flight=lambda: advance("flight"),
        )
    there = f", {flown.found} of them there before" if flown.found else ""
    print_written(
        options,
        f"{options.out} ({len(flown.paths)} flights of {plan.duration:g} s{there})",
    )
    for path, why in flown.ended.items():
        print(f"helisim fly: {path}: {why}, where the flight was terminated early", file=sys.stderr)
    return 3 if flown.ended else 0
