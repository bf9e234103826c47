"""What proofs share: a command line of main's arguments, tables; truths, records, fits, prints."""

import argparse
import csv
import inspect
import re
import sys
import textwrap
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, get_args

import numpy as np

import helisim as hs
from helisim.base.errors import HelisimError
from helisim.base.files import read_toml
from helisim.records.record import Channel, FlightRecord, channel

# What a print says of a helicopter beside what the model does: which differences matter.
KNOT = 1852.0 / 3600.0  # m/s
CLOSE = 0.15  # Relative difference up to which a prediction counts as the print.
SMALL = 0.05  # Share of an axis's largest effect below which a difference is nobody's matter.
HALF_A_DEGREE = np.radians(0.5)  # Of an angle: what a protractor on a blade tells.
PUSH = {**dict.fromkeys("uvw", 1.0), **dict.fromkeys("pqr", 0.1)}
PUSH |= dict.fromkeys(("theta_0", "theta_1s", "theta_1c", "A_1", "B_1", "theta_0T"), 0.01)
"""m/s, rad/s and rad whose effects on an axis are compared with each other."""
_ANGLES = ("th", "ph", "a_", "b_", "B_", "al")


def run(main: Callable[..., Any]) -> NoReturn:
    """Call main with what the command line says, and exit with what it returns.

    Its arguments, of annotated types, are those of the command line. Those by keyword alone are
    options: a bool is a flag, a list takes several words.
    """
    about = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=main.__globals__["__doc__"], formatter_class=about)
    called = inspect.signature(main)
    for name, one in called.parameters.items():
        option, words = one.kind is one.KEYWORD_ONLY, get_args(one.annotation)
        how: dict[str, Any] = {} if one.default is one.empty else {"default": one.default}
        if one.annotation is bool:
            how |= {"action": "store_true"}
        elif words or one.kind is one.VAR_POSITIONAL:
            how |= {"type": words[0] if words else one.annotation, "nargs": "*"}
        else:
            how |= {"type": one.annotation, "nargs": None if option or not how else "?"}
        parser.add_argument(f"--{name.replace('_', '-')}" if option else name, **how)
    said = called.bind_partial()
    said.arguments |= vars(parser.parse_args())
    try:
        sys.exit(main(*said.args, **said.kwargs))
    except HelisimError as error:
        sys.exit(str(error))


def table(notation: str, rows: Iterable[Sequence[Any]]) -> None:
    """Print rows under headings: those of "name:<9|mean:8.2f" have the width of their cells.

    A text among numbers is as wide as they are, as is None, for nothing.
    """
    columns = [one.partition(":")[::2] for one in notation.split("|")]
    widths = [re.sub(r"^(?![<>])\+?", ">", re.match(r"[<>+]?\d*", form)[0]) for _, form in columns]
    print("".join(f"{name:{width}}" for (name, _), width in zip(columns, widths)).rstrip())
    for row in rows:
        cells = [
            f"{one or '':{width}}" if isinstance(one, str | None) else f"{one:{form}}"
            for one, (_, form), width in zip(row, columns, widths)
        ]
        print("".join(cells).rstrip(), flush=True)


def legend(words: Mapping[str, str]) -> None:
    """Print what the signs of a table mean."""
    for sign, text in words.items():
        print(textwrap.fill(f"{sign}  {text}", 88, subsequent_indent="   "))


def identified(
    records: Sequence[FlightRecord],
    structure: hs.Structure,
    band: tuple[float, float],
    reference: Sequence[str] | None = None,
) -> tuple[hs.FrequencyResponse, hs.Fit]:
    """Return the response of records, and the fit of a structure to it, with default options."""
    names = {"inputs": structure.inputs, "outputs": structure.outputs, "reference": reference}
    with quiet():
        frf = hs.frequency_response(records, band=band, **names)
        return frf, hs.identify(frf, structure)


def truths(path: Any, kind: type) -> dict[str, Any]:
    """Return the truths of a TOML file, each with its structure: a name's, or a table's own."""
    found = {}
    for name, table in read_toml(path).items():
        how = table.pop("structure", name)
        if isinstance(how, Mapping) and "zeros" in how:
            structure = hs.structures.transfer_function(**how)
        else:
            structure = (
                hs.structures.named(how) if isinstance(how, str) else hs.Structure.from_dict(how)
            )
        found[name] = kind(structure, **table)
    return found


def decoded(path: str | Path) -> dict[str, np.ndarray]:
    """Return the columns of blackbox_decode's table that are numbers, without their units."""
    with open(path, encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file, skipinitialspace=True)
    found = {}
    for name, column in zip(names, zip(*rows)):
        with suppress(ValueError):  # flags as words
            found[name.partition(" (")[0].strip()] = np.array(column, np.float64)
    return found


def channel_of(name: str) -> Channel:
    try:
        return channel(name)
    except HelisimError:
        return Channel(name, "1", "OTHER", name)


def law_of(truth: Any, states: Sequence[str]) -> np.ndarray:
    """Return a truth's feedback, (n_in, n_state), of what it says by input and state."""
    by_input = [truth.law.get(name, {}) for name in truth.structure.inputs]
    return np.array([[own.get(name, 0.0) for name in states] for own in by_input])


def swept(
    time: np.ndarray, length: float, low: float, high: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return phase and size, 0 to 1, of an exponential sweep with a rest of 3 s at both ends."""
    there = np.clip((time - 3.0) / (length - 6.0), 0.0, 1.0)
    rate = low + 0.0187 * (np.exp(4.0 * there) - 1.0) * (high - low)
    fade = np.clip(np.minimum(time - 3.0, length - 3.0 - time) / 2.0, 0.0, 1.0)
    return np.cumsum(rate, axis=0) * (time[1] - time[0]), fade


def record(time: np.ndarray, columns: Mapping[str, np.ndarray]) -> FlightRecord:
    values = np.column_stack(list(columns.values()))
    return FlightRecord(time, values, tuple(map(channel_of, columns)))


def wanted(only: str, name: str) -> bool:
    """Return whether a name has one of the parts that are asked for, commas between."""
    return any(one in name for one in only.split(","))


def counted(words: Sequence[str]) -> str:
    return ", ".join(f"{words.count(one)} {one}" for one in dict.fromkeys(words))


quiet = partial(warnings.catch_warnings, action="ignore")  # within it nothing warns


def small(name: str, printed: Mapping[str, float], push: Mapping[str, float]) -> float:
    """Return the difference of a printed figure that is nobody's matter."""
    axis, _, cause = name.partition("_")
    if cause not in push:
        return float(HALF_A_DEGREE) if name[:2] in _ANGLES else 0.0
    same = [row for row in printed if row[0] == axis and row[2:] in push]
    return SMALL * max(abs(printed[row]) * push[row[2:]] for row in same) / push[cause]


def within(found: float, printed: float, least: float) -> bool:
    return abs(found - printed) <= max(least, CLOSE * abs(printed))


def weighed(weights: Mapping[str, Any], figures: Mapping[str, float], k: int = 0) -> float:
    """Return a sum of figures, each with its weight, or the k-th of its weights; "one" is 1."""
    figures = {"one": 1.0, **figures}
    by = {name: one[k] if isinstance(one, list) else one for name, one in weights.items()}
    return sum(weight * figures[name] for name, weight in by.items())
