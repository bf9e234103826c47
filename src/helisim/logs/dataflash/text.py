"""Reads ArduPilot's logs in text, which ground stations make of binary ones: a line a message.

Numbers of a letter that scales are in their unit already.
"""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from helisim.logs.dataflash.layout import FMT_LENGTH, FMT_NUMBER, Field, Layout, layout
from helisim.logs.dataflash.store import Part, Wanted

_LINE = re.compile(rb"^([A-Za-z0-9_]{1,4}),", re.MULTILINE)


class TextStore:
    """The lines of a text log.

    Args:
        data: of the file.

    Attributes:
        parts: the lines of each type that has a FMT line.
        skipped: bytes of lines that are no message.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._parsed: dict[str, tuple[NDArray[np.signedinteger], dict[str, NDArray]]] = {}
        places: dict[bytes, list[int]] = {}
        for match in _LINE.finditer(data):
            places.setdefault(match[1], []).append(match.start())
        known = {one.name: one for one in map(_layout, self._lines(places.get(b"FMT", []))) if one}
        self.parts = [
            Part(known[name.decode()], self._whole(np.array(found), known[name.decode()]))
            for name, found in places.items()
            if name.decode() in known
        ]
        used = sum(
            min(len(line) + 1, len(data) - place)
            for part in self.parts
            for place, line in zip(part.places.tolist(), self._lines(part.places))
        )
        self.skipped = len(data) - used

    def raw(self, wanted: Wanted) -> list[list[NDArray]]:
        """Return the fields of each part, each (n_message,) or (n_message, n_number)."""
        found = []
        for part, fields in wanted:
            places, columns = self._columns(part.layout.name)
            here = np.searchsorted(places, part.places)
            found.append([columns[field.name][here] for field in fields])
        return found

    def _columns(self, name: str) -> tuple[NDArray[np.signedinteger], dict[str, NDArray]]:
        """Return where a type's lines begin, (n_line,), and its columns, each (n_line,)."""
        if name not in self._parsed:
            part = next(one for one in self.parts if one.layout.name == name)
            columns = _columns(part.layout.fields, self._lines(part.places))
            self._parsed[name] = part.places, columns
        return self._parsed[name]

    def _whole(self, places: NDArray[np.int64], layout: Layout) -> NDArray[np.int64]:
        """Return those of the lines at places, (n_line,), that have all fields."""
        count = max((one.index for one in layout.fields), default=0) + 1
        return places[[line.count(b",") >= count for line in self._lines(places)]]

    def _lines(self, places: list[int] | NDArray) -> list[bytes]:
        ends = [self._data.find(b"\n", place) for place in places]
        return [self._data[a : b if b >= 0 else None] for a, b in zip(places, ends)]


def _layout(line: bytes) -> Layout | None:
    """Return what a FMT line says, None if it isn't one."""
    cells = [cell.strip() for cell in line.split(b",", 5)[1:]]
    if len(cells) < 5 or not (cells[0].isdigit() and cells[1].isdigit()):
        return None
    number, length = int(cells[0]), int(cells[1])
    if number == FMT_NUMBER:
        length = FMT_LENGTH
    found = layout(number, length, *cells[2:])
    if found is None:
        return None
    return replace(found, fields=tuple(replace(one, divisor=1.0) for one in found.fields))


def _columns(fields: Sequence[Field], lines: list[bytes]) -> dict[str, NDArray]:
    """Return field -> its cells in lines, (n_line,)."""
    if not fields:
        return {}
    if not any(one.is_text for one in fields):
        try:
            where = [one.index + 1 for one in fields]
            numbers = np.loadtxt(lines, delimiter=",", usecols=where, ndmin=2, comments=None)
        except ValueError:
            pass  # a cell isn't a number: which ones, is found one by one
        else:
            return {one.name: _shaped(one, numbers[:, k]) for k, one in enumerate(fields)}
    count = max(one.index for one in fields) + 1
    rows = [line.split(b",", count)[1:] for line in lines]
    return {one.name: _shaped(one, _column(rows, one)) for one in fields}


def _shaped(field: Field, values: NDArray) -> NDArray:
    """Return a column, (n_line,); without numbers, (n_line, n_number), where it has several."""
    if field.count == 1:
        return values
    return np.full((values.size, field.count), np.nan)  # no program writes them in text


def _column(rows: list[list[bytes]], field: Field) -> NDArray:
    """Return a field of split lines, (n_message,); NaN where it isn't a number."""
    cells = [row[field.index].strip() if field.index < len(row) else b"" for row in rows]
    if field.is_text:
        return np.array(cells, field.kind)
    return np.array([_number(cell) for cell in cells], np.float64)


def _number(cell: bytes) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan
