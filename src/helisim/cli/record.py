"""`helisim record`: a flight log as a Rerun recording."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from helisim.cli.common import add_quiet, wrapped, write_recording


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "record",
        help="turn flight records into a Rerun recording",
        description="Turn flight records (.parquet or .csv) into a Rerun recording: the "
        "helicopter in space and its signals over time. A folder that helisim reproduce wrote "
        "gives the whole run, with what was found.",
        epilog="example: helisim record lat.parquet --out lat.rrd",
    )
    command.add_argument(
        "logs", nargs="+", type=Path, metavar="LOG", help="record, or folder of a run"
    )
    command.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="recording to write, .rrd"
    )
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.errors import InputError
    from helisim.output.rerun.scene import knows_rotor
    from helisim.records.files import check_destination
    from helisim.records.storage import read_record
    from helisim.study.run import FLIGHTS, read_run

    check_destination(options.out, (".rrd",))
    run, paths = None, []
    for log in options.logs:
        if log.is_dir():
            if run is not None:
                raise InputError("give one folder of a run, got several")
            run = read_run(log)
            paths += sorted((log / FLIGHTS).glob("[!.]*.parquet"))
        else:
            paths.append(log)
    flights = {}
    for path in paths:
        name = path.stem
        if name in flights:
            raise InputError(f"two logs are called {name!r}; rename one")
        flights[name] = read_record(path)
    write_recording(options.out, flights, run=run, quiet=options.quiet)
    plain = [name for name, record in flights.items() if not knows_rotor(record)]
    if plain and not options.quiet:
        print(_without_rotor(plain, len(flights)))
    return 0


def _without_rotor(plain: Sequence[str], count: int) -> str:
    """Return why some flights have no arrows, and what brings them."""
    which = "the flights have" if len(plain) == count else f"{', '.join(plain)} has"
    if count == 1:
        which = "the flight has"
    return wrapped(
        f"Without thrust arrows and disc tilt: {which} no rotor channels; fly with helisim fly "
        "--rotor, or reproduce with --rerun, to record them."
    )
