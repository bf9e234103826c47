"""Arithmetic in parameter names, such as "-tau_f" or "N_v * Y_ped", with exact derivatives.

Text is parsed into a tree that may hold numbers, names, + - * / **, and a few functions;
anything else is refused. Nothing is ever executed as Python.
"""

import ast
import math
from collections.abc import Callable, Mapping

from helisim.errors import InputError, UnknownNameError

Gradient = dict[str, float]
Dual = tuple[float, Gradient]
"""A value with its derivatives by name (forward differentiation)."""

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


class Expression:
    """One parsed expression. `names` are the parameters it uses."""

    def __init__(self, text: str | float) -> None:
        self.text = str(text).strip()
        self._tree = _parse(self.text)
        self.names = frozenset(
            node.id
            for node in ast.walk(self._tree)
            if isinstance(node, ast.Name) and node.id not in FUNCTIONS
        )

    def __repr__(self) -> str:
        return f"Expression({self.text!r})"

    def evaluate(self, values: Mapping[str, float]) -> Dual:
        """Return the value and its derivatives by name; nan where it is undefined.

        Raises:
            UnknownNameError: a name has no value.
        """
        try:
            return _evaluate(self._tree, values)
        except (ZeroDivisionError, OverflowError, ValueError) as error:
            if isinstance(error, UnknownNameError):
                raise
            return math.nan, dict.fromkeys(self.names, math.nan)


def _parse(text: str) -> ast.expr:
    if not text or len(text) > _LONGEST:
        raise InputError(f"expression has {len(text)} characters, expected 1 to {_LONGEST}")
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError):
        raise InputError(f"can't read the expression {text!r}; allowed are {_ALLOWED}") from None
    _check(tree, text)
    return tree


def _check(node: ast.expr, text: str) -> None:
    match node:
        case ast.Constant(value=int() | float() as value) if _is_number(value):
            return
        case ast.Name():
            if node.id in FUNCTIONS:
                raise InputError(f"function {node.id!r} needs an argument in {text!r}")
        case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
            _check(node.operand, text)
        case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div()):
            _check(node.left, text)
            _check(node.right, text)
        case ast.BinOp(op=ast.Pow()):
            _check(node.left, text)
            if _literal(node.right) is None:
                raise InputError(f"a power needs a number as exponent in {text!r}")
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
            _check(argument, text)
        case _:
            raise InputError(
                f"{ast.unparse(node)!r} isn't allowed in the expression {text!r}; "
                f"allowed are {_ALLOWED}"
            )


def _literal(node: ast.expr) -> float | None:
    match node:
        case ast.Constant(value=int() | float() as value) if _is_number(value):
            return float(value)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = _literal(operand)
            return None if inner is None else -inner
    return None


def _is_number(value: float) -> bool:
    return not isinstance(value, bool) and math.isfinite(value)


def _evaluate(node: ast.expr, values: Mapping[str, float]) -> Dual:
    match node:
        case ast.Constant(value=int() | float() as value):
            return float(value), {}
        case ast.Name(id=name):
            if name not in values:
                raise UnknownNameError("parameter", name, values)
            return values[name], {name: 1.0}
        case ast.UnaryOp(op=op, operand=operand):
            value, gradient = _evaluate(operand, values)
            sign = -1.0 if isinstance(op, ast.USub) else 1.0
            return sign * value, _scaled(gradient, sign)
        case ast.Call(func=ast.Name(id=name), args=[argument]):
            value, gradient = _evaluate(argument, values)
            function, derivative = FUNCTIONS[name]
            return function(value), _scaled(gradient, derivative(value))
        case ast.BinOp(left=left, op=op, right=right):
            return _binary(op, _evaluate(left, values), _evaluate(right, values))
    raise InputError(f"{ast.unparse(node)!r} isn't an expression")


def _binary(op: ast.operator, left: Dual, right: Dual) -> Dual:
    (a, da), (b, db) = left, right
    match op:
        case ast.Add():
            return a + b, _sum(da, db)
        case ast.Sub():
            return a - b, _sum(da, _scaled(db, -1.0))
        case ast.Mult():
            return a * b, _sum(_scaled(da, b), _scaled(db, a))
        case ast.Div():
            return a / b, _sum(_scaled(da, 1.0 / b), _scaled(db, -a / b**2))
    if a < 0.0 and not b.is_integer():
        raise ValueError("a fractional power of a negative number")
    return a**b, _scaled(da, b * a ** (b - 1.0))


def _scaled(gradient: Gradient, factor: float) -> Gradient:
    return {name: factor * slope for name, slope in gradient.items()}


def _sum(first: Gradient, second: Gradient) -> Gradient:
    total = dict(first)
    for name, slope in second.items():
        total[name] = total.get(name, 0.0) + slope
    return total
