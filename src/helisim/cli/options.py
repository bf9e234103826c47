"""Makes each command's parser from its docstring, and reads the values of options.

A command is a function of its options; its docstring is its page: a line for the list of commands,
what it does, its options, and examples.

    def mass(o: Options) -> int:
        '''Print a vehicle's mass.

        Print the mass of the whole vehicle, kg.

        Options:
            @vehicle
            --count N <=1>  of vehicles
            how it is written:
            --json FILE <.json>  write it too

        example: helisim mass blade360
        '''

An option is its name, what stands behind it, marks, and after two spaces its help, which goes on in
indented lines. `--from/from_time` has another name in Python; `model MODEL` has no dashes. The type
is that of the word behind it in `_TYPES`, or a mark: int, float, path, text, names (A,B), numbers
(1,2), named (NAME=VALUE with a number). Further marks: `=VALUE` default, `many` (may be given
again; of a word, one or more), `any` (of a word, none or more), `maybe` or `maybe=VALUE` (nothing
need follow), `must`, `ordered` (with the option's name, in the order of the command line),
`prints=MODULE.FUNCTION`, and `.json` or `.svg .png`: a file that is written, which is checked
before the command runs. A line that ends with a colon begins a group; "@name" is a shared text.
"""

import argparse
import inspect
import json
import re
import sys
import textwrap
import time
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from shlex import quote
from types import ModuleType
from typing import TYPE_CHECKING, Any, NoReturn

from helisim.base.errors import InputError, UnknownNameError, similar
from helisim.base.note import Command, Note, Option
from helisim.base.text import single_line

if TYPE_CHECKING:
    from helisim.base.units import UserUnits
    from helisim.vehicle import Vehicle


Options = argparse.Namespace
"""What a command is called with: the value of each option by its name."""

_WIDTH = 80
_PATHS = ("FILE", "FILE|DIR", "DIR", "FOLDER", "LOG", "MODEL", "RUN", "SOURCE")
_NUMBERS = ("S", "M", "M/S", "HZ", "DEG", "RAD/S", "SHARE", "X", "RPM")
_TYPES: dict[str, Callable[[str], Any]] = {"N": int, **dict.fromkeys(_PATHS, Path)}
_TYPES |= dict.fromkeys(_NUMBERS, float)
_HEAD = re.compile(r"(\S+?)(?:/(\w+))?(?: ([^<]+?))?(?: ?<(.*)>)?")


def names(text: str | None) -> tuple[str, ...]:
    """Return names that are separated by commas."""
    return tuple(name.strip() for name in (text or "").split(",") if name.strip())


def numbers(text: str) -> tuple[float, ...]:
    """Return numbers that are separated by commas, as an option's type."""
    try:
        return tuple(float(item) for item in names(text))
    except ValueError:
        message = f"takes numbers separated by commas, got {text!r}"
        raise argparse.ArgumentTypeError(message) from None


def named(text: str) -> dict[str, float]:
    """Return NAME=VALUE,... as numbers by name, as an option's type."""
    try:
        pairs = (item.partition("=") for item in names(text))
        return {name.strip(): float(value) for name, _, value in pairs}
    except ValueError:
        message = f"takes NAME=VALUE with a number, got {text!r}"
        raise argparse.ArgumentTypeError(message) from None


_MARKS = {"int": int, "float": float, "path": Path, "text": str}
_MARKS |= {"names": names, "numbers": numbers, "named": named}


class _Named(argparse.Action):
    """Adds NAME=VALUE to those that were given before."""

    def __call__(self, parser: Any, namespace: Options, values: Any, option: Any = None) -> None:
        """Add them."""
        setattr(namespace, self.dest, {**getattr(namespace, self.dest), **values})


class _InOrder(argparse.Action):
    """Keeps what several options give in the order of the command line, each with its name."""

    def __call__(self, parser: Any, namespace: Options, values: Any, option: Any = None) -> None:
        """Add one."""
        setattr(namespace, self.dest, (*getattr(namespace, self.dest), (option, values)))


class _Prints(argparse.Action):
    """Prints what the function "module.name" of this package returns, and exits."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        """Print and exit."""
        module, _, name = self.const.rpartition(".")
        print(getattr(import_module(f"helisim.cli.{module}"), name)(), end="")
        parser.exit()


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
            command: Any = self
            while parts := [a for a in command._actions if a.nargs == argparse.PARSER]:
                command = parts[0].choices[getattr(found, parts[0].dest)]
            flags = [name for action in command._actions for name in action.option_strings]
            alike = " or ".join(similar(unknown[0].split("=")[0], flags))
            meant = f"; did you mean {alike}?" if alike else ""
            command.error(f"unrecognized arguments: {' '.join(unknown)}{meant}")
        return found

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.nargs == argparse.PARSER and value not in (action.choices or ()):
            self.error(str(UnknownNameError("command", value, action.choices or ())))
        super()._check_value(action, value)

    def add_options(self, text: str, shared: Mapping[str, str]) -> None:
        """Add the options that a text says, one a line; see this module."""

        def expanded(match: re.Match[str]) -> str:
            return shared[match[1]].strip().replace("{}", match[2] or "")

        group: Any = self
        text = re.sub(r"^@(\w+)(?:: (.*))?$", expanded, textwrap.dedent(text).strip(), flags=re.M)
        for line in re.split(r"\n(?=\S)", text):
            if line.endswith(":") and not line.startswith("-"):
                group = self if line == "options:" else self.add_argument_group(line[:-1])
            elif line.startswith("| "):
                group.description = "\n".join(one[2:] for one in line.splitlines())
            elif line:
                head, _, said = line.partition("  ")
                self._add(group, head.strip(), " ".join(said.split()))

    def _add(self, group: Any, head: str, said: str) -> None:
        """Add one option of its head and its help."""
        match = _HEAD.fullmatch(head)
        assert match is not None, head
        flag, dest, metavar, marks = match.groups(default="")
        word = not flag.startswith("-")
        given: dict[str, Any] = {"help": said.replace("%", "%%"), "metavar": metavar or None}
        kind, many = _TYPES.get(metavar), False
        for mark in marks.split():
            name, equals, value = mark.partition("=")
            if mark.startswith("."):
                self.files.setdefault(dest or flag.strip("-"), ())
                self.files[dest or flag.strip("-")] += (mark,)
            elif name in _MARKS:
                kind = _MARKS[name]
            elif mark == "ordered":
                given |= {"action": _InOrder, "default": ()}
            elif name == "prints":
                given |= {
                    "action": _Prints,
                    "nargs": 0,
                    "const": value,
                    "default": argparse.SUPPRESS,
                }
            elif name in ("many", "any"):
                many = True
                given |= {"nargs": "+" if mark == "many" else "*"} if word else {}
            elif name == "maybe":
                given |= {"nargs": "?", **({"const": (kind or str)(value)} if equals else {})}
            elif mark == "must":
                given["required"] = True
            elif mark.startswith("{"):
                given |= {"choices": mark.strip("{}").split(","), "metavar": None}
            else:
                given |= {"default": (kind or str)(value), **({"nargs": "?"} if word else {})}
        if "action" in given:
            pass
        elif not metavar and "choices" not in given:
            del given["metavar"]
            given["action"] = "store_true"
        elif kind is named:
            given |= {"action": _Named, "type": kind, "default": given.get("default", {})}
        else:
            given |= {"type": kind} if kind else {}
            given |= {"action": "append", "default": []} if many and not word else {}
        group.add_argument(flag, **given, **({"dest": dest} if dest else {}))


def add_command(
    commands: Any, function: Callable[[Options], int], shared: Mapping[str, str], name: str
) -> Parser:
    """Add a command to its kind, made of its docstring; return its parser."""
    said = inspect.getdoc(function) or ""
    head, _, rest = said.partition("\n\n")
    about, *rest = re.split(r"Options:\n|^(?=examples?:)", rest, maxsplit=1, flags=re.M)
    split = re.fullmatch(r"((?: [^\n]*\n?|\n)*)(.*)", "".join(rest), flags=re.S)
    lines, epilog = split.groups() if split else ("", "")
    epilog = re.sub(r"^@(\w+)$", lambda one: shared[one[1]].strip(), epilog, flags=re.M)
    title = " ".join(head.split())
    command = commands.add_parser(
        name,
        help=title[0].lower() + title[1:].removesuffix("."),
        description="\n".join(" ".join(one.split()) for one in about.strip().split("\n\n")),
        epilog=epilog.strip() + "\n" if epilog.strip() else None,
    )
    command.add_options(lines, shared)
    command.set_defaults(run=function, files=command.files)
    return command


def joined_band(words: Sequence[str]) -> list[str]:
    """Return a command line with `--band LO HI` as one word, so that argparse takes it."""
    result = list(words)
    for k in range(len(result) - 3, -1, -1):
        if result[k].startswith("--ba") and all(map(is_number, result[k + 1 : k + 3])):
            result[k : k + 3] = [f"--band={result[k + 1]}:{result[k + 2]}"]
    return result


def is_number(text: str) -> bool:
    """Return whether a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def worded(remedy: Sequence[Option | Command]) -> str:
    """Return what mends something as one types it, " (--windows, --repair gaps)"."""
    said = ", ".join(_typed(one) for one in remedy)
    return f" ({said})" if said else ""


def _typed(one: Option | Command) -> str:
    if isinstance(one, Option):
        word = one.value if one.value.replace(" ", "").isupper() else quote(one.value)  # LO HI
        return f"--{one.name.replace('_', '-')}{f' {word}' if one.value else ''}"
    return " ".join(["helisim", one.name, *map(quote, one.arguments), *map(_typed, one.options)])


def worded_note(note: Note) -> str:
    """Return a note's text with the options that mend it."""
    return note.text + worded(note.remedy)


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


def wrapped(text: str, *, indent: int = 0) -> str:
    """Return each line of a text within 80 columns, continued at an indent; paths stay whole."""
    options: Any = {"break_long_words": False, "break_on_hyphens": False}
    lines = text.splitlines()
    return "\n".join(
        textwrap.fill(one, _WIDTH, subsequent_indent=" " * indent, **options) for one in lines
    )


SHARED = {
    "vehicle": """
vehicle VEHICLE <=jr700>  jr700 (default), blade360 or lynx, or the path of a vehicle's folder of
    your own
""",
    "quiet": "--quiet  no progress bar, and no word of what is written",
    "set": """
--set NAME=VALUE <many>  replace a physical parameter, such as main_rotor.hub_stiffness=100 (SI)
    or drive.governor=ideal; may be given again
""",
    "jobs": "--jobs J <int>  threads (default: all processors)",
    "seed": "--seed S <int =1>  {} (default: 1)",
    "rerun": "--rerun FILE <.rrd>  write a Rerun recording too, .rrd",
    "write": "--write  replace the vehicle's {}",
    "controller": """
--controller LAW  fly by this control law in place of the gyro: a file, law.toml, or MODULE:NAME,
    a function of (seen, state, settings) or a helisim.Controller of module.py, here or installed;
    none: the servos stay at the trim
""",
    "units": """
--units deg,ft,percent  {} in degrees, feet and percent of a control's range, or some of them
    (default: SI); frequencies stay in rad/s, and JSON in SI
""",
    "weather": """
--turbulence LEVEL|M/S  light, moderate or severe (Dryden, MIL-F-8785C), or the wind at 20 ft that
    makes it, m/s (default: calm)
--wind M/S  steady wind, m/s (default: 0)
--wind-from-deg DEG  where it comes from; flights head north: 0 is a headwind, 90 from the right
""",
    "ground": """
--ground flat|SETTING=VALUE[,...]|off  fly above a ground that can be landed on: flat, a slope, or
    a deck that moves; see below
""",
    "about_ground": """
a ground is flat, or SETTING=VALUE[,...], to take off from and to land on:
  --ground slope=0.1,uphill=1.57         rad, rising to the east
  --ground flat,parked                   start on it, not in the hover above it
  --ground flat,parked,rotor=0           and a motor spins the rotor up
  --ground deck,length=8,heave=0.3/6     m, and m over s; also surge, sway, and
                                         roll, pitch in rad over s
""",
    "manoeuvre": """
--excitation/flown KIND[,NAME=VALUE...] <ordered>  what is flown on purpose, see below: sweep
    (default), step, multisine, ...; may be given again
--history/flown FILE[,NAME=VALUE...] <ordered>  fly the columns of this file, .csv or .parquet; may
    be given again
--sequence S <float maybe=0>  fly them one after the other, S seconds of trimmed flight between
    (default: 0)
--kinds <prints=flying.kinds_in_words>  list all kinds with their settings
--axis AXIS  col|lon|lat|ped{}
--at PLACE  sticks (default), servos, actuators or sensors (axis p, q, r, phi, theta, psi)
--duration S  of the flight, s (default: a sweep's is 90)
--amplitude A <float>  of the stick, unitised (default: the axis's own)
""",
    "about_manoeuvres": """
a manoeuvre is KIND[,NAME=VALUE...], several numbers are joined as 3:42; or
MODULE:FUNCTION, a Python function of time in s. --kinds lists all:
  --excitation step,axis=ped,amplitude=0.02
  --excitation chirp,axis=lat,band=1:30,spacing=linear
  --excitation multisine,period=20,duration=46        all four axes at once
  --excitation doublet,axis=tail,at=actuators,amplitude=0.05
  --history steps.csv,axis=lat+ped,method=hold        time, LAT and PED
several are flown together, with --sequence one after the other.
""",
    "logs": """
logs LOG <many>  helisim record, CSV, Parquet, ULog (PX4) or DataFlash (ArduPilot)
how to read the logs:
--map FILE  which column is which channel, TOML; see below
--channel NAME=COLUMN:UNIT <many>  the same for one channel, with sign=-1, trim=X, range=X after
    further colons; may be given again
--time COLUMN[:UNIT]  column of times, in s, ms, us, ...
--rate HZ  of a log without times
--resample HZ  make the samples uniform (with a filter where the log is faster)
--repair NAME,... <many>  allow repairs: duplicates (average rows that have the same stamp); frozen
    (leave out stretches in which measured motion is frozen, and split the log there as at gaps);
    gaps (split the log at its gaps); missing (interpolate cells without a number); order (sort
    rows by time); resets (split the log where the clock goes back); spikes (interpolate single
    samples, or two, that stick out); tail (leave out an incomplete last line)
--max-gap S  longest time between samples that is no gap (default: 4.5 median steps)
--min-duration S <=0>  leave out shorter parts of a log that is split
--use-ended  use logs of simulated flights that were terminated early, too
--from/from_time S  leave out what is before, s after the log's first sample
--to/to_time S  leave out what is after, s after the log's first sample
""",
    "about_maps": """
a map is a TOML file, such as
  [time]
  column = "t"
  unit = "us"

  [channels.p]
  column = "gyro_x"
  unit = "deg/s"
  sign = -1

  [channels.lat]
  column = "rc1"
  unit = "us"          # pulse width: (pulse - trim) / range
  trim = 1520
  range = 800

  [file]               # only where it can't be found out, CSV
  delimiter = ";"
  decimal = ","
""",
    "estimator": """
--estimator <{windows,local}>  local: a polynomial or rational function in each narrow band, which
    no window smears and no transient biases (default); windows: CIFER's composite of Hann windows
--windows S,S,... <numbers>  CIFER's windows with these lengths, s: long ones for low frequencies,
    short ones for less scatter (with --estimator windows alone five, by the band and the records)
--overlap SHARE  with windows: of a window that the next one covers (default: 0.75)
""",
}
"""Options that several commands have, and texts below them, by the names that docstrings say."""


_SILENT, _INTERVAL = 3.0, 10.0
"""s, before the first line in a log file, and between two: most commands are done by then."""


class Progress:
    """Show how many steps of a command are done, on standard error, unless it shall be quiet.

    A bar on a terminal, a line now and then in a log file.

    Args:
        steps: in all; None if that is not known.
        quiet: True shows nothing.
        unit: what a step is called.
    """

    def __init__(self, steps: int | None, quiet: bool, unit: str = "step") -> None:
        from tqdm import tqdm  # not above: it takes a while

        self._of_all, self._unit, self._done = "" if steps is None else f" of {steps}", unit, 0
        self._bar = tqdm(total=steps, disable=quiet or None, unit=unit, leave=False)
        self._writes_lines = not quiet and not sys.stderr.isatty()
        self._start = time.monotonic()
        self._next = self._start + _SILENT

    def __enter__(self) -> Callable[[str], None]:
        return self._advance

    def _advance(self, label: str) -> None:
        self._done += 1
        self._bar.set_description(label)
        self._bar.update()
        now = time.monotonic()
        if self._writes_lines and now >= self._next:
            self._next = now + _INTERVAL
            done = f"{self._unit} {self._done}{self._of_all}, {now - self._start:.0f} s"
            print(f"{label}: {done}", file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        self._bar.close()


def loaded(options: Options, **more: Any) -> "Vehicle":
    """Return the vehicle that the options say, with --set and --controller. Raises InputError."""
    from helisim.vehicle import load

    vehicle = load(options.vehicle, parameters=parameters(options), **more)
    asked = getattr(options, "controller", None)
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


def parameters(options: Options) -> dict[str, float | str]:
    """Return what --set gives: numbers, and words where a parameter is a choice."""
    from helisim.vehicle.parameters import number_of, words_of

    given: dict[str, float | str] = {}
    for item in options.set:
        name, _, text = map(str.strip, item.partition("="))
        if words_of(name):
            try:
                number_of(name, text)
            except InputError as error:
                raise InputError(f"--set {error}") from None
            given[name] = text
        else:
            given |= numbers_by_name("--set", [item])
    return given


def numbers_by_name(option: str, items: list[str]) -> dict[str, float]:
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


def chosen_units(options: Options) -> "UserUnits | None":
    """Return the units that --units asks for, None for SI. Raises InputError."""
    if options.units is None:
        return None
    from helisim.base.units import UserUnits

    return UserUnits.of(options.units)


def print_json(data: Any) -> None:
    """Print plain data as strict JSON."""
    print(json.dumps(data, indent=2, allow_nan=False))


def print_written(options: Options, *texts: object) -> None:
    """Print what was written where, each that is not None, unless --quiet."""
    for text in texts:
        if text is not None and not options.quiet:
            print(f"Written: {text}")


def replace_parameter_file(options: Options, name: str, text: str) -> None:
    """Write a vehicle's parameter file of that name anew, its MJCF too, and print where."""
    from helisim.base.files import atomic_write
    from helisim.vehicle.build import write_numbers
    from helisim.vehicle.folder import model_folder

    path = model_folder(options.vehicle) / name
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print_written(options, path, *write_numbers(options.vehicle))


def write_recording(
    path: Path, records: Any, *, vehicle: str | Path = "jr700", run: Any = None, quiet: bool = False
) -> None:
    """Write a Rerun recording of flights, and of what a run found from them, and print where."""
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
