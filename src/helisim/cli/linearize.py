"""`helisim linearize`: the exact linear model at the hover."""

import argparse
import json
from typing import Any

from helisim.cli.common import add_controller, add_parameters, add_vehicle, controlled, parameters


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "linearize",
        help="print the exact linearisation at the hover",
        description="Print the exact linearisation of the nonlinear vehicle at its hover.",
        epilog="example: helisim linearize --inputs IN2 --json",
    )
    add_vehicle(command)
    command.add_argument(
        "--inputs",
        default="IN1",
        metavar="IN",
        help="IN1 (servo commands to motion, default) or IN2 (sticks to motion)",
    )
    command.add_argument("--json", action="store_true", help="matrices and names as JSON")
    add_controller(command)
    add_parameters(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.records.provenance import made_by
    from helisim.show.terminal import render_derivatives
    from helisim.vehicle import load

    vehicle = controlled(load(options.vehicle, parameters=parameters(options)), options)
    linear = vehicle.linearize(options.inputs)
    if options.json:
        provenance = made_by("linearization", **vehicle.provenance)
        data = {**linear.to_dict(), "derivatives": vehicle.derivatives, "provenance": provenance}
        print(json.dumps(data, indent=2))
    else:
        print(render_derivatives(linear, vehicle.derivatives))
    return 0
