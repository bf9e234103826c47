"""`helisim completion`: what a shell needs to complete commands and options."""

import argparse
from typing import Any


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "completion",
        help="print what a shell needs to complete commands and options",
        description="Print a script that makes a shell complete helisim's commands, options and "
        "file names.",
        epilog="examples:\n"
        "  helisim completion bash > ~/.local/share/bash-completion/completions/helisim\n"
        '  eval "$(helisim completion zsh)"          in ~/.zshrc\n',
    )
    command.add_argument("shell", metavar="SHELL", help="bash, zsh or tcsh")
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    import shtab

    from helisim.base.errors import UnknownNameError
    from helisim.cli import parser

    if options.shell not in shtab.SUPPORTED_SHELLS:
        raise UnknownNameError("shell", options.shell, shtab.SUPPORTED_SHELLS)
    print(shtab.complete(parser(), options.shell))
    return 0
