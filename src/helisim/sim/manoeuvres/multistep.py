"""Inputs of steps: a step, a pulse, a doublet, a 3-2-1-1."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.physics.layout import DOUBLET, PARAM
from helisim.records.channels import AXES
from helisim.sim.excitation import (
    Excitation,
    check_amplitude,
    check_settings,
    check_times,
    complete,
)

_ROUNDING = 1e-9
"""s: an edge comes so much early, for the times of the steps are added up."""


@dataclass(frozen=True, kw_only=True)
class Step(Excitation):
    """A step that stays to the end of the flight.

    Attributes:
        axis: one, as for every `Excitation`.
        duration: s, of the whole flight.
        amplitude: unitised, of sensors rad/s, negative the other way; of sticks the vehicle's
            own for that axis if None.
        trim_time: s of trimmed flight before.
        at: "sticks", "servos", "actuators" or "sensors".
    """

    axis: str
    duration: float = 8.0
    amplitude: float | None = None
    trim_time: float = 2.0

    left_open: ClassVar[tuple[str, ...]] = ("amplitude",)
    several: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_settings(self)
        check_times(self.duration, self.trim_time, after=False)
        check_amplitude(self, signed=True)

    def wave(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added, (n_time,), at the times in s, (n_time,)."""
        return np.where(time >= self.trim_time - _ROUNDING, complete(self, self.amplitude), 0.0)


@dataclass(frozen=True, kw_only=True)
class Pulse(Excitation):
    """A pulse: there, and after its width back.

    Attributes:
        axis: one, as for every `Excitation`.
        duration: s, of the whole flight.
        amplitude: unitised, of sensors rad/s, negative the other way; of sticks the vehicle's
            own for that axis if None.
        width: s.
        trim_time: s of trimmed flight before.
        at: "sticks", "servos", "actuators" or "sensors".
    """

    axis: str
    duration: float = 8.0
    amplitude: float | None = None
    width: float = 0.5
    trim_time: float = 2.0

    left_open: ClassVar[tuple[str, ...]] = ("amplitude",)
    several: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_settings(self)
        check_times(self.duration, self.trim_time, after=False)
        _check_width("pulse", self.width, self.duration - self.trim_time)
        check_amplitude(self, signed=True)

    def wave(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added, (n_time,), at the times in s, (n_time,)."""
        since = time - self.trim_time + _ROUNDING
        inside = (since >= 0.0) & (since < self.width)
        return np.where(inside, complete(self, self.amplitude), 0.0)


@dataclass(frozen=True, kw_only=True)
class Doublet(Excitation):
    """A doublet: the stick one way, then the other, then centred.

    Attributes:
        axis: one, as for every `Excitation`.
        duration: s, of the whole flight.
        amplitude: unitised, of sensors rad/s; of sticks the vehicle's own for that axis if None.
        width: s, of both halves together.
        trim_time: s of trimmed flight before.
        at: "sticks", "servos", "actuators" or "sensors".
    """

    axis: str
    duration: float = 8.0
    amplitude: float | None = None
    width: float = 1.0
    trim_time: float = 2.0

    left_open: ClassVar[tuple[str, ...]] = ("amplitude",)
    several: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_settings(self)
        check_times(self.duration, self.trim_time)
        _check_width("doublet", self.width, self.duration - self.trim_time)
        check_amplitude(self)

    def wave(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added, (n_time,), at the times in s, (n_time,)."""
        since = time - self.trim_time + _ROUNDING
        first = (since >= 0.0) & (since < 0.5 * self.width)
        second = (since >= 0.5 * self.width) & (since < self.width)
        return complete(self, self.amplitude) * (1.0 * first - 1.0 * second)

    def _write_closed_form(self, par: NDArray[np.float64]) -> None:
        par[PARAM.excitation] = DOUBLET
        par[PARAM.excitation_start] = self.trim_time
        par[PARAM.excitation_duration] = self.width
        first = PARAM.excitation_col
        par[first : first + 4] = 0.0
        par[first + AXES.index(self.axis)] = complete(self, self.amplitude)


@dataclass(frozen=True, kw_only=True)
class ThreeTwoOneOne(Excitation):
    """A 3-2-1-1 multistep: the stick there and back in steps of 3, 2, 1 and 1 units of time.

    With as much effort as a doublet it excites a band about three times as wide (Plaetschke and
    Schulz, AGARD LS-104, 1979; Jategaonkar, Flight Vehicle System Identification, ch. 2).

    Attributes:
        axis: one, as for every `Excitation`.
        duration: s, of the whole flight.
        amplitude: unitised, of sensors rad/s; of sticks the vehicle's own for that axis if None.
        unit: s, of the shortest step; all seven units must fit behind the trimmed stretch.
        trim_time: s of trimmed flight before.
        at: "sticks", "servos", "actuators" or "sensors".
    """

    axis: str
    duration: float = 10.0
    amplitude: float | None = None
    unit: float = 0.3
    trim_time: float = 2.0

    left_open: ClassVar[tuple[str, ...]] = ("amplitude",)
    several: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_settings(self)
        check_times(self.duration, self.trim_time)
        longest = (self.duration - self.trim_time) / 7.0
        if not 0.0 < self.unit <= longest:
            raise InputError(
                f"unit must be above 0 and at most {longest:g} s (a seventh of what the trimmed "
                f"stretch leaves), got {self.unit}"
            )
        check_amplitude(self)

    def wave(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added, (n_time,), at the times in s, (n_time,)."""
        edges = self.trim_time + self.unit * np.array([0.0, 3.0, 5.0, 6.0, 7.0])
        step = np.searchsorted(edges, time, side="right")
        return np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[step] * complete(self, self.amplitude)


def _check_width(what: str, width: float, longest: float) -> None:
    if not 0.0 < width <= longest:
        raise InputError(
            f"{what} width must be above 0 and at most {longest:g} s (what the trimmed stretch "
            f"leaves), got {width}"
        )
