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
import re
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from shlex import quote
from types import ModuleType
from typing import Any, NoReturn

from helisim.base.errors import InputError, UnknownNameError, similar
from helisim.base.note import Command, Note, Option
from helisim.base.text import single_line

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
