"""`helisim recover`: a vehicle's derivatives from its own sweeps."""

import argparse
import json
import sys
from typing import Any

from helisim.cli.common import add_parameters, add_quiet, add_vehicle, parameters
from helisim.cli.progress import Progress


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "recover",
        help="sweep a vehicle and recover its derivatives",
        description="Sweep a vehicle on all four axes, identify yaw, roll-pitch and heave from the "
        "records, and print them beside the exact linearisation and what is published.",
        epilog="example: helisim recover blade360 --flights 3",
    )
    add_vehicle(command)
    command.add_argument(
        "--flights", type=int, default=3, metavar="N", help="kept on each axis (default: 3)"
    )
    command.add_argument(
        "--seed", type=int, default=1, metavar="S", help="of pilots and sensors (default: 1)"
    )
    command.add_argument("--jobs", type=int, metavar="J", help="threads (default: all processors)")
    command.add_argument("--json", action="store_true", help="print the results as JSON")
    add_parameters(command)
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.show.terminal import render_results, wants_color
    from helisim.study.flights import flights_in_all
    from helisim.study.recover import recover

    with Progress(flights_in_all(max(1, options.flights)) + 3, options.quiet) as advance:
        results = recover(
            options.vehicle,
            flights=options.flights,
            seed=options.seed,
            jobs=options.jobs,
            parameters=parameters(options),
            on_progress=advance,
        )
    if options.json:
        print(json.dumps(results.to_dict(), indent=2, allow_nan=False))
    else:
        print(render_results(results, color=wants_color(sys.stdout)))
    return 1 if results.misses else 0
