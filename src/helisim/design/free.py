"""The parameters of a law that a design may move, and the coordinates in which it moves them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError

_SPAN = 4.0
"""Coordinates that a range around zero is long: as much as a factor of 55."""
_REACH = 30.0
"""Factor up and down from a start, where no range is stated."""


@dataclass(frozen=True)
class Free:
    """A parameter that may be moved within a range.

    Where the whole range is positive its logarithm is what is moved, so that steps are relative.

    Attributes:
        name: such as "lat.k_rate".
        low: least value.
        high: largest value.

    Raises:
        InputError: the range is empty, or not finite.
    """

    name: str
    low: float
    high: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise InputError(
                f"{self.name} can't be moved from {self.low:g} to {self.high:g}: give the lower "
                "value first, both finite"
            )

    @property
    def relative(self) -> bool:
        """Whether the logarithm is moved."""
        return self.low > 0.0

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value, that of the range's end where it is outside."""
        inside = min(max(value, self.low), self.high)
        if self.relative:
            return math.log(inside)
        return _SPAN * (inside - self.low) / (self.high - self.low)

    def value(self, coordinate: float) -> float:
        """Return the value at a coordinate."""
        if self.relative:
            return math.exp(coordinate)
        return self.low + (self.high - self.low) * coordinate / _SPAN


def free_parameters(
    parameters: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    only: Sequence[str] | None = None,
) -> tuple[Free, ...]:
    """Return what may be moved of a law.

    Args:
        parameters: of the law, by name.
        bounds: least and largest value, by name; of another parameter a factor of 30 both ways,
            and one that is 0 stays.
        only: names of those that are moved; by default all.

    Raises:
        UnknownNameError: a name that the law doesn't have.
        InputError: a range is empty, or nothing is left to move.
    """
    for name in (*bounds, *(only or ())):
        if name not in parameters:
            raise UnknownNameError("parameter of the law", name, parameters)
    found = []
    for name in parameters if only is None else only:
        value = parameters[name]
        if name not in bounds and value == 0.0:
            continue
        ends = bounds.get(name) or tuple(sorted((value / _REACH, value * _REACH)))
        found.append(Free(name, *ends))
    if not found:
        raise InputError(
            "the law leaves nothing to design: none of its parameters has a value or a range"
        )
    return tuple(found)


def coordinates(free: Sequence[Free], parameters: Mapping[str, float]) -> NDArray[np.float64]:
    """Return the coordinates of a law's parameters, (n_free,)."""
    return np.array([one.coordinate(parameters[one.name]) for one in free])


def values(free: Sequence[Free], at: NDArray[np.float64]) -> dict[str, float]:
    """Return the parameters at coordinates, (n_free,), by name."""
    return {one.name: one.value(float(where)) for one, where in zip(free, at)}


def box(free: Sequence[Free]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest and the highest coordinates, (n_free,) each."""
    low = np.array([one.coordinate(one.low) for one in free])
    return low, np.array([one.coordinate(one.high) for one in free])
