"""The options that say which mission is flown."""

import argparse
from collections.abc import Sequence
from dataclasses import MISSING, fields, replace
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError, UnknownNameError
from helisim.cli.common import imported, wrapped
from helisim.cli.manoeuvres import stated

if TYPE_CHECKING:
    from helisim.sim.missions import Mission

EPILOG = """\
a mission is NAME[,NAME=VALUE...], or MODULE:CLASS, a Mission of your own;
--missions lists all with their settings:
  --mission forward,speed=20             out at 20 m/s, and back
  --mission take_off_hover_land          with --excitation, flown on top of it
"""


def add_mission(command: argparse.ArgumentParser) -> None:
    """Add the options of a mission."""
    command.add_argument(
        "--mission",
        metavar="NAME[,NAME=VALUE...]",
        help="fly this script, see below: take_off_hover_land, forward, pirouette, autorotation",
    )
    command.add_argument("--missions", action=_Missions, help="list all missions with settings")


def mission(options: argparse.Namespace, planned: "Mission | None" = None) -> "Mission | None":
    """Return the mission that the options say, else that of a plan; None for none.

    Raises:
        UnknownNameError: no such mission or setting.
        InputError: a setting is none, or the module has no such mission.
    """
    flown = planned if options.mission is None else _asked(options.mission)
    if flown is None or options.duration is None:
        return flown
    return replace(flown, duration=options.duration)


def _asked(text: str) -> "Mission":
    from helisim.sim.missions import Mission, missions_by_name
    from helisim.sim.plain import from_plain

    word, *items = (one.strip() for one in text.split(","))
    given = stated("--mission", items)
    if ":" not in word:
        kinds = missions_by_name()
        if word.lower() not in kinds:
            raise UnknownNameError("mission", word, kinds)
        return from_plain(kinds[word.lower()], given, f"the mission {word}")
    kind = imported("--mission", word)
    if not (isinstance(kind, type) and issubclass(kind, Mission)):
        raise InputError(
            f"--mission {word}: it is no subclass of helisim.Mission, but {kind!r:.80}"
        )
    return from_plain(kind, given, f"the mission {word}")


def missions_in_words() -> str:
    """Return every mission: what it is, its settings and their defaults."""
    from helisim.sim.missions import missions_by_name

    lines = []
    for name, kind in sorted(missions_by_name().items()):
        meaning = str(kind.__doc__).splitlines()[0]
        said = [
            one.name if one.default is MISSING else f"{one.name}={one.default}"
            for one in fields(kind)
        ]
        lines += [
            wrapped(f"{name}: {meaning}", indent=4),
            wrapped(f"    {', '.join(said)}", indent=4),
        ]
    return "\n".join(lines) + "\n"


class _Missions(argparse.Action):
    """Prints every mission with its settings and their defaults, and exits."""

    def __init__(self, option_strings: Sequence[str], dest: str, **options: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, default=argparse.SUPPRESS, **options)

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        """Print and exit."""
        print(missions_in_words(), end="")
        parser.exit()
