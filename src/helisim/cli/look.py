"""`helisim look`: what logs hold, what was flown, what is usable, and what to run next."""

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.cli.common import add_quiet, names, print_written, worded_note, wrapped
from helisim.cli.logs import MAP_HELP, add_log_options, given_columns

if TYPE_CHECKING:
    from helisim.look import Proposal

_EPILOG = f"""\
example:
  helisim look flight.ulg
  helisim look lat.csv lon.csv --channel p=gyro_x:deg/s --json look.json

Nothing need be known of the logs: what the options don't say is guessed, with
the reason. Exit status 1: nothing can be identified from them.

{MAP_HELP}"""
_DOUBTS = ("sign", "axes", "scale")
"""Findings that the command to run next doesn't mend by itself."""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "look",
        help="look at flight logs of which nothing is known, and say what to run next",
        description="Print the channels of flight logs with guessed units, rates, gaps and jitter, "
        "what was swept and when, which channels answer and in which band, closed loops, what "
        "can't be as it is declared, and the `helisim identify` to run next.",
        epilog=_EPILOG,
    )
    add_log_options(command)
    command.add_argument("--json", type=Path, metavar="FILE", help="write what was found, .json")
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.base.files import check_destination, write_json
    from helisim.look import look

    if options.json is not None:
        check_destination(options.json, (".json",))
    channels, time = given_columns(options)
    found = look(
        options.logs,
        channels=channels,
        time=time,
        resample_hz=options.resample,
        repair=[name for item in options.repair for name in names(item)],
        max_gap=options.max_gap,
        start=options.from_time,
        stop=options.to_time,
    )
    for log in found.logs:
        print(wrapped(log.worded(worded_note), indent=4))
    print()
    command = "" if found.proposal is None else command_line(found.proposal)
    if command and any(one.kind in _DOUBTS for log in found.logs for one in log.findings):
        print(wrapped("settle first what is marked ! above: what follows takes columns as named\n"))
    # one line, so that it can be pasted
    print(f"run next:\n{command}" if command else "nothing can be identified from this")
    if options.json is not None:
        write_json({**found.to_dict(), "command": command}, options.json)
        print_written(options, str(options.json))
    return 0 if command else 1


def command_line(proposal: "Proposal") -> str:
    """Return a proposal as a line that works when it is pasted."""
    words = ["helisim", proposal.command, *proposal.logs]
    for name, values in proposal.options:
        words += [f"--{name.replace('_', '-')}", *values]
    return shlex.join(words)
