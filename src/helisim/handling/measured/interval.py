"""Intervals of 95 % of any figure of a measured loop, from its draws."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.handling.loop import NoResponse
from helisim.handling.measured.loop import MeasuredLoop

_NORMAL = 1.959964
"""Standard deviations to either side that hold 95 %."""

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
    """Return the interval of a figure.

    Args:
        value: as measured.
        drawn: (n_draw,) of the draws; not finite where one doesn't have the figure.
    """
    there = drawn[np.isfinite(drawn)]
    if there.size < (1.0 - _LOST) * drawn.size:
        return Interval(value, -np.inf, np.inf)
    half = _NORMAL * float(np.std(there))
    return Interval(value, value - half, value + half)


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
