"""The command line: a command parses, calls the library once, prints, and exits.

Exit status: 0 all is well, 1 the result misses a tolerance or a guideline, 2 the input is at
fault, 3 a flight was terminated early, 130 interrupted, 141 a broken pipe.
"""

import argparse
import io
import json
import logging
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from importlib import import_module
from typing import Any

from helisim import __version__
from helisim.base.errors import DivergedError, HelisimError, LogError, single_line
from helisim.cli.options import (
    STDOUT,
    Parser,
    add_command,
    worded,
    worded_note,
)

_EXAMPLES = """\
examples:
  helisim reproduce --out reproduction      the paper's experiment, end to end
  helisim fly --axis lat --out lat.parquet  one lateral sweep
  helisim identify lat.parquet lon.parquet --structure rollpitch_speeds \\
      --json model.json
  helisim verify model.json doublet.parquet
"""
_TASKS = {
    "fly": "reproduce fly view sitl report rerun",
    "identify": "look frf identify verify structures examples",
    "control": "design margins tune",
    "groups": "vehicle study ardupilot",
}  # What one does -> the commands for it, as the help has them
_MODULES = {
    "autopilot": "sitl ardupilot ardupilot_parm ardupilot_export",
    "design": "design margins tune",
    "fitting": "identify structures verify",
    "flying": "fly view",
    "logs": "examples frf look rerun",
    "study": "report reproduce study study_recover study_campaign study_errata",
    "vehicle": "vehicle vehicle_list vehicle_new vehicle_check vehicle_build "
    "vehicle_linearize vehicle_trim vehicle_bench vehicle_calibrate",
}  # Module -> its commands, one with parts ahead of them
_COMMANDS = {name: module for module, words in _MODULES.items() for name in words.split()}
_MOVED = {"record": "rerun"} | {
    name.partition("_")[2]: name.replace("_", " ") for name in _COMMANDS if "_" in name
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    bare = {"", *(name.partition("_")[0] for name in _COMMANDS if "_" in name)}
    options = parser(words).parse_args([*words, "--help"] if " ".join(words) in bare else words)
    status, options.data = 2, []
    text = io.StringIO() if getattr(options, "json", None) == STDOUT else sys.stdout
    try:
        with _messages(quiet=getattr(options, "quiet", False)), redirect_stdout(text):
            for name, suffixes in options.parser.files.items():
                if suffixes and getattr(options, name) not in (None, STDOUT):
                    from helisim.base.files import check_destination

                    check_destination(getattr(options, name), suffixes)
            status = options.run(options) or 0
        for data in options.data:
            print(json.dumps(data, allow_nan=False))
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        # as `helisim ... | head` ends; what is still to be printed goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except HelisimError as error:
        said = f"{_lines(error)}{worded(error.remedy)}"
        status = 3 if isinstance(error, DivergedError) else 2
    except MemoryError as error:
        said = f"too much for this machine: {error}"
    except KeyboardInterrupt:
        said, status = "interrupted", 130
    print(f"{options.parser.prog}: {said}", file=sys.stderr)
    return status


def _lines(error: HelisimError) -> str:
    findings = error.findings if isinstance(error, LogError) else ()
    if len(findings) < 2:
        return single_line(str(error)) + "".join(worded(one.remedy) for one in findings)
    faults = [f"  {single_line(worded_note(finding))}" for finding in findings]
    return "\n".join([f"{len(faults)} things are wrong with the logs:", *faults])


@contextmanager
def _messages(*, quiet: bool) -> Iterator[None]:
    logger, handler = logging.getLogger("helisim"), logging.StreamHandler()
    before = logger.level
    logger.setLevel(logging.ERROR if quiet else logging.INFO)
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before)


def command_names() -> list[str]:
    """Return the names of all commands, sorted, without importing any."""
    return sorted(name for name in _COMMANDS if "_" not in name)


def parser(words: Sequence[str] = ()) -> Parser:
    """Return the parser; of the commands only the one that `words` begin with, if there is one."""
    known = command_names()
    named = next((word for word in words if not word.startswith("-")), None)
    wanted = [named] if named in known else [] if words[:1] == ["--version"] else known
    whole = Parser(
        prog="helisim",
        description="Fly, sweep, identify and verify a nonlinear helicopter in MuJoCo.",
        epilog=_EXAMPLES,
    )
    whole.add_argument("--version", action="version", version=f"helisim {__version__}")
    if named in _MOVED and named not in known:
        whole.error(f"there is no command {named!r}: it is helisim {_MOVED[named]}")
    whole.usage = "helisim COMMAND [options]"
    commands: Any = whole.add_subparsers(
        dest="command", prog="helisim", help=argparse.SUPPRESS, parser_class=Parser, required=True
    )
    for name in wanted:
        command = _add(commands, name, name)
        parts = [one for one in _COMMANDS if one.startswith(f"{name}_")]
        if parts:
            inner = command.add_subparsers(
                dest="part",
                prog=command.prog,
                metavar="PART",
                parser_class=Parser,
                required=True,
            )
            for part in parts:
                _add(inner, part, part.removeprefix(f"{name}_"))
    said = {one.dest: one.help for one in commands._choices_actions}
    for task, names in _TASKS.items():
        lines = [f"  {name:<12}{said[name]}" for name in names.split() if name in said]
        whole.description = "\n".join([f"{whole.description}\n", f"{task}:", *lines])
    return whole


def _add(commands: object, function: str, name: str) -> Parser:
    module = import_module(f"helisim.cli.{_COMMANDS[function]}")
    return add_command(commands, getattr(module, function), name)
