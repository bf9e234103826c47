"""The options that say what is flown on purpose, of every command that flies."""

import argparse
from collections.abc import Sequence
from dataclasses import MISSING, Field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError, UnknownNameError
from helisim.cli.common import imported
from helisim.records.channels import AXES

if TYPE_CHECKING:
    from helisim.sim import Excitation

EPILOG = """\
a manoeuvre is KIND[,NAME=VALUE...], several numbers are joined as 3:42; or
MODULE:FUNCTION, a Python function of time in s. --kinds lists all:
  --excitation step,axis=ped,amplitude=0.02
  --excitation chirp,axis=lat,band=1:30,spacing=linear
  --excitation multisine,period=20,duration=46        all four axes at once
  --excitation doublet,axis=tail,at=actuators,amplitude=0.05
  --history steps.csv,axis=lat+ped,method=hold        time, LAT and PED
several are flown together, with --sequence one after the other.
"""

_GENERAL = ("axis", "at", "duration", "amplitude")
"""Options that are settings of every manoeuvre that takes them and doesn't say its own."""


def add_manoeuvre(command: argparse.ArgumentParser, *, alone: str) -> None:
    """Add the options of a manoeuvre.

    Args:
        command: parser of the command.
        alone: what --axis alone means.
    """
    command.add_argument(
        "--excitation",
        action=_InOrder,
        metavar="KIND[,NAME=VALUE...]",
        help="what is flown on purpose, see below: sweep (default), step, multisine, ...; may be "
        "given again",
    )
    command.add_argument(
        "--history",
        action=_InOrder,
        metavar="FILE[,NAME=VALUE...]",
        help="fly the columns of this file, .csv or .parquet; may be given again",
    )
    command.add_argument(
        "--sequence",
        nargs="?",
        const=0.0,
        type=float,
        metavar="S",
        help="fly them one after the other, S seconds of trimmed flight between (default: 0)",
    )
    command.add_argument("--kinds", action=_Kinds, help="list all kinds with their settings")
    command.add_argument("--axis", metavar="AXIS", help=f"{'|'.join(AXES)}{alone}")
    command.add_argument(
        "--at",
        metavar="PLACE",
        help="sticks (default), servos, actuators or sensors (axis p, q, r, phi, theta, psi)",
    )
    command.add_argument(
        "--duration", type=float, metavar="S", help="of the flight, s (default: a sweep's is 90)"
    )
    command.add_argument(
        "--amplitude",
        type=float,
        metavar="A",
        help="of the stick, unitised (default: the axis's own)",
    )


def is_asked(options: argparse.Namespace) -> bool:
    """Return whether the options name a manoeuvre.

    Raises:
        InputError: they don't, but say something of one.
    """
    if options.flown or options.axis is not None:
        return True
    for name in ("at", "amplitude", "sequence"):
        if getattr(options, name) is not None:
            raise InputError(f"--{name} is of a manoeuvre: say which, by --axis or --excitation")
    return False


def manoeuvre(options: argparse.Namespace, planned: "Excitation | None" = None) -> "Excitation":
    """Return the manoeuvre that the options say, beside that of a plan.

    Raises:
        UnknownNameError: no such kind, setting or axis.
        InputError: a setting is none, or what is asked for together can't be.
        StorageError: a file can't be read.
    """
    given = {
        name: value for name in _GENERAL if (value := getattr(options, name, None)) is not None
    }
    asked = [
        _history(text, given) if option == "--history" else _kind(text, given, planned)
        for option, text in options.flown
    ]
    if not asked:
        asked = [
            _kind("sweep", given, None) if planned is None else _changed(options, planned, given)
        ]
    return _joined(asked, options.sequence)


def _joined(asked: list["Excitation"], pause: float | None) -> "Excitation":
    from helisim.sim import Sequence, Together

    if pause is not None:
        if len(asked) < 2:
            raise InputError("--sequence joins two manoeuvres or more: give --excitation again")
        return Sequence(parts=tuple(asked), pause=pause)
    return asked[0] if len(asked) == 1 else Together(parts=tuple(asked))


def _changed(
    options: argparse.Namespace, planned: "Excitation", given: dict[str, Any]
) -> "Excitation":
    """Return a plan's manoeuvre with the settings that are given."""
    from helisim.sim.plain import from_plain, to_plain

    axis = given.get("axis", planned.axis)
    fixed = [one for one in planned.left_open if getattr(planned, one) is not None]
    if axis != planned.axis and fixed:
        raise InputError(
            f"{options.plan}: {' and '.join(fixed)} of the {planned.axis} axis: take them out "
            f"for --axis {axis}, or leave out --axis"
        )
    return from_plain(type(planned), {**to_plain(planned), **given}, "the excitation")


def _kind(text: str, given: dict[str, Any], planned: "Excitation | None") -> "Excitation":
    """Return the manoeuvre of one --excitation."""
    from helisim.sim.excitation import EXCITATIONS
    from helisim.sim.plain import from_plain

    word, *items = text.split(",")
    settings = stated("--excitation", items)
    if ":" in word:
        return _function(word.strip(), {**given, **settings})
    kinds = {name.lower(): kind for name, kind in EXCITATIONS.items()}
    if word.strip().lower() not in kinds:
        raise UnknownNameError("excitation", word, kinds)
    kind = kinds[word.strip().lower()]
    if "parts" in kind.__dataclass_fields__:
        raise InputError(
            f"--excitation {word}: give --excitation for each part, and --sequence to fly them "
            "one after the other; a plan file nests them"
        )
    if "samples" in kind.__dataclass_fields__:
        raise InputError(f"--excitation {word}: give its file, --history FILE[,NAME=VALUE...]")
    axis = {} if planned is None else {"axis": planned.axis}
    return from_plain(kind, {**axis, **given, **settings}, f"the excitation {kind.__name__}")


def _history(text: str, given: dict[str, Any]) -> "Excitation":
    """Return the manoeuvre of one --history."""
    from helisim.sim import History

    path, *items = text.split(",")
    settings = {**given, **stated("--history", items)}
    _check_settings("--history", settings, ("axis", "at", "method", "duration"))
    return History.read(Path(path), **settings)


def _function(word: str, settings: dict[str, Any]) -> "Excitation":
    """Return the manoeuvre of MODULE:FUNCTION, looked up in the current folder too."""
    from helisim.sim import Manoeuvre

    _check_settings("--excitation MODULE:FUNCTION", settings, ("axis", "at", "duration"))
    return Manoeuvre(imported("--excitation", word), **settings)


def _check_settings(option: str, settings: dict[str, Any], known: Sequence[str]) -> None:
    for name in settings:
        if name not in known:
            raise UnknownNameError(f"setting of {option}", name, known)


def stated(option: str, items: Sequence[str]) -> dict[str, Any]:
    """Return NAME=VALUE items: numbers, several numbers as 3:42, or text. Raises InputError."""
    found = {}
    for item in items:
        name, equals, text = (one.strip() for one in item.partition("="))
        if not (name and equals and text):
            raise InputError(f"{option} takes NAME=VALUE, got {item!r}")
        found[name] = _value(text)
    return found


def _value(text: str) -> Any:
    try:
        numbers = [float(one) for one in text.split(":")]
    except ValueError:
        return text
    return numbers[0] if len(numbers) == 1 else tuple(numbers)


class _InOrder(argparse.Action):
    """Keeps the manoeuvres of --excitation and --history in the order of the command line."""

    def __init__(self, option_strings: Sequence[str], dest: str, **options: Any) -> None:
        del dest
        super().__init__(option_strings, "flown", default=(), **options)

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Add one."""
        namespace.flown = (*namespace.flown, (self.option_strings[0], values))


class _Kinds(argparse.Action):
    """Prints every kind of manoeuvre with its settings and their defaults, and exits."""

    def __init__(self, option_strings: Sequence[str], dest: str, **options: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, default=argparse.SUPPRESS, **options)

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        """Print and exit."""
        print(kinds_in_words(), end="")
        parser.exit()


def kinds_in_words() -> str:
    """Return every kind of manoeuvre: what it is, its settings and their defaults."""
    from helisim.cli.common import wrapped
    from helisim.sim.excitation import EXCITATIONS

    lines = []
    for name, kind in sorted(EXCITATIONS.items()):
        meaning = str(kind.__doc__).splitlines()[0]
        settings = [_setting(kind, one) for one in fields(kind) if one.name not in _UNASKED]
        lines += [
            wrapped(f"{name.lower()}: {meaning}", indent=4),
            wrapped(f"    {', '.join(settings)}", indent=4),
        ]
    return "\n".join(lines) + "\n"


_UNASKED = ("digest", "samples", "source")
"""What a `History` knows by itself."""


def _setting(kind: type["Excitation"], one: Field[Any]) -> str:
    if one.name in kind.left_open:
        return f"{one.name}=the vehicle's own"
    return one.name if one.default in (MISSING, "") else f"{one.name}={one.default}"
