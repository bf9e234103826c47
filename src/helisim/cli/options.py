"""Makes each command's parser from its docstring, and reads the values of options.

    def mass(o: Options) -> int:
        '''Print a vehicle's mass.

        Print the mass of the whole vehicle, kg.

        Options:
            @vehicle
            --count N <=1>  of vehicles
            how it is written:
            --json FILE <.json>  write it too

        example: helisim mass --vehicle blade360
        '''

An option is its name, metavar, marks, and after two spaces its help, which goes on in indented
lines. `--from/from_time` has another name in Python; `model MODEL` has no dashes. The type is that
of the metavar in `_TYPES`, or one of the `_MARKS`, which have more: `some` (of a word, one or
more), `any` (none or more), `many` (an option that may be repeated), `must`, and `maybe` (nothing
need follow; `maybe=VALUE` is meant then). `=VALUE` is the default, and `.json` or `.svg .png` a
file that is written, checked before the command runs. A line that ends with a colon begins a group;
"@name" is a shared text.
"""

import argparse
import inspect
import os
import re
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any, NoReturn

from helisim.base.errors import InputError, UnknownNameError, similar, single_line
from helisim.base.note import Command, Note, Option

if TYPE_CHECKING:
    from helisim.vehicle import Vehicle


Options = argparse.Namespace  # What a command is called with: the value of each option by its name

STDOUT = Path("-")  # What --json is without a file
_WIDTH = 80
_TYPED = {"calibrate": "vehicle calibrate", "tune": "tune --vehicle"}  # As one types remedies
_TYPES: dict[str, Callable[[str], Any]] = {
    "N": int,
    **dict.fromkeys(("FILE", "FILE|DIR", "DIR", "FOLDER", "LOG", "MODEL", "RUN", "SOURCE"), Path),
    **dict.fromkeys(("LO HI", "S", "M", "M/S", "HZ", "DEG", "RAD/S", "SHARE", "X", "RPM"), float),
}  # Types by metavar; all others are text
_PAGE = re.compile(
    r"(.+?)(?:\n\n((?!Options:).*?))?(?:\n\nOptions:\n(.*?))?(?:\n\n(examples?:.*))?", re.S
)  # A docstring's title, description, options and examples
_HEAD = re.compile(r"(\S+?)(?:/(\w+))?(?: ([^<]+?))?(?: ?<(.*)>)?")


def names(text: str | None) -> tuple[str, ...]:
    """Return names that are separated by commas."""
    return tuple(name.strip() for name in (text or "").split(",") if name.strip())


_MARKS: dict[str, dict[str, Any]] = {
    "int": {"type": int},
    "float": {"type": float},
    "text": {"type": str},
    "names": {"type": names},
    "some": {"nargs": "+"},
    "any": {"nargs": "*"},
    "many": {"action": "append", "default": []},
    "maybe": {"nargs": "?"},
    "must": {"required": True},
}  # What argparse is told for a mark


class Parser(argparse.ArgumentParser):
    """Wraps its description and keeps the lines of its epilog; says what is wrong in one line."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        options.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        options["description"] = wrapped(options.get("description") or "")
        self.files: dict[str, tuple[str, ...]] = {}
        super().__init__(*arguments, **options)

    def error(self, message: str) -> NoReturn:
        """Exit with a message and status 2."""
        message = re.sub(r"^argument (\S+): takes", r"\1 takes", message)
        self.exit(2, f"{self.prog}: {single_line(message)}; see {self.prog} --help\n")

    def parse_args(self, *arguments: Any, **options: Any) -> Any:
        """Parse, or exit with what may have been meant by an option that does not exist."""
        found, unknown = self.parse_known_args(*arguments, **options)
        if unknown:
            command = found.parser
            flags = [name for action in command._actions for name in action.option_strings]
            alike = " or ".join(similar(unknown[0].split("=")[0], flags))
            meant = f"; did you mean {alike}?" if alike else ""
            if "--vehicle" in flags and not unknown[0].startswith("-"):
                meant = f"; a vehicle is said by --vehicle {unknown[0]}"
            command.error(f"unrecognized arguments: {' '.join(unknown)}{meant}")
        return found

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.nargs == argparse.PARSER and value not in (action.choices or ()):
            self.error(str(UnknownNameError("command", value, action.choices or ())))
        super()._check_value(action, value)

    def add_options(self, text: str) -> None:
        """Add the options that a text says, one a line; see this module."""
        group: Any = self
        for line in re.split(r"\n(?=\S)", expanded(textwrap.dedent(text).strip())):
            if line.endswith(":") and not line.startswith("-"):
                group = self if line == "options:" else self.add_argument_group(line[:-1])
            elif line:
                head, _, said = line.partition("  ")
                self._add(group, head.strip(), " ".join(said.split()))

    def _add(self, group: Any, head: str, said: str) -> None:
        match = _HEAD.fullmatch(head)
        assert match is not None, head
        flag, dest, metavar, marks = match.groups(default="")
        given: dict[str, Any] = {"help": said.replace("%", "%%")}
        given |= {"dest": dest} if dest else {}
        if metavar:
            given |= {"metavar": metavar, "type": _TYPES.get(metavar, str)}
        else:
            given["action"] = "store_true"
        if metavar == "LO HI":
            given |= {"metavar": ("LO", "HI"), "nargs": 2}
        for mark in marks.split():
            name, equals, value = mark.partition("=")
            given |= _MARKS.get(name, {})
            if equals:
                given["const" if name else "default"] = value
        written = group.add_argument(flag, **given).dest
        self.files[written] = tuple(mark for mark in marks.split() if mark.startswith("."))


def expanded(text: str) -> str:
    """Return a text with each line "@name: more" replaced by the shared text of that name."""
    return re.sub(
        r"^@(\w+)(?:: (.*))?$",
        lambda one: SHARED[one[1]].strip().replace("{}", one[2] or ""),
        text,
        flags=re.M,
    )


def add_command(commands: Any, function: Callable[[Options], int | None], name: str) -> Parser:
    """Add a command to its kind, made of its docstring; return its parser."""
    page = _PAGE.fullmatch(inspect.getdoc(function) or "")
    assert page is not None
    head, about, lines, epilog = page.groups(default="")
    title = " ".join(head.split())
    command = commands.add_parser(
        name,
        help=title[0].lower() + title[1:].removesuffix("."),
        description="\n".join(" ".join(one.split()) for one in about.split("\n\n")),
        epilog=f"{expanded(epilog)}\n" if epilog else None,
    )
    command.add_options(lines)
    words = [action.metavar for action in command._actions if not action.option_strings]
    command.usage = " ".join([command.prog, *map(str, filter(None, words)), "[options]"])
    command.set_defaults(run=function, parser=command)
    return command


def worded(remedy: Sequence[Option | Command]) -> str:
    """Return what mends something as one types it, " (--windows, --repair gaps)"."""
    said = ", ".join(map(_typed, remedy))
    return f" ({said})" if said else ""


def _typed(one: Option | Command) -> str:
    if isinstance(one, Option):
        word = one.value if one.value.replace(" ", "").isupper() else quote(one.value)  # LO HI
        return f"--{one.name.replace('_', '-')}{f' {word}' if one.value else ''}"
    name = _TYPED.get(one.name, one.name)
    return " ".join(["helisim", name, *map(quote, one.arguments), *map(_typed, one.options)])


def worded_note(note: Note) -> str:
    """Return a note's text with the options that mend it."""
    return note.text + worded(note.remedy)


def imported(option: str, word: str) -> Any:
    """Return what MODULE:NAME says, here or installed. Raises InputError."""
    module, _, name = word.rpartition(":")
    if not (module and name):
        raise InputError(f"{option} takes MODULE:NAME, as of module.py in this folder; got {word}")
    path = Path(module)
    sys.path.insert(0, str(path.parent.resolve()))
    try:
        return getattr(import_module(path.stem if path.suffix == ".py" else path.name), name)
    except Exception as error:  # whatever the module raises
        reason = single_line(str(error)) or type(error).__name__
        raise InputError(f"{option} {word}: can't import it: {reason}") from None
    finally:
        del sys.path[0]


def wrapped(text: str, *, indent: int = 0) -> str:
    """Return each line of a text within 80 columns, continued at an indent; paths stay whole."""
    options: Any = {"break_long_words": False, "break_on_hyphens": False}
    return "\n".join(
        textwrap.fill(line, _WIDTH, subsequent_indent=" " * indent, **options)
        for line in text.splitlines()
    )


def coloured(text: str) -> str:
    """Return a text with what is bad in its cells in red, on a terminal without NO_COLOR."""
    plain = not sys.stdout.isatty() or "NO_COLOR" in os.environ
    bad = r"(?<= )(poor|differs|\d \(was \d\))(?=\s|$)"
    return text if plain else re.sub(bad, "\x1b[31m\\1\x1b[0m", text)


SHARED = {
    "vehicle": "--vehicle VEHICLE <=jr700>  jr700 (default), blade360, lynx, or a folder's path",
    "subject": """
vehicle VEHICLE <maybe =jr700>  jr700 (default), blade360, lynx, or a folder's path
""",
    "json": """
--json FILE <maybe=- .json>  {}, .json; no FILE: printed in place of text
""",
    "quiet": "--quiet  no progress bar, no names of written files",
    "set": """
--set NAME=VALUE <many>  a physical parameter: main_rotor.hub_stiffness=100, SI
""",
    "slung": "--slung FILE  hang a load on the vehicle, .xml, see docs/extend/slung_load.md",
    "jobs": "--jobs J <int>  threads (default: all processors)",
    "seed": "--seed S <int =1>  {} (default: 1)",
    "rerun": "--rerun FILE <.rrd>  write a Rerun recording too, .rrd",
    "write": "--write  replace the vehicle's {}",
    "controller": """
--controller LAW  in place of the gyro: law.toml, MODULE:NAME of a function or
    helisim.Controller, or none (servos at trim)
""",
    "weather": """
--turbulence LEVEL  light, moderate, severe (Dryden, MIL-F-8785C), or wind at 20 ft, m/s
--wind M/S  steady wind, m/s (default: 0)
--wind-from-deg DEG  0: a headwind, 90: from the right
""",
    "ground": """
--ground SETTING  flat or SETTING[=VALUE],... (see helisim fly)
""",
    "about_ground": """
a ground is flat, or SETTING[=VALUE],...:
  --ground slope=0.1,uphill=1.57,parked  rad, rising to the east; start on it
  --ground deck,length=8,heave=0.3/6     m, m over s; roll, pitch: rad over s
""",
    "manoeuvre": """
--excitation KIND  manoeuvre, see below (default: sweep)
--axis AXIS  lat|lon|ped|col, or roll|pitch|yaw|heave{}
--at PLACE  sticks (default), servos, actuators or sensors
--duration S  of the flight, s (default: a sweep's is 90)
--amplitude A <float>  of the stick, unitised (default: the axis's own)
""",
    "about_manoeuvres": """
a manoeuvre is KIND[,NAME=VALUE...]: step, pulse, doublet, threetwooneone,
sweep, chirp, multisine; the axis of sensors is p, q, r, phi, theta or psi:
  --excitation step,axis=ped,amplitude=0.02
  --excitation chirp,axis=lat,band=1:30
  --excitation multisine,period=20,duration=46        all four axes at once
  --excitation doublet,axis=ped,at=actuators,amplitude=0.05
""",
    "logs": """
logs LOG <some>  Parquet, CSV, ULog, DataFlash, Blackbox, .npy, .mat
how to read the logs:
--map FILE  columns of channels, .toml, see helisim examples
--channel NAME=... <many>  COLUMN:UNIT[:sign=-1][:trim=X][:range=X]; repeatable
--names A,B,... <names =>  of the columns of a file without a heading
--log N <int>  of several in a Blackbox file (default: largest)
--time COLUMN[:UNIT]  column of times, in s, ms, us, ..., or RATE:Hz
--resample HZ  make the samples uniform
--repair NAME,... <many>  duplicates, frozen, gaps, missing, resets, spikes
--max-gap S  longer steps are gaps (default: 4.5 median steps)
--min-duration S <=0>  leave out shorter parts of a log that is split
--use-ended  use flights that were terminated early, too
--from/from_time S  leave out what is before, s from the first sample
--to/to_time S  leave out what is after
""",
    "reference": """
--reference A,B <names =>  signals outside the loop: joint method, unbiased by feedback
    and gusts (default: sticks, where they excite; none: the direct method)
""",
    "estimator": """
--estimator NAME  local (default), windows (CIFER's), predictor (needs no reference), or,
    of identify, likelihood (default where all records are shorter than 20 s)
""",
}  # Options that several commands have, and texts below them, by the names that docstrings say


@contextmanager
def progress(steps: int | None, quiet: bool, unit: str = "step") -> Iterator[Callable[[str], None]]:
    """Show on a terminal how many steps of a command are done; `None` if not known of how many."""
    from tqdm import tqdm  # not above: it takes a while

    with tqdm(total=steps, disable=quiet or None, unit=unit, leave=False) as bar:

        def advance(label: str) -> None:
            bar.set_description(label)
            bar.update()

        yield advance


def loaded(options: Options, **more: Any) -> "Vehicle":
    """Return the vehicle that the options say, with --set and --controller. Raises InputError."""
    from helisim.base.settings import placed
    from helisim.vehicle import load

    more["slung"] = getattr(options, "slung", None)
    vehicle = load(options.vehicle, parameters=parameters(options), **more)
    asked = getattr(options, "controller", None)
    if asked is None:
        return vehicle
    if asked.lower().endswith(".toml"):
        from helisim.design.laws.law import read_law

        law: Any = read_law(asked)
    else:
        law = None if asked == "none" else imported("--controller", asked)
    with placed(f"--controller {asked}"):
        return vehicle.with_controller(law)


def parameters(options: Options) -> dict[str, float | str]:
    """Return what --set gives: numbers, and words where a parameter is a choice."""
    from helisim.vehicle.parameters import words_of

    given: dict[str, float | str] = {}
    for item in options.set:
        name, _, text = map(str.strip, item.partition("="))
        given |= {name: text} if words_of(name) else numbers_by_name("--set", [item])
    return given


def numbers_by_name(option: str, items: Sequence[str]) -> dict[str, float]:
    """Return NAME=VALUE[,...] items as numbers by name. Raises InputError."""
    values = {}
    for item in [one for text in items for one in names(text) or [text]]:
        name, _, text = item.partition("=")
        try:
            values[name.strip()] = float(text)
        except ValueError:
            raise InputError(f"{option} takes NAME=VALUE with a number, got {item!r}") from None
    return values


def print_rows(rows: Mapping[str, str]) -> None:
    """Print texts below each other, each behind its name."""
    width = max(map(len, rows))
    for name, text in rows.items():
        print(wrapped(f"{name:<{width}}  {text}", indent=width + 2))


def print_written(options: Options, *texts: object) -> None:
    """Print what was written where, each that is not None, unless --quiet."""
    for text in texts:
        if text is not None and not getattr(options, "quiet", False):
            print(f"Written: {text}")


def write_data(options: Options, data: Mapping[str, Any], path: Path | None = None) -> None:
    """Write plain data where --json says, if it does; to `path` in place of its file."""
    from helisim.base.files import write_json

    if options.json == STDOUT:
        options.data.append(data)
    elif options.json is not None:
        write_json(data, path or options.json)
        print_written(options, path or options.json)


def replace_parameter_file(options: Options, name: str, text: str) -> None:
    """Write a vehicle's parameter file of that name anew, its MJCF too, and print where."""
    from helisim.base.files import write_text
    from helisim.vehicle.build import write_numbers
    from helisim.vehicle.parameters import model_folder

    path = model_folder(options.vehicle) / name
    write_text(path, text)
    print_written(options, path, *write_numbers(options.vehicle))


def write_recording(
    options: Options, path: Path, records: Any, vehicle: str | Path = "jr700"
) -> None:
    """Write a Rerun recording of flights, and print where and what opens it."""
    from helisim.show.recording import write_recording
    from helisim.vehicle import load

    with progress(len(records), options.quiet, unit="flight") as advance:
        slung = {str(record.provenance.get("slung", "")) for record in records.values()} - {""}
        drawn = load(vehicle, slung=slung.pop() if len(slung) == 1 else None)
        write_recording(path, records, model=drawn.visual_model(), on_progress=advance)
    print_written(options, opened(path))


def opened(path: Path) -> str:
    """Return a recording's path and what opens it."""
    return f"{path}; open it with: rerun {path}"
