"""Arithmetic in parameter names, such as "-tau_f" or "N_v * Y_ped", with exact derivatives.

Text is parsed into a tree that may hold numbers, names, + - * / **, and a few functions;
anything else is refused. Nothing is ever executed as Python: the tree is turned into closures.
"""

import ast
import math
from collections.abc import Callable, Mapping
from functools import cached_property

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident.model.forms import (
    Dual,
    added,
    applied,
    divided,
    multiplied,
    picked,
    powered,
    value_at,
)

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
        return _compiled(self._tree, places, constants)

    @cached_property
    def _own(self) -> tuple[tuple[str, ...], Dual]:
        order = tuple(sorted(self.names))
        return order, self.compiled({name: k for k, name in enumerate(order)}, {})


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


def _compiled(node: ast.expr, places: Mapping[str, int], constants: Mapping[str, float]) -> Dual:
    match node:
        case ast.Constant(value=int() | float() as value):
            return float(value), {}
        case ast.Name(id=name):
            return (constants[name], {}) if name in constants else picked(places[name])
        case ast.UnaryOp(op=op, operand=operand):
            sign = -1.0 if isinstance(op, ast.USub) else 1.0
            return multiplied((sign, {}), _compiled(operand, places, constants))
        case ast.Call(func=ast.Name(id=name), args=[argument]):
            return applied(*FUNCTIONS[name], _compiled(argument, places, constants))
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return powered(_compiled(left, places, constants), _literal(right) or 0.0)
        case ast.BinOp(left=left, op=op, right=right):
            one, other = (_compiled(side, places, constants) for side in (left, right))
            match op:
                case ast.Add():
                    return added(one, other)
                case ast.Sub():
                    return added(one, multiplied((-1.0, {}), other))
                case ast.Mult():
                    return multiplied(one, other)
                case _:
                    return divided(one, other)
    raise InputError(f"{ast.unparse(node)!r} isn't an expression")
