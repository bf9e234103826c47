"""`helisim record`: a flight log as a Rerun recording."""

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.cli.common import add_quiet, print_recording, wrapped
from helisim.cli.progress import Progress

if TYPE_CHECKING:
    from helisim.records.record import FlightRecord


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "record",
        help="turn flight records into a Rerun recording",
        description="Turn flight records (.parquet or .csv) into a Rerun recording: the "
        "helicopter in space and its signals over time. A folder that helisim reproduce wrote "
        "gives the flights that the run used, and what was found from them.",
        epilog="example: helisim record lat.parquet --out lat.rrd",
    )
    command.add_argument(
        "logs", nargs="+", type=Path, metavar="LOG", help="record, or folder of a run"
    )
    command.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="recording to write, .rrd"
    )
    command.add_argument(
        "--vehicle",
        metavar="VEHICLE",
        help="to draw, a name or the path of a folder (default: the shipped one that flew)",
    )
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.base.errors import InputError
    from helisim.base.files import check_destination
    from helisim.records.storage import read_record
    from helisim.show.recording import write_recording
    from helisim.show.scene import knows_rotor
    from helisim.study.run import FLIGHTS, read_run
    from helisim.vehicle import load

    check_destination(options.out, (".rrd",))
    run, paths = None, []
    for log in options.logs:
        if log.is_dir():
            if run is not None:
                raise InputError("give one folder of a run, got several")
            run = read_run(log)
            found = sorted((log / FLIGHTS).glob("[!.]*.parquet"))
            paths += [path for path in found if path.stem not in run.results.left_out]
        else:
            paths.append(log)
    twins = [name for name, count in Counter(path.stem for path in paths).items() if count > 1]
    if twins:
        raise InputError(f"two logs are called {twins[0]!r}; rename one")
    flights = {}
    with Progress(2 * len(paths), options.quiet) as advance:
        for path in paths:
            flights[path.stem] = read_record(path)
            advance(f"{path.stem} read")
        drawn = load(options.vehicle or _vehicle(flights))
        write_recording(
            options.out,
            flights,
            model=drawn.visual_model(),
            roles=drawn.roles,
            run=run,
            on_progress=advance,
        )
    print_recording(options.out, options.quiet)
    if run is not None and run.results.left_out and not options.quiet:
        names = ", ".join(sorted(run.results.left_out))
        print(
            wrapped(f"Left out by the run, so not recorded: {names}; give their files to see them.")
        )
    plain = [name for name, record in flights.items() if not knows_rotor(record)]
    if plain and not options.quiet:
        print(_without_rotor(plain, len(flights)))
    return 0


def _vehicle(flights: "Mapping[str, FlightRecord]") -> str:
    """Return the vehicle to draw: the one that flew, and the JR700 for other people's logs."""
    from helisim.base.errors import InputError
    from helisim.vehicle.folder import vehicle_names

    named = {record.provenance.get("vehicle") for record in flights.values()}
    flew = sorted(name for name in named if isinstance(name, str))
    if len(flew) > 1:
        raise InputError(f"one recording draws one vehicle, got {', '.join(flew)}")
    if flew and flew[0] not in vehicle_names():
        raise InputError(
            f"flown by {flew[0]!r}, which is not one of the shipped vehicles "
            f"({', '.join(vehicle_names())}): give its folder with --vehicle PATH"
        )
    return flew[0] if flew else "jr700"


def _without_rotor(plain: Sequence[str], count: int) -> str:
    """Return why some flights have no arrows, and what brings them."""
    which = "the flights have" if len(plain) == count else f"{', '.join(plain)} has"
    if count == 1:
        which = "the flight has"
    return wrapped(
        f"Without thrust arrows and disc tilt: {which} no rotor channels; fly with helisim fly "
        "--rotor, or reproduce with --rerun, to record them."
    )
