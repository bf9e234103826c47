"""`helisim calibrate`: physical parameters from the paper's tables."""

import argparse
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "calibrate",
        help="solve the physical parameters from the paper's tables",
        description="Solve for the physical parameters whose linearised flight has the paper's "
        "derivatives.",
        epilog="example: helisim calibrate > calibrated.toml",
    )
    command.add_argument(
        "--write",
        action="store_true",
        help="replace the vehicle's calibrated.toml instead of printing it",
    )
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.pipeline import calibrated_text
    from helisim.storage import atomic_write
    from helisim.vehicle.assembly import model_folder

    text = calibrated_text("jr700")
    if not options.write:
        print(text, end="")
        return 0
    path = model_folder("jr700") / "calibrated.toml"
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print(f"Written: {path}")
    return 0
