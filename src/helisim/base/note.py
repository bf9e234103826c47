"""A message about data as a value; what mends it is data too, which only the command line words."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Option:
    """A setting of a function, and of the command beside it, that mends something.

    Attributes:
        name: as Python has it, such as "max_gap", which the command line words as an option.
        value: to try, such as "0.5"; "" where it is left to the reader.
    """

    name: str
    value: str = ""


@dataclass(frozen=True)
class Command:
    """A command that mends something.

    Attributes:
        name: such as "calibrate".
        arguments: behind it, such as a vehicle's folder.
        options: behind those.
    """

    name: str
    arguments: tuple[str, ...] = ()
    options: tuple[Option, ...] = ()


Remedy = str | Option | Command | Iterable[str | Option | Command]
"""What a remedy is given as: "windows", Option("repair", "gaps"), or several."""


def options(remedy: Remedy) -> tuple[Option | Command, ...]:
    """Return a remedy as options: a bare text "a,b" names two, "a=1" one with its value."""
    if isinstance(remedy, Option | Command):
        return (remedy,)
    if isinstance(remedy, str):
        parts = (one.partition("=") for one in remedy.split(",") if one)
        return tuple(Option(name.strip(), value) for name, _, value in parts)
    return tuple(one for part in remedy for one in options(part))


@dataclass(frozen=True)
class Note:
    """A message about data.

    Attributes:
        kind: of message, one word or two that a program can ask for, such as "gaps".
        text: one sentence for people, without an option of the command line in it.
        remedy: options that mend it or are worth a try; in the order given.
    """

    kind: str
    text: str
    remedy: tuple[Option | Command, ...] = ()

    @classmethod
    def of(cls, kind: str, text: str, remedy: Remedy = ()) -> "Note":
        """Return a note with a remedy such as "windows,min_duration" or "repair=gaps"."""
        return cls(kind, text, options(remedy))

    @property
    def option(self) -> Option | None:
        """The first option that mends it, None if none does."""
        return next((one for one in self.remedy if isinstance(one, Option)), None)

    def __str__(self) -> str:
        return self.text
