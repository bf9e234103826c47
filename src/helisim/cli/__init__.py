"""The command line: each command parses, calls the library once, prints, and exits.

Exit status: 0 all is well, 1 the result misses a tolerance or a guideline, 2 the input is at
fault, 3 a flight was over before its time, 130 interrupted, 141 whoever read the output has gone.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version

from helisim.cli import (
    bench,
    calibrate,
    campaign,
    errata,
    fly,
    frf,
    identify,
    linearize,
    record,
    recover,
    report,
    reproduce,
    structures,
    trim,
    tune,
    verify,
    view,
)
from helisim.cli.common import Parser
from helisim.errors import DivergedError, HelisimError

_EXAMPLES = """\
examples:
  helisim reproduce --out reproduction      the paper's experiment, end to end
  helisim fly --axis lat --out lat.parquet  one lateral sweep
  helisim linearize --json                  the exact linear model, for a script
  helisim identify lat.parquet lon.parquet --structure rollpitch \\
      --json model.json
  helisim verify model.json doublet.parquet
"""

_COMMANDS = (
    reproduce,
    fly,
    linearize,
    trim,
    calibrate,
    tune,
    recover,
    campaign,
    identify,
    frf,
    verify,
    structures,
    bench,
    errata,
    record,
    report,
    view,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    options = _parser().parse_args(arguments)
    try:
        status = options.run(options)
        sys.stdout.flush()
        return status
    except HelisimError as error:
        print(f"helisim {options.command}: {_one_line(str(error))}", file=sys.stderr)
        return 3 if isinstance(error, DivergedError) else 2
    except KeyboardInterrupt:
        print(f"helisim {options.command}: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # as `helisim ... | head` ends; what is still to be printed goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141


def _one_line(text: str) -> str:
    """Return a message without line breaks, such as a file's name may hold."""
    return " ".join(text.splitlines())


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="helisim",
        description="Fly, sweep, identify and verify a nonlinear helicopter in MuJoCo.",
        epilog=_EXAMPLES,
    )
    parser.add_argument("--version", action="version", version=f"helisim {version('helisim')}")
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", parser_class=Parser
    )
    for command in _COMMANDS:
        command.add(commands)
    return parser
