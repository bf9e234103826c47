"""Parameters in the units that people read, by their places in the matrices; SI is stored.

N_ped is stated in 1/s^2 and means rad/s^2 by the whole range of the pedal: its row is a yaw
acceleration, its column a control. In every term of an entry the powers of its factors and of its
column's signal add up to its row's; terms with one unknown are solved, until none is left.
"""

import ast
from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction

from helisim.base.units import CONTROL, Powers, UserUnits, parts
from helisim.ident.fitted import FittedParameter
from helisim.ident.result import Fit
from helisim.ident.structure import Structure
from helisim.records.record import CHANNELS, signal_powers


def fit_in(fit: Fit, units: UserUnits) -> tuple[tuple[FittedParameter, ...], tuple[str, ...]]:
    """Return a fit's parameters in the given units, and what a reader must know of them.

    Where a parameter stands says what its unit leaves out: N_ped in 1/s^2 is a yaw acceleration by
    the pedal, so deg/(s^2 %). What doesn't follow from the structure stays SI, and is told.

    Returns:
        The parameters in the fit's order; notes, a line each.
    """
    data = fit.data
    signals = dict(zip((*data.inputs, *data.outputs), (*data.input_units, *data.output_units)))
    full = dimensions(fit.structure, signals)
    found, apart, per_radian = [], [], []
    for one in fit.parameters.values():
        declared = parts(one.unit)
        powers = _agreed(declared, full.get(one.name))
        if powers is None:
            apart.append(one.name)
            found.append(one)
            continue
        if declared and "rad" not in declared and full.get(one.name, {}).get("rad", 0) < 0:
            per_radian.append(one.name)
        found.append(_scaled(one, *units.shown(powers)))
    notes = []
    if apart:
        notes.append(f"in SI, as the structure doesn't tell their units: {', '.join(apart)}")
    if per_radian and any(part == "rad" for part, *_ in units.chosen):
        notes.append(f"by a radian of what they multiply: {', '.join(per_radian)}")
    return tuple(found), tuple(notes)


def _agreed(declared: Powers | None, full: Powers | None) -> Powers | None:
    """Return a parameter's powers by its stated unit and by its place; None where unknown.

    An angle that the stated unit leaves out below the line stays a radian.
    """
    if full is None:
        return declared if declared == {"s": 1} else None
    if declared is None:
        return full
    if any(declared.get(part, 0) != full.get(part, 0) for part in ("m", "s")):
        return None
    radian = full.get("rad", 0)
    if "rad" not in declared and radian < 0:
        radian = 0
    elif "rad" in declared and declared["rad"] != radian:
        return None
    found = {**declared, "rad": radian, CONTROL: full.get(CONTROL, 0)}
    return {part: power for part, power in found.items() if power}


def _scaled(one: FittedParameter, unit: str, factor: float) -> FittedParameter:
    if factor == 1.0 and one.unit:
        return one
    known = one.definition
    bounds = None if known.bounds is None else (known.bounds[0] * factor, known.bounds[1] * factor)
    scale = None if known.scale is None else known.scale * factor
    start, error = known.start * factor, known.error * factor
    return replace(
        one,
        definition=replace(known, unit=unit, start=start, bounds=bounds, scale=scale, error=error),
        value=one.value * factor,
        cramer_rao=one.cramer_rao * factor,
        insensitivity=one.insensitivity * factor,
        standard_error=one.standard_error * factor,
    )


Known = dict[str, Mapping[str, int | Fraction]]
"""Parameter, state or row -> powers of its unit's parts."""


def dimensions(structure: Structure, signals: Mapping[str, str]) -> dict[str, Powers]:
    """Return the full units of the parameters that the structure tells.

    Args:
        structure: whose states are known by the names of channels and outputs.
        signals: unit of each input and output, "" where it isn't known.

    Returns:
        Parameter -> powers; those that don't follow, or follow differently twice, are left out.
    """
    known = _signals(structure, signals)
    terms = list(_terms(structure))
    solved = True
    while solved:
        solved = False
        for term in terms:
            unknown = [name for name in term if name not in known]
            if len(unknown) == 1:
                powers = _sum(term, known).items()
                known[unknown[0]] = {part: -one / term[unknown[0]] for part, one in powers}
                solved = True
    wrong = {
        name
        for term in terms
        if all(name in known for name in term) and any(_sum(term, known).values())
        for name in term
    }
    found = {}
    for name in structure.names:
        powers = known.get(f"parameter {name}")
        whole = powers is not None and all(one.denominator == 1 for one in powers.values())
        if powers is not None and whole and f"parameter {name}" not in wrong:
            found[name] = {part: int(power) for part, power in powers.items() if power}
    return found


def _signals(structure: Structure, units: Mapping[str, str]) -> Known:
    """Return what is known to begin with: signals, and states of channels' names."""
    known: Known = {"second": {"s": 1}}
    for name in (*structure.inputs, *structure.outputs):
        powers = signal_powers(name, units.get(name, ""), is_input=name in structure.inputs)
        if powers is not None:
            known[f"signal {name}"] = powers
    for name in structure.states:
        standard = signal_powers(name, "", is_input=False) if name in CHANNELS else None
        state = known.get(f"signal {name}", standard)
        if state is not None:
            known[f"state {name}"] = state
    return known


def _terms(structure: Structure) -> Iterator[dict[str, Fraction]]:
    """Yield what adds up to nothing, name -> power, for every term of every entry."""
    for entry in structure.entries:
        if entry.matrix in ("input_delays", "output_delays", "delays"):
            ends = {"second": Fraction(-1)}
        else:
            ends = _ends(structure, entry.matrix, entry.row, entry.column)
        for factors in _monomials(ast.parse(entry.expression.text, mode="eval").body):
            term = dict(ends)
            for name, power in factors.items():
                term[f"parameter {name}"] = term.get(f"parameter {name}", Fraction(0)) + power
            yield {name: power for name, power in term.items() if power}


def _ends(structure: Structure, matrix: str, row: int, column: int) -> dict[str, Fraction]:
    """Return the row's and the column's part of a term."""
    driven = matrix in ("G", "D", "D1")
    names = structure.inputs if driven else structure.states
    ends = {f"{'signal' if driven else 'state'} {names[column]}": Fraction(1)}
    if matrix in ("M", "H1", "D1"):  # of a rate
        ends["second"] = Fraction(-1)
    if matrix in ("M", "F", "G"):
        ends[f"equation {row}"] = Fraction(-1)
    else:
        output = f"signal {structure.outputs[row]}"
        ends[output] = ends.get(output, Fraction(0)) - 1
    return ends


def _sum(term: Mapping[str, Fraction], known: Known) -> dict[str, Fraction]:
    """Return the powers that the known names of a term add up to."""
    total: dict[str, Fraction] = {}
    for name, times in term.items():
        for part, power in known.get(name, {}).items():
            total[part] = total.get(part, Fraction(0)) + times * power
    return total


def _monomials(node: ast.expr) -> Iterator[dict[str, Fraction]]:
    """Yield the powers of the names in each term of an expression.

    A number alone, other than 1, is left out: it may have a unit of its own, such as gravity.
    """
    match node:
        case ast.BinOp(op=ast.Add() | ast.Sub()):
            yield from _monomials(node.left)
            yield from _monomials(node.right)
        case ast.UnaryOp():
            yield from _monomials(node.operand)
        case ast.Constant(value=int() | float() as value) if abs(value) != 1.0:
            return
        case _:
            factors = _factors(node)
            if factors is not None:
                yield factors


def _factors(node: ast.expr) -> dict[str, Fraction] | None:
    """Return the powers of the names in a product; None where it has none, as in a function."""
    match node:
        case ast.Constant():
            return {}
        case ast.Name(id=name):
            return {name: Fraction(1)}
        case ast.UnaryOp():
            return _factors(node.operand)
        case ast.BinOp(op=ast.Add() | ast.Sub()):  # both of one unit
            return _factors(node.left)
        case ast.BinOp(op=ast.Mult() | ast.Div()):
            left, right = _factors(node.left), _factors(node.right)
            if left is None or right is None:
                return None
            sign = 1 if isinstance(node.op, ast.Mult) else -1
            names = {*left, *right}
            return {n: left.get(n, Fraction(0)) + sign * right.get(n, Fraction(0)) for n in names}
        case ast.BinOp(op=ast.Pow(), right=ast.Constant(value=int() as power)):
            base = _factors(node.left)
            return None if base is None else {name: one * power for name, one in base.items()}
    return None
