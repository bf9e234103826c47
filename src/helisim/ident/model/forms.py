"""Closures of arithmetic with their exact derivatives, folded where they are numbers.

A form is a number, or a function of a list of parameters. With numbers folded, what is affine in
the parameters has derivatives that are numbers, so they are known before any parameter is.
"""

import math
from collections.abc import Callable, Sequence
from operator import itemgetter

Form = float | Callable[[Sequence[float]], float]

Dual = tuple[Form, dict[int, Form]]
"""A value and its derivatives by the parameters' places."""


def value_at(form: Form, parameters: Sequence[float]) -> float:
    """Return a form's value; nan where it is undefined."""
    if not callable(form):
        return form
    try:
        return form(parameters)
    except (ZeroDivisionError, OverflowError, ValueError):
        return math.nan


def picked(place: int) -> Dual:
    """Return the parameter at a place."""
    return itemgetter(place), {place: 1.0}


def added(one: Dual, other: Dual) -> Dual:
    """Return the sum."""
    return _sum(one[0], other[0]), _summed(one[1], other[1])


def multiplied(one: Dual, other: Dual) -> Dual:
    """Return the product."""
    (a, da), (b, db) = one, other
    return _product(a, b), _summed(_scaled(da, b), _scaled(db, a))


def divided(one: Dual, other: Dual) -> Dual:
    """Return the quotient."""
    (a, da), (b, db) = one, other
    inverse = _of(lambda x: 1.0 / x, b)
    slope = _product(-1.0, _product(a, _of(lambda x: 1.0 / x**2, b)))
    return _product(a, inverse), _summed(_scaled(da, inverse), _scaled(db, slope))


def powered(base: Dual, exponent: float) -> Dual:
    """Return a power; a negative number has whole ones only."""
    value, slopes = base
    slope = _of(lambda x: exponent * _power(x, exponent - 1.0), value)
    return _of(lambda x: _power(x, exponent), value), _scaled(slopes, slope)


def applied(
    function: Callable[[float], float], derivative: Callable[[float], float], argument: Dual
) -> Dual:
    """Return a function of a form, given its derivative."""
    value, slopes = argument
    return _of(function, value), _scaled(slopes, _of(derivative, value))


def _power(base: float, exponent: float) -> float:
    if base < 0.0 and not exponent.is_integer():
        raise ValueError("a fractional power of a negative number")
    return base**exponent


def _of(function: Callable[[float], float], inner: Form) -> Form:
    if not callable(inner):
        return value_at(lambda _: function(inner), ())
    return lambda parameters: function(inner(parameters))


def _sum(a: Form, b: Form) -> Form:
    if not callable(a) and not callable(b):
        return a + b
    if not callable(a):
        a, b = b, a
    assert callable(a)  # two numbers are added above
    if not callable(b):
        return a if b == 0.0 else lambda parameters: a(parameters) + b
    return lambda parameters: a(parameters) + b(parameters)


def _product(a: Form, b: Form) -> Form:
    if not callable(a) and not callable(b):
        return a * b
    if not callable(a):
        a, b = b, a
    assert callable(a)  # two numbers are multiplied above
    if not callable(b):
        return a if b == 1.0 else lambda parameters: a(parameters) * b
    return lambda parameters: a(parameters) * b(parameters)


def _scaled(slopes: dict[int, Form], factor: Form) -> dict[int, Form]:
    return {place: _product(slope, factor) for place, slope in slopes.items()}


def _summed(one: dict[int, Form], other: dict[int, Form]) -> dict[int, Form]:
    total = dict(one)
    for place, slope in other.items():
        total[place] = _sum(total.get(place, 0.0), slope)
    return total
