"""Model structures as data: named parameters and expressions for the matrix entries.

    M dx/dt = F x + G u(t - tau_in)
    y(t + tau_out) = H0 x + H1 dx/dt + D u(t - tau_in)

A delay belongs to an input or to an output, and may be negative: recorder channels can be
skewed against each other.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

from helisim.errors import InputError, UnknownNameError
from helisim.ident.expression import FUNCTIONS, Expression

Entries = tuple[tuple[str, ...], ...]
"""A matrix of expressions, by rows."""

_DEFAULT_SCALE = 1.0


@dataclass(frozen=True)
class Parameter:
    """One parameter of a structure.

    Attributes:
        name: an identifier, such as "N_r".
        unit: SI unit.
        start: where the search begins: an order of magnitude is enough.
        bounds: (lowest, highest) value, or None.
        meaning: what it is.
        scale: its order of magnitude; needed where the start is 0, otherwise |start|.
        fixed: keep it at `start`.
    """

    name: str
    unit: str
    start: float
    bounds: tuple[float, float] | None = None
    meaning: str = ""
    scale: float | None = None
    fixed: bool = False

    def __post_init__(self) -> None:
        if not self.name.isidentifier() or self.name in FUNCTIONS:
            raise InputError(f"parameter name {self.name!r} isn't an identifier, such as 'N_r'")
        if not math.isfinite(self.start):
            raise InputError(f"parameter {self.name!r} starts at {self.start}, expected a number")
        low, high = self.limits
        if not low < high or not low <= self.start <= high:
            raise InputError(
                f"parameter {self.name!r} has bounds {low} to {high} and starts at "
                f"{self.start}; expected lower < upper with the start between them"
            )
        if self.scale is not None and not (math.isfinite(self.scale) and self.scale > 0.0):
            raise InputError(f"parameter {self.name!r} has scale {self.scale}, expected > 0")

    @property
    def limits(self) -> tuple[float, float]:
        """The bounds, infinite where there are none."""
        return (-math.inf, math.inf) if self.bounds is None else self.bounds

    @property
    def magnitude(self) -> float:
        """The order of magnitude."""
        return self.scale or abs(self.start) or _DEFAULT_SCALE


class Entry(NamedTuple):
    """One matrix entry that depends on parameters."""

    matrix: str
    row: int
    column: int
    expression: Expression


@dataclass(frozen=True, eq=False)
class Structure:
    """A parametrised linear model with delays; see the module for its equations.

    Matrices are rows of expressions in the parameters' and constants' names. Left out, M is
    the identity, H0 picks the states that have the outputs' names, H1 and D are zero, and
    there are no delays.
    """

    name: str
    parameters: tuple[Parameter, ...]
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    F: Entries = ()
    G: Entries = ()
    M: Entries = ()
    H0: Entries = ()
    H1: Entries = ()
    D: Entries = ()
    input_delays: Mapping[str, str] = field(default_factory=dict)
    output_delays: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)
    meaning: str = ""

    def __post_init__(self) -> None:
        for attribute in ("parameters", "states", "inputs", "outputs"):
            object.__setattr__(self, attribute, tuple(getattr(self, attribute)))
        for attribute in ("input_delays", "output_delays", "constants"):
            object.__setattr__(self, attribute, MappingProxyType(dict(getattr(self, attribute))))
        n, n_in, n_out = len(self.states), len(self.inputs), len(self.outputs)
        shapes = {
            "F": (n, n),
            "G": (n, n_in),
            "M": (n, n),
            "H0": (n_out, n),
            "H1": (n_out, n),
            "D": (n_out, n_in),
        }
        for matrix, shape in shapes.items():
            rows = getattr(self, matrix) or self._default(matrix, shape)
            object.__setattr__(self, matrix, _entries(rows, shape, f"{self.name}: {matrix}"))
        self._check_names()
        _ = self.entries

    def __repr__(self) -> str:
        return (
            f"Structure({self.name}: {', '.join(self.outputs)} over {', '.join(self.inputs)}; "
            f"{len(self.states)} states; parameters {', '.join(self.names)})"
        )

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def free(self) -> tuple[Parameter, ...]:
        """The parameters that a fit varies."""
        return tuple(parameter for parameter in self.parameters if not parameter.fixed)

    @property
    def starts(self) -> dict[str, float]:
        """Every parameter's start by name."""
        return {parameter.name: parameter.start for parameter in self.parameters}

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """Every matrix entry and delay that isn't the number zero."""
        found = []
        for matrix in ("M", "F", "G", "H0", "H1", "D"):
            for row, cells in enumerate(getattr(self, matrix)):
                for column, cell in enumerate(cells):
                    found.append(Entry(matrix, row, column, self._expression(cell)))
        for matrix, delays, signals in (
            ("input_delays", self.input_delays, self.inputs),
            ("output_delays", self.output_delays, self.outputs),
        ):
            for name, cell in delays.items():
                found.append(Entry(matrix, 0, signals.index(name), self._expression(cell)))
        return tuple(entry for entry in found if entry.expression.text not in ("0", "0.0"))

    def parameter(self, name: str) -> Parameter:
        """Return a parameter. Raises UnknownNameError."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise UnknownNameError(f"parameter of {self.name!r}", name, self.names)

    def with_fixed(self, values: Mapping[str, float]) -> "Structure":
        """Return a copy where the named parameters keep the given values."""
        return self._with({name: {"start": x, "fixed": True} for name, x in values.items()})

    def with_starts(self, values: Mapping[str, float]) -> "Structure":
        """Return a copy where the named parameters start at the given values."""
        return self._with({name: {"start": x} for name, x in values.items()})

    def with_bounds(self, bounds: Mapping[str, tuple[float, float] | None]) -> "Structure":
        """Return a copy where the named parameters have the given bounds."""
        return self._with({name: {"bounds": x} for name, x in bounds.items()})

    def renamed(self, signals: Mapping[str, str], *, name: str | None = None) -> "Structure":
        """Return a copy for other channels, such as {"lat": "LAT", "lon": "LON"}."""
        for signal in signals:
            if signal not in (*self.inputs, *self.outputs):
                raise UnknownNameError(
                    f"signal of {self.name!r}", signal, (*self.inputs, *self.outputs)
                )
        return replace(
            self,
            name=name or self.name,
            inputs=tuple(signals.get(x, x) for x in self.inputs),
            outputs=tuple(signals.get(x, x) for x in self.outputs),
            input_delays={signals.get(x, x): tau for x, tau in self.input_delays.items()},
            output_delays={signals.get(x, x): tau for x, tau in self.output_delays.items()},
        )

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Structure":
        """Read a structure from plain data, as a TOML file holds it.

        Parameters are a table by name. A matrix is a list of rows, or a table of rows by state
        or output name, each a table by state or input name, where what is left out is zero
        (in M: one on the diagonal).

        Raises:
            InputError: something is missing, unknown or misshapen.
        """
        required = ("name", "parameters", "states", "inputs", "outputs", "F", "G")
        optional = ("M", "H0", "H1", "D", "input_delays", "output_delays", "constants", "meaning")
        for key in data:
            if key not in required + optional:
                raise UnknownNameError("key of a structure", key, required + optional)
        missing = [key for key in required if key not in data]
        if missing:
            raise InputError(f"the structure lacks {', '.join(missing)}")
        fields = dict(data)
        fields["parameters"] = tuple(
            _parameter(name, table) for name, table in data["parameters"].items()
        )
        states, inputs, outputs = data["states"], data["inputs"], data["outputs"]
        axes = {
            "M": (states, states),
            "F": (states, states),
            "G": (states, inputs),
            "H0": (outputs, states),
            "H1": (outputs, states),
            "D": (outputs, inputs),
        }
        for matrix, (rows, columns) in axes.items():
            if matrix in data:
                fields[matrix] = _dense(data[matrix], rows, columns, matrix)
        return cls(**fields)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data that `from_dict` reads back."""
        table = {}
        for parameter in self.parameters:
            row: dict[str, Any] = {"unit": parameter.unit, "start": parameter.start}
            if parameter.bounds is not None:
                row["bounds"] = list(parameter.bounds)
            if parameter.meaning:
                row["meaning"] = parameter.meaning
            if parameter.scale is not None:
                row["scale"] = parameter.scale
            if parameter.fixed:
                row["fixed"] = True
            table[parameter.name] = row
        return {
            "name": self.name,
            "meaning": self.meaning,
            "parameters": table,
            "states": list(self.states),
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            **{key: [list(row) for row in getattr(self, key)] for key in _MATRICES},
            "input_delays": dict(self.input_delays),
            "output_delays": dict(self.output_delays),
            "constants": dict(self.constants),
        }

    def _with(self, changes: Mapping[str, Mapping[str, Any]]) -> "Structure":
        for name in changes:
            self.parameter(name)
        return replace(
            self,
            parameters=tuple(
                replace(parameter, **changes.get(parameter.name, {}))
                for parameter in self.parameters
            ),
        )

    def _default(self, matrix: str, shape: tuple[int, int]) -> Entries:
        if matrix == "M":
            return tuple(tuple(str(int(i == j)) for j in range(shape[1])) for i in range(shape[0]))
        if matrix == "H0":
            for output in self.outputs:
                if output not in self.states:
                    raise InputError(
                        f"{self.name}: output {output!r} isn't a state, so H0 must be given"
                    )
            return tuple(
                tuple(str(int(state == output)) for state in self.states) for output in self.outputs
            )
        if matrix in ("F", "G") and self.states:
            raise InputError(f"{self.name}: {matrix} is missing")
        return tuple(("0",) * shape[1] for _ in range(shape[0]))

    def _expression(self, text: str) -> Expression:
        expression = Expression(text)
        known = (*self.names, *self.constants)
        for name in sorted(expression.names):
            if name not in known:
                raise UnknownNameError(f"name in {text!r} of {self.name!r}", name, known)
        return expression

    def _check_names(self) -> None:
        for what, names in (
            ("parameter", (*self.names, *self.constants)),
            ("state", self.states),
            ("signal", (*self.inputs, *self.outputs)),
        ):
            repeated = sorted({name for name in names if names.count(name) > 1})
            if repeated:
                raise InputError(f"{self.name}: {what} names repeat: {', '.join(repeated)}")
        if not self.inputs or not self.outputs:
            raise InputError(f"{self.name}: expected at least one input and one output")
        for delays, signals, what in (
            (self.input_delays, self.inputs, "input"),
            (self.output_delays, self.outputs, "output"),
        ):
            for name in delays:
                if name not in signals:
                    raise UnknownNameError(f"{what} with a delay", name, signals)


_MATRICES = ("M", "F", "G", "H0", "H1", "D")


def _entries(rows: Sequence[Sequence[object]], shape: tuple[int, int], what: str) -> Entries:
    entries = tuple(tuple(str(cell) for cell in row) for row in rows)
    if len(entries) != shape[0] or any(len(row) != shape[1] for row in entries):
        received = f"{len(entries)} rows of {sorted({len(row) for row in entries})}"
        raise InputError(f"{what} has {received} entries, expected {shape[0]} of {shape[1]}")
    return entries


def _parameter(name: str, table: Mapping[str, Any]) -> Parameter:
    known = ("unit", "start", "bounds", "meaning", "scale", "fixed")
    for key in table:
        if key not in known:
            raise UnknownNameError(f"key of parameter {name!r}", key, known)
    if "unit" not in table or "start" not in table:
        raise InputError(f"parameter {name!r} needs a unit and a start")
    fields = dict(table)
    if fields.get("bounds") is not None:
        low, high = fields["bounds"]
        fields["bounds"] = (float(low), float(high))
    return Parameter(name, **fields)


def _dense(
    matrix: Mapping[str, Mapping[str, Any]] | Sequence[Sequence[Any]],
    rows: Sequence[str],
    columns: Sequence[str],
    what: str,
) -> Entries:
    if not isinstance(matrix, Mapping):
        return tuple(tuple(str(cell) for cell in row) for row in matrix)
    for row, cells in matrix.items():
        if row not in rows:
            raise UnknownNameError(f"row of {what}", row, rows)
        for column in cells:
            if column not in columns:
                raise UnknownNameError(f"column of {what}", column, columns)
    return tuple(
        tuple(
            str(matrix.get(row, {}).get(column, int(what == "M" and row == column)))
            for column in columns
        )
        for row in rows
    )
