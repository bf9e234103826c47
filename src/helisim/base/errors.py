"""Exceptions, one subclass for each cause; messages have at most 500 printable characters.

Settings that help are the `remedy`, such as "windows,repair=gaps".
"""

from collections.abc import Collection, Iterable, Mapping
from difflib import SequenceMatcher
from functools import partial
from typing import Any, TypeVar

from helisim.base.note import Command, Option, Remedy, options

QUOTED = 80  # characters of a quoted text


def shown(item: object, limit: int = QUOTED) -> str:
    """Return a text, or a `repr`, without control characters, at most `limit` (8 or more) long."""
    text = item if isinstance(item, str) else repr(item)
    if not text.isprintable():
        text = "".join(c if c.isprintable() else " " * c.isspace() for c in text)
    if len(text) <= limit:
        return text
    tail = (limit - 5) // 3
    return f"{text[: limit - 5 - tail]} ... {text[len(text) - tail :]}"


def single_line(text: str) -> str:
    """Return a message without line breaks."""
    return " ".join(text.splitlines())


Item = TypeVar("Item")

_LONGEST = 500  # characters of a message; of logs' errors, of a line
_MOST_LISTED = 40  # Most names in a message; of more, only similar ones and their number
# _LONGEST_LIST: characters of the names in a message
# _ALIKE: least likeness of a suggested name; difflib's default
_LONGEST_LIST, _ALIKE = 300, 0.6
_CLOSE_TO_BEST = 0.1  # largest distance of other suggestions from the best


class HelisimError(Exception):
    """Base of helisim's errors; `remedy` holds settings by their Python names, or a command."""

    def __init__(self, *arguments: object, remedy: Remedy = ()) -> None:
        super().__init__(*arguments)
        self.remedy: tuple[Option | Command, ...] = options(remedy)

    def __str__(self) -> str:
        lines = super().__str__().splitlines()
        kept = lines if isinstance(self, LogError) else [" ".join(lines)]
        return "\n".join(shown(one, _LONGEST) for one in kept)


class InputError(HelisimError, ValueError):
    """An argument is outside what the function accepts."""


class UnknownNameError(InputError):
    """An unknown name was given; `available` are the known ones."""

    def __init__(
        self,
        what: str,
        received: object,
        available: Iterable[str],
        *,
        advice: str = "",
        remedy: Remedy = (),
    ) -> None:
        self.available = tuple(available)
        said = f"unknown {what} {shown(repr(received))}"
        alike = " or ".join(shown(one) for one in similar(str(received)[:200], self.available))
        meant = f"did you mean {alike}?" if alike else ""
        if not self.available:
            listed = "there is none"
        elif not self.unlisted:
            listed = f"available: {', '.join(self.available)}"
        else:
            listed = f"there are {len(self.available)}"
        super().__init__("; ".join(filter(None, (said, listed, meant, advice))), remedy=remedy)
        self._arguments, self._advice = (what, received, self.available), advice

    def __reduce__(self) -> tuple[Any, ...]:
        made = partial(UnknownNameError, advice=self._advice)
        # the state has words that were put before the message
        return made, self._arguments, {"args": self.args, "remedy": self.remedy}

    @property
    def unlisted(self) -> tuple[str, ...]:
        """Known names, where the message doesn't list them."""
        long = len(self.available) > 1 and len(", ".join(self.available)) > _LONGEST_LIST
        return self.available if long or len(self.available) > _MOST_LISTED else ()


def item_of(found: Mapping[str, Item], name: str, what: str) -> Item:
    """Return the item of that name. Raises UnknownNameError."""
    check_known(what, [name], found)
    return found[name]


def named(items: Iterable[Any], name: str, what: str) -> Any:
    """Return the item whose `name` it is. Raises UnknownNameError."""
    return item_of({one.name: one for one in items}, name, what)


def check_known(
    what: str, names: Iterable[object], known: Collection[str], *, remedy: Remedy = ()
) -> None:
    """Raise UnknownNameError for the first of the names that isn't a known one."""
    for name in names:
        if name not in known:
            raise UnknownNameError(what, name, known, remedy=remedy)


def similar(name: str, available: Iterable[str]) -> list[str]:
    """Return up to three names similar to `name`, best first."""
    likeness = {one: _likeness(name.casefold(), one.casefold()) for one in available}
    least = max(_ALIKE, max(likeness.values(), default=0.0) - _CLOSE_TO_BEST)
    ranked = sorted(likeness, key=lambda one: (-likeness[one], one))
    return [one for one in ranked[:3] if likeness[one] >= least]


def _likeness(wanted: str, name: str) -> float:
    part_of = 0.9 if len(wanted) > 3 and wanted in name else 0.0
    return max(part_of, SequenceMatcher(None, wanted, name).ratio())


class RecordError(HelisimError):
    """A flight record is malformed or incomplete."""


class StorageError(HelisimError):
    """A file can't be read or written."""


class LogError(InputError, RecordError, StorageError):
    """Logs can't be used; `findings` are their faults."""

    findings: tuple[Any, ...] = ()


class ModelError(HelisimError):
    """A vehicle model or its parameters can't be used."""


class CallbackError(HelisimError):
    """The compiled callbacks can't be installed safely."""


class TrimError(HelisimError):
    """No equilibrium was found."""


class DivergedError(HelisimError):
    """A simulated flight left the validity of the model; `record` is the flight so far, or None."""

    record: Any = None


class AutopilotError(HelisimError):
    """An external autopilot refused a request, or ended."""


class IdentificationError(HelisimError):
    """The data do not support the identification."""


class DisplayError(HelisimError):
    """A window can't be opened."""


class WorkerError(HelisimError):
    """A campaign's workers are lost, unreachable, or unusable."""
