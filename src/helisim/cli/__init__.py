"""The command line: each command parses, calls the library once, prints, and exits.

A module in this folder that has an `add` is the command of that name; only the one that was asked
for is imported.

Exit status: 0 all is well, 1 the result misses a tolerance or a guideline, 2 the input is at
fault, 3 a flight was terminated early, 130 interrupted, 141 whoever read the output has gone.
"""

import logging
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pkgutil import iter_modules

from helisim import __version__
from helisim.base.errors import DivergedError, HelisimError, LogError, UnknownNameError
from helisim.cli.bands import joined
from helisim.cli.common import Parser, single_line, worded, worded_note

_EXAMPLES = """\
examples:
  helisim reproduce --out reproduction      the paper's experiment, end to end
  helisim fly --axis lat --out lat.parquet  one lateral sweep
  helisim linearize --json                  the exact linear model, for a script
  helisim identify lat.parquet lon.parquet --structure rollpitch \\
      --json model.json
  helisim verify model.json doublet.parquet
"""

_SHARED = {
    "bands",
    "by_hand",
    "common",
    "fitting",
    "given",
    "ground",
    "inferred",
    "logs",
    "looked",
    "manoeuvres",
    "missions",
    "progress",
    "responses",
    "sitl_script",
    "sitl_serving",
    "suspicions",
    "units",
    "weather",
}
"""Modules here that are no commands."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    words = joined(sys.argv[1:] if arguments is None else arguments)
    options = parser(words).parse_args(words)
    try:
        with _messages(quiet=getattr(options, "quiet", False)):
            status = options.run(options)
        sys.stdout.flush()
        return status
    except HelisimError as error:
        unlisted = error.unlisted if isinstance(error, UnknownNameError | LogError) else ()
        hint = worded(error.remedy)
        hint += "; --names lists them" if unlisted and not options.names else ""
        print(f"helisim {options.command}: {_lines(error)}{hint}", file=sys.stderr)
        if options.names:
            print(*unlisted, sep="\n", end="\n" if unlisted else "", file=sys.stderr)
        return 3 if isinstance(error, DivergedError) else 2
    except MemoryError as error:
        print(f"helisim {options.command}: too much for this machine: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"helisim {options.command}: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # as `helisim ... | head` ends; what is still to be printed goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141


def _lines(error: HelisimError) -> str:
    """Return an error's message: one line, or one for each fault of logs."""
    findings = error.findings if isinstance(error, LogError) else ()
    if len(findings) < 2:
        return single_line(str(error)) + "".join(worded(one.remedy) for one in findings)
    faults = [f"  {single_line(worded_note(finding))}" for finding in findings]
    return "\n".join([f"{len(faults)} things are wrong with the logs:", *faults])


@contextmanager
def _messages(*, quiet: bool) -> Iterator[None]:
    """Print what the library says while it works, on standard error."""
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
    return sorted({module.name for module in iter_modules(__path__)} - _SHARED)


def parser(words: Sequence[str] = ()) -> Parser:
    """Return the parser; of the commands only the one that `words` begin with, if there is one.

    Args:
        words: of the command line.
    """
    known = command_names()
    named = next((word for word in words if not word.startswith("-")), None)
    wanted = [named] if named in known else [] if words[:1] == ["--version"] else known
    whole = Parser(
        prog="helisim",
        description="Fly, sweep, identify and verify a nonlinear helicopter in MuJoCo.",
        epilog=_EXAMPLES,
    )
    whole.add_argument("--version", action="version", version=f"helisim {__version__}")
    commands = whole.add_subparsers(
        dest="command", required=True, metavar="COMMAND", parser_class=Parser
    )
    for name in wanted:
        import_module(f"helisim.cli.{name}").add(commands)
        commands.choices[name].add_argument(
            "--names", action="store_true", help="of a name that does not exist, list all that do"
        )
    return whole
