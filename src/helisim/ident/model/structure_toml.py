"""Reads and writes structures as TOML and plain data, checked entry by entry."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import toml_key, toml_value

REQUIRED = ("name", "parameters", "states", "inputs", "outputs", "F", "G")
DELAYS = {"input_delays": "input", "output_delays": "output", "delays": "response"}
"""Each table of delays, and what they belong to."""
OPTIONAL = ("M", "H0", "H1", "D", "D1", *DELAYS, "constants", "meaning", "series")
MATRICES = ("M", "F", "G", "H0", "H1", "D", "D1")
PARAMETER_KEYS = ("unit", "start", "bounds", "meaning", "scale", "fixed", "error")


def axes(
    states: Sequence[str], inputs: Sequence[str], outputs: Sequence[str]
) -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
    """Return the names of every matrix's rows and columns."""
    x, u, y = tuple(states), tuple(inputs), tuple(outputs)
    by_state = {"M": (x, x), "F": (x, x), "G": (x, u), "H0": (y, x), "H1": (y, x)}
    return {**by_state, "D": (y, u), "D1": (y, u)}


def delay_places(
    inputs: Sequence[str], outputs: Sequence[str]
) -> dict[str, dict[str, tuple[int, int]]]:
    """Return for each table of delays which names it may have, with their row and column."""
    return {
        "input_delays": {name: (0, k) for k, name in enumerate(inputs)},
        "output_delays": {name: (k, 0) for k, name in enumerate(outputs)},
        "delays": {
            f"{output}/{input_}": (row, column)
            for row, output in enumerate(outputs)
            for column, input_ in enumerate(inputs)
        },
    }


def read_fields(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return a structure's fields, checked; its parameters as keyword arguments each.

    Raises:
        InputError: something is missing, unknown, misshapen or of the wrong type.
    """
    if not isinstance(data, Mapping):
        raise InputError(f"a structure is a table, received {_type(data)}")
    for key in data:
        if key not in REQUIRED + OPTIONAL:
            raise UnknownNameError("key of a structure", key, REQUIRED + OPTIONAL)
    missing = [key for key in REQUIRED if key not in data]
    if missing:
        raise InputError(
            f"the structure lacks {', '.join(missing)}; it needs {', '.join(REQUIRED)} and may "
            f"have {', '.join(OPTIONAL)}"
        )
    fields: dict[str, Any] = {"name": _text(data["name"], "name")}
    fields["meaning"] = _text(data.get("meaning", ""), "meaning")
    fields["parameters"] = tuple(
        _parameter(name, table) for name, table in _table(data["parameters"], "parameters").items()
    )
    for key in ("states", "inputs", "outputs"):
        fields[key] = _names(data[key], key)
    for matrix, (rows, columns) in axes(
        fields["states"], fields["inputs"], fields["outputs"]
    ).items():
        if matrix in data:
            fields[matrix] = _dense(data[matrix], rows, columns, matrix)
    for key, places in delay_places(fields["inputs"], fields["outputs"]).items():
        delays = _table(data.get(key, {}), key)
        for name in delays:
            if name not in places:
                raise UnknownNameError(f"{DELAYS[key]} with a delay", name, places)
        fields[key] = {name: _cell(cell, f"{key}.{name}") for name, cell in delays.items()}
    fields["constants"] = {
        name: _number(number, f"constant {name!r}")
        for name, number in _table(data.get("constants", {}), "constants").items()
    }
    fields["series"] = {
        signals: _text(block, f"series.{signals}")
        for signals, block in _table(data.get("series", {}), "series").items()
    }
    return fields


def as_entries(
    rows: Sequence[Sequence[object]], shape: tuple[int, int], what: str
) -> tuple[tuple[str, ...], ...]:
    """Return a matrix's cells as expressions. Raises InputError: it hasn't the shape."""
    entries = tuple(tuple(str(cell) for cell in row) for row in rows)
    if len(entries) != shape[0] or any(len(row) != shape[1] for row in entries):
        received = f"{len(entries)} rows of {sorted({len(row) for row in entries})}"
        raise InputError(f"{what} has {received} entries, expected {shape[0]} of {shape[1]}")
    return entries


def to_toml(data: Mapping[str, Any]) -> str:
    """Return a structure's plain data as TOML with sparse matrices by name."""
    lines = [f"name = {toml_value(data['name'])}"]
    if data["meaning"]:
        lines.append(f"meaning = {toml_value(data['meaning'])}")
    lines += [f"{key} = {toml_value(data[key])}" for key in ("states", "inputs", "outputs")]
    for name, table in data["parameters"].items():
        lines += ["", f"[parameters.{toml_key(name)}]"]
        lines += [
            f"{key} = {_limits(item) if key == 'bounds' else toml_value(item)}"
            for key, item in table.items()
        ]
    for key in ("constants", *DELAYS):
        if data.get(key):
            lines += ["", f"[{key}]"]
            lines += [f"{toml_key(name)} = {toml_value(item)}" for name, item in data[key].items()]
    for matrix, (rows, columns) in axes(data["states"], data["inputs"], data["outputs"]).items():
        written = _sparse(matrix, data.get(matrix, ()), rows, columns)
        if written or matrix in ("F", "G", "H0"):
            lines += ["", f"[{matrix}]", *written]
    return "\n".join(lines) + "\n"


def _sparse(
    matrix: str, cells: Sequence[Sequence[str]], rows: tuple[str, ...], columns: tuple[str, ...]
) -> list[str]:
    lines = []
    for row, texts in zip(rows, cells):
        kept = {
            column: text
            for column, text in zip(columns, texts)
            if text != str(int(matrix == "M" and row == column))
        }
        if kept:
            inside = ", ".join(
                f"{toml_key(name)} = {toml_value(text)}" for name, text in kept.items()
            )
            lines.append(f"{toml_key(row)} = {{ {inside} }}")
    return lines


def _limits(bounds: Sequence[float | None]) -> str:
    """Return bounds with a sign for each open end, which plain data have as None."""
    low, high = bounds
    return f"[{'-inf' if low is None else repr(low)}, {'inf' if high is None else repr(high)}]"


def _parameter(name: str, table: object) -> dict[str, Any]:
    what = f"parameter {name!r}"
    fields = dict(_table(table, what))
    for key in fields:
        if key not in PARAMETER_KEYS:
            raise UnknownNameError(f"key of {what}", key, PARAMETER_KEYS)
    for key in ("unit", "start"):
        if key not in fields:
            raise InputError(f'{what} lacks its {key}; write, say, unit = "1/s", start = -1.0')
    fields["unit"] = _text(fields["unit"], f"{what}: unit")
    fields["start"] = _number(fields["start"], f"{what}: start")
    fields["meaning"] = _text(fields.get("meaning", ""), f"{what}: meaning")
    if not isinstance(fields.get("fixed", False), bool):
        raise InputError(f"{what}: fixed is {fields['fixed']!r}, expected true or false")
    if fields.get("scale") is not None:
        fields["scale"] = _number(fields["scale"], f"{what}: scale")
    if "error" in fields:
        fields["error"] = _number(fields["error"], f"{what}: error")
    if fields.get("bounds") is not None:
        fields["bounds"] = _bounds(fields["bounds"], what)
    return {"name": name, **fields}


def _bounds(pair: object, what: str) -> tuple[float, float]:
    if not isinstance(pair, list | tuple) or len(pair) != 2:
        raise InputError(f"{what}: bounds are {pair!r}, expected [lowest, highest]")
    low, high = (
        fallback if edge is None else _number(edge, f"{what}: bound", finite=False)
        for edge, fallback in zip(pair, (-math.inf, math.inf))
    )
    return low, high


def _dense(
    matrix: object, rows: tuple[str, ...], columns: tuple[str, ...], what: str
) -> tuple[tuple[str, ...], ...]:
    if isinstance(matrix, list | tuple):
        return tuple(
            tuple(
                _cell(cell, f"{what}, row {i + 1}, column {j + 1}")
                for j, cell in enumerate(_sequence(row, f"{what}, row {i + 1}"))
            )
            for i, row in enumerate(matrix)
        )
    table = _table(matrix, what)
    for row, cells in table.items():
        if row not in rows:
            raise UnknownNameError(f"row of {what}", row, rows)
        for column in _table(cells, f"{what}.{row}"):
            if column not in columns:
                raise UnknownNameError(f"column of {what}.{row}", column, columns)
    return tuple(
        tuple(
            _cell(
                table.get(row, {}).get(column, int(what == "M" and row == column)),
                f"{what}.{row}.{column}",
            )
            for column in columns
        )
        for row in rows
    )


def _cell(cell: object, what: str) -> str:
    if isinstance(cell, bool) or not isinstance(cell, str | int | float):
        raise InputError(f"{what} is {cell!r}, expected a number or an expression in quotes")
    return str(cell)


def _names(names: object, what: str) -> tuple[str, ...]:
    listed = _sequence(names, what)
    for name in listed:
        if not isinstance(name, str) or not name:
            raise InputError(f"{what} holds {name!r}, expected names in quotes")
    return tuple(listed)


def _sequence(items: object, what: str) -> list[Any]:
    if not isinstance(items, list | tuple):
        raise InputError(f"{what} is {_type(items)}, expected a list")
    return list(items)


def _table(table: object, what: str) -> Mapping[str, Any]:
    if not isinstance(table, Mapping):
        raise InputError(f"{what} is {_type(table)}, expected a table")
    return table


def _text(text: object, what: str) -> str:
    if not isinstance(text, str):
        raise InputError(f"{what} is {text!r}, expected text in quotes")
    return text


def _number(number: object, what: str, *, finite: bool = True) -> float:
    if isinstance(number, bool) or not isinstance(number, int | float) or math.isnan(number):
        raise InputError(f"{what} is {number!r}, expected a number")
    if finite and not math.isfinite(number):
        raise InputError(f"{what} is {number!r}, expected a finite number")
    return float(number)


def _type(item: object) -> str:
    return f"{item!r}" if isinstance(item, str | int | float | bool) else type(item).__name__
