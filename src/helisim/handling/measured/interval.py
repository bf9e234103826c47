"""Intervals of 95 % of any figure of a measured loop, from its draws."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from helisim.handling.loop import NoResponse
from helisim.handling.measured.loop import MeasuredLoop

_TAIL = 0.025
"""Share of the draws beyond either end. A figure of a flat curve, such as the crossover of a loop
whose gain stays near one, scatters far from normally: an interval of standard deviations holds 68
to 90 % of such, one reflected about the value 47 %, percentiles 94 % and more."""

_LOST = 0.1
"""Where a larger share of the draws don't have the figure, it has no interval."""


@dataclass(frozen=True)
class Interval:
    """A measured figure.

    Attributes:
        value: as measured.
        low, high: ends of the 95 % interval, the same unit; not finite where the records don't
            bound it.
    """

    value: float
    low: float
    high: float


def interval(value: float, drawn: NDArray[np.float64]) -> Interval:
    """Return the interval of a figure: between percentiles of its draws.

    A highest value, such as DRP, is too high by noise already, and in the draws once more: the ends
    are the outer ones of the percentiles and of those corrected for bias (B. Efron, "Nonparametric
    standard errors and confidence intervals", Canadian Journal of Statistics 9, 1981, section 7).

    Args:
        value: as measured.
        drawn: (n_draw,) of the draws; not finite where one doesn't have the figure.
    """
    there = drawn[np.isfinite(drawn)]
    if there.size < (1.0 - _LOST) * drawn.size:
        return Interval(value, -np.inf, np.inf)
    below = np.mean(there < value) + 0.5 * np.mean(there == value)
    shift = 2.0 * ndtri(np.clip(below, _TAIL, 1.0 - _TAIL))
    ends = ndtri([_TAIL, 1.0 - _TAIL])
    plain, corrected = (np.quantile(there, ndtr(ends + one)) for one in (0.0, shift))
    return Interval(value, float(min(plain[0], corrected[0])), float(max(plain[1], corrected[1])))


def intervals(
    loop: MeasuredLoop, figures: Callable[[MeasuredLoop], Mapping[str, float]]
) -> dict[str, Interval]:
    """Return figures of a loop with their intervals.

    Args:
        loop: measured.
        figures: what is asked of a loop, such as `lambda one: criterion.rate(one).figures`.

    Raises:
        NoResponse: the loop doesn't know what they ask for.
    """
    nominal = figures(loop)
    each: dict[str, list[float]] = {name: [] for name in nominal}
    for one in loop.draws:
        try:
            found = figures(one)
        except NoResponse:
            found = {}
        for name, values in each.items():
            values.append(found.get(name, np.nan))
    return {name: interval(value, np.array(each[name])) for name, value in nominal.items()}
