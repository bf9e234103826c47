"""`helisim calibrate`: physical parameters from derivatives."""

import argparse
from typing import Any

from helisim.cli.common import add_quiet, add_vehicle, add_write, replace_parameter_file
from helisim.cli.progress import Progress


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "calibrate",
        help="solve the physical parameters from derivatives",
        description="Solve for the physical parameters whose linearised flight has the derivatives "
        "that are published of the vehicle, or that [targets] of its parameters.toml states.",
        epilog="example: helisim calibrate blade360 > calibrated.toml",
    )
    add_vehicle(command)
    command.add_argument(
        "--from-geometry",
        action="store_true",
        help="estimate what [targets] leaves out, in closed form, from [geometry]",
    )
    add_write(command, "calibrated.toml")
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.study.calibrate import calibrated_text

    with Progress(None, options.quiet, unit="trial") as advance:
        text = calibrated_text(
            options.vehicle, from_geometry=options.from_geometry, on_progress=advance
        )
    if not options.write:
        print(text, end="")
        return 0
    replace_parameter_file(options, "calibrated.toml", text)
    return 0
