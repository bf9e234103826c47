"""The option --units: what is printed and tabulated in the user's units."""

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from helisim.base.user_units import UserUnits


def add_units(command: argparse.ArgumentParser, what: str) -> None:
    """Add --units, of what the command shows."""
    command.add_argument(
        "--units",
        metavar="deg,ft,percent",
        help=f"{what} in degrees, feet and percent of a control's range, or some of them "
        "(default: SI); frequencies stay in rad/s, and JSON in SI",
    )


def chosen_units(options: argparse.Namespace) -> "UserUnits | None":
    """Return the units that are asked for, None for SI. Raises InputError."""
    if options.units is None:
        return None
    from helisim.base.user_units import UserUnits

    return UserUnits.of(options.units)
