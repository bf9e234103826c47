"""Transfer functions in factors, such as (a)/[zeta,omega](0); see `helisim.ident.model.factor`."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.ident.model.factor import Factor, parsed
from helisim.ident.model.structure import Parameter, Structure
from helisim.ident.model.transfer import Coefficients, coefficients, delay_parameter

_LEGEND = "in factors: (a) = s + a, [zeta, omega] = s^2 + 2 zeta omega s + omega^2"

_DAMPING = (-2.0, 5.0)
"""Bounds of a damping ratio: from far to the right of the axis to two real ones a hundred apart."""

_FREQUENCIES = (1e-3, 1e4)
"""Rad/s, bounds of a natural frequency: beyond any record of a vehicle on both sides."""

_TIMES = (1e-4, 1e3)
"""Bounds of a time constant, s, likewise."""

_APART = 3.0
"""Factors of one kind start so many times apart: from equal starts they would move together."""


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
            `helisim.ident.model.factor`.
        input: name of the input.
        output: name of the output.
        delay: name of the delay, of either sign; None for no delay.
        gain: name of the gain at high frequency.
        name: name of the structure.
        frequency: rad/s, around which factors without a number begin.

    Raises:
        InputError: the notation can't be read, or the numerator's order is above the denominator's.
    """
    above, below = parsed(notation)
    zeros, poles = (sum(factor.order for factor in side) for side in (above, below))
    if zeros > poles:
        raise InputError(
            f"{notation!r} has a numerator of order {zeros} over a denominator of order {poles}; "
            "expected at most as high a one"
        )
    wait = [delay_parameter(delay, "delay")] if delay else []
    rows, driven, seen, feed = _chain(above, below)
    top, bottom = ("".join(map(str, side)) for side in (above, below))
    return Structure(
        name=name or f"{output}_over_{input}",
        meaning=f"{gain}{top}/{bottom or '1'}, {_LEGEND}",
        parameters=(
            Parameter(gain, "", 1.0, None, "gain at high frequency"),
            *_parameters(above, "numerator", frequency),
            *_parameters(below, "denominator", frequency),
            *wait,
        ),
        states=tuple(f"x{k}" for k in range(poles)),
        inputs=(input,),
        outputs=(output,),
        F=tuple(tuple(row) for row in rows),
        G=tuple((gain if one else "0",) for one in driven),
        H0=(tuple(seen),),
        D=((gain if feed else "0",),),
        input_delays={input: delay} if delay else {},
    )


class Factors(NamedTuple):
    """A structure that `factored` made, for the rational fits that it can begin from.

    Attributes:
        gain: the gain's name.
        above: factors of the numerator.
        below: factors of the denominator.
        delay: the delay's name, if it has one.
    """

    gain: str
    above: tuple[Factor, ...]
    below: tuple[Factor, ...]
    delay: str | None

    @property
    def zeros(self) -> int:
        """Order of the numerator that is sought."""
        return sum(factor.order for factor in self.above if factor.kind != "0")

    @property
    def poles(self) -> int:
        """Order of the denominator that is sought."""
        return sum(factor.order for factor in self.below if factor.kind != "0")

    @property
    def power(self) -> int:
        """The power of s by which the response is to be multiplied first."""
        free = [sum(factor.kind == "0" for factor in side) for side in (self.above, self.below)]
        return free[1] - free[0]

    def values(
        self, numerator: NDArray[np.float64], denominator: NDArray[np.float64]
    ) -> dict[str, float]:
        """Return parameters for polynomials, each (n_order,) from s^0 up.

        Pairs go to second-order factors, real roots to the others, each the slower the sooner it
        stands; where there are too few of a kind, a near one stands in.
        """
        found = {self.gain: float(numerator[-1])}
        for side, polynomial in ((self.above, numerator), (self.below, denominator)):
            found |= _assigned(side, np.roots(polynomial[::-1]))
        return found


def rational_form(structure: Structure) -> Coefficients | Factors | None:
    """Return how a structure's parameters follow from polynomials; None where they don't."""
    return coefficients(structure) or _factors(structure)


def _factors(structure: Structure) -> Factors | None:
    """Return the factors of a structure that `factored` made; None of any other."""
    text, _, legend = structure.meaning.partition(", in factors")
    if not legend or len(structure.inputs) != 1 or len(structure.outputs) != 1:
        return None
    delay = next(iter(structure.input_delays.values()), None)
    gain = structure.names[0]
    try:
        notation = text.removeprefix(gain)
        made = factored(
            notation,
            input=structure.inputs[0],
            output=structure.outputs[0],
            delay=delay,
            gain=gain,
            name=structure.name,
        )
    except InputError:
        return None
    same = structure.names == made.names and all(
        getattr(structure, part) == getattr(made, part)
        for part in (*"MFGD", "H0", "H1", "D1", "input_delays", "output_delays", "delays")
    )
    if not same or any(one.fixed for one in structure.parameters if one.name != delay):
        return None
    above, below = parsed(notation)
    return Factors(gain, tuple(above), tuple(below), delay)


def _parameters(side: Sequence[Factor], where: str, frequency: float) -> list[Parameter]:
    sought = [factor for factor in side if factor.kind != "0"]
    found = []
    for k, factor in enumerate(sought):
        place = frequency * _APART ** (k - (len(sought) - 1) / 2)
        of = f"{factor} of the {where}"
        match factor.kind:
            case "2":
                (zeta, omega), (damping, own) = factor.names, factor.starts
                damping = 0.5 if damping is None else damping
                own = place if own is None else own
                low, high = min(_DAMPING[0], 2 * damping), max(_DAMPING[1], 2 * damping)
                found.append(Parameter(zeta, "1", damping, (low, high), f"damping of {of}", 0.5))
                found.append(Parameter(omega, "rad/s", own, _FREQUENCIES, f"frequency of {of}"))
            case "T":
                own = 1.0 / place if factor.starts[0] is None else factor.starts[0]
                found.append(Parameter(factor.names[0], "s", own, _TIMES, f"time constant of {of}"))
            case _:
                own = place if factor.starts[0] is None else factor.starts[0]
                found.append(Parameter(factor.names[0], "rad/s", own, None, f"break of {of}"))
    return found


def _chain(
    above: Sequence[Factor], below: Sequence[Factor]
) -> tuple[list[list[str]], list[bool], list[str], bool]:
    """Return F, which states the input drives, what the output sees of the states and the input.

    The factors are sections in a row, of second order as far as they go, each driven by what the
    one before gives: s^2 x = v - c1 s x - c0 x gives (s^2 + b1 s + b0) x, or less.
    """
    tops, bottoms = _sections(above, below)
    size = sum(len(bottom) for bottom in bottoms)
    rows = [["0"] * size for _ in range(size)]
    driven = [False] * size
    seen, feed, at = ["0"] * size, True, 0
    for top, bottom in zip(tops, bottoms):
        order = len(bottom)
        last = at + order - 1
        if order == 2:
            rows[at][last] = "1"
        rows[last] = list(seen)
        driven[last] = feed
        for k, coefficient in enumerate(bottom):
            rows[last][at + k] = f"-({coefficient})"
        if len(top) == order:
            for k in range(order):
                seen[at + k] = f"({top[k]})-({bottom[k]})"
        else:
            seen, feed = ["0"] * size, False
            for k, coefficient in enumerate((*top, "1")):
                seen[at + k] = coefficient
        at += order
    return rows, driven, seen, feed


def _sections(
    above: Sequence[Factor], below: Sequence[Factor]
) -> tuple[list[tuple[str, ...]], list[tuple[str, ...]]]:
    """Return each section's numerator and denominator, from s^0 up, without the leading 1."""
    pairs = [factor.polynomial for factor in below if factor.order == 2]
    singles = [factor.polynomial for factor in below if factor.order == 1]
    while len(singles) > 1:
        pairs.append(_times(singles.pop(0), singles.pop(0)))
    bottoms = [*pairs, *singles]
    tops: list[tuple[str, ...]] = [() for _ in bottoms]
    places = iter(range(len(pairs)))
    for factor in above:
        if factor.order == 2:
            tops[next(places)] = factor.polynomial
    for factor in above:
        if factor.order == 1:
            k = next(k for k, top in enumerate(tops) if len(top) < len(bottoms[k]))
            tops[k] = _times(tops[k], factor.polynomial) if tops[k] else factor.polynomial
    return tops, bottoms


def _times(one: tuple[str, ...], other: tuple[str, ...]) -> tuple[str, ...]:
    """Return the product of s + a and s + b."""
    return f"({one[0]})*({other[0]})", f"({one[0]})+({other[0]})"


def _assigned(side: Sequence[Factor], roots: NDArray) -> dict[str, float]:
    """Return the parameters of the factors that have these roots."""
    pairs = [(z, z.conjugate()) for z in roots if z.imag > 0.0]
    reals = sorted((complex(z.real) for z in roots if z.imag == 0.0), key=abs)
    pairs.sort(key=lambda pair: abs(pair[0]))
    seconds = [factor for factor in side if factor.kind == "2"]
    while len(pairs) > len(seconds):  # a pair stands in for two real ones
        one = pairs.pop()[0]
        reals += [complex(one.real - 0.5 * abs(one)), complex(one.real + 0.5 * abs(one))]
        reals.sort(key=abs)
    while len(pairs) < len(seconds):  # two real ones, the nearest, are a pair
        k = min(range(len(reals) - 1), key=lambda k: abs(reals[k + 1]) / max(abs(reals[k]), 1e-9))
        pairs.append((reals.pop(k), reals.pop(k)))
        pairs.sort(key=lambda pair: abs(pair[0] * pair[1]))
    found: dict[str, float] = {}
    for factor in side:
        if factor.kind == "2":
            one, other = pairs.pop(0)
            omega = math.sqrt(max(abs(one * other), _FREQUENCIES[0] ** 2))
            found[factor.names[0]] = -(one + other).real / (2.0 * omega)
            found[factor.names[1]] = omega
        elif factor.kind != "0":
            a = -reals.pop(0).real
            found[factor.names[0]] = a if factor.kind == "a" else _time(a)
    return found


def _time(a: float) -> float:
    return 1.0 / a if a > 1.0 / _TIMES[1] else _TIMES[1]
