"""`helisim reproduce`: the paper's experiment, end to end."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from helisim.base.errors import InputError
from helisim.cli.common import add_common, parameters, print_written, write_recording
from helisim.cli.progress import Progress

_FLIGHTS = 10
"""Kept on each axis, as in the paper."""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "reproduce",
        help="fly the paper's experiment, identify its models, compare",
        description="Fly sweeps on all four axes, identify the paper's models from the records, "
        "and print them beside the paper and the exact linearisation of the model that flew.",
        epilog="examples:\n"
        "  helisim reproduce --out reproduction --flights 10 --seed 1\n"
        "  helisim reproduce --from reproduction       is every number the same again?\n\n"
        "Exit status 1: a tolerance is missed; with --from, a number differs.",
    )
    command.add_argument(
        "--from",
        dest="run_folder",
        type=Path,
        metavar="DIR",
        help="repeat the run in DIR as it says that it was made, and compare: records to the byte, "
        "results to the last digit",
    )
    command.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder of results.json and flights/ (default: reproduction; with --from none)",
    )
    command.add_argument(
        "--flights", type=int, metavar="N", help=f"kept on each axis (default: {_FLIGHTS})"
    )
    command.add_argument("--jobs", type=int, metavar="J", help="threads (default: all processors)")
    command.add_argument("--timestep", type=float, metavar="S", help="of the simulation, s")
    command.add_argument(
        "--reuse", action="store_true", help="identify the flights in DIR again instead of flying"
    )
    command.add_argument("--json", action="store_true", help="print results.json, no tables")
    add_common(command)
    command.set_defaults(run=_run, seed=None)


def _run(options: argparse.Namespace) -> int:
    return _reproduce(options) if options.run_folder is None else _repeat(options)


def _repeat(options: argparse.Namespace) -> int:
    from helisim.show.report import write_report
    from helisim.study.flights import flights_in_all
    from helisim.study.models import MODELS
    from helisim.study.replay import arguments_of, repeat

    given = {
        "--flights": options.flights,
        "--seed": options.seed,
        "--timestep": options.timestep,
        "--set": options.set or None,
        "--reuse": options.reuse or None,
        "--rerun": options.rerun,
    }
    set_here = [name for name, value in given.items() if value is not None]
    if set_here:
        raise InputError(
            f"--from repeats a run with its own options: leave out {', '.join(set_here)}"
        )
    flights = arguments_of(options.run_folder).flights
    steps = flights_in_all(flights) + len(MODELS) + (options.out is not None)
    with Progress(steps, options.quiet) as advance:
        found = repeat(options.run_folder, out=options.out, jobs=options.jobs, on_progress=advance)
        if options.out is not None:
            write_report(options.out)
            advance("report")
    print(json.dumps(found.to_dict(), indent=2) if options.json else found)
    return 0 if found.same else 1


def _reproduce(options: argparse.Namespace) -> int:
    from helisim.base.files import check_destination
    from helisim.show.report import write_report
    from helisim.show.terminal import render_results, wants_color
    from helisim.study.flights import flights_in_all, named_records
    from helisim.study.models import MODELS
    from helisim.study.reproduce import reproduce

    flights_kept = _FLIGHTS if options.flights is None else options.flights
    seed = 1 if options.seed is None else options.seed
    out = options.out or Path("reproduction")
    if flights_kept < 1:
        raise InputError(f"--flights must be 1 or more, got {flights_kept}")
    if options.rerun is not None:
        check_destination(options.rerun, (".rrd",))
    flown = 0 if options.reuse else flights_in_all(flights_kept)
    steps = flown + len(MODELS) + 1  # the report
    with Progress(steps, options.quiet) as advance:
        run = reproduce(
            out=out,
            flights=flights_kept,
            seed=seed,
            jobs=options.jobs,
            parameters=parameters(options),
            timestep=options.timestep,
            rotor=options.rerun is not None,
            reuse=options.reuse,
            on_progress=advance,
        )
        write_report(out, run)
        advance("report")
    if options.json:
        print(json.dumps(run.results.to_dict(), indent=2, allow_nan=False))
    else:
        print(render_results(run.results, color=wants_color(sys.stdout)))
        print_written(options, f"{out / 'results.json'}, records in {out / 'flights'}")
        print_written(options, f"{out / 'report.html'}")
    if options.rerun is not None:
        records = named_records(run.flights)
        quiet = options.quiet or options.json
        write_recording(options.rerun, records, run=run, quiet=quiet)
    return 1 if run.results.misses else 0
