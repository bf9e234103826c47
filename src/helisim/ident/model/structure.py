"""Model structures as data: named parameters and expressions for the matrix entries.

    M dx/dt = F x + G u(t - tau_in)
    y(t + tau_out) = H0 x + H1 dx/dt + D u(t - tau_in) + D1 du/dt(t - tau_in)

A delay belongs to an input, to an output, or to a pair of them, where one input reaches two
outputs by different ways; those of a response add up. It may be negative: recorder channels can
be skewed against each other.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import Any, NamedTuple

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import atomic_write, read_toml
from helisim.base.value import FrozenMap, Value
from helisim.ident.model.expression import Expression
from helisim.ident.model.parameter import Parameter
from helisim.ident.model.program import Program
from helisim.ident.model.structure_toml import (
    DELAYS,
    MATRICES,
    as_entries,
    axes,
    delay_places,
    read_fields,
    to_toml,
)

__all__ = ["Entries", "Entry", "Parameter", "Structure"]

Entries = tuple[tuple[str, ...], ...]
"""A matrix of expressions, by rows."""


class Entry(NamedTuple):
    """One matrix entry that depends on parameters."""

    matrix: str
    row: int
    column: int
    expression: Expression


@dataclass(frozen=True, eq=False)
class Structure(Value):
    """A parametrised linear model with delays; see the module for its equations.

    Matrices are rows of expressions in the parameters' and constants' names. Left out, M is
    the identity, H0 picks the states that have the outputs' names, H1, D and D1 are zero, and
    there are no delays.

    Attributes:
        name: of the structure.
        parameters: what the expressions may name, the free ones for a fit to find.
        states, inputs, outputs: names, in the order of the matrices' rows and columns.
        M, F, G, H0, H1, D, D1: see the module. D1 is for improper outputs, whose response rises
            with frequency, such as the acceleration over a collective that flaps the blades.
        input_delays, output_delays: by input or output, s.
        delays: by response, such as {"p/lat": "tau_p_lat"}, s; added to those of its input and
            output.
        constants: numbers that expressions may name.
        meaning: what it is.
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
    D1: Entries = ()
    input_delays: Mapping[str, str] = field(default_factory=dict)
    output_delays: Mapping[str, str] = field(default_factory=dict)
    delays: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)
    meaning: str = ""

    def __post_init__(self) -> None:
        for attribute in ("parameters", "states", "inputs", "outputs"):
            object.__setattr__(self, attribute, tuple(getattr(self, attribute)))
        for attribute in (*DELAYS, "constants"):
            object.__setattr__(self, attribute, FrozenMap(getattr(self, attribute)))
        n, n_in, n_out = len(self.states), len(self.inputs), len(self.outputs)
        shapes = {
            "F": (n, n),
            "G": (n, n_in),
            "M": (n, n),
            "H0": (n_out, n),
            "H1": (n_out, n),
            "D": (n_out, n_in),
            "D1": (n_out, n_in),
        }
        for matrix, shape in shapes.items():
            rows = getattr(self, matrix) or self._default(matrix, shape)
            object.__setattr__(self, matrix, as_entries(rows, shape, f"{self.name}: {matrix}"))
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
        for matrix, (rows, columns) in axes(self.states, self.inputs, self.outputs).items():
            for row, cells in enumerate(getattr(self, matrix)):
                for column, cell in enumerate(cells):
                    place = f"{matrix}.{rows[row]}.{columns[column]}"
                    found.append(Entry(matrix, row, column, self._expression(cell, place)))
        for matrix, places in delay_places(self.inputs, self.outputs).items():
            for name, cell in getattr(self, matrix).items():
                expression = self._expression(cell, f"{matrix}.{name}")
                found.append(Entry(matrix, *places[name], expression))
        return tuple(entry for entry in found if entry.expression.text not in ("0", "0.0"))

    @cached_property
    def program(self) -> Program:
        """The matrices compiled, for `helisim.ident.model.evaluate`."""
        return Program(self)

    @property
    def improper(self) -> bool:
        """Whether an output follows an input's rate, so that no state space has its response."""
        return any(entry.matrix == "D1" for entry in self.entries)

    def parameter(self, name: str) -> Parameter:
        """Return a parameter. Raises UnknownNameError."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise UnknownNameError(f"parameter of {self.name!r}", name, self.names)

    def with_fixed(
        self, values: Mapping[str, float], errors: Mapping[str, float] | None = None
    ) -> "Structure":
        """Return a copy where the named parameters keep the given values.

        Args:
            values: by name.
            errors: their standard errors by name, as from a bench; exact where none is given.

        Raises:
            UnknownNameError: no such parameter, or an error of one that has no value.
        """
        known = errors or {}
        for name in known:
            if name not in values:
                raise UnknownNameError("fixed parameter with an error", name, values)
        return self._with(
            {
                name: {"start": x, "fixed": True, "error": known.get(name, 0.0)}
                for name, x in values.items()
            }
        )

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
            delays={
                f"{signals.get(y, y)}/{signals.get(u, u)}": self.delays[f"{y}/{u}"]
                for y in self.outputs
                for u in self.inputs
                if f"{y}/{u}" in self.delays
            },
        )

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Structure":
        """Read a structure from plain data, as a TOML file holds it.

        Parameters are a table by name. A matrix is a list of rows, or a table of rows by state
        or output name, each a table by state or input name, where what is left out is zero
        (in M: one on the diagonal). `series` puts `blocks` at its signals, as `with_blocks` does.

        Raises:
            InputError: something is missing, unknown, misshapen or of the wrong type.
        """
        fields = read_fields(data)
        fields["parameters"] = tuple(Parameter(**one) for one in fields["parameters"])
        from helisim.ident.model.blocks import with_blocks  # which are structures themselves

        series = fields.pop("series")
        return with_blocks(cls(**fields), series)

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> "Structure":
        """Read a structure from a TOML file; `to_toml` of any built-in one is an example.

        Raises:
            StorageError: the file can't be read, or isn't TOML.
            InputError: something in it is missing, unknown, misshapen or of the wrong type; the
                message names the file and the entry.
        """
        data = read_toml(path)
        try:
            return cls.from_dict(data)
        except InputError as error:
            error.args = (f"{path}: {error}",)
            raise

    def to_toml(self, path: str | PathLike[str] | None = None) -> str:
        """Return the structure as TOML that `from_toml` reads back; write it if a path is given.

        Raises:
            StorageError: the file can't be written.
        """
        text = to_toml(self.to_dict())
        if path is not None:
            with atomic_write(path) as temporary:
                temporary.write_text(text, encoding="utf-8")
        return text

    def to_dict(self) -> dict[str, Any]:
        """Return plain data that `from_dict` reads back."""
        table = {}
        for parameter in self.parameters:
            row: dict[str, Any] = {"unit": parameter.unit, "start": parameter.start}
            if parameter.bounds is not None:
                row["bounds"] = [edge if math.isfinite(edge) else None for edge in parameter.bounds]
            if parameter.meaning:
                row["meaning"] = parameter.meaning
            if parameter.scale is not None:
                row["scale"] = parameter.scale
            if parameter.fixed:
                row["fixed"] = True
            if parameter.error:
                row["error"] = parameter.error
            table[parameter.name] = row
        return {
            "name": self.name,
            "meaning": self.meaning,
            "parameters": table,
            "states": list(self.states),
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            **{key: [list(row) for row in getattr(self, key)] for key in MATRICES if key != "D1"},
            "input_delays": dict(self.input_delays),
            "output_delays": dict(self.output_delays),
            # What few structures have is left out of the others, so older versions read those.
            **({"D1": [list(row) for row in self.D1]} if self.improper else {}),
            **({"delays": dict(self.delays)} if self.delays else {}),
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

    def _expression(self, text: str, place: str) -> Expression:
        try:
            expression = Expression(text)
        except InputError as error:
            error.args = (f"{place} of {self.name!r}: {error}",)
            raise
        known = (*self.names, *self.constants)
        for name in sorted(expression.names):
            if name not in known:
                raise UnknownNameError(f"name in {place} = {text!r} of {self.name!r}", name, known)
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
        for matrix, places in delay_places(self.inputs, self.outputs).items():
            for name in getattr(self, matrix):
                if name not in places:
                    raise UnknownNameError(f"{DELAYS[matrix]} with a delay", name, places)
