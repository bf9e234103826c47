"""The options that say what weather is flown through, of every command that flies in some."""

import argparse
import math
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from helisim.sim import Weather


def add_weather(command: argparse.ArgumentParser) -> None:
    """Add the options of the weather."""
    command.add_argument(
        "--turbulence",
        metavar="LEVEL|M/S",
        help="light, moderate or severe (Dryden, MIL-F-8785C), or the wind at 20 ft that makes "
        "it, m/s (default: calm)",
    )
    command.add_argument("--wind", type=float, metavar="M/S", help="steady wind, m/s (default: 0)")
    command.add_argument(
        "--wind-from-deg",
        type=float,
        metavar="DEG",
        help="where it comes from; flights head north: 0 is a headwind, 90 from the right",
    )


def weather(options: argparse.Namespace, planned: "Weather") -> "Weather":
    """Return the weather that the options say, beside that of a plan. Raises InputError."""
    turbulence: Any = options.turbulence
    with suppress(TypeError, ValueError):
        turbulence = float(turbulence)
    given = {
        "turbulence": turbulence,
        "wind": options.wind,
        "wind_from": None if options.wind_from_deg is None else math.radians(options.wind_from_deg),
    }
    return replace(planned, **{name: one for name, one in given.items() if one is not None})
