"""Parameters that are a choice between words, and the numbers that stand for them inside."""

import math
from collections.abc import Mapping
from numbers import Real
from types import MappingProxyType
from typing import Any

from helisim.base.errors import InputError

CHOICES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "drive.governor": ("ideal", "motor"),
        "drive.engine": ("electric", "combustion"),
        "main_rotor.inflow": ("quasi-steady", "pitt-peters"),
    }
)
"""Parameter -> the words that it can be. Inside, each is its place in the row, from 0 on."""


def number_of(name: str, value: Any) -> float:
    """Return a parameter's value as a number: of a choice, the number that stands for its word.

    Args:
        name: of the parameter, dotted.
        value: a number, or one of the words of its `CHOICES`.

    Raises:
        InputError: it is neither, or not finite.
    """
    words = CHOICES.get(name)
    if words is not None:
        if isinstance(value, str) and value in words:
            return float(words.index(value))
        if _is_number(value) and value in range(len(words)):
            return float(value)
        raise InputError(f"{name} must be {' or '.join(words)}, got {value!r:.60}")
    if _is_number(value) and math.isfinite(value):
        return float(value)
    raise InputError(f"parameter {name!r} must be a finite number, got {value!r:.60}")


def word_of(name: str, value: float) -> str | float:
    """Return the word that a number stands for, or the number itself where there is no choice."""
    words = CHOICES.get(name)
    return value if words is None else words[int(value)]


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)
