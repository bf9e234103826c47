"""Model structures as data: named parameters and expressions for the matrix entries.

    M dx/dt = F x + G u(t - tau_in)
    y(t + tau_out) = H0 x + H1 dx/dt + D u(t - tau_in) + D1 du/dt(t - tau_in)

A delay belongs to an input, to an output, or to a pair of them, where one input reaches two
outputs by different ways; those of a response add up. It may be negative: recorder channels can
be skewed against each other.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from inspect import signature
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import atomic_write, read_toml
from helisim.base.settings import (
    FrozenMap,
    Inline,
    Value,
    check,
    convert,
    from_plain,
    placed,
    setting,
    to_plain,
    toml_text,
)
from helisim.ident.expression import FUNCTIONS, Entry, Expression, Program

Entries = tuple[tuple[str, ...], ...]
"""A matrix of expressions, by rows."""

MATRICES = {
    **{"M": ("states", "states"), "F": ("states", "states"), "G": ("states", "inputs")},
    **{"H0": ("outputs", "states"), "H1": ("outputs", "states")},
    **{"D": ("outputs", "inputs"), "D1": ("outputs", "inputs")},
}
"""Each matrix, and whose its rows and columns are."""
DELAYS = {"input_delays": "input", "output_delays": "output", "delays": "response"}
"""Each table of delays, and what they belong to."""
_ZERO = ("0", "0.0")


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
        error: standard error of a fixed parameter, known from a bench; a fit carries it through to
            the errors of the free ones. 0: known exactly.
    """

    name: str
    unit: str
    start: float
    bounds: tuple[float, float] | None = setting(None, finite=False, unsaid=True)
    meaning: str = setting("", unsaid=True)
    scale: float | None = setting(None, above=0.0, unsaid=True)
    fixed: bool = setting(False, unsaid=True)
    error: float = setting(0.0, low=0.0, unsaid=True)

    def __post_init__(self) -> None:
        check(self, f"parameter {self.name!r}")
        if not self.name.isidentifier() or self.name in FUNCTIONS:
            raise InputError(f"parameter name {self.name!r} isn't an identifier, such as 'N_r'")
        low, high = self.limits
        if not low < high or not low <= self.start <= high:
            raise InputError(
                f"parameter {self.name!r} has bounds {low} to {high} and starts at {self.start}; "
                "expected lower < upper with the start between them",
                remedy="bounds,start",
            )
        if self.error and not self.fixed:
            raise InputError(
                f"parameter {self.name!r} has error {self.error} but is free: a standard error is "
                "given for a fixed parameter, as from a bench; a free one's comes from the fit"
            )

    @property
    def limits(self) -> tuple[float, float]:
        """The bounds, infinite where there are none."""
        return (-math.inf, math.inf) if self.bounds is None else self.bounds

    @property
    def magnitude(self) -> float:
        """The order of magnitude."""
        return self.scale or abs(self.start) or 1.0


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
        for matrix in MATRICES:
            rows, (height, width) = getattr(self, matrix), self._shapes[matrix]
            cells = tuple(tuple(map(str, row)) for row in rows or self._default(matrix))
            if len(cells) != height or any(len(row) != width for row in cells):
                raise InputError(
                    f"{self.name}: {matrix} has {len(cells)} rows of "
                    f"{sorted({len(row) for row in cells})} entries, expected {height} of {width}"
                )
            object.__setattr__(self, matrix, cells)
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
        cells = [
            (matrix, row, column, cell, f"{matrix}.{rows[row]}.{columns[column]}")
            for matrix in MATRICES
            for rows, columns in [self._axes(matrix)]
            for row, line in enumerate(getattr(self, matrix))
            for column, cell in enumerate(line)
        ]
        cells += [
            (table, *self.delay_places(table)[name], cell, f"{table}.{name}")
            for table in DELAYS
            for name, cell in getattr(self, table).items()
        ]
        found = [
            Entry(matrix, row, column, self._expression(cell, place))
            for matrix, row, column, cell, place in cells
        ]
        return tuple(entry for entry in found if entry.expression.text not in _ZERO)

    @cached_property
    def program(self) -> Program:
        """The matrices compiled, for `helisim.ident.evaluate`."""
        n_in, n_out = len(self.inputs), len(self.outputs)
        delays = {"input_delays": (1, n_in), "output_delays": (n_out, 1), "delays": (n_out, n_in)}
        free = [one.name for one in self.free]
        return Program(self.names, free, self._shapes | delays, self.entries, self.constants)

    @property
    def improper(self) -> bool:
        """Whether an output follows an input's rate, so that no state space has its response."""
        return any(entry.matrix == "D1" for entry in self.entries)

    @cached_property
    def connected(self) -> frozenset[str]:
        """The responses ("p/lat") that aren't zero by the structure's own zeros.

        A response that is zero has neither decibels nor a phase, so nothing measured can be fitted
        to it. Parameters that are fixed at zero count as paths: they are values, not the structure.
        """
        there = {name: np.zeros(shape, dtype=np.bool_) for name, shape in self._shapes.items()}
        for entry in self.entries:
            if entry.matrix in there:
                there[entry.matrix][entry.row, entry.column] = True
        # An equation without a rate constrains its states; else it drives those whose rates it has.
        driven = np.where(np.any(there["M"], axis=1, keepdims=True), there["M"], there["F"])
        moved = driven.T @ (driven | there["F"])  # a state moved by another in one step
        reached: NDArray[np.bool_] = driven.T @ there["G"]
        for _ in self.states:
            reached = reached | (moved @ reached)
        paths: NDArray[np.bool_] = (there["H0"] | there["H1"]) @ reached | there["D"] | there["D1"]
        return frozenset(f"{self.outputs[o]}/{self.inputs[i]}" for o, i in np.argwhere(paths))

    def delay_places(self, table: str) -> dict[str, tuple[int, int]]:
        """Return which names a table of delays may have, with their row and column."""
        if table == "input_delays":
            return {name: (0, k) for k, name in enumerate(self.inputs)}
        if table == "output_delays":
            return {name: (k, 0) for k, name in enumerate(self.outputs)}
        return {
            f"{output}/{input_}": (row, column)
            for row, output in enumerate(self.outputs)
            for column, input_ in enumerate(self.inputs)
        }

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
        known = (*self.inputs, *self.outputs)
        for signal in signals:
            if signal not in known:
                raise UnknownNameError(f"signal of {self.name!r}", signal, known)
        new = {one: signals.get(one, one) for one in known}
        return replace(
            self,
            name=name or self.name,
            inputs=tuple(new[x] for x in self.inputs),
            outputs=tuple(new[x] for x in self.outputs),
            input_delays={new[x]: tau for x, tau in self.input_delays.items()},
            output_delays={new[x]: tau for x, tau in self.output_delays.items()},
            delays={
                f"{new[self.outputs[row]]}/{new[self.inputs[column]]}": self.delays[pair]
                for pair, (row, column) in self.delay_places("delays").items()
                if pair in self.delays
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
        given = dict(convert(Mapping[str, Any], data, "structure"))
        series = convert(Mapping[str, str], given.pop("series", {}), "series")
        if "parameters" in given:
            tables = convert(Mapping[str, Mapping[str, Any]], given["parameters"], "parameters")
            given["parameters"] = [
                from_plain(Parameter, {"name": name, **table}, f"parameter {name!r}")
                for name, table in tables.items()
            ]
        for table in DELAYS.keys() & given:
            cells = convert(Mapping[str, str | float], given[table], table)
            given[table] = {name: str(cell) for name, cell in cells.items()}
        for matrix in MATRICES.keys() & given:
            if isinstance(given[matrix], Mapping):
                rows, columns = (
                    convert(tuple[str, ...], given.get(axis, ()), axis) for axis in MATRICES[matrix]
                )
                given[matrix] = _dense(given[matrix], rows, columns, matrix)
            cells = convert(tuple[tuple[str | float, ...], ...], given[matrix], matrix)
            given[matrix] = [list(map(str, row)) for row in cells]
        return with_blocks(from_plain(cls, given, "structure"), series)

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> "Structure":
        """Read a structure from a TOML file; `to_toml` of any built-in one is an example.

        Raises:
            StorageError: the file can't be read, or isn't TOML.
            InputError: something in it is missing, unknown, misshapen or of the wrong type; the
                message names the file and the entry.
        """
        data = read_toml(path)
        with placed(path):
            return cls.from_dict(data)

    def to_toml(self, path: str | PathLike[str] | None = None) -> str:
        """Return the structure as TOML that `from_toml` reads back; write it if a path is given.

        Raises:
            StorageError: the file can't be written.
        """
        tables: dict[str, Any] = {"name": self.name, "meaning": self.meaning or None}
        tables |= {key: list(getattr(self, key)) for key in ("states", "inputs", "outputs")}
        tables["parameters"] = self._table(toml=True)
        tables |= {key: getattr(self, key) for key in ("constants", *DELAYS) if getattr(self, key)}
        for matrix in MATRICES:
            rows = _sparse(getattr(self, matrix), *self._axes(matrix), matrix)
            tables |= {matrix: rows} if rows or matrix in ("F", "G", "H0") else {}
        text = toml_text(tables)
        if path is not None:
            with atomic_write(path) as temporary:
                temporary.write_text(text, encoding="utf-8")
        return text

    def to_dict(self) -> dict[str, Any]:
        """Return plain data that `from_dict` reads back."""
        cells = {key: [list(row) for row in getattr(self, key)] for key in MATRICES}
        rate = cells.pop("D1")
        return {
            "name": self.name,
            "meaning": self.meaning,
            "parameters": self._table(),
            **{key: list(getattr(self, key)) for key in ("states", "inputs", "outputs")},
            **cells,
            "input_delays": dict(self.input_delays),
            "output_delays": dict(self.output_delays),
            **({"D1": rate} if self.improper else {}),
            **({"delays": dict(self.delays)} if self.delays else {}),
            "constants": dict(self.constants),
        }

    @property
    def _shapes(self) -> dict[str, tuple[int, int]]:
        axes = {matrix: self._axes(matrix) for matrix in MATRICES}
        return {matrix: (len(rows), len(columns)) for matrix, (rows, columns) in axes.items()}

    def _axes(self, matrix: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
        rows, columns = MATRICES[matrix]
        return getattr(self, rows), getattr(self, columns)

    def _table(self, *, toml: bool = False) -> dict[str, Any]:
        plain = [to_plain(parameter, toml=toml) for parameter in self.parameters]
        return {table.pop("name"): table for table in plain}

    def _with(self, changes: Mapping[str, Mapping[str, Any]]) -> "Structure":
        for name in changes:
            self.parameter(name)
        parameters = tuple(replace(one, **changes.get(one.name, {})) for one in self.parameters)
        return replace(self, parameters=parameters)

    def _default(self, matrix: str) -> Entries:
        rows, columns = self._axes(matrix)
        if matrix in ("F", "G") and rows:
            raise InputError(f"{self.name}: {matrix} is missing")
        if matrix == "H0" and not {*rows} <= {*columns}:
            missing = next(output for output in rows if output not in columns)
            raise InputError(f"{self.name}: output {missing!r} isn't a state, so H0 must be given")
        same = matrix in ("M", "H0")
        return tuple(tuple(str(int(same and x == y)) for x in columns) for y in rows)

    def _expression(self, text: str, place: str) -> Expression:
        with placed(f"{place} of {self.name!r}"):
            expression = Expression(text)
        known = (*self.names, *self.constants)
        for name in sorted(expression.names):
            if name not in known:
                raise UnknownNameError(f"name in {place} = {text!r} of {self.name!r}", name, known)
        return expression

    def _check_names(self) -> None:
        for kind, names in (
            ("parameter", (*self.names, *self.constants)),
            ("state", self.states),
            ("signal", (*self.inputs, *self.outputs)),
        ):
            repeated = sorted({name for name in names if names.count(name) > 1})
            if repeated or "" in names:
                fault = f"names repeat: {', '.join(repeated)}" if repeated else "name is empty"
                raise InputError(f"{self.name}: {kind} {fault}")
        if not self.inputs or not self.outputs:
            raise InputError(f"{self.name}: expected at least one input and one output")
        for table, owner in DELAYS.items():
            for name in getattr(self, table):
                if name not in self.delay_places(table):
                    raise UnknownNameError(f"{owner} with a delay", name, self.delay_places(table))


def _dense(
    table: Mapping[str, Any], rows: Sequence[str], columns: Sequence[str], matrix: str
) -> list[list[Any]]:
    """Return a matrix of cells by row and column name as rows; what is left out is zero."""
    given = {
        row: convert(Mapping[str, str | float], cells, f"{matrix}.{row}")
        for row, cells in table.items()
    }
    for row, cells in given.items():
        if row not in rows:
            raise UnknownNameError(f"row of {matrix}", row, rows)
        for column in cells:
            if column not in columns:
                raise UnknownNameError(f"column of {matrix}.{row}", column, columns)
    return [
        [given.get(y, {}).get(x, str(int(matrix == "M" and x == y))) for x in columns] for y in rows
    ]


def _sparse(
    cells: Entries, rows: Sequence[str], columns: Sequence[str], matrix: str
) -> dict[str, Inline]:
    """Return what `_dense` reads back, without what may be left out."""
    tables = {
        y: Inline({x: c for x, c in zip(columns, line) if c != str(int(matrix == "M" and x == y))})
        for y, line in zip(rows, cells)
    }
    return {row: table for row, table in tables.items() if table}


BLOCKS: dict[str, Callable[..., Structure]] = {}
"""The functions that make blocks, by kind of block; `helisim.ident.blocks` has them."""


def block_named(kind: str) -> Callable[..., Structure]:
    """Return the function that makes a block. Raises UnknownNameError."""
    if kind not in BLOCKS:
        raise UnknownNameError("block", kind, BLOCKS)
    return BLOCKS[kind]


def read_block(text: str, name: str | None = None) -> Structure:
    """Read a block from text, such as "second_order:omega=62+-1,zeta=0.7".

    Args:
        text: the block's kind, and its numbers; "value+-error" has a standard error, what is left
            out is for a fit to find. "name=servo" names it.
        name: of the block, where the text has none; its kind if None.

    Raises:
        UnknownNameError: no such kind, or no such number of it.
        InputError: a number can't be read, or can't be.
    """
    kind, _, rest = (one.strip() for one in text.partition(":"))
    make = block_named(kind)
    known = [*signature(make).parameters]
    given: dict[str, Any] = {"name": name or kind}
    for part in filter(None, (one.strip() for one in rest.split(","))):
        key, equals, number = (one.strip() for one in part.partition("="))
        if not equals or key not in known:
            raise UnknownNameError(f"number of the block {kind!r}", key, known)
        value, sign, error = number.replace("±", "+-").partition("+-")
        try:
            if key == "name":
                given[key] = number
            elif key == "order":
                given[key] = int(number)
            else:
                given[key] = (float(value), float(error)) if sign else float(value)
        except ValueError:
            raise InputError(
                f"{key} = {number!r} of the block {text!r} isn't a number, such as 62 or 62+-1"
            ) from None
    return make(**given)


def with_blocks(structure: Structure, series: Mapping[str, str]) -> Structure:
    """Return a structure with blocks in series that are told in words.

    Args:
        structure: before whose inputs and behind whose outputs they come.
        series: signal, or several with commas between that share one block -> block as
            `read_block` takes it: {"lat,lon": "second_order:omega=62+-1,zeta=0.7"}. It has the
            signals' names if it has no name.

    Raises:
        UnknownNameError: no such signal, block or number.
        InputError: a number can't be read, or a signal has two blocks.
    """
    blocks: dict[str, Structure] = {}
    known = (*structure.inputs, *structure.outputs)
    for signals, text in series.items():
        names = [one.strip() for one in signals.split(",") if one.strip()]
        block = read_block(text, "_".join(names))
        for signal in names:
            if signal not in known:
                raise UnknownNameError(f"signal of {structure.name!r}", signal, known)
            if signal in blocks:
                raise InputError(f"{signal} has two blocks in series; put one after the other")
            blocks[signal] = block
    return in_series(
        structure,
        inputs={name: block for name, block in blocks.items() if name in structure.inputs},
        outputs={name: block for name, block in blocks.items() if name in structure.outputs},
    )


def in_series(
    structure: Structure,
    *,
    inputs: Mapping[str, Structure] | None = None,
    outputs: Mapping[str, Structure] | None = None,
    name: str | None = None,
) -> Structure:
    """Return a structure behind other dynamics at its inputs, and before others at its outputs.

    Args:
        structure: that is to be found, say.
        inputs: by input, what its signal passes before it drives the structure, such as a servo.
        outputs: by output, what it passes before it is recorded, such as a sensor's filter.
        name: of the new one; the structure's if None.

    Each of the blocks has one input and one output (`blocks`, or any such structure); parameters
    of the same name are the same parameter, so one servo for two inputs has one natural frequency.

    Raises:
        UnknownNameError: no such input or output.
        InputError: a block has several inputs or outputs, two parameters of one name differ, or
            an output that follows an input's rate would have to be differentiated.
    """
    made = replace(structure, name=name or structure.name)
    for side, blocks in (("input", inputs or {}), ("output", outputs or {})):
        known = structure.inputs if side == "input" else structure.outputs
        for signal, block in blocks.items():
            if signal not in known:
                raise UnknownNameError(f"{side} of {structure.name!r}", signal, known)
            if len(block.inputs) != 1 or len(block.outputs) != 1:
                raise InputError(
                    f"the block {block.name!r} at {signal!r} has {len(block.inputs)} inputs and "
                    f"{len(block.outputs)} outputs, expected one of each"
                )
            made = _with_block(made, block, signal, known.index(signal), before=side == "input")
    return made


def _with_block(
    structure: Structure, block: Structure, signal: str, place: int, *, before: bool
) -> Structure:
    """Return the structure with a block before an input or behind an output.

    A delay commutes with all of it, so those of the block are added to the signal's.
    """
    own, its = ({key: _cells(one, key) for key in MATRICES} for one in (structure, block))
    # the block among wires that pass the other signals
    wires = _identity(len(structure.inputs if before else structure.outputs))
    pick = wires[[place]]
    its |= {key: _dot(pick.T, its[key]) for key in ("H0", "H1")}
    its |= {"G": _dot(its["G"], pick), "D1": _dot(_dot(pick.T, its["D1"]), pick)}
    through = wires.copy()
    through[place, place] = its["D"][0, 0]
    its["D"] = through
    made = _cascade(its, own) if before else _cascade(own, its)
    if made is None:
        raise InputError(
            f"the block {block.name!r} at {signal!r} would have an input's rate differentiated, "
            f"or drive a state by it: D1 of {structure.name!r} or of the block makes an output "
            "follow it"
        )
    if before:  # the structure's states come first
        order = np.roll(np.arange(len(made["F"])), len(structure.states))
        made |= {key: made[key][order] for key in "MFG"}
        made |= {key: made[key][:, order] for key in ("M", "F", "H0", "H1")}
    parameters = {one.name: one for one in structure.parameters}
    for one in block.parameters:
        other = parameters.setdefault(one.name, one)
        if other != one:
            raise InputError(
                f"two parameters are called {one.name!r}: {one.start:g} {one.unit} of the block "
                f"{block.name!r} and {other.start:g} {other.unit}; give the block another name"
            )
    for name, number in block.constants.items():
        if structure.constants.get(name, number) != number:
            raise InputError(
                f"the constant {name!r} of the block {block.name!r} is {number:g}, "
                f"elsewhere {structure.constants[name]:g}"
            )
    table = "input_delays" if before else "output_delays"
    delays = dict(getattr(structure, table))
    late = [tau for kind in DELAYS for tau in getattr(block, kind).values()]
    if late:
        delays[signal] = _sum(delays.get(signal, "0"), *late)
    return replace(
        structure,
        parameters=tuple(parameters.values()),
        constants={**structure.constants, **block.constants},
        states=(*structure.states, *(f"{signal}_{block.name}_{one}" for one in block.states)),
        **{table: delays},
        **{key: tuple(map(tuple, cells)) for key, cells in made.items()},
    )


_Cells = NDArray[np.object_]


def _cascade(first: Mapping[str, _Cells], second: Mapping[str, _Cells]) -> dict[str, _Cells] | None:
    """Return the matrices of two systems in a row, states of the first first; None if improper."""
    f, s = first, second
    if any(
        _any(_dot(a, b)) for a, b in ((s["G"], f["D1"]), (s["D1"], f["H1"]), (s["D1"], f["D1"]))
    ):
        return None
    across = np.full((len(f["F"]), len(s["F"])), "0", dtype=object)
    return {
        "M": np.block([[f["M"], across], [_dot(s["G"], f["H1"], "-1"), s["M"]]]),
        "F": np.block([[f["F"], across], [_dot(s["G"], f["H0"]), s["F"]]]),
        "G": np.vstack([f["G"], _dot(s["G"], f["D"])]),
        "H0": np.hstack([_dot(s["D"], f["H0"]), s["H0"]]),
        "H1": np.hstack([_plus(_dot(s["D"], f["H1"]), _dot(s["D1"], f["H0"])), s["H1"]]),
        "D": _dot(s["D"], f["D"]),
        "D1": _plus(_dot(s["D"], f["D1"]), _dot(s["D1"], f["D"])),
    }


def _cells(structure: Structure, matrix: str) -> _Cells:
    shape = [len(axis) for axis in structure._axes(matrix)]
    return np.array(getattr(structure, matrix), dtype=object).reshape(shape)


def _identity(size: int) -> _Cells:
    return np.where(np.eye(size) > 0.0, "1", "0").astype(object)


def _any(cells: _Cells) -> bool:
    return any(cell not in _ZERO for cell in cells.flat)


def _dot(one: _Cells, other: _Cells, sign: str = "1") -> _Cells:
    """Return the matrix product of expressions."""
    found = np.empty((one.shape[0], other.shape[1]), dtype=object)
    for row, column in np.ndindex(found.shape):
        terms = (_product(sign, a, b) for a, b in zip(one[row], other[:, column]))
        found[row, column] = _sum(*terms)
    return found


def _plus(one: _Cells, other: _Cells) -> _Cells:
    return np.asarray(np.frompyfunc(_sum, 2, 1)(one, other), dtype=object)


def _product(*factors: str) -> str:
    """Return a product of expressions; "0" and "1" as they are, others in brackets."""
    kept = [factor for factor in factors if factor not in ("1", "-1")]
    sign = "-" if factors.count("-1") % 2 else ""
    if any(factor in _ZERO for factor in kept):
        return "0"
    if not kept:
        return f"{sign}1"
    if len(kept) == 1 and not sign:
        return kept[0]
    return sign + "*".join(one if one.isidentifier() else f"({one})" for one in kept)


def _sum(*terms: str) -> str:
    return " + ".join(term for term in terms if term not in _ZERO) or "0"
