"""`helisim tune`: the gyro's gains from what is wanted of it, with the margins they leave."""

import argparse
from typing import Any

from helisim.cli.common import add_quiet, add_vehicle, add_write, replace_parameter_file
from helisim.cli.progress import Progress


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "tune",
        help="solve the gyro's gains from published models or a rate command",
        description="Solve for the gyro's settings at which the vehicle, seen from the sticks, has "
        "the models that are published of it (the JR700: eq. (8) and the IN2 column of Table 3), "
        "or the rate command that its parameters ask for; print the margins of its loops.",
        epilog="example: helisim tune",
    )
    add_vehicle(command)
    add_write(command, "tuned.toml")
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.study.tune import margin_table, tune
    from helisim.vehicle import load
    from helisim.vehicle.parameters import to_toml

    vehicle = load(options.vehicle, tuned=False)
    with Progress(None, options.quiet, unit="trial") as advance:
        settings = tune(vehicle, on_progress=advance)
    header = "Written by `helisim tune --write`; not by hand."
    text = to_toml(settings, header)
    print(text)
    tuned = vehicle.with_settings(dict(settings))
    print("# Margins: loop, more delay (ms), gain (dB), phase (deg), crossover (rad/s)")
    for one in margin_table(tuned):
        print(
            f"# {one.axis} {1e3 * one.extra_delay:4.0f} {one.margins.gain_db:6.1f} "
            f"{one.margins.phase_deg:6.1f} {one.margins.crossover:6.1f}"
        )
    if options.write:
        replace_parameter_file(options, "tuned.toml", text)
    return 0
