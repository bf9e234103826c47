"""What the messages of a DataFlash log hold: their fields, as the log's own FMT messages say.

Source: ArduPilot, "Downloading and analyzing data logs", and the format characters in the README
of its library AP_Logger: `a` int16[32], `b` int8, `B` uint8, `h` int16, `H` uint16, `i` int32,
`I` uint32, `f` float, `d` double, `g` half, `n` char[4], `N` char[16], `Z` char[64], `c`, `C`,
`e` and `E` hundredths of `h`, `H`, `i` and `I`, `L` int32 of 1e-7 degrees, `M` uint8, `q` int64,
`Q` uint64.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

HEADER = 3
"""Bytes of a message before its fields: two marks and its type's number."""
FMT_NUMBER, FMT_LENGTH = 128, 89
"""Number and bytes of FMT, the one layout that is known beforehand."""
CLOCKS: Mapping[str, float] = {"TimeUS": 1e-6, "TimeMS": 1e-3}
"""Fields that say when, and their units in s."""
INSTANCE = "#"
"""Unit of the field that says which of several sensors a message is of."""

SNIFFED = 1 << 16
"""Bytes of a file that show whether it is a DataFlash log."""
_BINARY_START, _TEXT_START = b"\xa3\x95\x80\x80\x59FMT", re.compile(rb"^FMT, ?\d", re.MULTILINE)
"""How the FMT message that describes itself begins, which is each log's first."""

_LETTERS: dict[str, tuple[str, float]] = {
    "a": ("<i2", 1.0), "b": ("i1", 1.0), "B": ("u1", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0),
    "i": ("<i4", 1.0), "I": ("<u4", 1.0), "f": ("<f4", 1.0), "d": ("<f8", 1.0), "g": ("<f2", 1.0),
    "n": ("S4", 1.0), "N": ("S16", 1.0), "Z": ("S64", 1.0), "c": ("<i2", 100.0),
    "C": ("<u2", 100.0), "e": ("<i4", 100.0), "E": ("<u4", 100.0), "L": ("<i4", 1e7),
    "M": ("u1", 1.0), "q": ("<i8", 1.0), "Q": ("<u8", 1.0),
}  # fmt: skip
"""Letter -> kind of number, and by how much it is divided."""
_SAMPLES = 32
"""Numbers in an `a`."""


def is_text(start: bytes) -> bool:
    """Return whether a file's first bytes are those of a DataFlash log in text."""
    return _BINARY_START not in start and _TEXT_START.search(start) is not None


def is_dataflash(start: bytes) -> bool:
    """Return whether a file's first bytes are those of a DataFlash log, damaged or not."""
    return start.startswith(_BINARY_START[:2]) or _BINARY_START in start or is_text(start)


@dataclass(frozen=True)
class Field:
    """A field of a message.

    Attributes:
        name: such as "Roll".
        kind: of number, as NumPy writes it.
        count: of numbers.
        offset: from the message's start, bytes.
        divisor: what the stored number is divided by, as the letter says.
        index: of the field in the FMT message.
    """

    name: str
    kind: str
    count: int
    offset: int
    divisor: float
    index: int

    @property
    def size(self) -> int:
        """Bytes that the field takes."""
        return self.count * np.dtype(self.kind).itemsize

    @property
    def is_text(self) -> bool:
        """Whether it holds characters."""
        return self.kind.startswith("S")


@dataclass(frozen=True)
class Layout:
    """What one FMT message says.

    Attributes:
        number: of the type of message.
        name: of the type, such as "RATE".
        length: of a message, bytes with its header.
        fields: that can be read.
        lost: why some can't be, empty if all can.
    """

    number: int
    name: str
    length: int
    fields: tuple[Field, ...]
    lost: str = ""

    @property
    def clock(self) -> Field | None:
        """The field that says when."""
        return next((one for one in self.fields if one.name in CLOCKS), None)

    def field(self, name: str) -> Field | None:
        """Return a field by its name, None if there is no such one."""
        return next((one for one in self.fields if one.name == name), None)


def layout(number: int, length: int, name: bytes, letters: bytes, labels: bytes) -> Layout | None:
    """Return what an FMT message says; None if it can't be one.

    A letter that isn't known, or a field beyond the message's length, ends what can be read.
    """
    words = [text(part) for part in (name, letters, labels)]
    if length < HEADER or not words[0] or not all(one.isascii() and _plain(one) for one in words):
        return None
    fields, offset, lost = [], HEADER, ""
    names = words[2].split(",") if words[2] else []
    for k, (letter, label) in enumerate(zip(words[1], [*names, *[""] * len(words[1])])):
        if letter not in _LETTERS:
            lost = f"{words[0]}: format letter {letter!r} isn't known, so {label or 'its rest'}"
            break
        kind, divisor = _LETTERS[letter]
        count = _SAMPLES if letter == "a" else 1
        field = Field(label.strip(), kind, count, offset, divisor, k)
        offset += field.size
        if offset > length:
            lost = f"{words[0]}: its format {words[1]} is longer than {length} bytes, so {label}"
            break
        if field.name and all(one.name != field.name for one in fields):
            fields.append(field)
    if lost:
        lost += " and what follows it is left out"
    return Layout(number, words[0], length, tuple(fields), lost)


def text(data: bytes) -> str:
    """Return characters up to the first NUL, in UTF-8, or else in Latin-1."""
    data = data.split(b"\0", 1)[0]
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _plain(word: str) -> bool:
    return all(" " <= letter <= "~" for letter in word)


@dataclass(frozen=True)
class Scales:
    """Units of fields, as the log's FMTU, UNIT and MULT messages say.

    Attributes:
        ids: number of a type -> a letter each field for its unit, and one for its multiplier.
        units: letter -> unit.
        multipliers: letter -> factor from the stored number to the unit.
    """

    ids: Mapping[int, tuple[str, str]]
    units: Mapping[str, str]
    multipliers: Mapping[str, float]

    def unit(self, layout: Layout, field: Field) -> str:
        """Return the unit of a field, empty where the log doesn't say it."""
        letters = self.ids.get(layout.number, ("", ""))[0]
        return self.units.get(letters[field.index], "") if field.index < len(letters) else ""

    def factor(self, layout: Layout, field: Field) -> float:
        """Return what a field's stored number is multiplied by, besides its divisor.

        A letter of the format that scales does so alone: the multiplier says the same again.
        """
        letters = self.ids.get(layout.number, ("", ""))[1]
        if field.index >= len(letters) or field.divisor != 1.0:
            return 1.0
        return self.multipliers.get(letters[field.index], 1.0) or 1.0

    def instance(self, layout: Layout) -> Field | None:
        """Return the field that says which of several sensors a message is of, if one does."""
        k = self.ids.get(layout.number, ("", ""))[0].find(INSTANCE)
        return next((one for one in layout.fields if one.index == k), None)
