"""Options and steps that the commands share which read flight logs."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING, Any, NamedTuple

from helisim.base.errors import IdentificationError, InputError
from helisim.cli.common import names, worded_note, wrapped
from helisim.logs.mapping import MAP_EXAMPLE, REPAIRS

if TYPE_CHECKING:
    from helisim.logs import Clock, Column, Log, Map
    from helisim.records.record import FlightRecord

MAP_HELP = "a map is a TOML file, such as\n" + indent(MAP_EXAMPLE, "  ")


def add_log_options(command: argparse.ArgumentParser) -> None:
    """Add the logs and the options of how to read them."""
    command.add_argument(
        "logs",
        nargs="+",
        type=Path,
        metavar="LOG",
        help="helisim record, CSV, Parquet, ULog (PX4) or DataFlash (ArduPilot)",
    )
    group = command.add_argument_group("how to read the logs")
    group.add_argument(
        "--map", type=Path, metavar="FILE", help="which column is which channel, TOML; see below"
    )
    group.add_argument(
        "--channel",
        action="append",
        default=[],
        metavar="NAME=COLUMN:UNIT",
        help="the same for one channel, with sign=-1, trim=X, range=X after further colons; "
        "may be given again",
    )
    group.add_argument("--time", metavar="COLUMN[:UNIT]", help="column of times, in s, ms, us, ...")
    group.add_argument("--rate", type=float, metavar="HZ", help="of a log without times")
    group.add_argument(
        "--resample",
        type=float,
        metavar="HZ",
        help="make the samples uniform (with a filter where the log is faster)",
    )
    group.add_argument(
        "--repair",
        action="append",
        default=[],
        metavar="NAME,...",
        help="allow repairs: "
        + "; ".join(f"{name} ({meaning})" for name, meaning in REPAIRS.items()),
    )
    group.add_argument(
        "--max-gap",
        type=float,
        metavar="S",
        help="longest time between samples that is no gap (default: 4.5 median steps)",
    )
    group.add_argument(
        "--min-duration",
        type=float,
        default=0.0,
        metavar="S",
        help="leave out shorter parts of a log that is split",
    )
    group.add_argument(
        "--use-ended",
        action="store_true",
        help="use logs of simulated flights that were terminated early, too",
    )
    group.add_argument(
        "--from",
        dest="from_time",
        type=float,
        metavar="S",
        help="leave out what is before, s after the log's first sample",
    )
    group.add_argument(
        "--to",
        dest="to_time",
        type=float,
        metavar="S",
        help="leave out what is after, s after the log's first sample",
    )


class Read(NamedTuple):
    """Logs that were read, and their records in one row."""

    logs: "tuple[Log, ...]"
    records: "tuple[FlightRecord, ...]"


def read_logs(
    options: argparse.Namespace,
    wanted: Sequence[str] | None,
    advance: Callable[[str], None],
    *,
    moving: bool = False,
) -> Read:
    """Read all logs: uniform, with all wanted channels, which must move somewhere if `moving`.

    None wants all that the options name, or else all that state their units.

    Raises:
        LogError: all that is wrong with them; the message names files, columns and rows.
    """
    from helisim.logs import read_logs

    channels, time = _columns(options, wanted)
    logs = read_logs(
        options.logs,
        channels=channels,
        wanted=wanted or (),
        moving=moving,
        time=time,
        resample_hz=options.resample,
        repair=[name for item in options.repair for name in names(item)],
        max_gap=options.max_gap,
        min_duration=options.min_duration,
        start=options.from_time,
        stop=options.to_time,
        use_ended=options.use_ended,
        on_progress=advance,
    )
    return Read(logs, tuple(record for log in logs for record in log.records))


@contextmanager
def located(logs: "Sequence[Log]") -> Iterator[None]:
    """Add files, columns and rows to an error about the channels that its message names."""
    try:
        yield
    except IdentificationError as error:
        if not logs:
            raise
        text = str(error)
        channels = [name for name in logs[0].headings if repr(name) in text]
        places = [log.where(name) for log in logs for name in channels] or [
            f"{log.report.path}, {log.report.counts}s {log.report.parts[0].first_row} to "
            f"{log.report.parts[-1].last_row}"
            for log in logs
        ]
        raise IdentificationError(f"{'; '.join(places)}: {text}") from None


def describe(logs: "Sequence[Log]") -> str:
    """Return how the logs were read."""
    return "\n".join(wrapped(log.report.worded(worded_note), indent=2) for log in logs)


def reports(logs: "Sequence[Log]") -> list[dict[str, Any]]:
    """Return how the logs were read, as plain data."""
    return [log.report.to_dict() for log in logs]


def _columns(
    options: argparse.Namespace, wanted: Sequence[str] | None
) -> "tuple[Map | tuple[str, ...] | None, Clock | None]":
    """Return the map, or the wanted names where none is given, and the clock."""
    from helisim.logs import Column

    given, time = given_columns(options)
    if wanted is None:
        return (given if given.channels else None), time
    if options.map is None and not options.channel:
        return tuple(wanted), time
    return (
        replace(given, channels={name: given.channels.get(name, Column(name)) for name in wanted}),
        time,
    )


def given_columns(options: argparse.Namespace) -> "tuple[Map, Clock | None]":
    """Return the map that the options say, empty if they say none, and the clock."""
    from helisim.logs import Clock, Map

    if options.time is not None and options.rate is not None:
        raise InputError("--time and --rate exclude each other: give one")
    time = None if options.rate is None else Clock(rate=options.rate)
    if options.time is not None:
        column, _, unit = options.time.partition(":")
        time = Clock(column, unit or None)
    given = Map() if options.map is None else Map.from_toml(options.map)
    return given.with_channels(dict(_channel(item) for item in options.channel)), time


def _channel(item: str) -> "tuple[str, Column]":
    from helisim.logs.mapping import named_column

    try:
        return named_column(item)
    except InputError as error:
        raise InputError(f"--channel: {error}") from None
