"""Arithmetic in parameter names, such as "-tau_f" or "N_v * Y_ped", with exact derivatives."""

import ast
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, check_known

FUNCTIONS: dict[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "sqrt": (math.sqrt, lambda x: 0.5 / math.sqrt(x)),
    "exp": (math.exp, math.exp),
    "log": (math.log, lambda x: 1.0 / x),
    "sin": (math.sin, math.cos),
    "cos": (math.cos, lambda x: -math.sin(x)),
}  # Functions of expressions, with derivatives

_LONGEST = 200
_ALLOWED = "numbers, parameter names, + - * / ** ( ) and " + ", ".join(FUNCTIONS)

Form = float | Callable[[Sequence[float]], float]  # A number, or a function of a list of parameters
Dual = tuple[Form, dict[int, Form]]  # A value and its derivatives by the parameters' indices


class Expression:
    """A parsed expression; `names` are its parameters."""

    def __init__(self, text: str | float) -> None:
        self.text = str(text).strip()
        if not 1 <= len(self.text) <= _LONGEST:
            raise InputError(
                f"expression has {len(self.text)} characters, expected 1 to {_LONGEST}"
            )
        try:
            self.tree = ast.parse(self.text, mode="eval").body
        except (SyntaxError, ValueError):
            raise InputError(
                f"can't read the expression {self.text!r}; allowed are {_ALLOWED}"
            ) from None
        walked = (node.id for node in ast.walk(self.tree) if isinstance(node, ast.Name))
        self.names = frozenset(walked) - FUNCTIONS.keys()
        self.compiled(dict.fromkeys(self.names, 0), {})  # refuses what isn't allowed

    def __repr__(self) -> str:
        return f"Expression({self.text!r})"

    def compiled(self, places: Mapping[str, int], constants: Mapping[str, float]) -> Dual:
        """Return value and derivatives as functions of a list with parameters at `places`."""
        return self._compiled(self.tree, places, constants)

    def _compiled(
        self, node: ast.expr, places: Mapping[str, int], constants: Mapping[str, float]
    ) -> Dual:
        compiled = partial(self._compiled, places=places, constants=constants)
        match node:
            case ast.Constant() if (number := _literal(node)) is not None:
                return number, {}
            case ast.Name(id=name) if name in FUNCTIONS:
                raise InputError(f"function {name!r} needs an argument in {self.text!r}")
            case ast.Name(id=name):
                if name in constants:
                    return constants[name], {}
                return operator.itemgetter(places[name]), {places[name]: 1.0}
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as op, operand=operand):
                return _times((-1.0 if isinstance(op, ast.USub) else 1.0, {}), compiled(operand))
            case ast.Call(func=ast.Name(id=name), args=[inner], keywords=[]) if name in FUNCTIONS:
                return _applied(*FUNCTIONS[name], compiled(inner))
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                power = _literal(right)
                if power is None:
                    raise InputError(f"a power needs a number as exponent in {self.text!r}")
                return _applied(
                    partial(_power, power=power),
                    lambda base: power * _power(base, power - 1.0),
                    compiled(left),
                )
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                return _plus(compiled(left), compiled(right))
            case ast.BinOp(left=left, op=ast.Sub(), right=right):
                return _plus(compiled(left), _times((-1.0, {}), compiled(right)))
            case ast.BinOp(left=left, op=ast.Mult(), right=right):
                return _times(compiled(left), compiled(right))
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                return _over(compiled(left), compiled(right))
        raise InputError(
            f"{ast.unparse(node)!r} isn't allowed in the expression {self.text!r}; allowed are "
            f"{_ALLOWED}"
        )


def value_at(form: Form, parameters: Sequence[float]) -> float:
    """Return a form's value; nan if undefined."""
    if not callable(form):
        return form
    try:
        return form(parameters)
    except (ZeroDivisionError, OverflowError, ValueError):
        return math.nan


def _literal(node: ast.expr) -> float | None:
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return float(value) if math.isfinite(value) else None
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = _literal(operand)
            return None if inner is None else -inner
    return None


def _joined(operation: Callable[[float, float], float], neutral: float, a: Form, b: Form) -> Form:
    match (b, a) if callable(b) else (a, b):
        case float() | int() as one, float() | int() as other:
            return operation(one, other)
        case one, float() | int() as other:
            return one if other == neutral else lambda at: operation(one(at), other)
        case one, other:
            return lambda at: operation(one(at), other(at))


_sum = partial(_joined, operator.add, 0.0)
_product = partial(_joined, operator.mul, 1.0)


def _of(function: Callable[[float], float], inner: Form) -> Form:
    if callable(inner):
        return lambda parameters: function(inner(parameters))
    return value_at(lambda _: function(inner), ())


def _power(base: float, power: float) -> float:
    if base < 0.0 and not power.is_integer():
        raise ValueError("a fractional power of a negative number")
    return base**power


def _scaled(slopes: dict[int, Form], factor: Form) -> dict[int, Form]:
    return {place: _product(slope, factor) for place, slope in slopes.items()}


def _summed(one: dict[int, Form], other: dict[int, Form]) -> dict[int, Form]:
    return one | {place: _sum(one.get(place, 0.0), slope) for place, slope in other.items()}


def _plus(one: Dual, other: Dual) -> Dual:
    return _sum(one[0], other[0]), _summed(one[1], other[1])


def _times(one: Dual, other: Dual) -> Dual:
    (a, da), (b, db) = one, other
    return _product(a, b), _summed(_scaled(da, b), _scaled(db, a))


def _over(one: Dual, other: Dual) -> Dual:
    (a, da), (b, db) = one, other
    inverse = _of(lambda x: 1.0 / x, b)
    slope = _product(-1.0, _product(a, _of(lambda x: 1.0 / x**2, b)))
    return _product(a, inverse), _summed(_scaled(da, inverse), _scaled(db, slope))


def _applied(
    function: Callable[[float], float], derivative: Callable[[float], float], argument: Dual
) -> Dual:
    return _of(function, argument[0]), _scaled(argument[1], _of(derivative, argument[0]))


class Entry(NamedTuple):
    """One nonzero matrix entry or delay."""

    matrix: str
    row: int
    column: int
    expression: Expression


class Dependence(NamedTuple):
    """Derivative of a matrix entry by a parameter, given by its index."""

    place: int
    matrix: str
    row: int
    column: int
    slope: Form


class Program:
    """Compiled matrices and delays; `names` in the order of `fill`, `free` (n_free,) indices."""

    def __init__(
        self,
        names: Sequence[str],
        free: Sequence[str],
        shapes: Mapping[str, tuple[int, int]],
        entries: Sequence[Entry],
        constants: Mapping[str, float],
    ) -> None:
        self.names = tuple(names)
        places = {name: k for k, name in enumerate(names)}
        self.free = np.array([places[name] for name in free], dtype=np.intp)
        self._shapes = dict(shapes)
        self._values: list[tuple[str, int, int, Form]] = []
        self.dependences: list[Dependence] = []
        for matrix, row, column, expression in entries:
            value, slopes = expression.compiled(places, constants)
            self._values.append((matrix, row, column, value))
            self.dependences += [
                Dependence(place, matrix, row, column, slope)
                for place, slope in slopes.items()
                if slope != 0.0
            ]

    def ordered(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return parameters as `fill` takes them, (n_parameter,). Raises UnknownNameError."""
        check_known("parameter", self.names, values)
        return np.array([values[name] for name in self.names], dtype=np.float64)

    def fill(self, parameters: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return each matrix by name for parameters, (n_parameter,); undefined entries are nan."""
        filled = {name: np.zeros(shape) for name, shape in self._shapes.items()}
        listed = parameters.tolist()
        for matrix, row, column, value in self._values:
            filled[matrix][row, column] = value_at(value, listed)
        return filled
