"""The options of `helisim view` that let a hand fly."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from helisim.base.errors import InputError
from helisim.cli.common import controlled, parameters
from helisim.cli.ground import ground
from helisim.cli.weather import add_weather, weather

if TYPE_CHECKING:
    from helisim.hand import StickFeel

EPILOG = """\
by hand:
  helisim view --keyboard --out hand.parquet
  helisim view --joystick --mode 1 --assist level
  helisim view --joystick radio --map radio.toml --turbulence light
W S A D are the left gimbal of a transmitter and the arrows the right one; what
each does is the mode's and stands in the window, with all other keys. R starts
and stops a recording, which helisim identify reads.
"""

_DEFAULT_OUT = Path("by_hand.parquet")


def add_by_hand(command: argparse.ArgumentParser) -> None:
    """Add the options."""
    group = command.add_argument_group("by hand")
    group.add_argument("--keyboard", action="store_true", help="fly by hand, with keys")
    group.add_argument(
        "--joystick",
        nargs="?",
        const="",
        metavar="N|NAME",
        help="fly by hand, with a joystick, gamepad or transmitter: its number or part of its "
        "name (default: the only one)",
    )
    group.add_argument(
        "--mode", type=int, metavar="1|2|3|4", help="which stick is where (default: 2)"
    )
    group.add_argument(
        "--assist",
        metavar="NAME",
        help="hover (default): the sticks command velocities; level: tilt; none: rates, as the "
        "gyro takes them",
    )
    group.add_argument(
        "--rate", type=float, metavar="R", help="share of the travel that a full stick gives"
    )
    group.add_argument("--expo", type=float, metavar="E", help="0 linear to 1, soft in the middle")
    group.add_argument(
        "--deadband", type=float, metavar="D", help="deflection about the middle that is none"
    )
    group.add_argument(
        "--order",
        metavar="LETTERS",
        help="of a transmitter's channels: aileron, elevator, throttle, rudder (default: AETR)",
    )
    group.add_argument("--map", type=Path, metavar="FILE", help="axes of the joystick, .toml")
    group.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help=f"recordings, .parquet or .csv, further ones numbered (default: {_DEFAULT_OUT})",
    )
    add_weather(command)


_ONLY_BY_HAND = (
    *("mode", "assist", "rate", "expo", "deadband", "order", "map", "out"),
    *("turbulence", "wind", "wind_from_deg"),
)


def is_by_hand(options: argparse.Namespace) -> bool:
    """Return whether a hand flies. Raises InputError: options are given that ask for one."""
    if options.keyboard or options.joystick is not None:
        return True
    given = [name for name in _ONLY_BY_HAND if getattr(options, name) is not None]
    if given:
        raise InputError(
            f"--{given[0].replace('_', '-')} is for a flight by hand: add --keyboard or --joystick"
        )
    return False


def fly_by_hand(options: argparse.Namespace) -> int:
    """Fly and say which records were written. Raises HelisimError."""
    _check(options)
    from helisim.base.files import check_destination
    from helisim.hand import KEY_FEEL, JoystickMap, StickFeel
    from helisim.hand.assist import check_assist
    from helisim.hand.sticks import check_mode
    from helisim.hand.window import fly_by_hand
    from helisim.show.viewer import check_display
    from helisim.sim import Weather
    from helisim.vehicle import load

    mode = check_mode(2 if options.mode is None else options.mode)
    assist = check_assist(options.assist or "hover")
    feel = _feel(options, KEY_FEEL if options.keyboard else StickFeel())
    axes = None if options.map is None else JoystickMap.read(options.map)
    if options.order is not None:
        axes = JoystickMap.transmitter(options.order)
    air, below = weather(options, Weather()), ground(options)
    out = check_destination(options.out or _DEFAULT_OUT)
    check_display()
    written = fly_by_hand(
        controlled(load(options.vehicle, parameters=parameters(options)), options),
        joystick=options.joystick,
        mode=mode,
        assist=assist,
        feel=feel,
        axes=axes,
        weather=air,
        ground=below,
        out=out,
        duration=options.duration,
        seed=options.seed,
    )
    for path in written:
        print(f"Written: {path}")
    return 0


def _feel(options: argparse.Namespace, usual: "StickFeel") -> "StickFeel":
    """Return the feel of the sticks that the options say, else the usual one."""
    given = {name: getattr(options, name) for name in ("rate", "expo", "deadband")}
    return replace(usual, **{name: one for name, one in given.items() if one is not None})


def _check(options: argparse.Namespace) -> None:
    """Refuse what excludes each other."""
    if options.keyboard and options.joystick is not None:
        raise InputError("--keyboard and --joystick exclude each other: give one of them")
    if options.joystick is None:
        for name in ("order", "map"):
            if getattr(options, name) is not None:
                raise InputError(f"--{name} is of a joystick: add --joystick")
    if options.map is not None and options.order is not None:
        raise InputError("--map and --order exclude each other: give one of them")
