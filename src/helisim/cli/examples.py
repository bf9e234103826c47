"""`helisim examples`: small recorded logs, for a first look without a flight."""

import argparse
from pathlib import Path
from typing import Any

from helisim.cli.common import add_quiet, print_written

_EPILOG = """\
example:
  helisim examples --to logs
  helisim identify logs/sweep_lat.parquet logs/sweep_lon.parquet \\
      --structure rollpitch --band 3 42 --json rollpitch.json
  helisim verify rollpitch.json logs/doublet_lat.parquet
  helisim identify logs/logger.csv --map logs/logger.toml --structure tf:0/2 \\
      --inputs lat --outputs p --band 3 25
"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "examples",
        help="list recorded logs that come with helisim, or copy them",
        description="List the recorded logs that come with helisim, or copy them into a folder, "
        "where the other commands read them as they read anyone's.",
        epilog=_EPILOG,
    )
    command.add_argument("--to", type=Path, metavar="FOLDER", help="copy them there")
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.logs.examples import copy_examples, examples

    if options.to is not None:
        copied = copy_examples(options.to)
        print_written(options, f"{len(copied)} files in {options.to}")
        return 0
    found = examples().values()
    width = max(len(one.name) for one in found)
    for one in found:
        print(f"{one.name:<{width}}  {one.meaning}")
    return 0
