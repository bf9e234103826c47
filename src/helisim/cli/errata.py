"""`helisim errata`: what is wrong in the paper, with its calculation."""

import argparse
import json
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "errata",
        help="list the paper's errors, each with its calculation",
        description="List what the paper's own numbers contradict, each computed as it is printed.",
        epilog="example: helisim errata --json",
    )
    command.add_argument("--json", action="store_true", help="as JSON")
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.show.terminal import render_errata
    from helisim.study.paper.errata import errata

    found = errata()
    if options.json:
        print(json.dumps([erratum.to_dict() for erratum in found], indent=2, allow_nan=False))
    else:
        print(render_errata(found))
    return 0
