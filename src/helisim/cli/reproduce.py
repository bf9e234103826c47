"""`helisim reproduce`: the paper's experiment, end to end."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from helisim.cli.common import Progress, add_common, parameters, write_recording
from helisim.errors import InputError


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "reproduce",
        help="fly the paper's experiment, identify its models, compare",
        description="Fly sweeps on all four axes, identify the paper's models from the records, "
        "and print them beside the paper and the exact linearisation of the model that flew.",
        epilog="example: helisim reproduce --out reproduction --flights 10 --seed 1",
    )
    command.add_argument(
        "--out",
        type=Path,
        default=Path("reproduction"),
        metavar="DIR",
        help="folder of results.json and flights/ (default: reproduction)",
    )
    command.add_argument(
        "--flights", type=int, default=10, metavar="N", help="kept on each axis (default: 10)"
    )
    command.add_argument("--jobs", type=int, metavar="J", help="threads (default: all processors)")
    command.add_argument("--timestep", type=float, metavar="S", help="of the simulation, s")
    command.add_argument(
        "--reuse", action="store_true", help="identify the flights in DIR again instead of flying"
    )
    command.add_argument("--json", action="store_true", help="print results.json, no tables")
    add_common(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim import pipeline
    from helisim.experiment import MODELS
    from helisim.flights import flights_in_all, named_records
    from helisim.output.run import read_run
    from helisim.output.tables import render_results, wants_color
    from helisim.storage import check_destination

    if options.flights < 1:
        raise InputError(f"--flights must be 1 or more, got {options.flights}")
    if options.rerun is not None:
        check_destination(options.rerun, (".rrd",))
    flown = 0 if options.reuse else flights_in_all(options.flights)
    steps = flown + len(MODELS) + 1  # the report
    with Progress(steps, options.quiet) as advance:
        results, flights = pipeline.reproduce(
            out=options.out,
            flights=options.flights,
            seed=options.seed,
            jobs=options.jobs,
            parameters=parameters(options),
            timestep=options.timestep,
            rotor=options.rerun is not None,
            reuse=options.reuse,
            on_progress=advance,
        )
    if options.json:
        print(json.dumps(results.to_dict(), indent=2, allow_nan=False))
    else:
        print(render_results(results, color=wants_color(sys.stdout)))
        print(f"\nWritten: {options.out / 'results.json'}, records in {options.out / 'flights'}")
        print(f"Report: {options.out / 'report.html'}")
    if options.rerun is not None:
        records = named_records(flights)
        write_recording(options.rerun, records, run=read_run(options.out), quiet=options.json)
    return 1 if results.misses else 0
