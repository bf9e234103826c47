"""`helisim calibrate`: physical parameters from published derivatives."""

import argparse
from typing import Any

from helisim.cli.common import add_quiet, add_vehicle, tell_written
from helisim.cli.progress import Progress


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "calibrate",
        help="solve the physical parameters from published derivatives",
        description="Solve for the physical parameters whose linearised flight has the derivatives "
        "that are published of the vehicle.",
        epilog="example: helisim calibrate blade360 > calibrated.toml",
    )
    add_vehicle(command)
    command.add_argument(
        "--write",
        action="store_true",
        help="replace the vehicle's calibrated.toml instead of printing it",
    )
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.records.files import atomic_write
    from helisim.study.calibrate import calibrated_text
    from helisim.vehicle.assembly import model_folder

    with Progress(None, options.quiet, unit="trial") as advance:
        text = calibrated_text(options.vehicle, on_progress=advance)
    if not options.write:
        print(text, end="")
        return 0
    path = model_folder(options.vehicle) / "calibrated.toml"
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    tell_written(options, str(path))
    return 0
