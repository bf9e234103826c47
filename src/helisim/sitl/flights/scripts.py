"""Scripts by name, and scripts of one's own from a file."""

import inspect
import runpy
import traceback
from collections.abc import Callable
from pathlib import Path

from helisim.base.errors import HelisimError, InputError, UnknownNameError
from helisim.sitl.flights.pilot import Pilot, Steps

_FUNCTION = "fly"
"""What a file's function is called."""
CORNERS = ((5.0, 0.0), (5.0, 5.0), (0.0, 5.0), (0.0, 0.0))
"""m north and east."""


def hover(pilot: Pilot) -> Steps:
    """Take off to 5 m, hover for five minutes, and land."""
    yield from pilot.take_off(5.0)
    pilot.say("hovering for 300 s")
    yield from pilot.wait(300.0)
    yield from pilot.land()


def square(pilot: Pilot) -> Steps:
    """Take off to 5 m, fly a square of 5 m, and land."""
    yield from pilot.take_off(5.0)
    for north, east in CORNERS:
        pilot.say(f"to {north:g} m north, {east:g} m east")
        yield from pilot.go_to(north, east, 5.0)
    yield from pilot.land()


SCRIPTS: dict[str, Callable[[Pilot], Steps]] = {"hover": hover, "square": square}
"""Name -> script; "sysid" has options of its own, see `sweeps`."""
SYSID = "sysid"


def script_of(name: str) -> Callable[[Pilot], Steps]:
    """Return a script by its name, or the function `fly` of a file.

    Args:
        name: a key of `SCRIPTS`, or a path that ends in .py.

    Raises:
        UnknownNameError: there is no such script.
        InputError: the file can't be run, or has no such function.
    """
    if name in SCRIPTS:
        return SCRIPTS[name]
    if not name.endswith(".py"):
        advice = "or a file of your own, whose name ends in .py"
        raise UnknownNameError("script", name, [*SCRIPTS, SYSID], advice=advice)
    path = Path(name)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        found = runpy.run_path(str(path)).get(_FUNCTION)
    except Exception as error:
        raise InputError(f"{path}: {type(error).__name__}: {error}") from error
    if not inspect.isgeneratorfunction(found):
        raise InputError(
            f"{path}: expected a function `def {_FUNCTION}(pilot):` with `yield from` in it, as "
            "`yield from pilot.take_off(5.0)`"
        )
    return found


def told(script: Callable[[Pilot], Steps], pilot: Pilot) -> Steps:
    """Go through a script, and tell in a line what it does wrong, and where.

    Raises:
        InputError: it raised what is no error of helisim's.
    """
    try:
        yield from script(pilot)
    except HelisimError:
        raise
    except Exception as error:
        frames = [one for one in traceback.extract_tb(error.__traceback__) if one.name == _FUNCTION]
        where = f"{frames[-1].filename}, line {frames[-1].lineno}" if frames else "the script"
        raise InputError(f"{where}: {type(error).__name__}: {error}") from error
