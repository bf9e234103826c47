"""`helisim ardupilot`: identified models as ArduPilot's state-space helicopter."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError
from helisim.base.units import RAD_S_PER_RPM
from helisim.cli.common import add_quiet, named_numbers, names, print_written, wrapped

if TYPE_CHECKING:
    from helisim.ident import ArduPilotModel, Fit

_EPILOG = """\
examples:
  helisim ardupilot rollpitch.json yaw.json heave.json --rpm 1700 \\
      --late r=0.0405 --out heli.json
  helisim ardupilot reproduction --rpm 1700 --out heli.json
  helisim ardupilot heli.json                  what such a file says

The file is of ArduPilot's pull request 29462, "Add Statespace model support to
SITL", frame -heli. Its servos are delays; what else it can't say is printed.
"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "ardupilot",
        help="write identified models for ArduPilot's state-space simulation",
        description="Write what was identified as the JSON of ArduPilot's state-space helicopter, "
        "or show such a file.",
        epilog=_EPILOG,
    )
    command.add_argument(
        "models",
        nargs="+",
        type=Path,
        metavar="MODEL",
        help="of identify, .json, where two say one thing the first does; a folder of "
        "helisim reproduce; or a file of ArduPilot's alone",
    )
    command.add_argument("--out", type=Path, metavar="FILE", help="the file, .json")
    command.add_argument("--rpm", type=float, metavar="RPM", help="of the main rotor")
    command.add_argument(
        "--lean", type=float, default=0.0, metavar="DEG", help="of the hover, to the right (0)"
    )
    command.add_argument(
        "--hover",
        type=float,
        default=0.5,
        metavar="SHARE",
        help="collective of the hover, of its range (0.5)",
    )
    command.add_argument(
        "--full",
        default="",
        metavar="NAME=X,...",
        help="what ArduPilot's 1 is in the records' unit (col=1,lon=0.5,lat=0.5,ped=0.5)",
    )
    command.add_argument(
        "--late",
        default="",
        metavar="NAME=S,...",
        help="by how much a channel is recorded late, s (default: 0, or what a folder's records "
        "say)",
    )
    command.add_argument(
        "--set",
        default="",
        metavar="NAME=X,...",
        help="further numbers of the file, in its units, such as Nv=1.7",
    )
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.base.files import check_destination
    from helisim.ident import ArduPilotModel

    if options.out is None:
        if len(options.models) > 1 or options.models[0].is_dir():
            raise InputError("--out FILE is missing; without it one file of ArduPilot's is shown")
        print(_text(ArduPilotModel.read(options.models[0])))
        return 0
    check_destination(options.out, (".json",))
    if options.rpm is None:
        raise InputError("--rpm is missing: the speed of the main rotor, 1/min")
    fits, late = _fits(options.models)
    late |= named_numbers("--late", names(options.late))
    model = ArduPilotModel.of(
        fits,
        rotor_speed=options.rpm * RAD_S_PER_RPM,
        hover_lean=math.radians(options.lean),
        hover=options.hover,
        full=named_numbers("--full", names(options.full)),
        late=late,
        others=named_numbers("--set", names(options.set)),
    )
    model.write(options.out)
    print(_text(model))
    print_written(options, str(options.out))
    return 0


def _fits(paths: list[Path]) -> "tuple[list[Fit], dict[str, float]]":
    """Return the models, and by how much their channels are recorded late."""
    from helisim.ident import load_fit

    if not paths[0].is_dir():
        return [load_fit(path) for path in paths], {}
    from helisim.study.for_design import identify_for_design

    plant = identify_for_design(paths[0])
    return list(plant.fits), dict(plant.late)


def _text(model: "ArduPilotModel") -> str:
    """Return the numbers, and what the file can't say."""
    width = max(map(len, model.values))
    rows = [f"{name:<{width}}  {value:.6g}" for name, value in model.values.items()]
    return "\n".join([*rows, *(wrapped(remark, indent=2) for remark in model.remarks)])
