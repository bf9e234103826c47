"""Commands about vehicles: their linear models, trims, ground tests, parameters and folders."""

import math

from helisim.base.errors import InputError, single_line
from helisim.cli.options import (
    Options,
    loaded,
    print_written,
    progress,
    replace_parameter_file,
    worded,
    write_data,
)

FORMAT = "helisim level flights, version 1"
_MOST = 1000  # Speeds; more are a mistake in the step


def vehicle_linearize(o: Options) -> None:
    """Print the exact linearisation at the hover.

    Print the exact linearisation at the hover.

    Options:
        @subject
        --inputs IN <=IN1>  IN1 (servo commands to motion, default) or IN2 (sticks to motion)
        @json: matrices and names
        @controller
        @slung
        @set

    example: helisim vehicle linearize --inputs IN2 --json
    """
    from helisim.records.record import made_by
    from helisim.show.terminal import render_derivatives

    vehicle = loaded(o)
    linear = vehicle.linearize(o.inputs)
    print(render_derivatives(linear, vehicle.derivatives))
    made = made_by("linearization", **vehicle.provenance)
    write_data(o, {**linear.to_dict(), "derivatives": vehicle.derivatives, "provenance": made})


def vehicle_trim(o: Options) -> None:
    """Trim level flight over a range of speeds: power, controls, attitude.

    Solve steady level flight at each speed, and print power, controls, attitude and disc tilt.

    Options:
        @subject
        --speeds LIST <=0:20:2>  m/s, FROM:TO:STEP or separated by commas (default: 0:20:2)
        --height H <float>  m above the ground (default: 10)
        --inputs IN <=IN1>  of the linearisations: IN1 (servo commands, default) or IN2 (sticks)
        @json: trims and linearisations
        @slung
        @set
        @quiet

    examples:
      helisim vehicle trim --speeds 0:20:1 --json trim.json
      helisim vehicle trim --set air.ground_effect=1 --height 0.5

    With --json each speed has its exact linearisation and derivatives.
    """
    from helisim.records.record import made_by
    from helisim.show.terminal import render_trims
    from helisim.vehicle.trim import HEIGHT

    speeds, height = speeds_of(o.speeds), HEIGHT if o.height is None else o.height
    flights = [loaded(o)]
    with progress(len(speeds), o.quiet, unit="speed") as advance:
        for speed in speeds:  # each search starts from the flight before
            flights.append(flights[-1].trimmed(speed=speed, height=height))
            advance(f"{speed:g} m/s")
    del flights[0]
    if o.json is not None:
        found = [
            {
                "speed_m_s": flight.trim.speed,
                "power_w": flight.power,
                **flight.linearize(o.inputs).to_dict(),
                "derivatives": flight.derivatives,
            }
            for flight in flights
        ]
        made = made_by("level flights", **flights[0].provenance)
        write_data(o, {"format": FORMAT, "flights": found, "provenance": made})
    print(render_trims(flights))


def speeds_of(text: str) -> list[float]:
    """Return the speeds that a text such as "0:20:1" or "0,5,10" names. Raises InputError."""
    try:
        speeds = [float(part) for part in text.split(":" if ":" in text else ",")]
        if ":" in text:
            first, last, step = speeds
            count = 1 + (last - first) / step * (1.0 + 1e-12) + 1e-9
            speeds = [first + k * step for k in range(int(min(count, _MOST + 1)))]
    except (ValueError, ArithmeticError):
        speeds = []
    if not (0 < len(speeds) <= _MOST and all(map(math.isfinite, speeds))):
        raise InputError(
            "--speeds takes FROM:TO:STEP, or numbers separated by commas, in m/s and at most "
            f"{_MOST}, got {text!r}"
        )
    return speeds


def vehicle_bench(o: Options) -> None:
    """Run the ground tests: the yaw gyro's gains, the centre of gravity.

    Step the pedals, sweep a turntable and hang from two points, rotor off; print estimates and
    truth.

    Options:
        @subject
        @seed: of the sensors
        @set
        @quiet

    example: helisim vehicle bench
    """
    from helisim.show.terminal import render_rigs
    from helisim.sim.rigs import run_rigs

    with progress(3, o.quiet, unit="rig") as advance:
        tests = run_rigs(loaded(o), seed=o.seed, on_progress=advance)
    print(render_rigs(tests))


def vehicle_calibrate(o: Options) -> None:
    """Solve the physical parameters from derivatives.

    Solve for the physical parameters that give the published derivatives, or those of [targets] in
    parameters.toml.

    Options:
        @subject
        @write: calibrated.toml
        @quiet

    example: helisim vehicle calibrate blade360 > calibrated.toml
    """
    from helisim.study.new_vehicle import calibrated_text

    with progress(None, o.quiet, unit="trial") as advance:
        text = calibrated_text(o.vehicle, on_progress=advance)
    if o.write:
        replace_parameter_file(o, "calibrated.toml", text)
    else:
        print(text, end="")


def vehicle(_: Options) -> None:
    """Make a vehicle of your own, check, linearise, trim, measure it.

    Here a vehicle is the word behind the command; elsewhere it is --vehicle VEHICLE.

    examples:
      helisim vehicle list
      helisim vehicle new myheli --like jr700      the folder myheli/, which flies
      helisim vehicle check myheli                 what is wrong with it
      helisim fly --vehicle myheli --axis lat --out lat.parquet
      helisim vehicle build myheli                 its MJCF for stock MuJoCo

    A vehicle is a folder: every command takes its path. parameters.toml in it
    says of each line what it is, in which unit, and where to get it.
    """


def vehicle_new(o: Options) -> int | None:
    """Make a folder that flies at once, commented line by line.

    Make a vehicle's folder from another's, or of the size that numbers say. Nothing is overwritten.

    Options:
        name NAME  of the vehicle and its folder
        --like VEHICLE <=jr700>  that it is made from, name or path (default: jr700)
        --to DIR  in which its folder is made (default: here)
        @quiet
        from numbers, all else estimated in proportion to --like:
        --mass KG <float>  as it flies; with --rotor and --rpm
        --rotor M  diameter
        --rpm RPM  of the main rotor
        --blades N  of the main rotor
        --chord M  of its blades
        --tail-rotor M  diameter
        --tail-chord M  of its blades
        --tail-ratio X  turns of the tail rotor for one of the main rotor
        --tail-arm M  from mast to tail rotor's shaft
        --servo S  of the swashplate, for 60 degrees

    examples:
      helisim vehicle new myheli --like blade360
      helisim vehicle new libelle --mass 4.2 --rotor 1.35 --rpm 2100

    From numbers the hover is solved and the gyro tuned, which takes half a minute.
    """
    from helisim.base.settings import from_plain, setting_names
    from helisim.study.new_vehicle import Airframe, new_vehicle

    given = {name: getattr(o, name) for name in setting_names(Airframe)}
    given = {name: value for name, value in given.items() if value is not None}
    airframe = from_plain(Airframe, given, "airframe") if given else None
    with progress(None, o.quiet or airframe is None) as advance:
        folder = new_vehicle(o.name, like=o.like, to=o.to, airframe=airframe, on_progress=advance)
    shown = folder.name if o.to is None else o.to / folder.name
    print_written(o, f"{shown}; next: see {shown}/README.md, or helisim vehicle linearize {shown}")
    o.vehicle = folder
    return None if airframe is None else vehicle_check(o)


def vehicle_check(o: Options) -> int:
    """Say everything that is wrong with a vehicle, with the remedy.

    Print a vehicle's faults, each with its file and remedy, and its hover. Exit status 2 if
    anything is wrong.

    Options:
        @subject
        @quiet

    example: helisim vehicle check myheli
    """
    from helisim.show.terminal import render_check
    from helisim.study.check import check_vehicle

    found = check_vehicle(o.vehicle)
    for problem in found.problems:
        print(single_line(str(problem)) + worded((problem.remedy,) if problem.remedy else ()))
    if not o.quiet:
        print(render_check(found))
    return 2 if found.problems else 0


def vehicle_build(o: Options) -> int | None:
    """Write the force laws' numbers into the vehicle's MJCF.

    Write the force laws' numbers, the gyro's timing, the fuselage's inertia and the hover's trim
    into a vehicle's MJCF. Stock MuJoCo flies it then, within helisim.installed().

    Options:
        vehicle VEHICLE  its folder, or name of a shipped one
        --check  write nothing; say what is not as the parameters give it, status 1
        @quiet

    example: helisim vehicle build myheli
    """
    from helisim.vehicle.build import unwritten, write_numbers

    if o.check:
        changes = unwritten(o.vehicle)
        for change in changes:
            print(f"{change.element.place}: {', '.join(change.attributes)}")
        return 1 if changes else 0
    written = write_numbers(o.vehicle)
    print_written(o, *written)
    if not written and not o.quiet:
        print("Nothing to write: the MJCF says what the parameters give")


def vehicle_list(_: Options) -> None:
    """List the shipped vehicles."""
    from helisim.vehicle.parameters import model_folder, vehicle_names

    for name in vehicle_names():
        title = (model_folder(name) / "README.md").read_text(encoding="utf-8").splitlines()[0]
        print(f"{name:<10} {title.lstrip('# ')}")
