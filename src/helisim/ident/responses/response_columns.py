"""What a column of a frequency response in text holds, by its heading.

Headings such as "p/lat magnitude [dB]", "freq_Hz" or "Phase (deg)" are understood. A unit is never
guessed from the numbers: where a heading has none, it must be given.
"""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from helisim.base.errors import InputError

_WORDS: Mapping[str, Sequence[str]] = {
    "error": ("error", "err", "eps"),
    "coherence": ("coherence", "coh", "gamma2", "gxy2", "cxy"),
    "real": ("real", "re"),
    "imaginary": ("imaginary", "imag", "im"),
    "magnitude": ("magnitude", "mag", "gain", "amplitude", "modulus", "db"),
    "phase": ("phase", "angle", "arg", "deg"),
    "frequency": ("frequency", "freq", "omega", "w", "f", "hz", "rad/s"),
}
"""Quantity -> words of headings that mean it, the surest quantity first."""

_UNITS: Mapping[str, Mapping[str, Sequence[str]]] = {
    "frequency": {"rad/s": ("rad/s", "rad/sec", "rad s", "rad sec", "rads"), "Hz": ("hz",)},
    "magnitude": {"dB": ("db",), "1": ("abs", "absolute", "ratio", "linear", "lin", "1")},
    "phase": {"deg": ("deg", "degree", "degrees", "°"), "rad": ("rad", "radian", "radians")},
    "coherence": {"1": ("", "1")},
    "error": {"1": ("", "1"), "percent": ("percent", "%")},
    "real": {"1": ("", "1")},
    "imaginary": {"1": ("", "1")},
}
"""Quantity -> its units, each with the words that mean it."""

_FILLING = {"random", "partial", "response", "std", "of", "the"}

_PAIR = re.compile(r"([^\s/\[\]()=,;]+/[^\s/\[\]()=,;]+)\s+(.+)")

HINT = (
    "say what the columns hold, in their order: columns='frequency:Hz,magnitude:dB,phase:deg,"
    "coherence,-', or --columns on the command line"
)


class Column(NamedTuple):
    """What a column holds.

    Attributes:
        pair: such as "p/lat"; "" where its heading names none.
        quantity: such as "magnitude"; "" for one that isn't used.
        unit: of it.
    """

    pair: str
    quantity: str
    unit: str


def by_heading(heading: str) -> Column:
    """Return what a column holds by its heading. Raises InputError where its unit is missing."""
    pair, quantity, left = _parts(heading)
    if not quantity:
        return Column("", "", "")
    for unit, words in _UNITS[quantity].items():
        if left in words or set(left.split()) & {word for word in words if " " not in word}:
            return Column(pair, quantity, unit)
    known = ", ".join(_UNITS[quantity])
    raise InputError(
        f"the heading {heading.strip()!r} has no unit that a {quantity} can have ({known}), and "
        f"units aren't guessed from numbers; {HINT}"
    )


def by_order(text: str) -> list[Column]:
    """Return what columns hold by "frequency:Hz,p/lat magnitude:dB,-". Raises InputError."""
    columns = []
    for item in text.split(","):
        name, _, unit = item.strip().partition(":")
        if name in ("-", ""):
            columns.append(Column("", "", ""))
            continue
        if not quantity_of(name):
            raise InputError(f"a column can't hold {name!r}; available: {', '.join(_WORDS)}, -")
        columns.append(by_heading(f"{name} [{unit}]"))
    return columns


def quantity_of(heading: str) -> str:
    """Return the quantity that a heading means, such as "phase"; "" for none."""
    return _parts(heading)[1]


def _parts(heading: str) -> tuple[str, str, str]:
    """Return the pair, the quantity, and what is left of a heading, in lower case."""
    pair = _PAIR.fullmatch(heading.strip())
    text = pair[2] if pair else heading
    bracket = re.search(r"[\[(]([^\])]*)[\])]", text)
    outside = text if bracket is None else text[: bracket.start()] + " " + text[bracket.end() :]
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", outside.replace("dB", " db"))
    words = [one for one in re.split(r"[_\s:,]+", apart.lower()) if one and one not in _FILLING]
    meant = [(one, quantity) for quantity, names in _WORDS.items() for one in words if one in names]
    if not meant:
        return "", "", ""
    word, quantity = meant[0]
    if bracket is not None:
        left = bracket[1].strip().lower()
    else:
        left = " ".join(one for one in words if one != word or one in ("db", "hz", "deg", "rad/s"))
    return pair[1] if pair else "", quantity, left
