"""What a first look at logs of PX4 says for `helisim identify`, where its options say nothing."""

import argparse
import shlex

from helisim.base.errors import InputError
from helisim.cli.common import names, worded_note, wrapped
from helisim.cli.logs import given_columns
from helisim.cli.look import command_line

_OF_THE_LOOK = {"logs", "channel", "map", "time", "rate", "resample", "repair", "max_gap"}
_OF_THE_LOOK |= {"from_time", "to_time"}
"""Options that the look has taken, and its command has again."""
_SET = (
    "nothing in it answers coherently to a sweep; log fast (SDLOG_PROFILE's bit 4, high rate), "
    "sweep one axis after the other, or say --structure and --map; helisim look {} says what is "
    "in it"
)


def looked(options: argparse.Namespace) -> argparse.Namespace | None:
    """Return the options with what a look at ULogs adds, and print what that is.

    PX4 logs no sweeps of its own as ArduPilot does; so what moved is seen by its signals, whether a
    pilot, an offboard program or an autotune moved it.

    Args:
        options: of `helisim identify`.

    Returns:
        None where the structure is said, or a log is no ULog.

    Raises:
        InputError: nothing that can be identified is seen.
    """
    from helisim.base.files import first_bytes
    from helisim.logs.ulog import ULOG_MAGIC
    from helisim.look import look

    size = len(ULOG_MAGIC)
    if options.structure is not None or not all(path.is_file() for path in options.logs):
        return None
    if not all(first_bytes(path, size) == ULOG_MAGIC for path in options.logs):
        return None
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
    where = " ".join(shlex.quote(str(path)) for path in options.logs)
    if found.proposal is None:
        raise InputError(f"{options.logs[0]}: a log of PX4: {_SET.format(where)}")
    print(wrapped("a log of PX4, which says of no sweep itself: what moved is told by its signals"))
    for log in found.logs:
        print(wrapped(log.worded(worded_note), indent=4))
    command = command_line(found.proposal)
    print(f"\nso what is run is\n{command}\n")
    return _with_own(options, command)


def _with_own(options: argparse.Namespace, command: str) -> argparse.Namespace:
    """Return a command's options, those that were given in place of its own."""
    from helisim.cli import parser
    from helisim.cli.bands import joined

    words = joined(shlex.split(command)[1:])
    chosen = parser(words).parse_args(words)
    usual = ["identify", *map(str, options.logs)]
    for name, usual_value in vars(parser(usual).parse_args(usual)).items():
        if name not in _OF_THE_LOOK and (own := getattr(options, name)) != usual_value:
            setattr(chosen, name, own)
    return chosen
