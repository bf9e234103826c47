"""`helisim view`: fly in MuJoCo's viewer, in real time."""

import argparse
from typing import Any

from helisim.cli.common import add_parameters, add_vehicle, parameters
from helisim.records.channels import AXES


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "view",
        help="watch the helicopter fly in MuJoCo's viewer",
        description="Fly in MuJoCo's viewer, in real time: a hover, or a frequency sweep. Needs "
        "a display; without one, record a flight with helisim fly --rerun.",
        epilog="example: helisim view --axis lat",
    )
    add_vehicle(command)
    command.add_argument("--axis", metavar="AXIS", help=f"{'|'.join(AXES)} (default: hover)")
    command.add_argument(
        "--duration",
        type=float,
        metavar="S",
        help="s (default: a sweep's 90; a hover goes on until the window is closed)",
    )
    command.add_argument(
        "--seed", type=int, default=1, metavar="S", help="of the pilot (default: 1)"
    )
    add_parameters(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.errors import InputError
    from helisim.output.viewer import check_display, view
    from helisim.sim import Sweep
    from helisim.vehicle import load

    duration = options.duration
    if duration is not None and not 0.0 < duration < float("inf"):
        raise InputError(f"--duration must be a positive number of seconds, got {duration}")
    sweep = None
    if options.axis is not None:
        sweep = Sweep(axis=options.axis, duration=90.0 if duration is None else duration)
    check_display()
    vehicle = load(options.vehicle, parameters=parameters(options))
    flown = view(vehicle, sweep, duration=duration, seed=options.seed)
    print(f"Flown: {flown:.1f} s")
    return 0
