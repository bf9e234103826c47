"""Frequency responses as columns of text, by anyone: read by their headings, and written."""

import csv
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.files import atomic_write, parse_object, read_text
from helisim.base.settings import placed
from helisim.base.units import DB_PER_NEPER, RAD_PER_DEG

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

_TOLD = ("frequency", "magnitude", "phase")  # quantities whose units are told, as they were found
_FILLING = {"random", "partial", "response", "std", "of", "the"}

_PAIR = re.compile(r"([^\s/\[\]()=,;]+/[^\s/\[\]()=,;]+)\s+(.+)")

_HINT = (
    "say what the columns hold, in their order, such as "
    "columns='frequency:Hz,magnitude:dB,phase:deg,coherence,-'"
)

_COMMENTS = ("#", "%", "!", "//")

_PROVENANCE = "# provenance: "

_SEEN = 1 << 16  # bytes of a file that are read to see whether it holds a response
_MOST_LINES = 1_000_000  # of a file: no response has as many frequencies
_ROUNDING = 1e-3  # by which a coherence that is written with few digits may exceed 1


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


class _Column(NamedTuple):
    """What a column holds: a quantity, "" for none, of a pair, "" where none is named."""

    pair: str = ""
    quantity: str = ""
    unit: str = ""


def looks_like_response(path: str | PathLike[str]) -> bool:
    """Return whether a text's headings are a frequency response's, and not a log's."""
    try:
        with Path(path).open("rb") as file:
            text = file.read(_SEEN).decode("utf-8-sig", "replace")
    except (OSError, ValueError):
        return False
    quantities = {_parts(heading)[1] for heading in _split(text)[0]}
    return "frequency" in quantities and any(
        both <= quantities for both in ({"magnitude", "phase"}, {"real", "imaginary"})
    )


def read_columns(path: str | PathLike[str], columns: str | None = None) -> Text:
    """Read columns that are separated by commas, semicolons, tabs or blanks.

    Lines that begin with #, %, ! or // are comments; the last one before the numbers may hold the
    headings.

    Args:
        path: of the file.
        columns: what they hold, such as "frequency:Hz,p/lat magnitude:dB,phase:deg,-"; by default
            that of their headings.

    Raises:
        StorageError: the file can't be read.
        InputError: a column, a unit or a number is missing; the message names the file.
    """
    text = read_text(path)
    with placed(path):
        headings, lines = _split(text)
        if columns is not None:
            found = list(map(_ordered, columns.split(",")))
        elif headings:
            found = list(map(_headed, headings))
        else:
            raise InputError(f"the columns have no headings; {_HINT}", remedy="columns")
        frequency, curves = _curves(found, _numbers(lines, len(found)))
    said = [f"{one.quantity} in {one.unit}" for one in found if one.quantity in _TOLD]
    first, provenance = text.split("\n", 1)[0], {}
    if first.startswith(_PROVENANCE):
        provenance = parse_object(first.removeprefix(_PROVENANCE), f"{path}: the provenance")
    return Text(frequency, curves, ", ".join(dict.fromkeys(said)), provenance)


def write_columns(
    columns: Mapping[str, NDArray[np.float64]],
    provenance: Mapping[str, Any],
    path: str | PathLike[str],
) -> None:
    """Write a comment with the provenance, the headings, and a line a frequency.

    Args:
        columns: by heading, (n_freq,) each.
        provenance: plain data.
        path: of the file.

    Raises:
        StorageError: it can't be written.
    """
    with (
        atomic_write(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        file.write(f"{_PROVENANCE}{json.dumps(provenance, sort_keys=True)}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(np.column_stack(list(columns.values())).tolist())


def paired(names: Iterable[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the outputs and the inputs of responses such as "p/lat", in their order.

    Raises:
        InputError: a name isn't OUTPUT/INPUT.
    """
    halves = []
    for name in names:
        output, slash, input_ = name.partition("/")
        if not (output and slash and input_) or "/" in input_:
            raise InputError(f"a response is named OUTPUT/INPUT, such as p/lat, not {name!r}")
        halves.append((output, input_))
    outputs, inputs = (tuple(dict.fromkeys(one)) for one in zip(*halves))
    return outputs, inputs


def _headed(heading: str) -> _Column:
    """Return what a column holds by its heading. Raises InputError where its unit is missing."""
    pair, quantity, rest = _parts(heading)
    if not quantity:
        return _Column()
    for unit, words in _UNITS[quantity].items():
        if rest in words or set(rest.split()) & {word for word in words if " " not in word}:
            return _Column(pair, quantity, unit)
    raise InputError(
        f"the heading {heading.strip()!r} has no unit that a {quantity} can have "
        f"({', '.join(_UNITS[quantity])}), and units aren't guessed from numbers; {_HINT}",
        remedy="columns",
    )


def _ordered(item: str) -> _Column:
    """Return what a column holds by "p/lat magnitude:dB". Raises InputError."""
    name, _, unit = item.strip().partition(":")
    if name in ("-", ""):
        return _Column()
    if not _parts(name)[1]:
        raise InputError(f"a column can't hold {name!r}; available: {', '.join(_WORDS)}, -")
    return _headed(f"{name} [{unit}]")


def _parts(heading: str) -> tuple[str, str, str]:
    """Return the pair, the quantity, and the rest of a heading, in lower case."""
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
        rest = bracket[1].strip().lower()
    else:
        rest = " ".join(one for one in words if one != word or one in ("db", "hz", "deg", "rad/s"))
    return pair[1] if pair else "", quantity, rest


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


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _numbers(lines: Sequence[tuple[int, list[str]]], width: int) -> NDArray[np.float64]:
    """Return the numbers, (n_freq, n_column). Raises InputError, with the line."""
    if not 2 <= len(lines) <= _MOST_LINES:
        raise InputError(f"holds {len(lines)} lines of numbers, expected 2 to {_MOST_LINES}")
    for number, cells in lines:
        if len(cells) != width:
            raise InputError(
                f"line {number} has {len(cells)} cells, expected {width}, one a column; {_HINT}",
                remedy="columns",
            )
        for cell in cells:
            if not _is_number(cell):
                raise InputError(f"line {number}: {cell!r} isn't a number")
    return np.array([[float(cell) for cell in cells] for _, cells in lines])


def _curves(
    columns: Sequence[_Column], numbers: NDArray[np.float64]
) -> tuple[NDArray[np.float64], dict[str, Curve]]:
    """Return the frequencies, rad/s, and the responses. Raises InputError."""
    at = [k for k, one in enumerate(columns) if one.quantity == "frequency"]
    if len(at) != 1:
        raise InputError(
            f"{len(at)} columns hold a frequency, expected one; {_HINT}", remedy="columns"
        )
    frequency = numbers[:, at[0]] * (2.0 * math.pi if columns[at[0]].unit == "Hz" else 1.0)
    order = np.argsort(frequency, kind="stable")
    order = order[frequency[order] != 0.0]  # spectra begin at 0, where there is no phase
    frequency, numbers = frequency[order], numbers[order]
    if frequency.size < 2 or frequency[0] < 0.0 or np.any(np.diff(frequency) <= 0.0):
        raise InputError("frequencies repeat, are negative or missing; expected one line each")
    if not np.all(np.isfinite(numbers[:, [k for k, one in enumerate(columns) if one.quantity]])):
        raise InputError("a number isn't finite; leave its line out")
    held: dict[str, dict[str, tuple[NDArray[np.float64], str]]] = {}
    for k, one in enumerate(columns):
        if one.quantity not in ("", "frequency"):
            held.setdefault(one.pair, {})[one.quantity] = numbers[:, k], one.unit
    if not held:
        raise InputError(f"no column holds a magnitude or a real part; {_HINT}", remedy="columns")
    return frequency, {pair: _curve(pair or "the response", one) for pair, one in held.items()}


def _curve(pair: str, held: Mapping[str, tuple[NDArray[np.float64], str]]) -> Curve:
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
            f"{pair} has {', '.join(held)}, expected magnitude and phase, or real and imaginary "
            f"part; {_HINT}",
            remedy="columns",
        )
    if not np.all(np.isfinite(response)) or np.any(response == 0.0):
        raise InputError(f"{pair} is zero or isn't finite at a frequency")
    coherence, error = (held.get(name, (None, ""))[0] for name in ("coherence", "error"))
    if coherence is not None:
        if np.any(np.abs(coherence - 0.5) > 0.5 + _ROUNDING):
            raise InputError(f"the coherence of {pair} isn't from 0 to 1")
        coherence = np.clip(coherence, 0.0, 1.0)
    if error is not None:
        if np.any(error < 0.0):
            raise InputError(f"the error of {pair} is negative")
        error = error * (0.01 if held["error"][1] == "percent" else 1.0)
    return Curve(response, coherence, error)
