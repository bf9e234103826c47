"""The option that says what ground is below, of every command that flies."""

import argparse
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from helisim.sim import Ground

EPILOG = """\
a ground is flat, or SETTING=VALUE[,...], to take off from and to land on:
  --ground slope=0.1,uphill=1.57         rad, rising to the east
  --ground flat,parked                   start on it, not in the hover above it
  --ground flat,parked,rotor=0           and a motor spins the rotor up
  --ground deck,length=8,heave=0.3/6     m, and m over s; also surge, sway, and
                                         roll, pitch in rad over s
"""
_WORDS = ("flat", "deck", "parked")


def add_ground(command: argparse.ArgumentParser) -> None:
    """Add the option."""
    command.add_argument(
        "--ground",
        metavar="flat|SETTING=VALUE[,...]|off",
        help="fly above a ground that can be landed on: flat, a slope, or a deck that moves; see "
        "below",
    )


def ground(options: argparse.Namespace, planned: "Ground | None" = None) -> "Ground | None":
    """Return the ground that the option says, else that of a plan; None for none.

    Raises:
        UnknownNameError: no such setting.
        InputError: a setting is none.
    """
    if options.ground is None:
        return planned
    if options.ground.strip() == "off":
        return None
    from helisim.sim import Deck, Ground
    from helisim.sim.plain import setting_names

    own, deck = setting_names(Ground), setting_names(Deck)
    given: dict[str, dict[str, Any]] = {"ground": {}, "deck": {}}
    items = [item.strip() for item in options.ground.split(",")]
    for item in items:
        name, equals, text = (part.strip() for part in item.partition("="))
        if not equals and name in _WORDS:
            continue
        where = "deck" if name in deck else "ground"
        if name not in deck and (name not in own or name in ("deck", "parked")):
            known = dict.fromkeys([*_WORDS, *own, *deck])
            raise UnknownNameError("setting of --ground", name, known)
        given[where][name] = _value(item, text, swing=name in Deck.motions)
    if given["deck"] or "deck" in items:
        given["ground"]["deck"] = Deck(**given["deck"])
    return Ground(parked="parked" in items, **given["ground"])


def _value(item: str, text: str, *, swing: bool) -> Any:
    """Return a number, or a swing of AMPLITUDE/PERIOD."""
    from helisim.sim import Swing

    try:
        numbers = [float(part) for part in text.split("/")]
    except ValueError:
        numbers = []
    if len(numbers) != 1 + swing:
        raise InputError(
            f"--ground takes {'AMPLITUDE/PERIOD' if swing else 'a number'}, got {item!r}"
        )
    return Swing(amplitude=numbers[0], period=numbers[1]) if swing else numbers[0]
