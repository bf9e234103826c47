"""ArduPilot's parameters as a file that says of each why it is what it is."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from os import PathLike
from textwrap import wrap

from helisim.base.errors import InputError
from helisim.base.files import atomic_write, read_text
from helisim.base.value import FrozenMap

_LONGEST_NAME = 16
_WIDTH = 90
"""Of a line: ArduPilot reads 98 characters, and takes what follows for the next line."""


@dataclass(frozen=True)
class Setting:
    """One parameter.

    Attributes:
        name: ArduPilot's.
        value: in its unit there.
        why: what it follows from; "" where it goes with the one before.

    Raises:
        InputError: it is no name of a parameter, or no finite number.
    """

    name: str
    value: float
    why: str = ""

    def __post_init__(self) -> None:
        own = self.name.replace("_", "")
        known = own.isascii() and own.isalnum() and own == own.upper() and own[0].isalpha()
        if not (own and known and len(self.name) <= _LONGEST_NAME):
            raise InputError(
                f"{self.name!r:.40} is no parameter of ArduPilot: expected up to {_LONGEST_NAME} "
                "capitals, digits and underscores"
            )
        if not math.isfinite(self.value):
            raise InputError(f"{self.name} must be a finite number, got {self.value!r}")


@dataclass(frozen=True, repr=False)
class AutopilotParameters:
    """What an autopilot is set to, in groups, and what is left to be found otherwise.

    Attributes:
        title: what flies with them, and what they were made from.
        groups: heading -> its settings, in order.
        remarks: what could not be derived, and what was left out on purpose.

    Raises:
        InputError: a parameter is set twice.
    """

    title: str
    groups: Mapping[str, tuple[Setting, ...]]
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        groups = {heading: tuple(some) for heading, some in self.groups.items()}
        object.__setattr__(self, "groups", FrozenMap(groups))
        object.__setattr__(self, "remarks", tuple(self.remarks))
        names = [one.name for one in self.settings]
        twice = [name for k, name in enumerate(names) if name in names[:k]]
        if twice:
            raise InputError(f"{twice[0]} is set twice")

    def __repr__(self) -> str:
        return f"AutopilotParameters({self.title.partition(';')[0]!r:.60}, {len(self.settings)})"

    @property
    def settings(self) -> tuple[Setting, ...]:
        """All of them, in the order of the file."""
        return tuple(one for some in self.groups.values() for one in some)

    @property
    def values(self) -> dict[str, float]:
        """Value by name, as the file has it: of six digits."""
        return {one.name: float(_number(one.value)) for one in self.settings}

    @property
    def text(self) -> str:
        """The file, which ArduPilot and ground stations read: name and value, or # a comment."""
        lines = [*_comment(self.title), "#"]
        lines += [line for remark in self.remarks for line in _comment(remark)]
        for heading, some in self.groups.items():
            lines += ["#", f"# ---- {heading}"]
            for one in some:
                lines += _comment(one.why) if one.why else []
                lines.append(f"{one.name} {_number(one.value)}")
        return "\n".join([*lines, ""])

    def write(self, path: str | PathLike[str]) -> None:
        """Write the file. Raises StorageError."""
        with atomic_write(path) as temporary:
            temporary.write_text(self.text, encoding="utf-8")


def read_parameters(path: str | PathLike[str]) -> dict[str, float]:
    """Return the values of a .parm file by name, as ArduPilot and ground stations write it.

    Args:
        path: of lines NAME VALUE or NAME,VALUE; from # on they are comments.

    Raises:
        StorageError: it can't be read.
        InputError: a line is neither; the message says which.
    """
    found: dict[str, float] = {}
    for number, line in enumerate(read_text(path).splitlines(), 1):
        parts = line.partition("#")[0].replace(",", " ").replace("=", " ").split()
        if not parts:
            continue
        try:
            name, value = parts[:2]
            found[name] = Setting(name, float(value)).value
        except (ValueError, InputError):
            raise InputError(
                f"{path}:{number}: {line.strip()!r:.60} is no parameter: expected NAME VALUE, "
                "such as ATC_RAT_RLL_P 0.02"
            ) from None
    if not found:
        raise InputError(f"{path}: no parameter is in it; expected lines NAME VALUE")
    return found


def _comment(text: str) -> Iterable[str]:
    return wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="#   ")


def _number(value: float) -> str:
    return f"{value:.6g}"
