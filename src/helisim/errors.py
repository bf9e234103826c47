"""Exceptions: one base, one subclass for each cause.

A message says what was received, what was expected, which names exist, and what to do.
"""

from collections.abc import Iterable
from typing import Any


class HelisimError(Exception):
    """Base of every error that helisim raises on purpose."""


class InputError(HelisimError, ValueError):
    """An argument is outside what the function accepts."""


class UnknownNameError(InputError):
    """A name was given that does not exist."""

    def __init__(self, what: str, received: object, available: Iterable[str]) -> None:
        names = ", ".join(available)
        super().__init__(f"unknown {what} {received!r}; available: {names}")


class RecordError(HelisimError):
    """A flight record is malformed or lacks what was asked of it."""


class StorageError(HelisimError):
    """A file can't be read or written."""


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


class IdentificationError(HelisimError):
    """The data do not support the identification that was asked for."""


class DisplayError(HelisimError):
    """A window can't be opened."""


class WorkerError(HelisimError):
    """The workers of a campaign are lost, out of reach, or can't be used."""
