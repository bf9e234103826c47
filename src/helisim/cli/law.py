"""`helisim law`: what a control law's file says, and LQG laws from flights."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError
from helisim.cli.common import add_quiet, named_numbers, names, print_written

if TYPE_CHECKING:
    from helisim.design.lqg import LqgWeights, Tracked

_EPILOG = """\
examples:
  helisim reproduce --out reproduction
  helisim law lqg reproduction --out lqg.toml
  helisim law show lqg.toml
  helisim fly --axis lat --controller lqg.toml --out lat.parquet
"""
_PERIOD = 0.002
_STICKS = {"theta": "LON", "phi": "LAT", "r": "PED"}
_GAINS = {"theta": 0.6, "phi": 0.6, "r": 3.0}
_ERRORS = {"theta": 0.1, "phi": 0.1, "r": 0.3}
_RATES = {"p": 0.4, "q": 0.4}
_DISTURBANCE = {"lon": 0.05, "lat": 0.05, "ped": 0.02}


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "law",
        help="show a control law's file, or make an LQG law from flights",
        description="Show what a control law's file says, as words or matrices, and make LQG laws "
        "of what flights identify.",
        epilog=_EPILOG,
    )
    parts = command.add_subparsers(
        dest="part", required=True, metavar="PART", parser_class=type(command)
    )
    show = parts.add_parser(
        "show",
        help="what a law sees, commands and keeps",
        description="Print a law's inputs, commands, poles and parameters, or its matrices.",
        epilog="example: helisim law show law.toml --json > matrices.json",
    )
    show.add_argument("law", type=Path, metavar="LAW", help="its file, .toml")
    show.add_argument(
        "--period", type=float, metavar="S", help="of its ticks, s (default: its own, or 0.002)"
    )
    show.add_argument("--json", action="store_true", help="its sampled matrices and names as JSON")
    show.set_defaults(run=_show)
    _add_lqg(parts)


def _add_lqg(parts: Any) -> None:
    lqg = parts.add_parser(
        "lqg",
        help="make an LQG law of what sweeps identify",
        description="Identify the aircraft from sweeps, make an LQG law of it that commands roll "
        "and pitch attitude and yaw rate, and print the margins that the models predict. Each "
        "number is a size of what counts as much as any other's.",
        epilog="example: helisim law lqg reproduction --error phi=0.05 --out lqg.toml",
    )
    lqg.add_argument(
        "source", type=Path, metavar="FOLDER", help="of helisim reproduce, or of sweeps"
    )
    lqg.add_argument("--out", type=Path, required=True, metavar="FILE", help="the law, .toml")
    for option, usual, what in (
        ("gain", _GAINS, "of a whole stick, rad, of r rad/s"),
        ("error", _ERRORS, "that is borne, rad, of r rad/s"),
        ("rate", _RATES, "that is borne, rad/s"),
        ("effort", {"lat": 0.1}, "that is borne, unitised"),
        ("disturbance", _DISTURBANCE, "of a command that is expected, rms, unitised"),
        ("noise", {"p": 0.01}, "of what is sensed, rms, SI"),
    ):
        shown = ",".join(f"{name}={value:g}" for name, value in usual.items())
        lqg.add_argument(
            f"--{option}", default="", metavar="NAME=X,...", help=f"{what} (default: {shown})"
        )
    lqg.add_argument(
        "--frequency", type=float, default=6.0, metavar="W", help="of the command models, rad/s (6)"
    )
    add_quiet(lqg)
    lqg.set_defaults(run=_lqg)


def _show(options: argparse.Namespace) -> int:
    from helisim.design.laws import StateSpaceLaw, read_law
    from helisim.show.terminal import law_text

    law = read_law(options.law)
    period = options.period
    if period is None:
        period = law.period if isinstance(law, StateSpaceLaw) else _PERIOD
    if not period > 0.0:
        raise InputError(f"--period must be above 0 s, got {period:g}")
    if not options.json:
        print(law_text(law, period))
        return 0
    linear = law.linear(period).sampled
    matrices = {name: getattr(linear, name).tolist() for name in ("a", "b", "c", "d")}
    facts = {"period": period, "inputs": list(linear.inputs), "outputs": list(linear.outputs)}
    print(json.dumps({**facts, **matrices}, indent=2))
    return 0


def _lqg(options: argparse.Namespace) -> int:
    from helisim.base.files import check_destination
    from helisim.design.lqg import lqg
    from helisim.handling.closed_loop import ClosedLoop
    from helisim.show.table import as_text
    from helisim.show.tables import loop_margins
    from helisim.study.for_design import identify_for_design

    check_destination(options.out, (".toml",))
    tracked, weights = _asked(options)
    plant = identify_for_design(options.source, axes=("lon", "lat", "ped"))
    law = lqg(plant, tracked, weights)
    print(as_text(loop_margins(ClosedLoop(plant, law.linear(plant.period)))))
    law.write(options.out)
    print_written(options, str(options.out))
    return 0


def _asked(options: argparse.Namespace) -> "tuple[tuple[Tracked, ...], LqgWeights]":
    """Return what is tracked, and the weights. Raises InputError."""
    from helisim.design.lqg import LqgWeights, Tracked

    gains, errors = _sizes(options, "gain", _GAINS), _sizes(options, "error", _ERRORS)
    tracked = tuple(
        Tracked(
            output=name,
            stick=stick,
            gain=gains[name],
            frequency=options.frequency,
            error=errors[name],
        )
        for name, stick in _STICKS.items()
    )
    return tracked, LqgWeights(
        output=_RATES | named_numbers("--rate", names(options.rate)),
        effort=named_numbers("--effort", names(options.effort)),
        disturbance=_DISTURBANCE | named_numbers("--disturbance", names(options.disturbance)),
        noise=named_numbers("--noise", names(options.noise)),
    )


def _sizes(options: argparse.Namespace, option: str, usual: dict[str, float]) -> dict[str, float]:
    from helisim.base.errors import UnknownNameError

    given = named_numbers(f"--{option}", names(getattr(options, option)))
    for name in given:
        if name not in usual:
            raise UnknownNameError(f"output of --{option}", name, usual)
    return usual | given
