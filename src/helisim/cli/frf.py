"""`helisim frf`: frequency responses of anyone's logs."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from helisim.base.errors import InputError
from helisim.cli.bands import Bands
from helisim.cli.common import add_quiet, print_written
from helisim.cli.logs import MAP_HELP, add_log_options, describe, reports
from helisim.cli.progress import Progress
from helisim.cli.responses import Signals, add_responses, estimate
from helisim.cli.units import add_units, chosen_units

if TYPE_CHECKING:
    from helisim.ident import FrequencyResponse

_EPILOG = f"""\
example:
  helisim frf lat.csv --map heli.toml --inputs lat --outputs p,q \\
      --conditioning lon --csv p.csv

{MAP_HELP}"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "frf",
        help="estimate frequency responses from flight logs",
        description="Estimate frequency responses with coherence and random error from flight "
        "logs, by anyone, other inputs' effects removed.",
        epilog=_EPILOG,
    )
    add_log_options(command)
    add_responses(command, required=True)
    command.add_argument("--json", type=Path, metavar="FILE", help="write everything, .json")
    command.add_argument("--csv", type=Path, metavar="FILE", help="write the responses, .csv")
    add_units(command, "the responses in --csv")
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.base.files import check_destination
    from helisim.ident.response import save_response

    for path, suffix in ((options.json, ".json"), (options.csv, ".csv")):
        if path is not None:
            check_destination(path, (suffix,))
    if Bands.of(options).own:
        raise InputError("--band LO HI is one for all responses here; identify takes others by one")
    units = chosen_units(options)
    with Progress(len(options.logs) + 1, options.quiet) as advance:
        logs, _, frf, _ = estimate(options, Signals.of(options), advance)
    print(f"{describe(logs)}\n")
    print("\n".join(_table(frf)))
    shown = frf.in_units(units) if units else frf
    for found, path, more in (
        (frf, options.json, {"logs": reports(logs)}),
        (shown, options.csv, {}),
    ):
        if path is not None:
            save_response(found, path, more)
            print_written(options, str(path))
    return 0


def _table(frf: "FrequencyResponse") -> list[str]:
    """Return a line for each response: where it is usable and how well it is known."""
    from helisim.ident import USABLE_COHERENCE

    width = max(8, *map(len, frf.pairs))
    lines = [f"{'response':<{width}}  usable band, rad/s   coherence  random error, %"]
    usable = frf.usable()
    for name in frf.pairs:
        o, i = frf.index(*name.split("/", 1))
        where = usable[o, i]
        if not where.any():
            lines.append(
                f"{name:<{width}}  nowhere: coherence below {USABLE_COHERENCE} at all frequencies"
            )
            continue
        inside = frf.frequency[where]
        lines.append(
            f"{name:<{width}}  {inside[0]:8.3g} to {inside[-1]:<7.3g}  "
            f"{np.mean(frf.coherence[o, i, where]):9.3f}  "
            f"{100.0 * np.mean(frf.random_error[o, i, where]):15.2g}"
        )
    return lines + list(frf.flags)
