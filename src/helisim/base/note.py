"""Messages about data, with remedies as data."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Option:
    """A setting by its Python name, with a value to try or "", that helps."""

    name: str
    value: str = ""


@dataclass(frozen=True)
class Command:
    """A command that helps, with arguments and options."""

    name: str
    arguments: tuple[str, ...] = ()
    options: tuple[Option, ...] = ()


# Remedies: "windows", Option("repair", "gaps"), or several.
Remedy = str | Option | Command | Iterable[str | Option | Command]


def options(remedy: Remedy) -> tuple[Option | Command, ...]:
    """Return a remedy as options: "a,b" is two, "a=1" has a value."""
    if isinstance(remedy, Option | Command):
        return (remedy,)
    if isinstance(remedy, str):
        parts = (one.partition("=") for one in remedy.split(",") if one)
        return tuple(Option(name.strip(), value) for name, _, value in parts)
    return tuple(one for part in remedy for one in options(part))


@dataclass(frozen=True)
class Note:
    """A message about data: a kind such as "gaps", a sentence, and what helps."""

    kind: str
    text: str
    remedy: tuple[Option | Command, ...] = ()

    @classmethod
    def of(cls, kind: str, text: str, remedy: Remedy = ()) -> "Note":
        """Return a note with a remedy such as "windows,min_duration" or "repair=gaps"."""
        return cls(kind, text, options(remedy))

    @property
    def option(self) -> Option | None:
        """First option of the remedy, None if there is none."""
        return next((one for one in self.remedy if isinstance(one, Option)), None)

    def __str__(self) -> str:
        return self.text
