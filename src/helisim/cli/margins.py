"""`helisim margins`: a closed loop's margins, from flight logs alone."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError
from helisim.cli.bands import Bands
from helisim.cli.common import add_quiet, named_numbers, names, print_written, wrapped
from helisim.cli.logs import MAP_HELP, add_log_options, describe, located, read_logs, reports
from helisim.cli.progress import Progress

if TYPE_CHECKING:
    from helisim.handling.measured.margins import Cut, MeasuredMargins
    from helisim.look.loops import FlownLoops

_EPILOG = f"""\
example:
  helisim margins flight.bin
  helisim fly --axis ped --at actuators --excitation \\
      chirp,amplitude=0.05,band=2:90 --set pilot.k_heading=0 --out loop.parquet
  helisim margins loop.parquet
  helisim margins flight.ulg --map heli.toml --axis lat --injected dither \\
      --total mixer_in --returned rate_out --band 2 60

Where channels are called lat_disturbance (what was added to lat) and lat_sum
(what came of it), or phi_disturbance and phi_sum of a sensed angle, nothing
need be said. Sticks that were swept give bandwidth and phase delay. Nor need
it of logs of ArduPilot's mode SystemID (SID_AXIS 1 to 12) on a helicopter:
they say themselves what was injected, and that is printed.

Exit status 1: none of the figures could be measured.

{MAP_HELP}"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "margins",
        help="measure margins, disturbance rejection and bandwidth from flight logs",
        description="Measure a closed loop from flight logs, by anyone, in which something was "
        "injected that the control law doesn't know: crossover, phase and gain margin of the "
        "broken loop, disturbance rejection bandwidth and peak, bandwidth and phase delay of the "
        "answer to a stick, all with 95 % intervals. No model is fitted.",
        epilog=_EPILOG,
    )
    add_log_options(command)
    group = command.add_argument_group("what was injected")
    group.add_argument(
        "--axis", metavar="A,B", help="lat, lon, ped, col or roll, pitch, yaw, heave (default: all)"
    )
    group.add_argument(
        "--at",
        metavar="PLACE",
        help="where the loop was cut: actuators, sensors (an attitude that was turned), or a rate "
        "that is sensed, p, q or r (default: all that channels' names say; else actuators)",
    )
    group.add_argument(
        "--injected", metavar="C,D", help="channel of what was added there, one each axis"
    )
    group.add_argument(
        "--returned", metavar="C,D", help="channel of what comes back there, before that is added"
    )
    group.add_argument(
        "--total", metavar="C,D", help="channel of their sum; of both, one is enough"
    )
    group = command.add_argument_group("how it is measured")
    group.add_argument(
        "--band",
        action="append",
        default=[],
        metavar="LO HI",
        help="lowest and highest frequency, rad/s (default: where what was injected has power)",
    )
    group.add_argument(
        "--late",
        action="append",
        default=[],
        metavar="NAME=S",
        help="by how much the record of a channel is late, s; may be given again (default: 0, or "
        "what a simulation's record says)",
    )
    group.add_argument(
        "--draws", type=int, metavar="N", help="of the loop, for the intervals (default: 400)"
    )
    command.add_argument("--json", type=Path, metavar="FILE", help="write the figures, .json")
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.base.files import check_destination, write_json
    from helisim.handling.measured.margins import DRAWS, margins
    from helisim.show.table import as_text, filled
    from helisim.show.tables import measured_margins

    if _is_dataflash(options):
        return _run_inferred(options)
    if options.json is not None:
        check_destination(options.json, (".json",))
    bands, cuts = Bands.of(options), _cuts(options)
    if bands.own:
        raise InputError("--band LO HI is one for all responses here")
    late = named_numbers("--late", [item for text in options.late for item in names(text)])
    wanted = None if cuts is None else [n for cut in cuts for n in (cut.injected, *cut.outputs)]
    with Progress(len(options.logs) + 1, options.quiet) as advance:
        logs, records = read_logs(options, wanted, advance)
        with located(logs):
            found = margins(
                records,
                cuts=cuts,
                axes=None if options.axis is None else names(options.axis),
                at=options.at,
                band=bands.common,
                late=late,
                draws=DRAWS if options.draws is None else options.draws,
            )
        advance("margins")
    print(f"{describe(logs)}\n")
    if found.figures:
        print(as_text(measured_margins(found)))
    for remark in found.remarks:
        print(filled(remark))
    if options.json is not None:
        write_json({**found.to_dict(), "logs": reports(logs)}, options.json)
        print_written(options, str(options.json))
    return 0 if found.figures else 1


def _is_dataflash(options: argparse.Namespace) -> bool:
    """Return whether logs say themselves what was injected, and nothing else is asked for."""
    from helisim.logs.dataflash import is_dataflash

    named = (options.injected, options.total, options.returned, options.map, options.channel)
    return not any(named) and all(path.is_file() and is_dataflash(path) for path in options.logs)


def _run_inferred(options: argparse.Namespace) -> int:
    """Measure the loops that logs of SystemID cut. Return the exit status."""
    from helisim.base.files import check_destination, write_json
    from helisim.look.loops import flown_loops

    bands = Bands.of(options)
    if bands.own:
        raise InputError("--band LO HI is one for all responses here")
    if options.json is not None:
        check_destination(options.json, (".json",))
    unused = [
        f"--{name.replace('_', '-')}"
        for name in ("time", "rate", "resample", "repair", "max_gap", "min_duration", "late")
        if getattr(options, name)
    ]
    if unused:
        raise InputError(
            f"{', '.join(unused)}: of channels that --injected, --total and --channel name; sweeps "
            "of an autopilot are read at its own ticks"
        )
    with Progress(2, options.quiet) as advance:
        found = flown_loops(options.logs, start=options.from_time, stop=options.to_time)
        advance("logs")
        measured = found.margins(
            axes=None if options.axis is None else names(options.axis),
            at=options.at,
            band=bands.common,
            **({} if options.draws is None else {"draws": options.draws}),
        )
        advance("margins")
    print(wrapped(str(found), indent=4), end="\n\n")
    print_loops(found, measured)
    if options.json is not None:
        logs = [one.to_dict() for one in found.logs]
        write_json({**measured.to_dict(), "logs": logs}, options.json)
        print_written(options, str(options.json))
    return 0 if measured.figures else 1


def print_loops(found: "FlownLoops", measured: "MeasuredMargins") -> None:
    """Print the figures of loops as flown, and what is to be known of them."""
    from helisim.show.table import as_text, filled
    from helisim.show.tables import measured_margins

    if measured.figures:
        print(as_text(measured_margins(measured)))
    for remark in (*measured.remarks, *found.remarks):
        print(filled(remark))


def _cuts(options: argparse.Namespace) -> "tuple[Cut, ...] | None":
    """Return the cuts that the options say; None if the channels' names shall say them."""
    from helisim.handling.measured.margins import Cut

    injected, total, returned = (
        names(text) for text in (options.injected, options.total, options.returned)
    )
    if not injected:
        if total or returned:
            raise InputError("--total and --returned need --injected: what was added there")
        return None
    axes = names(options.axis)
    for flag, given in (("--axis", axes), ("--total", total), ("--returned", returned)):
        if len(given) != len(injected) and (given or flag == "--axis"):
            raise InputError(
                f"--injected names {len(injected)} channel(s) and {flag} {len(given)}; expected "
                "one of each for every axis"
            )
    nothing = (None,) * len(injected)
    return tuple(
        Cut(axis, options.at or "actuators", added, both, back)
        for axis, added, both, back in zip(axes, injected, total or nothing, returned or nothing)
    )
