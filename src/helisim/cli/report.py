"""`helisim report`: a run's report, made again from its files."""

import argparse
from pathlib import Path
from typing import Any

from helisim.cli.common import add_quiet, print_written


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "report",
        help="write a run's report again",
        description="Write DIR/report.html and DIR/figures again, from the files that helisim "
        "reproduce left in DIR: results.json, fits.json and flights/.",
        epilog="example: helisim report reproduction",
    )
    command.add_argument("folder", type=Path, metavar="DIR", help="folder of a run")
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.show.report import write_report

    path = write_report(options.folder)
    print_written(options, f"{path}, figures in {path.parent / 'figures'}")
    return 0
