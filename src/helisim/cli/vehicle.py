"""Commands about vehicles: their linear models, trims, ground tests, parameters and folders."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError
from helisim.base.text import single_line
from helisim.cli.options import (
    Options,
    Progress,
    loaded,
    print_json,
    print_written,
    replace_parameter_file,
    worded,
)

if TYPE_CHECKING:
    from helisim.vehicle import Vehicle

FORMAT = "helisim level flights, version 1"
_MOST = 1000
"""Speeds; more are a mistake in the step."""


def linearize(o: Options) -> int:
    """Print the exact linearisation at the hover.

    Print the exact linearisation of the nonlinear vehicle at its hover.

    Options:
        @vehicle
        --inputs IN <=IN1>  IN1 (servo commands to motion, default) or IN2 (sticks to motion)
        --json  matrices and names as JSON
        @controller
        @set

    example: helisim linearize --inputs IN2 --json
    """
    from helisim.records.record import made_by
    from helisim.show.terminal import render_derivatives

    vehicle = loaded(o)
    linear = vehicle.linearize(o.inputs)
    if o.json:
        provenance = made_by("linearization", **vehicle.provenance)
        more = {"derivatives": vehicle.derivatives, "provenance": provenance}
        print_json({**linear.to_dict(), **more})
    else:
        print(render_derivatives(linear, vehicle.derivatives))
    return 0


def trim(o: Options) -> int:
    """Trim level flight over a range of speeds: power, controls, attitude.

    Solve the steady level flight at each speed on the nonlinear force laws, and print the power,
    the controls, the attitude and the disc's tilt.

    Options:
        @vehicle
        --speeds LIST <=0:20:2>  m/s, FROM:TO:STEP or separated by commas (default: 0:20:2)
        --height H <float>  m above the ground (default: 10)
        --inputs IN <=IN1>  of the linearisations: IN1 (servo commands, default) or IN2 (sticks)
        --figure FILE <.svg .png>  draw them, .svg or .png
        --json FILE <.json>  write trims and linearisations, .json
        @set
        @quiet

    examples:
      helisim trim --speeds 0:20:1 --figure trim.png
      helisim trim blade360 --speeds 0,5,10 --json trim.json
      helisim trim --set air.ground_effect=1 --height 0.5

    With --json each speed has its exact linearisation, as `helisim linearize`
    prints it for the hover, and its derivatives.
    """
    from helisim.show.terminal import render_trims
    from helisim.vehicle.trim import HEIGHT

    speeds, height = speeds_of(o.speeds), HEIGHT if o.height is None else o.height
    flights = [loaded(o)]
    with Progress(len(speeds), o.quiet, unit="speed") as advance:
        for speed in speeds:  # each search starts from the flight before
            flights.append(flights[-1].trimmed(speed=speed, height=height))
            advance(f"{speed:g} m/s")
    del flights[0]
    if o.json is not None:
        _write_trims(flights, o)
    if o.figure is not None:
        _draw_trims(flights, o.figure)
    print(render_trims(flights))
    print_written(o, o.figure, o.json)
    return 0


def speeds_of(text: str) -> list[float]:
    """Return the speeds that a text such as "0:20:1" or "0,5,10" names. Raises InputError."""
    try:
        numbers = [float(part) for part in text.split(":" if ":" in text else ",")]
        speeds = numbers if all(map(math.isfinite, numbers)) else []
        if ":" in text:
            first, last, step = numbers
            # a last step that ends short of TO by rounding only is taken
            steps = min(math.floor((last - first) / step * (1.0 + 1e-12) + 1e-9), _MOST)
            backwards = step <= 0.0 or last < first
            speeds = [] if backwards else [first + k * step for k in range(steps + 1)]
    except (ValueError, ArithmeticError):
        speeds = []
    if not 0 < len(speeds) <= _MOST:
        raise InputError(
            "--speeds takes FROM:TO:STEP with a positive step, or numbers separated by commas, in "
            f"m/s and at most {_MOST}, got {text!r}"
        )
    return speeds


def _write_trims(flights: "list[Vehicle]", o: Options) -> None:
    from helisim.base.files import write_json
    from helisim.records.record import made_by

    found = [
        {
            "speed_m_s": flight.trim.speed,
            "power_w": flight.power,
            **flight.linearize(o.inputs).to_dict(),
            "derivatives": flight.derivatives,
        }
        for flight in flights
    ]
    provenance = made_by("level flights", **flights[0].provenance)
    write_json({"format": FORMAT, "flights": found, "provenance": provenance}, o.json)


def _draw_trims(flights: "list[Vehicle]", path: Path) -> None:
    from helisim.base.files import atomic_write
    from helisim.show.canvas import to_png
    from helisim.show.plots import draw_trims

    drawing = draw_trims(flights)
    with atomic_write(path) as temporary:
        content = to_png(drawing) if path.suffix == ".png" else drawing.svg.encode()
        temporary.write_bytes(content)


def bench(o: Options) -> int:
    """Run the ground tests: the yaw gyro's gains, the centre of gravity.

    Step the pedals on the bench, sweep the turntable, hang from two points, all with the rotor off,
    and print what is identified beside the truth.

    Options:
        @vehicle
        @seed: of the sensors
        --json  findings and notes as JSON
        @set
        @quiet

    example: helisim bench --json
    """
    from helisim.records.record import made_by
    from helisim.show.terminal import render_rigs
    from helisim.sim.rigs import run_rigs

    vehicle = loaded(o)
    with Progress(3, o.quiet, unit="rig") as advance:
        tests = run_rigs(vehicle, seed=o.seed, on_progress=advance)
    if o.json:
        provenance = made_by("ground tests", **vehicle.provenance, seed=o.seed)
        print_json({"rigs": [test.to_dict() for test in tests], "provenance": provenance})
    else:
        print(render_rigs(tests))
    return 0


def calibrate(o: Options) -> int:
    """Solve the physical parameters from derivatives.

    Solve for the physical parameters whose linearised flight has the derivatives that are published
    of the vehicle, or that [targets] of its parameters.toml states.

    Options:
        @vehicle
        --from-geometry  estimate what [targets] leaves out, in closed form, from [geometry]
        @write: calibrated.toml
        @quiet

    example: helisim calibrate blade360 > calibrated.toml
    """
    from helisim.study.new_vehicle import calibrated_text

    with Progress(None, o.quiet, unit="trial") as advance:
        text = calibrated_text(o.vehicle, from_geometry=o.from_geometry, on_progress=advance)
    if not o.write:
        print(text, end="")
        return 0
    replace_parameter_file(o, "calibrated.toml", text)
    return 0


def tune(o: Options) -> int:
    """Solve the gyro's gains from published models or a rate command.

    Solve for the gyro's settings at which the vehicle, seen from the sticks, has the models that
    are published of it (the JR700: eq. (8) and the IN2 column of Table 3), or the rate command that
    its parameters ask for; print the margins of its loops.

    Options:
        @vehicle
        @write: tuned.toml
        @quiet

    example: helisim tune
    """
    from helisim.study.tune import margin_table, tune
    from helisim.vehicle import load
    from helisim.vehicle.parameters import to_toml

    vehicle = load(o.vehicle, tuned=False)
    with Progress(None, o.quiet, unit="trial") as advance:
        settings = tune(vehicle, on_progress=advance)
    text = to_toml(settings, "Written by `helisim tune --write`; not by hand.")
    print(text)
    print("# Margins: loop, more delay (ms), gain (dB), phase (deg), crossover (rad/s)")
    for one in margin_table(vehicle.with_settings(dict(settings))):
        print(
            f"# {one.axis} {1e3 * one.extra_delay:4.0f} {one.margins.gain_db:6.1f} "
            f"{one.margins.phase_deg:6.1f} {one.margins.crossover:6.1f}"
        )
    if o.write:
        replace_parameter_file(o, "tuned.toml", text)
    return 0


def vehicle(o: Options) -> int:
    """Make a vehicle of your own, check it, build its MJCF, list the shipped.

    Make a vehicle of your own from a shipped one, say what is wrong with it, write its numbers for
    stock MuJoCo, list what is shipped.

    examples:
      helisim vehicle list
      helisim vehicle new myheli --like jr700      the folder myheli/, which flies
      helisim vehicle check myheli                 what is wrong with it, with lines
      helisim fly myheli --axis lat --out lat.parquet
      helisim vehicle build myheli                 its MJCF for stock MuJoCo

    A vehicle is a folder: every command takes its path. parameters.toml in it
    says of each line what it is, in which unit, and where to get it.
    """
    raise NotImplementedError(o.part)


def vehicle_new(o: Options) -> int:
    """Make a folder that flies at once, commented line by line.

    Make a vehicle's folder from another's. It flies at once; change it line by line. Nothing that
    is there is overwritten.

    Options:
        name NAME  of the vehicle and its folder
        --like VEHICLE <=jr700>  that it is made from, name or path (default: jr700)
        --to DIR  in which its folder is made (default: here)
        @quiet

    example: helisim vehicle new myheli --like blade360
    """
    from helisim.study.new_vehicle import new_vehicle

    folder = new_vehicle(o.name, like=o.like, to=o.to)
    shown = folder.name if o.to is None else o.to / folder.name
    print_written(o, f"{shown}; next: see {shown}/README.md, or helisim linearize {shown}")
    return 0


def vehicle_check(o: Options) -> int:
    """Say everything that is wrong with a vehicle, with its line and the remedy.

    Say everything that is wrong with a vehicle's folder, each with its line and the remedy, and
    print what it is in the hover. Exit status 2 if anything is wrong.

    Options:
        @vehicle
        @quiet

    example: helisim vehicle check myheli
    """
    from helisim.show.terminal import render_check
    from helisim.study.check import check_vehicle

    found = check_vehicle(o.vehicle)
    for problem in found.problems:
        remedy = worded((problem.remedy,)) if problem.remedy else ""
        print(single_line(str(problem)) + remedy)
    if not o.quiet:
        print(render_check(found))
    return 2 if found.problems else 0


def vehicle_build(o: Options) -> int:
    """Write the force laws' numbers into the vehicle's MJCF.

    Write into a vehicle's MJCF what its parameters give: the numbers of the force laws, the gyro's
    timing, the fuselage's inertia and the trim of the keyframe hover. Stock MuJoCo flies it then,
    within helisim.installed(). Nothing else of the file is changed.

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
            print(f"{change.element.place}: {', '.join(change.numbers)}")
        return 1 if changes else 0
    written = write_numbers(o.vehicle)
    print_written(o, *written)
    if not written and not o.quiet:
        print("Nothing to write: the MJCF says what the parameters give")
    return 0


def vehicle_list(o: Any) -> int:
    """List the shipped vehicles."""
    from helisim.vehicle.folder import model_folder, vehicle_names

    del o
    for name in vehicle_names():
        title = (model_folder(name) / "README.md").read_text(encoding="utf-8").splitlines()[0]
        print(f"{name:<10} {title.lstrip('# ')}")
    return 0
