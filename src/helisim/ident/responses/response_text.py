"""Reads frequency responses that anyone wrote as columns of text, and writes them so."""

import csv
import json
import math
import re
from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.files import atomic_write, parse_object, read_text
from helisim.base.units import DB_PER_NEPER, RAD_PER_DEG, decibel
from helisim.ident.responses.response_columns import HINT, Column, by_heading, by_order, quantity_of

if TYPE_CHECKING:
    from helisim.ident.responses.response import FrequencyResponse

_COMMENTS = ("#", "%", "!", "//")

_PROVENANCE = "# provenance: "

_SEEN = 1 << 16
"""Bytes of a file that are read to see whether it holds a response."""

_MOST_LINES = 1_000_000
"""Of a file: no response has as many frequencies."""


_ROUNDING = 1e-3
"""By which a coherence that is written with few digits may exceed 1."""


class Curve(NamedTuple):
    """One response as a file has it, (n_freq,) each, None where it isn't in the file."""

    response: NDArray[np.complex128]
    coherence: NDArray[np.float64] | None
    error: NDArray[np.float64] | None


class Text(NamedTuple):
    """What a file of text holds.

    Attributes:
        frequency: (n_freq,) rad/s, increasing.
        curves: by response; "" where the headings name none.
        units: of the columns, in words.
        provenance: what helisim wrote above them; empty in other programs' files.
    """

    frequency: NDArray[np.float64]
    curves: dict[str, Curve]
    units: str
    provenance: dict[str, Any]


def looks_like_response(path: str | PathLike[str]) -> bool:
    """Return whether a text's headings are a frequency response's, and not a log's."""
    try:
        with Path(path).open("rb") as file:
            text = file.read(_SEEN).decode("utf-8-sig", "replace")
    except (OSError, ValueError):
        return False
    quantities = {quantity_of(heading) for heading in _split(text)[0]}
    return "frequency" in quantities and any(
        both <= quantities for both in ({"magnitude", "phase"}, {"real", "imaginary"})
    )


def read_columns(path: str | PathLike[str], columns: str | None = None) -> Text:
    """Read columns that are separated by commas, semicolons, tabs or blanks.

    Lines that begin with #, %, ! or // are comments; the last one before the numbers may hold the
    headings.

    Args:
        path: of the file.
        columns: what they hold; by default that of their headings.

    Raises:
        StorageError: the file can't be read.
        InputError: a column, a unit or a number is missing; the message names the file.
    """
    text = read_text(path)
    try:
        headings, lines = _split(text)
        if columns is None and not headings:
            raise InputError(f"the columns have no headings; {HINT}")
        found = list(map(by_heading, headings)) if columns is None else by_order(columns)
        numbers = _numbers(lines, len(found))
        frequency, curves = _curves(found, numbers)
    except InputError as error:
        error.args = (f"{path}: {error}",)
        raise
    units = ", ".join(
        f"{one.quantity} in {one.unit}"
        for one in dict.fromkeys(Column("", *one[1:]) for one in found)
        if one.quantity in ("frequency", "magnitude", "phase")
    )
    return Text(frequency, curves, units, _provenance(path, text))


def write_columns(
    frf: "FrequencyResponse", provenance: dict[str, Any], path: str | PathLike[str]
) -> None:
    """Write a comment with the provenance, the headings, and a line a frequency.

    Raises StorageError.
    """
    heads = ["frequency [rad/s]"]
    columns = [frf.frequency]
    for name in frf.pairs:
        o, i = frf.index(*name.split("/", 1))
        response = frf.response[o, i]
        heads += [f"{name} magnitude [dB]", f"{name} phase [deg]"]
        heads += [f"{name} coherence [1]", f"{name} random error [1]"]
        columns += [
            decibel(np.abs(response)),
            np.degrees(np.unwrap(np.angle(response))),
            frf.coherence[o, i],
            frf.random_error[o, i],
        ]
    with (
        atomic_write(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        file.write(f"{_PROVENANCE}{json.dumps(provenance, sort_keys=True)}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heads)
        writer.writerows(np.column_stack(columns).tolist())


def _split(text: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the headings, if there are any, and the cells of every line with its number."""
    comment, lines = "", []
    for number, line in enumerate(text.split("\n"), start=1):
        line = line.strip()
        mark = next((one for one in _COMMENTS if line.startswith(one)), "")
        if mark and not lines:
            comment = line[len(mark) :].strip()
        elif line and not mark:
            lines.append((number, line))
    if not lines:
        return [], []
    sample = lines[min(1, len(lines) - 1)][1]
    delimiter = next((one for one in (";", ",", "\t") if one in sample), None)
    cells = [(number, _cells(line, delimiter)) for number, line in lines]
    if not all(map(_is_number, cells[0][1])):
        return cells[0][1], cells[1:]
    headings = _cells(comment, delimiter)
    return (headings if len(headings) == len(cells[0][1]) else []), cells


def _cells(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return re.sub(r"\s+(?=[\[(])", "", line).split()
    return [cell.strip().strip("\"'") for cell in line.split(delimiter)]


def _numbers(lines: Sequence[tuple[int, list[str]]], width: int) -> NDArray[np.float64]:
    """Return the numbers, (n_freq, n_column). Raises InputError, with the line."""
    if not 2 <= len(lines) <= _MOST_LINES:
        raise InputError(f"holds {len(lines)} lines of numbers, expected 2 to {_MOST_LINES}")
    rows = []
    for number, cells in lines:
        if len(cells) != width:
            raise InputError(
                f"line {number} has {len(cells)} cells, expected {width}, one a column; {HINT}"
            )
        if not all(map(_is_number, cells)):
            bad = next(cell for cell in cells if not _is_number(cell))
            raise InputError(f"line {number}: {bad!r} isn't a number")
        rows.append([float(cell) for cell in cells])
    return np.array(rows)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _curves(
    columns: Sequence[Column], numbers: NDArray[np.float64]
) -> tuple[NDArray[np.float64], dict[str, Curve]]:
    """Return the frequencies, rad/s, and the responses. Raises InputError."""
    at = [k for k, one in enumerate(columns) if one.quantity == "frequency"]
    if len(at) != 1:
        raise InputError(f"{len(at)} columns hold a frequency, expected one; {HINT}")
    frequency = numbers[:, at[0]] * (2.0 * math.pi if columns[at[0]].unit == "Hz" else 1.0)
    order = np.argsort(frequency, kind="stable")
    order = order[frequency[order] != 0.0]  # spectra begin at 0, where there is no phase
    frequency, numbers = frequency[order], numbers[order]
    if frequency.size < 2 or frequency[0] < 0.0 or np.any(np.diff(frequency) <= 0.0):
        raise InputError("frequencies repeat, are negative or missing; expected one line each")
    if not np.all(np.isfinite(numbers[:, [k for k, one in enumerate(columns) if one.quantity]])):
        raise InputError("a number isn't finite; leave its line out")
    curves = {}
    for pair in dict.fromkeys(one.pair for one in columns if one.quantity not in ("", "frequency")):
        held = {
            one.quantity: (numbers[:, k], one.unit)
            for k, one in enumerate(columns)
            if one.pair == pair and one.quantity
        }
        curves[pair] = _curve(pair, held)
    if not curves:
        raise InputError(f"no column holds a magnitude or a real part; {HINT}")
    return frequency, curves


def _curve(pair: str, held: dict[str, tuple[NDArray[np.float64], str]]) -> Curve:
    """Return a response from its columns with their units. Raises InputError."""
    if {"magnitude", "phase"} <= set(held):
        (size, unit), (angle, angle_unit) = held["magnitude"], held["phase"]
        with np.errstate(over="ignore"):
            size = np.exp(size / DB_PER_NEPER) if unit == "dB" else size
        turn = 1j * angle * (RAD_PER_DEG if angle_unit == "deg" else 1.0)
        response = np.asarray(size * np.exp(turn), dtype=np.complex128)
    elif {"real", "imaginary"} <= set(held):
        response = np.asarray(held["real"][0] + 1j * held["imaginary"][0], dtype=np.complex128)
    else:
        raise InputError(
            f"{pair or 'the response'} has {', '.join(held) or 'no columns'}, expected magnitude "
            f"and phase, or real and imaginary part; {HINT}"
        )
    if not np.all(np.isfinite(response)) or np.any(response == 0.0):
        raise InputError(f"{pair or 'the response'} is zero or isn't finite at a frequency")
    coherence, error = (held.get(name) for name in ("coherence", "error"))
    if coherence is not None and np.any(np.abs(coherence[0] - 0.5) > 0.5 + _ROUNDING):
        raise InputError(f"the coherence of {pair or 'the response'} isn't from 0 to 1")
    if error is not None and np.any(error[0] < 0.0):
        raise InputError(f"the error of {pair or 'the response'} is negative")
    return Curve(
        response,
        None if coherence is None else np.clip(coherence[0], 0.0, 1.0),
        None if error is None else error[0] * (0.01 if error[1] == "percent" else 1.0),
    )


def _provenance(path: str | PathLike[str], text: str) -> dict[str, Any]:
    """Return what helisim wrote above the columns."""
    first = text.split("\n", 1)[0]
    if not first.startswith(_PROVENANCE):
        return {}
    return parse_object(first.removeprefix(_PROVENANCE), f"{path}: the provenance")


def paired(names: Iterable[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the outputs and the inputs of responses such as "p/lat", in their order.

    Raises InputError.
    """
    halves = []
    for name in names:
        output, slash, input_ = name.partition("/")
        if not (output and slash and input_) or "/" in input_:
            raise InputError(f"a response is named OUTPUT/INPUT, such as p/lat, not {name!r}")
        halves.append((output, input_))
    outputs, inputs = (tuple(dict.fromkeys(one)) for one in zip(*halves))
    return outputs, inputs
