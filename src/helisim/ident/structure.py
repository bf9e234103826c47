"""Model structures as data: named parameters and expressions for the matrix entries.

    M dx/dt = F x + G u(t - tau_in)
    y(t + tau_out) = H0 x + H1 dx/dt + D u(t - tau_in)

A negative delay is a channel recorded early.
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

from helisim.base.errors import InputError, check_known
from helisim.base.files import read_toml, write_text
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

Entries = tuple[tuple[str | float, ...], ...]  # a matrix of expressions, by rows
MATRICES = {
    **{"M": ("states", "states"), "F": ("states", "states"), "G": ("states", "inputs")},
    **{"H0": ("outputs", "states"), "H1": ("outputs", "states"), "D": ("outputs", "inputs")},
}  # Owners of the rows and columns of each matrix
DELAYS = {"input_delays": "inputs", "output_delays": "outputs"}
_ZERO = ("0", "0.0")


@dataclass(frozen=True)
class Parameter:
    """One parameter of a structure, in SI; `bounds` are (lowest, highest) or None.

    `scale` is an order of magnitude, by default |start|; needed if the start is 0. `error` is the
    standard error of a fixed parameter, which a fit propagates.
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
        """Bounds, infinite where there are none."""
        return (-math.inf, math.inf) if self.bounds is None else self.bounds

    @property
    def magnitude(self) -> float:
        """Order of magnitude."""
        return self.scale or abs(self.start) or 1.0


@dataclass(frozen=True, eq=False)
class Structure(Value):
    """A parametrised linear model with delays, s; equations in the module's docstring.

    Matrices are rows of expressions in parameters and constants. Defaults: M the identity, H0 picks
    the states with the outputs' names, H1 and D zero, no delays.
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
        """Names of the parameters, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def free(self) -> tuple[Parameter, ...]:
        """Parameters that a fit varies."""
        return tuple(parameter for parameter in self.parameters if not parameter.fixed)

    @property
    def uncertain(self) -> tuple[Parameter, ...]:
        """Fixed parameters with a standard error."""
        return tuple(parameter for parameter in self.parameters if parameter.error > 0.0)

    @property
    def starts(self) -> dict[str, float]:
        """Start of every parameter by name."""
        return {parameter.name: parameter.start for parameter in self.parameters}

    @property
    def pairs(self) -> dict[str, tuple[int, int]]:
        """Indices (output, input) of each response, such as "p/lat"."""
        return {
            f"{output}/{input_}": (row, column)
            for row, output in enumerate(self.outputs)
            for column, input_ in enumerate(self.inputs)
        }

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """Matrix entries and delays that aren't the number zero."""
        cells: list[tuple[str, int, int, Any, str]] = [
            (matrix, row, column, cell, f"{matrix}.{rows[row]}.{columns[column]}")
            for matrix in MATRICES
            for rows, columns in [self._axes(matrix)]
            for row, line in enumerate(getattr(self, matrix))
            for column, cell in enumerate(line)
        ]
        for table, names in DELAYS.items():
            for name, cell in getattr(self, table).items():
                k = getattr(self, names).index(name)
                row, column = (0, k) if names == "inputs" else (k, 0)
                cells.append((table, row, column, cell, f"{table}.{name}"))
        found = [
            Entry(matrix, row, column, self._expression(cell, place))
            for matrix, row, column, cell, place in cells
        ]
        return tuple(entry for entry in found if entry.expression.text not in _ZERO)

    @cached_property
    def program(self) -> Program:
        """Compiled matrices."""
        delays = {"input_delays": (1, len(self.inputs)), "output_delays": (len(self.outputs), 1)}
        free = [one.name for one in self.free]
        return Program(self.names, free, self._shapes | delays, self.entries, self.constants)

    def matrices(self, values: Mapping[str, float]) -> dict[str, NDArray[np.float64]]:
        """Return matrices and delays by name, for all parameters. Raises UnknownNameError."""
        return self.program.fill(self.program.ordered(values))

    @cached_property
    def connected(self) -> frozenset[str]:
        """Responses ("p/lat") not zero by the structure; a parameter fixed at zero counts."""
        there = {name: np.zeros(shape, dtype=np.bool_) for name, shape in self._shapes.items()}
        for entry in self.entries:
            if entry.matrix in there:
                there[entry.matrix][entry.row, entry.column] = True
        # an equation without a rate constrains its states, else it drives those whose rates it has
        driven = np.where(np.any(there["M"], axis=1, keepdims=True), there["M"], there["F"])
        moved = driven.T @ (driven | there["F"])  # a state moved by another in one step
        reached: NDArray[np.bool_] = driven.T @ there["G"]
        for _ in self.states:
            reached = reached | (moved @ reached)
        paths: NDArray[np.bool_] = (there["H0"] | there["H1"]) @ reached | there["D"]
        return frozenset(name for name, place in self.pairs.items() if paths[place])

    def parameter(self, name: str) -> Parameter:
        """Return a parameter. Raises UnknownNameError."""
        check_known(f"parameter of {self.name!r}", [name], self.names)
        return self.parameters[self.names.index(name)]

    def with_fixed(
        self, values: Mapping[str, float], errors: Mapping[str, float] | None = None
    ) -> "Structure":
        """Return a copy with parameters fixed, with errors if any. Raises UnknownNameError."""
        known = errors or {}
        check_known("fixed parameter with an error", known, values)
        return self._with(
            {
                name: {"start": x, "fixed": True, "error": known.get(name, 0.0)}
                for name, x in values.items()
            }
        )

    def with_free(self, *names: str) -> "Structure":
        """Return a copy with parameters free that were fixed. Raises UnknownNameError."""
        return self._with({name: {"fixed": False, "error": 0.0} for name in names})

    def with_starts(self, values: Mapping[str, float]) -> "Structure":
        """Return a copy with other starts."""
        return self._with({name: {"start": x} for name, x in values.items()})

    def with_bounds(self, bounds: Mapping[str, tuple[float, float] | None]) -> "Structure":
        """Return a copy with other bounds."""
        return self._with({name: {"bounds": x} for name, x in bounds.items()})

    def renamed(self, signals: Mapping[str, str], *, name: str | None = None) -> "Structure":
        """Return a copy for other channels, such as {"lat": "LAT", "lon": "LON"}."""
        known = (*self.inputs, *self.outputs)
        check_known(f"signal of {self.name!r}", signals, known)
        new = {one: signals.get(one, one) for one in known}
        return replace(
            self,
            name=name or self.name,
            inputs=tuple(new[x] for x in self.inputs),
            outputs=tuple(new[x] for x in self.outputs),
            input_delays={new[x]: tau for x, tau in self.input_delays.items()},
            output_delays={new[x]: tau for x, tau in self.output_delays.items()},
        )

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Structure":
        """Read a structure from plain data, as in a TOML file. Raises InputError.

        Parameters are a table by name. A matrix is a list of rows, or a table of rows by state or
        output name, each a table by state or input name, zero where left out (in M: one on the
        diagonal). `series` puts blocks at signals, as `with_blocks` does.
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
        return with_blocks(from_plain(cls, given, "structure"), series)

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> "Structure":
        """Read a structure from TOML, such as `to_toml` writes. Raises StorageError, InputError."""
        with placed(path):
            return cls.from_dict(read_toml(path))

    def to_toml(self, path: str | PathLike[str] | None = None) -> str:
        """Return the structure as TOML, also written to a path if given. Raises StorageError."""
        text = toml_text(self.to_dict(toml=True))
        if path is not None:
            write_text(path, text)
        return text

    def to_dict(self, *, toml: bool = False) -> dict[str, Any]:
        """Return plain data for `from_dict`; with `toml` without None."""
        plain = [to_plain(parameter, toml=toml) for parameter in self.parameters]
        rows = {key: _sparse(getattr(self, key), *self._axes(key), key) for key in MATRICES}
        tables: dict[str, Any] = {
            **{"name": self.name, "meaning": self.meaning},
            **{key: list(getattr(self, key)) for key in ("states", "inputs", "outputs")},
            "parameters": {table.pop("name"): table for table in plain},
            **{key: dict(getattr(self, key)) for key in ("constants", *DELAYS)},
            **rows,
        }
        spared = ("meaning", "constants", *DELAYS, "M", "H1", "D")  # where they are empty
        return {key: item for key, item in tables.items() if item or key not in spared}

    @property
    def _shapes(self) -> dict[str, tuple[int, int]]:
        axes = {matrix: self._axes(matrix) for matrix in MATRICES}
        return {matrix: (len(rows), len(columns)) for matrix, (rows, columns) in axes.items()}

    def _axes(self, matrix: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
        rows, columns = MATRICES[matrix]
        return getattr(self, rows), getattr(self, columns)

    def _with(self, changes: Mapping[str, Mapping[str, Any]]) -> "Structure":
        check_known(f"parameter of {self.name!r}", changes, self.names)
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
        check_known(f"name in {place} = {text!r} of {self.name!r}", sorted(expression.names), known)
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
            check_known(f"name in {table}", getattr(self, table), getattr(self, owner))


def _dense(
    table: Mapping[str, Any], rows: Sequence[str], columns: Sequence[str], matrix: str
) -> list[list[Any]]:
    given = {
        row: convert(Mapping[str, str | float], cells, f"{matrix}.{row}")
        for row, cells in table.items()
    }
    check_known(f"row of {matrix}", given, rows)
    for row, cells in given.items():
        check_known(f"column of {matrix}.{row}", cells, columns)
    return [
        [given.get(y, {}).get(x, str(int(matrix == "M" and x == y))) for x in columns] for y in rows
    ]


def _sparse(
    cells: Entries, rows: Sequence[str], columns: Sequence[str], matrix: str
) -> dict[str, Inline]:
    tables = {
        y: Inline({x: c for x, c in zip(columns, line) if c != str(int(matrix == "M" and x == y))})
        for y, line in zip(rows, cells)
    }
    return {row: table for row, table in tables.items() if table}


BLOCKS: dict[str, Callable[..., Structure]] = {}
"""Functions that make blocks, by kind; from `helisim.ident.blocks`."""


def _known(text: str) -> tuple[float, ...]:
    return tuple(map(float, text.replace("±", "+-").split("+-")))


def _read_block(text: str, name: str) -> Structure:
    kind, _, rest = (one.strip() for one in text.partition(":"))
    check_known("block", [kind], BLOCKS)
    known = [*signature(BLOCKS[kind]).parameters]
    given: dict[str, Any] = {"name": name}
    for part in filter(None, (one.strip() for one in rest.split(","))):
        key, _, number = (one.strip() for one in part.partition("="))
        check_known(f"number of the block {kind!r}", [key], known)
        try:
            given[key] = {"name": str, "order": int}.get(key, _known)(number)
        except ValueError:
            raise InputError(
                f"{key} = {number!r} of the block {text!r} isn't a number, such as 62 or 62+-1"
            ) from None
    return BLOCKS[kind](**given)


def with_blocks(structure: Structure, series: Mapping[str, str]) -> Structure:
    """Return a structure with blocks in series; raises UnknownNameError, InputError.

    `series` is signals -> block, such as {"lat,lon": "second_order:omega=62+-1,zeta=0.7"}; "+-"
    gives a standard error; numbers left out are fitted; "name=" names the block, else its signals.
    """
    blocks: dict[str, Structure] = {}
    known = (*structure.inputs, *structure.outputs)
    for signals, text in series.items():
        names = [one.strip() for one in signals.split(",") if one.strip()]
        block = _read_block(text, "_".join(names))
        check_known(f"signal of {structure.name!r}", names, known)
        for signal in names:
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
    """Return a structure with blocks before its inputs, such as servos, and behind its outputs.

    Parameters of the same name are the same parameter. Raises UnknownNameError; InputError if a
    block has several inputs or outputs, or parameters of one name differ.
    """
    made = replace(structure, name=name or structure.name)
    for side, blocks in (("input", inputs or {}), ("output", outputs or {})):
        known = structure.inputs if side == "input" else structure.outputs
        check_known(f"{side} of {structure.name!r}", blocks, known)
        for signal, block in blocks.items():
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
    own, its = ({key: _cells(one, key) for key in MATRICES} for one in (structure, block))
    # the block among wires that pass the other signals
    size = len(structure.inputs if before else structure.outputs)
    wires = np.where(np.eye(size) > 0.0, "1", "0").astype(object)
    pick = wires[[place]]
    through = wires.copy()
    through[place, place] = its["D"][0, 0]
    its |= {key: _dot(pick.T, its[key]) for key in ("H0", "H1")}
    its |= {"G": _dot(its["G"], pick), "D": through}
    made = _cascade(its, own) if before else _cascade(own, its)
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


def _cascade(first: Mapping[str, _Cells], second: Mapping[str, _Cells]) -> dict[str, _Cells]:
    f, s = first, second
    across = np.full((len(f["F"]), len(s["F"])), "0", dtype=object)
    return {
        "M": np.block([[f["M"], across], [_dot(s["G"], f["H1"], "-1"), s["M"]]]),
        "F": np.block([[f["F"], across], [_dot(s["G"], f["H0"]), s["F"]]]),
        "G": np.vstack([f["G"], _dot(s["G"], f["D"])]),
        "H0": np.hstack([_dot(s["D"], f["H0"]), s["H0"]]),
        "H1": np.hstack([_dot(s["D"], f["H1"]), s["H1"]]),
        "D": _dot(s["D"], f["D"]),
    }


def _cells(structure: Structure, matrix: str) -> _Cells:
    shape = [len(axis) for axis in structure._axes(matrix)]
    return np.array(getattr(structure, matrix), dtype=object).reshape(shape)


def _dot(one: _Cells, other: _Cells, sign: str = "1") -> _Cells:
    found = np.empty((one.shape[0], other.shape[1]), dtype=object)
    for row, column in np.ndindex(found.shape):
        terms = (_product(sign, a, b) for a, b in zip(one[row], other[:, column]))
        found[row, column] = _sum(*terms)
    return found


def _product(*factors: str) -> str:
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
