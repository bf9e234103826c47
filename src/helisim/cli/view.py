"""`helisim view`: fly in MuJoCo's viewer, in real time."""

import argparse
from typing import Any

from helisim.base.errors import InputError
from helisim.cli import by_hand
from helisim.cli.common import add_controller, add_parameters, add_vehicle, controlled, parameters
from helisim.cli.ground import EPILOG as GROUND
from helisim.cli.ground import add_ground, ground
from helisim.cli.manoeuvres import EPILOG, add_manoeuvre, is_asked, manoeuvre

_WEATHER = ("turbulence", "wind", "wind_from_deg")


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "view",
        help="watch the helicopter fly in MuJoCo's viewer, or fly it by hand",
        description="Fly in MuJoCo's viewer, in real time: a hover, or any manoeuvre; or by hand, "
        "with keys or a joystick. Needs a display; without one, record a flight with helisim fly "
        "--rerun.",
        epilog=f"example: helisim view --axis lat\n\n{by_hand.EPILOG}\n{GROUND}\n{EPILOG}",
    )
    add_vehicle(command)
    add_manoeuvre(command, alone=" (default: a hover, until the window is closed)")
    command.add_argument(
        "--seed", type=int, default=1, metavar="S", help="of the pilot (default: 1)"
    )
    command.add_argument(
        "--sitl",
        nargs="?",
        type=int,
        const=9002,
        metavar="PORT",
        help="let ArduPilot fly it from the ground, as helisim sitl does, which has more options "
        "(default port: 9002)",
    )
    add_ground(command)
    add_controller(command)
    add_parameters(command)
    by_hand.add_by_hand(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.show.viewer import check_display, view
    from helisim.vehicle import load

    duration = options.duration
    if duration is not None and not 0.0 < duration < float("inf"):
        raise InputError(f"--duration must be a positive number of seconds, got {duration}")
    if options.sitl is not None:
        return _watch_autopilot(options)
    if by_hand.is_by_hand(options):
        if is_asked(options):
            raise InputError("a hand flies no manoeuvre: leave out --axis, --excitation, --history")
        return by_hand.fly_by_hand(options)
    flown_on_purpose = manoeuvre(options) if is_asked(options) else None
    vehicle = controlled(load(options.vehicle, parameters=parameters(options)), options)
    check_display()
    flown = view(
        vehicle, flown_on_purpose, duration=duration, ground=ground(options), seed=options.seed
    )
    print(f"Flown: {flown:.1f} s")
    return 0


def _watch_autopilot(options: argparse.Namespace) -> int:
    """Let an autopilot fly, as `helisim sitl --view` does with what is given here."""
    from helisim.cli import parser

    words = ["sitl", options.vehicle, "--view", "--port", str(options.sitl)]
    words += [f"--seed={options.seed}", *(f"--set={one}" for one in options.set)]
    for name in ("ground", *_WEATHER):
        if getattr(options, name) is not None:
            words.append(f"--{name.replace('_', '-')}={getattr(options, name)}")
            setattr(options, name, None)
    flown = by_hand.is_by_hand(options) or is_asked(options)
    if flown or options.controller is not None or options.duration is not None:
        raise InputError("--sitl lets ArduPilot fly: leave out manoeuvre, sticks and controller")
    asked = parser(words).parse_args(words)
    return asked.run(asked)
