"""`helisim fly`: one sweep, recorded."""

import argparse
from pathlib import Path
from typing import Any

from helisim.channels import AXES
from helisim.cli.common import Progress, add_common, parameters, write_recording


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "fly",
        help="fly one sweep and record it",
        description="Fly one frequency sweep and write what the flight computer records.",
        epilog="example: helisim fly --axis lat --duration 90 --seed 1 --out lat.parquet",
    )
    command.add_argument("--axis", required=True, metavar="AXIS", help="|".join(AXES))
    command.add_argument(
        "--duration", type=float, default=90.0, metavar="S", help="of the flight, s (default: 90)"
    )
    command.add_argument(
        "--amplitude",
        type=float,
        metavar="A",
        help="of the stick, unitised (default: the axis's own)",
    )
    command.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="record to write, .parquet or .csv"
    )
    add_common(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.sim import Recorder, Sweep, fly
    from helisim.storage import check_destination, write_record
    from helisim.vehicle import load

    sweep = Sweep(axis=options.axis, duration=options.duration, amplitude=options.amplitude)
    check_destination(options.out)
    if options.rerun is not None:
        check_destination(options.rerun, (".rrd",))
    vehicle = load(parameters=parameters(options))
    with Progress(1, options.quiet) as advance:
        (record,) = fly(
            vehicle,
            sweep,
            seed=options.seed,
            recorder=Recorder.of(vehicle, rotor=options.rerun is not None),
            on_flight=lambda: advance("flight"),
        )
    write_record(record, options.out)
    print(
        f"Written: {options.out} ({record.duration:.2f} s, {len(record)} samples, "
        f"{len(record.names)} channels)"
    )
    if options.rerun is not None:
        write_recording(options.rerun, {options.axis: record})
    return 0
