"""Factors of a transfer function as text, such as (a)/[zeta,omega](0).

The notation is McRuer's. What stands in a factor says what its parameter is called or where it
starts, and a 0 is a free integrator, or differentiator:

    (a)             s + a, rad/s; a negative a is to the right of the axis
    (1/T)           s + 1/T, T in s and positive
    [zeta, omega]   s^2 + 2 zeta omega s + omega^2; above zeta = 1 two real ones
    (2.5), [0.3,5]  the same, with that start and a name by kind
    (0)             s

A numerator of 1 has no factors. The gain K in front is that at high frequency, where the response
is K over a power of s. A name that stands more than once is numbered: (a)(a) has a1 and a2.
"""

import math
import re
from typing import NamedTuple

from helisim.base.errors import InputError

_FACTOR = re.compile(r"\s*(?:\((?P<one>[^()\[\]]*)\)|\[(?P<two>[^()\[\]]*)\])")
_EXAMPLE = "such as (a)/[zeta,omega](0) or 1/(1/T)(2.5)"


class Factor(NamedTuple):
    """One factor of a numerator or denominator.

    Attributes:
        kind: "a" for s + a, "T" for s + 1/T, "2" for a second order, "0" for s.
        names: of its parameters.
        starts: where they begin, as given or None.
    """

    kind: str
    names: tuple[str, ...] = ()
    starts: tuple[float | None, ...] = ()

    @property
    def order(self) -> int:
        """The power of s that it begins with."""
        return 2 if self.kind == "2" else 1

    @property
    def polynomial(self) -> tuple[str, ...]:
        """Its coefficients from s^0 up as expressions, without the leading 1."""
        match self.kind:
            case "2":
                zeta, omega = self.names
                return f"{omega}**2", f"2*{zeta}*{omega}"
            case "T":
                return (f"1/{self.names[0]}",)
            case "a":
                return (self.names[0],)
        return ("0",)

    def __str__(self) -> str:
        match self.kind:
            case "2":
                return f"[{', '.join(self.names)}]"
            case "T":
                return f"(1/{self.names[0]})"
            case "a":
                return f"({self.names[0]})"
        return "(0)"


def parsed(notation: str) -> tuple[list[Factor], list[Factor]]:
    """Return the factors above and below the slash, with the names that they have.

    Raises:
        InputError: the notation can't be read.
    """
    text = notation.strip().removeprefix("K").strip()
    above, at = _side(text, 0, notation)
    if not above and text[at : at + 1] == "1":
        at += 1
    rest = text[at:].lstrip()
    if not rest.startswith("/"):
        raise InputError(
            f"can't read {notation!r} at {rest[:12]!r}; expected factors of the numerator, or 1, "
            f"a slash, and those of the denominator, {_EXAMPLE}"
        )
    below, at = _side(rest, 1, notation)
    if not below and rest[1:].strip() == "1":
        at = len(rest)
    if rest[at:].strip() or not (below or rest[1:].strip() == "1"):
        raise InputError(
            f"can't read {notation!r} at {rest[at : at + 12]!r}; expected factors of the "
            f"denominator, {_EXAMPLE}"
        )
    return _numbered(above, below)


def _side(text: str, at: int, notation: str) -> tuple[list[Factor], int]:
    found = []
    while match := _FACTOR.match(text, at):
        found.append(_factor(match, notation))
        at = match.end()
    return found, at


def _factor(match: re.Match[str], notation: str) -> Factor:
    if match["two"] is not None:
        parts = [part.strip() for part in match["two"].split(",")]
        if len(parts) != 2:
            raise InputError(
                f"factor [{match['two']}] of {notation!r} has {len(parts)} entries, expected two: "
                "[zeta, omega]"
            )
        both = [_entry(part, kind, notation) for part, kind in zip(parts, ("zeta", "omega"))]
        if both[1][1] is not None and both[1][1] <= 0.0:
            raise InputError(f"omega of [{match['two']}] in {notation!r} isn't positive")
        return Factor("2", *map(tuple, zip(*both)))  # pyright: ignore[reportArgumentType]
    text = match["one"].strip()
    if text.startswith("1/"):
        name, start = _entry(text[2:].strip(), "T", notation)
        if start is not None and start <= 0.0:
            raise InputError(f"the time constant of ({text}) in {notation!r} isn't positive")
        return Factor("T", (name,), (start,))
    name, start = _entry(text, "a", notation)
    return Factor("0") if start == 0.0 else Factor("a", (name,), (start,))


def _entry(text: str, kind: str, notation: str) -> tuple[str, float | None]:
    """Return a parameter's name and its start, one of which is given."""
    try:
        number = float(text)
    except ValueError:
        if not text.isidentifier():
            raise InputError(
                f"{text!r} in {notation!r} is neither a name nor a number; {_EXAMPLE}"
            ) from None
        return text, None
    if not math.isfinite(number):
        raise InputError(f"{text!r} in {notation!r} isn't a finite number")
    return kind, number


def _numbered(above: list[Factor], below: list[Factor]) -> tuple[list[Factor], list[Factor]]:
    """Number the names that stand more than once."""
    names = [name for factor in (*above, *below) for name in factor.names]
    counts: dict[str, int] = {}

    def own(name: str) -> str:
        if names.count(name) == 1:
            return name
        counts[name] = counts.get(name, 0) + 1
        return f"{name}{counts[name]}"

    numbered = [
        [factor._replace(names=tuple(own(name) for name in factor.names)) for factor in side]
        for side in (above, below)
    ]
    return numbered[0], numbered[1]
