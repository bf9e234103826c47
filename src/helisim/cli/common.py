"""What several commands share: the parser and options."""

import argparse
import sys
import textwrap
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from shlex import quote
from types import ModuleType
from typing import TYPE_CHECKING, Any, NoReturn

from helisim.base.errors import InputError, UnknownNameError, similar
from helisim.base.note import Note, Option

if TYPE_CHECKING:
    from helisim.vehicle import Vehicle

_WIDTH = 80


class Parser(argparse.ArgumentParser):
    """Wraps its description and keeps the lines of its epilog; says what is wrong in one line."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        options.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        options["description"] = wrapped(options.get("description") or "")
        if "\n" not in (epilog := options.get("epilog") or ""):
            options["epilog"] = wrapped(epilog)
        super().__init__(*arguments, **options)

    def error(self, message: str) -> NoReturn:
        """Exit with a message and status 2."""
        self.exit(2, f"{self.prog}: {single_line(message)}; see {self.prog} --help\n")

    def parse_args(self, *arguments: Any, **options: Any) -> Any:
        """Parse, or exit with what may have been meant by an option that does not exist."""
        found, unknown = self.parse_known_args(*arguments, **options)
        if unknown:
            command = self._command_parser(found)
            alike = " or ".join(similar(unknown[0].split("=")[0], command.option_names))
            meant = f"; did you mean {alike}?" if alike else ""
            command.error(f"unrecognized arguments: {' '.join(unknown)}{meant}")
        return found

    @property
    def option_names(self) -> list[str]:
        """All options that the parser takes."""
        return [name for action in self._actions for name in action.option_strings]

    def _command_parser(self, found: argparse.Namespace) -> "Parser":
        """Return the parser of the command that was found."""
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                return action.choices[found.command]
        return self

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if isinstance(action, argparse._SubParsersAction) and value not in action.choices:
            self.error(str(UnknownNameError("command", value, action.choices)))
        super()._check_value(action, value)


def worded(remedy: Sequence[Option]) -> str:
    """Return what mends something as options of the command line, " (--windows, --repair gaps)"."""
    values = [quote(one.value) if one.value else "" for one in remedy]
    names = [f"--{one.name.replace('_', '-')}" for one in remedy]
    said = [f"{name} {value}".strip() for name, value in zip(names, values)]
    return f" ({', '.join(said)})" if said else ""


def worded_note(note: Note) -> str:
    """Return a note's text with the options that mend it."""
    return note.text + worded(note.remedy)


def single_line(text: str) -> str:
    """Return a message without line breaks, such as a file's name may hold."""
    return " ".join(text.splitlines())


def add_common(command: argparse.ArgumentParser) -> None:
    """Add the options of the commands that fly."""
    command.add_argument(
        "--seed", type=int, default=1, metavar="S", help="of pilot and sensors (default: 1)"
    )
    command.add_argument(
        "--rerun", type=Path, metavar="FILE", help="write a Rerun recording too, .rrd"
    )
    add_parameters(command)
    add_quiet(command)


def add_integrator(command: argparse.ArgumentParser) -> None:
    """Add --integrator."""
    command.add_argument(
        "--integrator",
        metavar="NAME",
        help="RK4, fourth order (default), or Euler, staggered: a third of the time, and still "
        "within a few parts in a thousand",
    )


def add_quiet(command: argparse.ArgumentParser) -> None:
    """Add --quiet."""
    command.add_argument(
        "--quiet", action="store_true", help="no progress bar, and no word of what is written"
    )


def add_vehicle(command: argparse.ArgumentParser) -> None:
    """Add the vehicle: a name or a path."""
    command.add_argument(
        "vehicle",
        nargs="?",
        default="jr700",
        metavar="VEHICLE",
        help="jr700 (default), blade360 or lynx, or the path of a vehicle's folder of your own",
    )


def add_parameters(command: argparse.ArgumentParser) -> None:
    """Add --set."""
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="replace a physical parameter, such as "
        "main_rotor.hub_stiffness=100 (SI) or drive.governor=ideal; may be given again",
    )


def parameters(options: argparse.Namespace) -> dict[str, float | str]:
    """Return what --set gives: numbers, and words where a parameter is a choice.

    Raises:
        InputError: neither.
    """
    from helisim.vehicle.choices import CHOICES, number_of

    chosen = [item for item in options.set if item.partition("=")[0].strip() in CHOICES]
    numbers = named_numbers("--set", [item for item in options.set if item not in chosen])
    words = {}
    for item in chosen:
        name, _, word = map(str.strip, item.partition("="))
        try:
            number_of(name, word)
        except InputError as error:
            raise InputError(f"--set {error}") from None
        words[name] = word
    return numbers | words


def imported(option: str, word: str) -> Any:
    """Return what MODULE:NAME says, the module looked up in the current folder too, or a file.

    Raises:
        InputError: it isn't of this form, or can't be imported.
    """
    module, colon, name = word.rpartition(":")
    if not (module and colon and name):
        raise InputError(f"{option} takes MODULE:NAME, as of module.py in this folder; got {word}")
    sys.path.insert(0, "")
    try:
        return getattr(_module(module), name)
    except Exception as error:  # whatever the module raises
        reason = single_line(str(error)) or type(error).__name__
        raise InputError(f"{option} {word}: can't import it: {reason}") from None
    finally:
        sys.path.remove("")


def _module(word: str) -> ModuleType:
    """Return a module by its name, or by the path of its file."""
    path = Path(word)
    if path.suffix != ".py" and path.name == word:
        return import_module(word)
    path = path.with_suffix(".py").resolve()
    if not path.is_file():
        raise ImportError(f"{word}: no such file")
    sys.path.insert(0, str(path.parent))
    try:
        module = import_module(path.stem)
    finally:
        sys.path.remove(str(path.parent))
    if Path(module.__file__ or "").resolve() != path:
        raise ImportError(f"another module is called {path.stem!r}; rename the file")
    return module


def add_controller(command: argparse.ArgumentParser) -> None:
    """Add --controller."""
    command.add_argument(
        "--controller",
        metavar="LAW",
        help="fly by this control law in place of the gyro: a file, law.toml, or MODULE:NAME, a "
        "function of (seen, state, settings) or a helisim.Controller of module.py, here or "
        "installed; none: the servos stay at the trim",
    )


def controlled(vehicle: "Vehicle", options: argparse.Namespace) -> "Vehicle":
    """Return a vehicle with the controller that is asked for. Raises InputError."""
    asked = options.controller
    if asked is None:
        return vehicle
    if asked.lower().endswith(".toml"):
        from helisim.design.laws.law import read_law

        law: Any = read_law(asked)
    else:
        law = None if asked == "none" else imported("--controller", asked)
    try:
        return vehicle.with_controller(law)
    except InputError as error:
        raise InputError(f"--controller {asked}: {error}") from None


def named_numbers(option: str, items: Sequence[str]) -> dict[str, float]:
    """Return NAME=VALUE items as numbers by name. Raises InputError."""
    values = {}
    for item in items:
        name, equals, text = item.partition("=")
        try:
            values[name.strip()] = float(text)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"{option} takes NAME=VALUE with a number, got {item!r}")
    return values


def names(text: str | None) -> tuple[str, ...]:
    """Return names that are separated by commas."""
    return tuple(name.strip() for name in (text or "").split(",") if name.strip())


def numbers(option: str, text: str | None) -> tuple[float, ...]:
    """Return numbers that are separated by commas. Raises InputError."""
    try:
        return tuple(float(item) for item in names(text))
    except ValueError:
        raise InputError(f"{option} takes numbers separated by commas, got {text!r}") from None


def add_write(command: argparse.ArgumentParser, name: str) -> None:
    """Add --write, for a command that makes a vehicle's parameter file of that name."""
    command.add_argument(
        "--write",
        action="store_true",
        help=f"replace the vehicle's {name}",
    )


def replace_parameter_file(options: argparse.Namespace, name: str, text: str) -> None:
    """Write a vehicle's parameter file of that name anew, its MJCF too, and print where."""
    from helisim.base.files import atomic_write
    from helisim.vehicle.build import write_numbers
    from helisim.vehicle.folder import model_folder

    path = model_folder(options.vehicle) / name
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print_written(options, str(path))
    for mjcf in write_numbers(options.vehicle):
        print_written(options, str(mjcf))


def print_written(options: argparse.Namespace, text: str) -> None:
    """Print what was written where, unless --quiet."""
    if not options.quiet:
        print(f"Written: {text}")


def write_recording(
    path: Path, records: Any, *, vehicle: str | Path = "jr700", run: Any = None, quiet: bool = False
) -> None:
    """Write a Rerun recording of flights, and of what a run found from them, and print where."""
    from helisim.cli.progress import Progress
    from helisim.show.recording import write_recording
    from helisim.vehicle import load

    with Progress(len(records), quiet, unit="flight") as advance:
        drawn = load(vehicle)
        model, roles = drawn.visual_model(), drawn.roles
        write_recording(path, records, model=model, roles=roles, run=run, on_progress=advance)
    print_recording(path, quiet)


def print_recording(path: Path, quiet: bool) -> None:
    """Print where a recording was written and what opens it, unless `quiet`."""
    if not quiet:
        print(f"Written: {path}; open it with: rerun {path}")


def wrapped(text: str, *, indent: int = 0) -> str:
    """Return each line of a text within 80 columns, continued at an indent; paths stay whole."""
    return "\n".join(
        textwrap.fill(
            line,
            _WIDTH,
            subsequent_indent=" " * indent,
            break_long_words=False,
            break_on_hyphens=False,
        )
        for line in text.splitlines()
    )
