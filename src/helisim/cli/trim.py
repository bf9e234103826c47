"""`helisim trim`: level flight over a range of speeds."""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError
from helisim.cli.common import add_parameters, add_quiet, add_vehicle, parameters, print_written
from helisim.cli.progress import Progress

if TYPE_CHECKING:
    from helisim.vehicle import Vehicle

FORMAT = "helisim level flights, version 1"

_MOST = 1000
"""Speeds; more are a mistake in the step."""

_EPILOG = """\
examples:
  helisim trim --speeds 0:20:1 --figure trim.png
  helisim trim blade360 --speeds 0,5,10 --json trim.json
  helisim trim --set air.ground_effect=1 --height 0.5

With --json each speed has its exact linearisation, as `helisim linearize`
prints it for the hover, and its derivatives.
"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "trim",
        help="trim level flight over a range of speeds: power, controls, attitude",
        description="Solve the steady level flight at each speed on the nonlinear force laws, "
        "and print the power, the controls, the attitude and the disc's tilt.",
        epilog=_EPILOG,
    )
    add_vehicle(command)
    command.add_argument(
        "--speeds",
        default="0:20:2",
        metavar="LIST",
        help="m/s, FROM:TO:STEP or separated by commas (default: 0:20:2)",
    )
    command.add_argument(
        "--height", type=float, metavar="H", help="m above the ground (default: 10)"
    )
    command.add_argument(
        "--inputs",
        default="IN1",
        metavar="IN",
        help="of the linearisations: IN1 (servo commands, default) or IN2 (sticks)",
    )
    command.add_argument("--figure", type=Path, metavar="FILE", help="draw them, .svg or .png")
    command.add_argument(
        "--json", type=Path, metavar="FILE", help="write trims and linearisations, .json"
    )
    add_parameters(command)
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.base.files import check_destination
    from helisim.show.terminal import render_trims
    from helisim.vehicle import load
    from helisim.vehicle.trim import HEIGHT

    speeds = speeds_of(options.speeds)
    for path, suffixes in ((options.figure, (".svg", ".png")), (options.json, (".json",))):
        if path is not None:
            check_destination(path, suffixes)
    height = HEIGHT if options.height is None else options.height
    vehicle = load(options.vehicle, parameters=parameters(options))
    flights: list[Vehicle] = []
    with Progress(len(speeds), options.quiet, unit="speed") as advance:
        for speed in speeds:  # each search starts from the flight before
            flights.append((flights or [vehicle])[-1].trimmed(speed=speed, height=height))
            advance(f"{speed:g} m/s")
    if options.json is not None:
        _write_json(flights, options)
    if options.figure is not None:
        _draw(flights, options.figure)
    print(render_trims(flights))
    for path in (options.figure, options.json):
        if path is not None:
            print_written(options, str(path))
    return 0


def speeds_of(text: str) -> list[float]:
    """Return the speeds that a text such as "0:20:1" or "0,5,10" names. Raises InputError."""
    asked = InputError(
        "--speeds takes FROM:TO:STEP with a positive step, or numbers separated by commas, in "
        f"m/s and at most {_MOST}, got {text!r}"
    )
    try:
        numbers = [float(part) for part in text.split(":" if ":" in text else ",")]
    except ValueError:
        raise asked from None
    if not all(map(math.isfinite, numbers)):
        raise asked
    if ":" not in text:
        speeds = numbers
    else:
        if len(numbers) != 3 or not (numbers[2] > 0.0 and numbers[0] <= numbers[1]):
            raise asked
        first, last, step = numbers
        # a last step that ends short of TO by rounding only is taken
        count = min(math.floor((last - first) / step * (1.0 + 1e-12) + 1e-9), _MOST) + 1
        speeds = [first + k * step for k in range(count)]
    if len(speeds) > _MOST:
        raise asked
    return speeds


def _write_json(flights: Sequence["Vehicle"], options: argparse.Namespace) -> None:
    from helisim.base.files import write_json
    from helisim.records.provenance import made_by

    found = [
        {
            "speed_m_s": flight.trim.speed,
            "power_w": flight.power,
            **flight.linearize(options.inputs).to_dict(),
            "derivatives": flight.derivatives,
        }
        for flight in flights
    ]
    provenance = made_by("level flights", **flights[0].provenance)
    write_json({"format": FORMAT, "flights": found, "provenance": provenance}, options.json)


def _draw(flights: Sequence["Vehicle"], path: Path) -> None:
    from helisim.base.files import atomic_write
    from helisim.show.canvas import to_png
    from helisim.show.plots import draw_trims

    drawing = draw_trims(flights)
    with atomic_write(path) as temporary:
        content = to_png(drawing) if path.suffix == ".png" else drawing.svg.encode()
        temporary.write_bytes(content)
