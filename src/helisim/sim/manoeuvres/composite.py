"""Manoeuvres made of manoeuvres: one after the other, or all at once."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.sim.excitation import Excitation, check_excitation, is_foreknown
from helisim.sim.places import PLACES
from helisim.sim.plain import is_number, settle

_DIGITS = 9
"""Of a part's own time, s: its edges come at the step at which they would alone."""


@dataclass(frozen=True, kw_only=True)
class _Composite(Excitation, ABC):
    """What `Sequence` and `Together` share."""

    parts: tuple[Excitation, ...]
    axis: str = ""
    duration: float = 0.0

    def __post_init__(self) -> None:
        kind = type(self).__name__
        if not isinstance(self.parts, list | tuple) or not self.parts:
            raise InputError(f"{kind} needs parts, a tuple of manoeuvres, got {self.parts!r:.60}")
        object.__setattr__(self, "parts", tuple(self.parts))
        for part in self.parts:
            check_excitation(part)
            if not is_foreknown(part):
                raise InputError(
                    f"a {type(part).__name__} is no part of a {kind}: its wobble belongs to the "
                    'pilot of a flight; take a Chirp(spacing="exponential")'
                )
        axes = "+".join(dict.fromkeys(one for part in self.parts for one in part.axes))
        if self.axis not in ("", axes):
            raise InputError(f"the axes of {kind} are those of its parts, {axes}; got {self.axis}")
        if self.at != "sticks":
            raise InputError(f"give {kind}'s parts their place: at={self.at!r} belongs to them")
        object.__setattr__(self, "axis", axes)
        settle(self)
        if self.duration == 0.0:
            object.__setattr__(self, "duration", self._length())
        if not self.duration >= self._length() - 1e-9:
            raise InputError(
                f"{kind} lasts {self.duration:g} s, shorter than its parts: {self._length():g} s"
            )

    @abstractmethod
    def _length(self) -> float:
        """Return how long the parts last together, s."""

    @abstractmethod
    def _starts(self) -> list[float]:
        """Return when each part begins, s."""

    @property
    def places(self) -> tuple[str, ...]:
        """Where its parts add something, in the order of `PLACES`."""
        found = {place for part in self.parts for place in part.places}
        return tuple(place for place in PLACES if place in found)

    @property
    def written(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether all its parts are plain data."""
        return all(part.written for part in self.parts)

    @property
    def highest(self) -> float:
        """The highest frequency of its parts, rad/s."""
        return max(part.highest for part in self.parts)

    def on(self, own: Mapping[str, float]) -> Self:
        """Return it with its parts complete. Raises InputError."""
        return replace(self, parts=tuple(part.on(own) for part in self.parts))

    def check(self) -> None:
        """Raise InputError unless parts and duration can be."""
        if not (isinstance(self.duration, int | float) and math.isfinite(self.duration)):
            raise InputError(f"times must be finite numbers of seconds, got {self.duration}")

    def added(self, time: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return what is added at the times in s, (n_time,), by place: (n_time, n_axis)."""
        total: dict[str, NDArray[np.float64]] = {}
        for start, part in zip(self._starts(), self.parts):
            own = np.round(time - start, _DIGITS)
            last = start + part.duration >= self.duration - 1e-9
            inside = (own >= 0.0) & (own < (np.inf if last else part.duration))
            for place, columns in part.added(own[inside]).items():
                total.setdefault(place, np.zeros((time.size, len(PLACES[place]))))
                total[place][inside] += columns
        return total


@dataclass(frozen=True, kw_only=True)
class Sequence(_Composite):
    """Manoeuvres one after the other.

    Attributes:
        parts: each lasts its own `duration`, with its own trimmed stretches.
        pause: s of trimmed flight between two parts.
        axis: that of its parts; leave it out.
        duration: s, of the whole flight; as long as all parts and pauses if 0.
    """

    pause: float = 0.0

    left_open: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        if not (is_number(self.pause) and 0.0 <= self.pause < math.inf):
            raise InputError(f"pause must be 0 s or more, got {self.pause}")
        super().__post_init__()

    def _length(self) -> float:
        return sum(part.duration for part in self.parts) + self.pause * (len(self.parts) - 1)

    def _starts(self) -> list[float]:
        lengths = [part.duration + self.pause for part in self.parts]
        return np.concatenate([[0.0], np.cumsum(lengths)[:-1]]).tolist()


@dataclass(frozen=True, kw_only=True)
class Together(_Composite):
    """Manoeuvres all at once, on several inputs or at several places.

    Attributes:
        parts: each begins with the flight.
        axis: that of its parts; leave it out.
        duration: s, of the whole flight; that of the longest part if 0.
    """

    def _length(self) -> float:
        return max(part.duration for part in self.parts)

    def _starts(self) -> list[float]:
        return [0.0] * len(self.parts)
