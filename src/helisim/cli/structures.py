"""`helisim structures`: what can be identified, and the start of a structure of your own."""

import argparse
import os
import re
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError, UnknownNameError
from helisim.cli.common import wrapped

if TYPE_CHECKING:
    from helisim.ident import Structure

_TRANSFER = re.compile(r"tf:(\d{1,2})/(\d{1,2})$")
_GENERIC = {
    "first_order_delay": "b0 e^(-tau s) / (s + a0), of any input and output",
    "second_order_delay": "b0 e^(-tau s) / (s^2 + a1 s + a0), of any input and output",
    "tf:ZEROS/POLES": "transfer function with delay, such as tf:1/2, of any input and output",
    "tf:FACTORS": "the same in factors, such as 'tf:(a)/[zeta,omega](0)': (a) = s + a, (1/T), "
    "[zeta,omega] = s^2 + 2 zeta omega s + omega^2, (0) = s; a number in a name's place is a start",
}


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "structures",
        help="list the built-in model structures, or print one",
        description="List the structures that can be identified. With a name, print that one as "
        "TOML: the start of a structure of your own.",
        epilog="example: helisim structures rollpitch > mine.toml",
    )
    command.add_argument("name", nargs="?", metavar="NAME", help="built-in name or TOML file")
    command.set_defaults(run=_run)


def find_structure(
    name: str, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()
) -> "Structure":
    """Return a structure by its built-in name, as a transfer function, or from a TOML file.

    Args:
        name: such as "rollpitch", "tf:1/2", "tf:(a)/[zeta,omega](0)" or "mine.toml".
        inputs: input of a transfer function.
        outputs: output of a transfer function.

    Raises:
        UnknownNameError: no such structure; the message lists those that exist.
        InputError: the file is wrong, or a transfer function lacks its channels.
        StorageError: the file can't be read.
    """
    from helisim.ident import Structure, structures

    if name in structures.BUILT_IN:
        return structures.named(name)
    orders = {"first_order_delay": (0, 1), "second_order_delay": (0, 2)}.get(name)
    match = _TRANSFER.match(name)
    if match is not None:
        orders = (int(match[1]), int(match[2]))
    in_factors = orders is None and name.startswith("tf:")
    if (orders is not None or in_factors) and (len(inputs) != 1 or len(outputs) != 1):
        raise InputError(f"{name} needs one input and one output: --inputs A --outputs B")
    if in_factors:
        return structures.factored(name[3:], input=inputs[0], output=outputs[0])
    if orders is not None:
        return structures.transfer_function(
            zeros=orders[0], poles=orders[1], input=inputs[0], output=outputs[0]
        )
    if name.lower().endswith(".toml") or os.path.isfile(name):
        return Structure.from_toml(name)
    raise UnknownNameError("structure", name, (*structures.BUILT_IN, *_GENERIC, "FILE.toml"))


def _run(options: argparse.Namespace) -> int:
    from helisim.ident import structures

    if options.name is not None:
        example = ("input",), ("output",)
        print(find_structure(options.name, *example).to_toml(), end="")
        return 0
    rows = [
        (
            structure.name,
            f"{', '.join(structure.outputs)} over {', '.join(structure.inputs)}: "
            f"{structure.meaning}",
        )
        for structure in structures.BUILT_IN.values()
    ]
    rows += list(_GENERIC.items())
    width = max(len(name) for name, _ in rows)
    for name, meaning in rows:
        print(wrapped(f"{name:<{width}}  {meaning}", indent=width + 2))
    return 0
