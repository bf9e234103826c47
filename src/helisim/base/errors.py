"""Exceptions: one base, one subclass for each cause.

A message says what was received, what was expected, which names exist, and what to do; it has at
most 500 characters, none of them a control character. Options of the command line aren't in it:
an error names the settings that mend it, which the command line words as its options:

    raise IdentificationError("the record is too short", remedy="windows,repair=gaps")
"""

from collections.abc import Iterable
from difflib import SequenceMatcher
from functools import partial
from typing import Any

from helisim.base.note import Command, Option, Remedy, options
from helisim.base.text import shown

_LONGEST = 500
"""Characters of a message, of logs' of a line."""
_MOST_LISTED = 30
"""Names in a message; of more, or of longer ones, only those alike and their number."""
_LONGEST_LIST = 300
"""Characters of the names in a message."""
_ALIKE = 0.6
"""Likeness from which on a name may have been meant; difflib's own default."""
_CLOSE_TO_BEST = 0.1
"""By which others may be less alike than the best."""


class HelisimError(Exception):
    """Base of every error that helisim raises on purpose.

    Attributes:
        remedy: settings that mend it, by their names in Python, with values worth a try, or a
            command.
    """

    def __init__(self, *arguments: object, remedy: Remedy = ()) -> None:
        super().__init__(*arguments)
        self.remedy: tuple[Option | Command, ...] = options(remedy)

    def __str__(self) -> str:
        lines = super().__str__().splitlines()
        if not isinstance(self, LogError):
            return shown(" ".join(lines), _LONGEST)
        return "\n".join(shown(one, _LONGEST) for one in lines)


class InputError(HelisimError, ValueError):
    """An argument is outside what the function accepts."""


class UnknownNameError(InputError):
    """A name was given that does not exist.

    A short list of names is part of the message; of a long one only those that are alike. Advice
    on what else could be done ends it.

    Attributes:
        available: all names that exist.
    """

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
        state = {"args": self.args, "remedy": self.remedy}  # with words put before the message
        return made, self._arguments, state

    @property
    def unlisted(self) -> tuple[str, ...]:
        """All names that exist, where the message doesn't list them."""
        long = len(self.available) > 1 and len(", ".join(self.available)) > _LONGEST_LIST
        return self.available if long or len(self.available) > _MOST_LISTED else ()


def similar(name: str, available: Iterable[str]) -> list[str]:
    """Return up to three names that someone who wrote `name` may have meant, best first."""
    wanted = name.casefold()
    likeness = {one: _likeness(wanted, one.casefold()) for one in available}
    least = max(_ALIKE, max(likeness.values(), default=0.0) - _CLOSE_TO_BEST)
    ranked = sorted(likeness, key=lambda one: (-likeness[one], one))
    return [one for one in ranked[:3] if likeness[one] >= least]


def _likeness(wanted: str, name: str) -> float:
    """Return 1 for the same name, 0 for one without a letter in common."""
    part_of = 0.9 if len(wanted) > 3 and wanted in name else 0.0
    return max(part_of, SequenceMatcher(None, wanted, name).ratio())


class RecordError(HelisimError):
    """A flight record is malformed or lacks what was asked of it."""


class StorageError(HelisimError):
    """A file can't be read or written."""


class LogError(InputError, RecordError, StorageError):
    """Logs can't be used. All that is wrong with them is said at once, a line each.

    It is an error of input, of a record and of a file, since a log's faults are of all three
    kinds.

    Attributes:
        findings: what is wrong, each a `LogFinding` with the option that mends it, if one does.
        unlisted: names that exist where one that does not was given, if too many for a message.
    """

    findings: tuple[Any, ...] = ()
    unlisted: tuple[str, ...] = ()


class ModelError(HelisimError):
    """A vehicle model or its parameters can't be used."""


class CallbackError(HelisimError):
    """The compiled callbacks can't be installed safely."""


class TrimError(HelisimError):
    """No equilibrium was found."""


class DivergedError(HelisimError):
    """A simulated flight left the validity of the model.

    Attributes:
        record: the flight as far as it went, marked as ended; None if it has none.
        last_second: what truly happened before the end, at the simulation's rate, or None.
    """

    record: Any = None
    last_second: Any = None


class AutopilotError(HelisimError):
    """An outside autopilot refused what was asked of it, or ended."""


class IdentificationError(HelisimError):
    """The data do not support the identification that was asked for."""


class DisplayError(HelisimError):
    """A window can't be opened."""


class WorkerError(HelisimError):
    """The workers of a campaign are lost, out of reach, or can't be used."""
