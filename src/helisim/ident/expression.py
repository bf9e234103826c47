"""Arithmetic in parameter names, such as "-tau_f" or "N_v * Y_ped", with exact derivatives.

Text is parsed into a tree that may hold numbers, names, + - * / **, and a few functions; anything
else is refused. Nothing is executed as Python: the tree becomes closures over a list of parameters.
Numbers are folded, so what is affine in the parameters has derivatives that are numbers.
"""

import ast
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError

FUNCTIONS: dict[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "sqrt": (math.sqrt, lambda x: 0.5 / math.sqrt(x)),
    "exp": (math.exp, math.exp),
    "log": (math.log, lambda x: 1.0 / x),
    "sin": (math.sin, math.cos),
    "cos": (math.cos, lambda x: -math.sin(x)),
}
"""Each function that an expression may use, with its derivative."""

_LONGEST = 200
_ALLOWED = "numbers, parameter names, + - * / ** ( ) and " + ", ".join(FUNCTIONS)

Form = float | Callable[[Sequence[float]], float]
"""A number, or a function of a list of parameters."""
Dual = tuple[Form, dict[int, Form]]
"""A value and its derivatives by the parameters' places."""


class Expression:
    """One parsed expression. `names` are the parameters it uses."""

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
        _ = self._own  # which refuses what isn't allowed

    def __repr__(self) -> str:
        return f"Expression({self.text!r})"

    def evaluate(self, values: Mapping[str, float]) -> tuple[float, dict[str, float]]:
        """Return the value and its derivatives by name; nan where it is undefined.

        Raises:
            UnknownNameError: a name has no value.
        """
        order, (value, slopes) = self._own
        for name in order:
            if name not in values:
                raise UnknownNameError("parameter", name, values)
        at = [values[name] for name in order]
        found = value_at(value, at)
        if math.isnan(found):
            return found, dict.fromkeys(order, math.nan)
        return found, {order[k]: value_at(slope, at) for k, slope in slopes.items()}

    def compiled(self, places: Mapping[str, int], constants: Mapping[str, float]) -> Dual:
        """Return the value and its derivatives as functions of a list of parameters.

        Args:
            places: each parameter's place in that list.
            constants: names that are numbers.
        """
        return self._compiled(self.tree, places, constants)

    @cached_property
    def _own(self) -> tuple[list[str], Dual]:
        order = sorted(self.names)
        return order, self.compiled({name: k for k, name in enumerate(order)}, {})

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
                slope = partial(_slope_of_power, power=power)
                return _applied(partial(_power, power=power), slope, compiled(left))
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
    """Return a form's value; nan where it is undefined."""
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
    """Return a commutative operation's form; what is neutral to it changes nothing."""
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


def _slope_of_power(base: float, power: float) -> float:
    return power * _power(base, power - 1.0)


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
    """One matrix entry or delay that isn't zero."""

    matrix: str
    row: int
    column: int
    expression: Expression


class Dependence(NamedTuple):
    """How one matrix entry depends on one parameter, by its place."""

    place: int
    matrix: str
    row: int
    column: int
    slope: Form


class Program:
    """A structure's matrices and delays, compiled once to be filled with parameters many times.

    All stand in one array. Entries that are affine in the parameters, nearly all of them, are
    filled by one product with a constant matrix.

    Attributes:
        names: the parameters, in the order in which `fill` takes them.
        free: (n_free,) places of the free ones among them.
        dependences: every entry that depends on a parameter.
    """

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
        ends = np.cumsum([rows * columns for rows, columns in shapes.values()]).tolist()
        self._slices = {
            matrix: (slice(end - shape[0] * shape[1], end), shape)
            for (matrix, shape), end in zip(shapes.items(), ends)
        }
        self._base = np.zeros(ends[-1])
        self._others: list[tuple[int, Form]] = []
        self.dependences: list[Dependence] = []
        affine: dict[int, dict[int, Form]] = {}
        for matrix, row, column, expression in entries:
            value, slopes = expression.compiled(places, constants)
            at = self._slices[matrix][0].start + row * shapes[matrix][1] + column
            if any(map(callable, slopes.values())):
                self._others.append((at, value))
            else:
                self._base[at] = value_at(value, [0.0] * len(names))
                affine |= {at: slopes} if slopes else {}
            self.dependences += [
                Dependence(place, matrix, row, column, slope)
                for place, slope in slopes.items()
                if slope != 0.0
            ]
        self._at = np.array(list(affine), dtype=np.intp)
        self._linear = np.zeros((len(affine), len(names)))
        for row, slopes in enumerate(affine.values()):
            for place, slope in slopes.items():
                self._linear[row, place] = value_at(slope, ())

    def ordered(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return parameters as `fill` takes them, (n_parameter,).

        Raises UnknownNameError if one is missing.
        """
        for name in self.names:
            if name not in values:
                raise UnknownNameError("parameter", name, values)
        return np.array([values[name] for name in self.names], dtype=np.float64)

    def fill(self, parameters: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return each matrix by name; an entry that is undefined is nan.

        Args:
            parameters: (n_parameter,) in the order of `names`.
        """
        flat = self._base.copy()
        flat[self._at] += self._linear @ parameters
        listed = parameters.tolist() if self._others else []
        for at, value in self._others:
            flat[at] = value_at(value, listed)
        return {name: flat[at].reshape(shape) for name, (at, shape) in self._slices.items()}
