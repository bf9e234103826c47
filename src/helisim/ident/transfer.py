"""Transfer functions with a delay as structures: by order, or in factors, McRuer's notation.

What stands in a factor says what its parameter is called or where it starts, and a 0 is a free
integrator, or differentiator:

    (a)             s + a, rad/s; a negative a is to the right of the axis
    (1/T)           s + 1/T, T in s and positive
    [zeta, omega]   s^2 + 2 zeta omega s + omega^2; above zeta = 1 two real ones
    (2.5), [0.3,5]  the same, with that start and a name by kind
    (0)             s

A numerator of 1 has no factors. The gain K in front is that at high frequency, where the response
is K over a power of s. A name that stands more than once is numbered: (a)(a) has a1 and a2.
"""

import math
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.ident.structure import DELAYS, MATRICES, Parameter, Structure

_DELAY_BOUNDS = (-0.3, 5.0)
"""s: a skewed recorder can let a channel lead; two cycles of a large vehicle's slow band last as
long. How far a search looks depends on the band, see `rational.delay_grid`."""
_LEGEND = "in factors: (a) = s + a, [zeta, omega] = s^2 + 2 zeta omega s + omega^2"
_EXAMPLE = "such as (a)/[zeta,omega](0) or 1/(1/T)(2.5)"
_FACTOR = re.compile(r"\s*(?:\((?P<one>[^()\[\]]*)\)|\[(?P<two>[^()\[\]]*)\])")
_BRACKETS = r"(?:\s*(?:\([^()\[\]]*\)|\[[^()\[\]]*\]))"
_NOTATION = re.compile(rf"({_BRACKETS}*|\s*1)\s*/({_BRACKETS}+|\s*1)\s*")
_DAMPING = (-2.0, 5.0)
"""Bounds of a damping ratio: from far to the right of the axis to two real ones a hundred apart."""
_FREQUENCIES, _TIMES = (1e-3, 1e4), (1e-4, 1e3)
"""Bounds of a natural frequency, rad/s, and of a time constant, s: beyond any record of a
vehicle on both sides."""
_APART = 3.0
"""Factors of one kind start so many times apart: from equal starts they would move together."""
_KINDS = {
    "a": ("({0})", ("{0}",)),
    "T": ("(1/{0})", ("1/{0}",)),
    "2": ("[{0}, {1}]", ("{1}**2", "2*{0}*{1}")),
    "0": ("(0)", ("0",)),
}
"""Each kind of factor as text, and its coefficients from s^0 up without the leading 1."""


def delay_parameter(name: str, meaning: str) -> Parameter:
    """Return a delay of either sign."""
    return Parameter(name, "s", 0.0, _DELAY_BOUNDS, meaning, 0.03)


def transfer_function(
    *,
    zeros: int,
    poles: int,
    input: str,
    output: str,
    delay: str | None = "tau",
    name: str | None = None,
    frequency: float = 5.0,
) -> Structure:
    """Return (b_m s^m + ... + b0) e^(-tau s) / (s^n + a_(n-1) s^(n-1) + ... + a0).

    Args:
        zeros: order m of the numerator.
        poles: order n of the denominator, at least m.
        input: name of the input.
        output: name of the output.
        delay: name of the delay, of either sign; None for no delay.
        name: name of the structure.
        frequency: rad/s, where the poles are first looked for.
    """
    if not 0 <= zeros <= poles:
        raise InputError(
            f"a transfer function has {zeros} zeros and {poles} poles; expected 0 <= zeros <= poles"
        )
    starts = [1.0, 2.0**0.5] if poles == 2 else [1.0]  # of well-damped poles
    for k in range(len(starts) - 1, poles - 1):
        starts.append(starts[-1] * (poles - k) / (k + 1.0))
    numerator = [Parameter(f"b{k}", "", 1.0, None, f"numerator, s^{k}") for k in range(zeros + 1)]
    denominator = [
        Parameter(
            f"a{k}",
            "1/s" if poles - k == 1 else f"1/s^{poles - k}",
            starts[k] * frequency ** (poles - k),
            None,
            f"denominator, s^{k}",
        )
        for k in range(poles)
    ]
    gains = [f"b{k}" if k <= zeros else "0" for k in range(poles)]
    if zeros == poles:
        gains = [f"b{k} - a{k}*b{poles}" for k in range(poles)]
    # Observable form: the numerator enters G alone, so it is solved from the data first.
    rows = [["1" if j == k - 1 else "0" for j in range(poles)] for k in range(poles)]
    for k in range(poles):
        rows[k][-1] = f"-a{k}"
    return _structure(
        (input, output, delay, name),
        f"transfer function with {zeros} zeros and {poles} poles",
        [*reversed(numerator), *reversed(denominator)],
        (rows, gains, ["0"] * (poles - 1) + ["1"] * (poles > 0)),
        f"b{poles}" if zeros == poles else "0",
    )


def first_order_delay(*, input: str, output: str, name: str | None = None) -> Structure:
    """Return b0 e^(-tau s) / (s + a0)."""
    return transfer_function(zeros=0, poles=1, input=input, output=output, name=name)


def second_order_delay(
    *, input: str, output: str, zeros: int = 0, name: str | None = None
) -> Structure:
    """Return (b1 s + b0) e^(-tau s) / (s^2 + a1 s + a0); b1 only with `zeros=1`."""
    return transfer_function(zeros=zeros, poles=2, input=input, output=output, name=name)


def factored(
    notation: str,
    *,
    input: str,
    output: str,
    delay: str | None = "tau",
    gain: str = "K",
    name: str | None = None,
    frequency: float = 5.0,
) -> Structure:
    """Return a transfer function in factors, with a delay, such as "(a)/[zeta,omega](0)".

    Args:
        notation: the factors of the numerator, a slash, those of the denominator; see
            `helisim.ident.transfer`.
        input: name of the input.
        output: name of the output.
        delay: name of the delay, of either sign; None for no delay.
        gain: name of the gain at high frequency.
        name: name of the structure.
        frequency: rad/s, around which factors without a number begin.

    Raises:
        InputError: the notation can't be read, or the numerator's order is above the denominator's.
    """
    above, below = _parsed(notation)
    zeros, poles = (sum(len(factor.polynomial) for factor in side) for side in (above, below))
    if zeros > poles:
        raise InputError(
            f"{notation!r} has a numerator of order {zeros} over a denominator of order {poles}; "
            "expected at most as high a one"
        )
    rows, driven, seen, feed = _chain(above, below)
    top, bottom = ("".join(map(str, side)) for side in (above, below))
    return _structure(
        (input, output, delay, name),
        f"{gain}{top}/{bottom or '1'}, {_LEGEND}",
        [
            Parameter(gain, "", 1.0, None, "gain at high frequency"),
            *_parameters(above, "numerator", frequency),
            *_parameters(below, "denominator", frequency),
        ],
        (rows, [gain if one else "0" for one in driven], seen),
        gain if feed else "0",
    )


def _structure(
    signals: tuple[str, str, str | None, str | None],
    meaning: str,
    parameters: Sequence[Parameter],
    states: tuple[list[list[str]], list[str], list[str]],
    feed: str,
) -> Structure:
    (input, output, delay, name), (rows, gains, seen) = signals, states
    late = [delay_parameter(delay, "delay")] if delay else []
    return Structure(
        name=name or f"{output}_over_{input}",
        meaning=meaning,
        parameters=(*parameters, *late),
        states=tuple(f"x{k}" for k in range(len(rows))),
        inputs=(input,),
        outputs=(output,),
        F=tuple(map(tuple, rows)),
        G=tuple((gain,) for gain in gains),
        H0=(tuple(seen),),
        D=((feed,),),
        input_delays={input: delay} if delay else {},
    )


class Rational(NamedTuple):
    """How the parameters of a transfer function follow from the polynomials of a rational fit.

    Attributes:
        zeros, poles: orders of the polynomials that are sought.
        delay: the delay's name, if it has one.
        values: parameters for a numerator and a denominator, each (n_order,) from s^0 up.
        names: the parameters that are the coefficients, numerator and denominator without its
            leading 1, each from s^0 up; empty where the parameters are those of factors.
        power: of s by which the response is to be multiplied first.
    """

    zeros: int
    poles: int
    delay: str | None
    values: Callable[[NDArray[np.float64], NDArray[np.float64]], dict[str, float]]
    names: tuple[str, ...] = ()
    power: int = 0


def rational_form(structure: Structure) -> Rational | None:
    """Return how a structure's parameters follow from polynomials; None where they don't."""
    if len(structure.inputs) != 1 or len(structure.outputs) != 1:
        return None
    delay = structure.input_delays.get(structure.inputs[0])
    if delay not in (None, *structure.names):  # an expression, such as that of a block in series
        return None
    names = {"input": structure.inputs[0], "output": structure.outputs[0], "delay": delay}
    poles = len(structure.states)
    zeros = len(structure.names) - poles - 1 - (delay is not None)
    if 0 <= zeros <= poles and _same(
        structure, transfer_function(zeros=zeros, poles=poles, **names)
    ):
        own = (*(f"b{k}" for k in range(zeros + 1)), *(f"a{k}" for k in range(poles)))
        return Rational(
            zeros,
            poles,
            delay,
            lambda b, a: dict(zip(own, [*b.tolist(), *a[:poles].tolist()])),
            own,
        )
    text, _, legend = structure.meaning.partition(", in factors")
    if not legend or any(one.fixed for one in structure.parameters if one.name != delay):
        return None
    gain = structure.names[0]
    notation = text.removeprefix(gain)
    try:
        made = factored(notation, gain=gain, **names)
    except InputError:
        return None
    if not _same(structure, made):
        return None
    above, below = _parsed(notation)
    sought = [[one for one in side if one.kind != "0"] for side in (above, below)]
    zeros, poles = (sum(len(one.polynomial) for one in side) for side in sought)

    def values(b: NDArray[np.float64], a: NDArray[np.float64]) -> dict[str, float]:
        roots = np.roots(b[::-1]), np.roots(a[::-1])
        return {gain: float(b[-1])} | _assigned(above, roots[0]) | _assigned(below, roots[1])

    free = [sum(one.kind == "0" for one in side) for side in (above, below)]
    return Rational(zeros, poles, delay, values, power=free[1] - free[0])


def _same(structure: Structure, made: Structure) -> bool:
    parts = ("names", *MATRICES, *DELAYS)
    return all(getattr(structure, part) == getattr(made, part) for part in parts)


class _Factor(NamedTuple):
    """One factor: its kind, its parameters' names, and where they begin, as given or None."""

    kind: str
    names: tuple[str, ...] = ()
    starts: tuple[float | None, ...] = ()

    @property
    def polynomial(self) -> tuple[str, ...]:
        return tuple(one.format(*self.names) for one in _KINDS[self.kind][1])

    def __str__(self) -> str:
        return _KINDS[self.kind][0].format(*self.names)


def _parsed(notation: str) -> tuple[list[_Factor], list[_Factor]]:
    """Return the factors above and below the slash, names that stand twice numbered."""
    found = _NOTATION.fullmatch(notation.strip().removeprefix("K"))
    if found is None:
        raise InputError(
            f"can't read {notation!r}; expected factors of the numerator, or 1, a slash, and those "
            f"of the denominator, or 1, {_EXAMPLE}"
        )
    sides = [[_factor(one, notation) for one in _FACTOR.finditer(side)] for side in found.groups()]
    names = [name for side in sides for factor in side for name in factor.names]
    counts = {name: iter(range(1, len(names) + 1)) for name in names if names.count(name) > 1}
    above, below = (
        [
            one._replace(
                names=tuple(f"{x}{next(counts[x])}" if x in counts else x for x in one.names)
            )
            for one in side
        ]
        for side in sides
    )
    return above, below


def _factor(match: re.Match[str], notation: str) -> _Factor:
    if match["two"] is not None:
        parts, kinds = match["two"].split(","), ("zeta", "omega")
        if len(parts) != 2:
            raise InputError(
                f"factor [{match['two']}] of {notation!r} has {len(parts)} entries, expected two: "
                "[zeta, omega]"
            )
    else:
        text = match["one"].strip()
        parts, kinds = ([text[2:]], ("T",)) if text.startswith("1/") else ([text], ("a",))
    names, starts = zip(*(_entry(part.strip(), kind, notation) for part, kind in zip(parts, kinds)))
    if kinds != ("a",) and starts[-1] is not None and starts[-1] <= 0.0:
        raise InputError(f"{kinds[-1]} of {match[0].strip()} in {notation!r} isn't positive")
    if kinds == ("a",) and starts == (0.0,):
        return _Factor("0")
    return _Factor("2" if len(parts) == 2 else kinds[0], names, starts)


def _entry(text: str, kind: str, notation: str) -> tuple[str, float | None]:
    """Return a parameter's name and its start, one of which is given."""
    try:
        number = float(text)
    except ValueError:
        if not text.isidentifier():
            raise InputError(
                f"{text!r} in {notation!r} is neither a name nor a number; {_EXAMPLE}"
            ) from None
        return text, None
    if not math.isfinite(number):
        raise InputError(f"{text!r} in {notation!r} isn't a finite number")
    return kind, number


def _parameters(side: Sequence[_Factor], where: str, frequency: float) -> list[Parameter]:
    sought = [factor for factor in side if factor.kind != "0"]
    found = []
    for k, factor in enumerate(sought):
        place = frequency * _APART ** (k - (len(sought) - 1) / 2)
        usual = {"2": (0.5, place), "T": (1.0 / place,), "a": (place,)}[factor.kind]
        starts = [own if own is not None else one for own, one in zip(factor.starts, usual)]
        damping = min(_DAMPING[0], 2 * starts[0]), max(_DAMPING[1], 2 * starts[0])
        for name, start, (unit, bounds, kind, scale) in zip(
            factor.names,
            starts,
            {
                "2": [("1", damping, "damping", 0.5), ("rad/s", _FREQUENCIES, "frequency", None)],
                "T": [("s", _TIMES, "time constant", None)],
                "a": [("rad/s", None, "break", None)],
            }[factor.kind],
        ):
            meaning = f"{kind} of {factor} of the {where}"
            found.append(Parameter(name, unit, start, bounds, meaning, scale))
    return found


def _chain(
    above: Sequence[_Factor], below: Sequence[_Factor]
) -> tuple[list[list[str]], list[bool], list[str], bool]:
    """Return F, which states the input drives, what the output sees of the states and the input.

    The factors are sections in a row, of second order as far as they go, each driven by what the
    one before gives: s^2 x = v - c1 s x - c0 x gives (s^2 + b1 s + b0) x, or less.
    """
    tops, bottoms = _sections(above, below)
    size = sum(map(len, bottoms))
    rows = [["0"] * size for _ in range(size)]
    driven = [False] * size
    seen, feed, at = ["0"] * size, True, 0
    for top, bottom in zip(tops, bottoms):
        order = len(bottom)
        last = at + order - 1
        rows[at][last] = "1"  # of a second order; overwritten below in a first-order section
        rows[last], driven[last] = [*seen], feed
        rows[last][at : last + 1] = [f"-({coefficient})" for coefficient in bottom]
        if len(top) == order:
            seen[at : last + 1] = [f"({b})-({c})" for b, c in zip(top, bottom)]
        else:
            seen, feed = ["0"] * size, False
            seen[at : at + len(top) + 1] = [*top, "1"]
        at += order
    return rows, driven, seen, feed


def _sections(
    above: Sequence[_Factor], below: Sequence[_Factor]
) -> tuple[list[tuple[str, ...]], list[tuple[str, ...]]]:
    """Return each section's numerator and denominator, from s^0 up, without the leading 1."""
    tall, low = ([one.polynomial for one in below if len(one.polynomial) == n] for n in (2, 1))
    while len(low) > 1:
        tall.append(_times(low.pop(0), low.pop(0)))
    bottoms = [*tall, *low]
    tops: list[tuple[str, ...]] = [()] * len(bottoms)
    for k, factor in enumerate(one for one in above if one.kind == "2"):
        tops[k] = factor.polynomial
    for factor in above:
        if factor.kind != "2":
            k = next(k for k, top in enumerate(tops) if len(top) < len(bottoms[k]))
            tops[k] = _times(tops[k], factor.polynomial) if tops[k] else factor.polynomial
    return tops, bottoms


def _times(one: tuple[str, ...], other: tuple[str, ...]) -> tuple[str, ...]:
    """Return the product of s + a and s + b."""
    return f"({one[0]})*({other[0]})", f"({one[0]})+({other[0]})"


def _assigned(side: Sequence[_Factor], roots: NDArray) -> dict[str, float]:
    """Return the parameters of the factors that have these roots.

    Pairs go to second-order factors, real roots to the others, each the slower the sooner it
    stands; where there are too few of a kind, a near one stands in.
    """
    pairs = sorted(((z, z.conjugate()) for z in roots if z.imag > 0.0), key=lambda p: abs(p[0]))
    reals = sorted((complex(z.real) for z in roots if z.imag == 0.0), key=abs)
    seconds = sum(factor.kind == "2" for factor in side)
    while len(pairs) > seconds:  # a pair stands in for two real ones
        one = pairs.pop()[0]
        reals += [complex(one.real - 0.5 * abs(one)), complex(one.real + 0.5 * abs(one))]
        reals.sort(key=abs)
    while len(pairs) < seconds:  # two real ones, the nearest, are a pair
        k = min(range(len(reals) - 1), key=lambda k: abs(reals[k + 1]) / max(abs(reals[k]), 1e-9))
        pairs.append((reals.pop(k), reals.pop(k)))
        pairs.sort(key=lambda pair: abs(pair[0] * pair[1]))
    found: dict[str, float] = {}
    for factor in (one for one in side if one.kind != "0"):
        if factor.kind == "2":
            one, other = pairs.pop(0)
            omega = math.sqrt(max(abs(one * other), _FREQUENCIES[0] ** 2))
            found[factor.names[0]] = -(one + other).real / (2.0 * omega)
            found[factor.names[1]] = omega
        else:
            a = -reals.pop(0).real
            time = 1.0 / a if a > 1.0 / _TIMES[1] else _TIMES[1]
            found[factor.names[0]] = a if factor.kind == "a" else time
    return found
