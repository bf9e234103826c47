"""Puts structures of one input and one output in series with a structure, as expressions.

With the block M_b z' = F_b z + G_b u, y_b = H0_b z + H1_b z' + D_b u before an input, whose
column of the structure's matrices is g, d, d1,

    M x' - g H1_b z' = F x + g H0_b z + g D_b u ,
    y = H0 x + (H1 x' + d H1_b z' + d1 H0_b z') + d H0_b z + d D_b u + d1 D_b u' ,

and behind an output, whose row is h0, h1, d, M_b z' - G_b h1 x' = F_b z + G_b h0 x + G_b d u.
A delay commutes with all of it, so delays stay with their signals and those of blocks are added.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident.model.structure import Parameter, Structure

_Rows = list[list[str]]
_ZERO = ("0", "0.0")


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
    for signal, block in (inputs or {}).items():
        _check(block, signal, made.inputs, "input", structure)
        made = _before(made, made.inputs.index(signal), block)
    for signal, block in (outputs or {}).items():
        _check(block, signal, made.outputs, "output", structure)
        made = _behind(made, made.outputs.index(signal), block)
    return made


def _check(
    block: Structure, signal: str, known: tuple[str, ...], side: str, structure: Structure
) -> None:
    if signal not in known:
        raise UnknownNameError(f"{side} of {structure.name!r}", signal, known)
    if len(block.inputs) != 1 or len(block.outputs) != 1:
        raise InputError(
            f"the block {block.name!r} at {signal!r} has {len(block.inputs)} inputs and "
            f"{len(block.outputs)} outputs, expected one of each"
        )


def _before(structure: Structure, column: int, block: Structure) -> Structure:
    """Return the structure with a block before an input."""
    signal = structure.inputs[column]
    if _any(block.D1) or (_any(block.H1) and any(row[column] not in _ZERO for row in structure.D1)):
        raise InputError(
            f"the block {block.name!r} before {signal!r} would have the input's rate differentiated"
        )
    old, new = len(structure.states), len(block.states)
    h0, h1, through = block.H0[0], block.H1[0], block.D[0][0]
    g = [row[column] for row in structure.G]
    d = [row[column] for row in structure.D]
    d1 = [row[column] for row in structure.D1]
    mass = [[*row, *(_product("-1", one, cell) for cell in h1)] for row, one in zip(structure.M, g)]
    rates = [[*row, *(_product(one, cell) for cell in h0)] for row, one in zip(structure.F, g)]
    drive = _with_column(structure.G, column, [_product(one, through) for one in g])
    seen = [[*row, *(_product(one, cell) for cell in h0)] for row, one in zip(structure.H0, d)]
    seen_rate = [
        [*row, *(_sum(_product(one, a), _product(two, b)) for a, b in zip(h1, h0))]
        for row, one, two in zip(structure.H1, d, d1)
    ]
    feed = _with_column(structure.D, column, [_product(one, through) for one in d])
    feed_rate = _with_column(structure.D1, column, [_product(one, through) for one in d1])
    for k in range(new):
        mass.append(["0"] * old + list(block.M[k]))
        rates.append(["0"] * old + list(block.F[k]))
        row = ["0"] * len(structure.inputs)
        row[column] = block.G[k][0]
        drive.append(row)
    return replace(
        structure,
        **_shared(structure, block, signal),
        input_delays=_later(structure.input_delays, signal, block),
        **_rows(M=mass, F=rates, G=drive, H0=seen, H1=seen_rate, D=feed, D1=feed_rate),
    )


def _behind(structure: Structure, row: int, block: Structure) -> Structure:
    """Return the structure with a block behind an output."""
    signal = structure.outputs[row]
    improper = any(cell not in _ZERO for cell in structure.D1[row])
    if _any(block.D1) or (improper and (_any(block.H1) or _any(block.G))):
        raise InputError(
            f"the block {block.name!r} behind {signal!r} would need the rate of an input: "
            f"D1 of {structure.name!r} makes {signal!r} follow it"
        )
    new = len(block.states)
    h0, h1, d = structure.H0[row], structure.H1[row], structure.D[row]
    through = block.D[0][0]
    mass = [[*cells, *["0"] * new] for cells in structure.M]
    rates = [[*cells, *["0"] * new] for cells in structure.F]
    drive = [list(cells) for cells in structure.G]
    for k in range(new):
        gain = block.G[k][0]
        mass.append([*(_product("-1", gain, cell) for cell in h1), *block.M[k]])
        rates.append([*(_product(gain, cell) for cell in h0), *block.F[k]])
        drive.append([_product(gain, cell) for cell in d])
    seen = [[*cells, *["0"] * new] for cells in structure.H0]
    seen_rate = [[*cells, *["0"] * new] for cells in structure.H1]
    feed = [list(cells) for cells in structure.D]
    feed_rate = [list(cells) for cells in structure.D1]
    seen[row] = [*(_product(through, cell) for cell in h0), *block.H0[0]]
    seen_rate[row] = [*(_product(through, cell) for cell in h1), *block.H1[0]]
    feed[row] = [_product(through, cell) for cell in d]
    feed_rate[row] = [_product(through, cell) for cell in structure.D1[row]]
    return replace(
        structure,
        **_shared(structure, block, signal),
        output_delays=_later(structure.output_delays, signal, block),
        **_rows(M=mass, F=rates, G=drive, H0=seen, H1=seen_rate, D=feed, D1=feed_rate),
    )


def _shared(structure: Structure, block: Structure, signal: str) -> dict[str, Any]:
    """Return the parameters, constants and states of both."""
    parameters = {one.name: one for one in structure.parameters}
    for one in block.parameters:
        if parameters.setdefault(one.name, one) != one:
            raise InputError(_differ(one, parameters[one.name], block))
    constants = dict(structure.constants)
    for name, number in block.constants.items():
        if constants.setdefault(name, number) != number:
            raise InputError(
                f"the constant {name!r} of the block {block.name!r} is {number:g}, "
                f"elsewhere {constants[name]:g}"
            )
    states = tuple(f"{signal}_{block.name}_{state}" for state in block.states)
    return {
        "parameters": tuple(parameters.values()),
        "constants": constants,
        "states": (*structure.states, *states),
    }


def _differ(one: Parameter, other: Parameter, block: Structure) -> str:
    return (
        f"two parameters are called {one.name!r}: {one.start:g} {one.unit} of the block "
        f"{block.name!r} and {other.start:g} {other.unit}; give the block another name"
    )


def _later(delays: Mapping[str, str], signal: str, block: Structure) -> dict[str, str]:
    """Return delays with the block's own added at its signal."""
    own = [
        *block.input_delays.values(),
        *block.output_delays.values(),
        *block.delays.values(),
    ]
    if not own:
        return dict(delays)
    return {**delays, signal: _sum(delays.get(signal, "0"), *own)}


def _rows(**matrices: _Rows) -> dict[str, Any]:
    return {name: tuple(map(tuple, rows)) for name, rows in matrices.items()}


def _with_column(matrix: tuple[tuple[str, ...], ...], column: int, cells: list[str]) -> _Rows:
    return [[*row[:column], cell, *row[column + 1 :]] for row, cell in zip(matrix, cells)]


def _any(matrix: tuple[tuple[str, ...], ...]) -> bool:
    return any(cell not in _ZERO for row in matrix for cell in row)


def _product(*factors: str) -> str:
    """Return a product of expressions; "0" and "1" as they are, others in brackets."""
    kept = [factor for factor in factors if factor != "1"]
    if any(factor in _ZERO for factor in kept):
        return "0"
    sign = ""
    while "-1" in kept:
        kept.remove("-1")
        sign = "" if sign else "-"
    if not kept:
        return f"{sign}1"
    if len(kept) == 1 and not sign:
        return kept[0]
    return sign + "*".join(one if one.isidentifier() else f"({one})" for one in kept)


def _sum(*terms: str) -> str:
    kept = [term for term in terms if term not in _ZERO]
    return " + ".join(kept) if kept else "0"
