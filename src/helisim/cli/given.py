"""Frequency responses that a command is given in place of logs."""

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from helisim.base.errors import InputError

if TYPE_CHECKING:
    from helisim.ident import FrequencyResponse

_NAMED = re.compile(r"([^=/]+/[^=/]+)=(.+)")

_OF_LOGS = (
    "map",
    "channel",
    "time",
    "rate",
    "resample",
    "repair",
    "max_gap",
    "min_duration",
    "use_ended",
    "from_time",
    "to_time",
    "conditioning",
    "reference",
    "estimator",
    "windows",
    "overlap",
)
"""Options of how logs are read and responses estimated: they would do nothing."""


def add_given(command: argparse.ArgumentParser) -> None:
    """Add the option of how responses in text are read."""
    group = command.add_argument_group("how frequency responses in files are read")
    group.add_argument(
        "--columns",
        metavar="WHAT:UNIT,...",
        help="what the columns of text hold, in their order, where the headings don't say it, such "
        "as frequency:Hz,magnitude:dB,phase:deg,coherence; - is not used",
    )
    command.set_defaults(unchanged={name: command.get_default(name) for name in _OF_LOGS})


def given_response(
    options: argparse.Namespace, inputs: Sequence[str], outputs: Sequence[str]
) -> "FrequencyResponse | None":
    """Return the frequency response that the files hold; None where they are logs.

    Args:
        options: of the command, whose `logs` are paths, or p/lat=PATH.
        inputs: of the structure, which name what a file without names holds.
        outputs: of the structure.

    Raises:
        HelisimError: a file can't be read, or can't be used beside the others.
    """
    from helisim.ident.response import is_response, load_response

    named, bare = _apart(options.logs)
    columns = options.columns
    if not named and columns is None and not any(map(is_response, bare)):
        return None
    if len(bare) + bool(named) > 1:
        raise InputError(
            f"{bare[0]} is one of several files, and frequency responses come from one file that "
            "holds all, or from one for each, named p/lat=FILE q/lon=FILE; logs can't be beside "
            "them"
        )
    _refuse_options_of_logs(options)
    if named:
        return load_response(named, columns=columns)
    alone = f"{outputs[0]}/{inputs[0]}" if len(inputs) == len(outputs) == 1 else None
    return load_response(bare[0], columns=columns, unnamed=alone)


def _apart(paths: Sequence[Path]) -> tuple[dict[str, Path], list[Path]]:
    """Return files that are named, by response, and the others."""
    named, bare = {}, []
    for path in paths:
        match = None if path.exists() else _NAMED.fullmatch(str(path))
        if match is None:
            bare.append(path)
        elif match[1] in named:
            raise InputError(f"{match[1]} was given twice: {named[match[1]]} and {match[2]}")
        else:
            named[match[1]] = Path(match[2])
    return named, bare


def _refuse_options_of_logs(options: argparse.Namespace) -> None:
    changed = [name for name, item in options.unchanged.items() if getattr(options, name) != item]
    if changed:
        flags = ["--" + name.removesuffix("_time").replace("_", "-") for name in changed]
        raise InputError(
            f"{', '.join(flags)}: of logs, and the files hold frequency responses; estimate them "
            "anew from the logs, or leave it out"
        )
