"""`helisim bench`: the ground tests on bench, turntable and suspension."""

import argparse
import json
from typing import Any

from helisim.cli.common import add_parameters, add_quiet, add_vehicle, parameters
from helisim.cli.progress import Progress


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "bench",
        help="run the ground tests: the yaw gyro's gains, the centre of gravity",
        description="Step the pedals on the bench, sweep the turntable, hang from two points, all "
        "with the rotor off, and print what is identified beside the truth.",
        epilog="example: helisim bench --json",
    )
    add_vehicle(command)
    command.add_argument(
        "--seed", type=int, default=1, metavar="S", help="of the sensors (default: 1)"
    )
    command.add_argument("--json", action="store_true", help="findings and notes as JSON")
    add_parameters(command)
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.records.provenance import made_by
    from helisim.show.terminal import render_rigs
    from helisim.sim.rigs import run_rigs
    from helisim.vehicle import load

    vehicle = load(options.vehicle, parameters=parameters(options))
    with Progress(3, options.quiet, unit="rig") as advance:
        tests = run_rigs(vehicle, seed=options.seed, on_progress=advance)
    if options.json:
        provenance = made_by("ground tests", **vehicle.provenance, seed=options.seed)
        data = {"rigs": [test.to_dict() for test in tests], "provenance": provenance}
        print(json.dumps(data, indent=2, allow_nan=False))
    else:
        print(render_rigs(tests))
    return 0
