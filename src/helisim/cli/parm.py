"""`helisim parm`: ArduPilot's parameters for a vehicle."""

import argparse
from pathlib import Path
from typing import Any

from helisim.cli.common import add_quiet, add_vehicle, print_written

_EPILOG = """\
examples:
  helisim parm jr700 --out jr700.parm               from its exact linear model
  helisim parm jr700 --from reproduction --out jr700.parm
                                                    from what was identified
  helisim parm myheli --from flight.bin --out myheli.parm
                                                    from what ArduPilot logged
"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "parm",
        help="write parameters with which ArduPilot flies a vehicle, derivation included",
        description="Write a parameter file with which ArduCopter-heli flies a vehicle: "
        "swashplate, collective, tail and rotor from its files, gains from a model of it, with "
        "the margins that they give. Prints what each follows from.",
        epilog=_EPILOG,
    )
    add_vehicle(command)
    command.add_argument(
        "--from",
        dest="source",
        type=Path,
        metavar="SOURCE",
        help="what gains come from: a folder of helisim reproduce or of sweeps, an autopilot's "
        "log of SystemID's sweeps, .bin, or a model of helisim identify, .json (default: the exact "
        "linearisation)",
    )
    command.add_argument(
        "--tail",
        default="direct",
        metavar="direct|gyro",
        help="direct: ArduPilot moves the tail servo (default); gyro: the vehicle's own yaw gyro "
        "does, as of helisim sitl --tail gyro",
    )
    command.add_argument("--out", type=Path, metavar="FILE", help="the file, .parm")
    command.add_argument(
        "--seed", type=int, default=1, metavar="S", help="of the servos' bench test (default: 1)"
    )
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.base.errors import UnknownNameError
    from helisim.base.files import check_destination
    from helisim.sitl.aircraft import TAILS
    from helisim.study.autopilot import autopilot_parameters

    if options.out is not None:
        check_destination(options.out, (".parm", ".param"))
    if options.tail not in TAILS:
        raise UnknownNameError("tail", options.tail, TAILS)
    parameters = autopilot_parameters(
        options.vehicle, options.source, gyro=options.tail == "gyro", seed=options.seed
    )
    print(parameters.text, end="")
    if options.out is not None:
        parameters.write(options.out)
        print_written(options, str(options.out))
    return 0
