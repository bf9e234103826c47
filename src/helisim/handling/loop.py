"""Axes, curves and closed loops; a broken loop is L of negative feedback, -1 critical."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import HelisimError, InputError, item_of
from helisim.base.settings import Value, check
from helisim.base.units import DB_PER_NEPER

GRID = np.geomspace(0.2, 150.0, 400)  # rad/s, default frequencies of responses
PLACES = ("actuators", "sensors")  # places at which a loop is cut
_LEAST = np.finfo(np.float64).tiny


class NoResponse(HelisimError):
    """A loop does not know a response that a criterion asks for."""


@dataclass(frozen=True)
class Axis:
    """One axis of control: servo command (IN1), pilots' word, stick (IN2), and what it holds.

    Angle in rad, of heave the velocity down, m/s; rate in rad/s, of heave None.
    """

    name: str
    word: str
    stick: str
    angle: str
    rate: str | None


BY_NAME = {
    "lat": Axis("lat", "roll", "LAT", "phi", "p"),
    "lon": Axis("lon", "pitch", "LON", "theta", "q"),
    "ped": Axis("ped", "yaw", "PED", "psi", "r"),
    "col": Axis("col", "heave", "COL", "w", None),
}
_BY_EITHER = BY_NAME | {one.word: one for one in BY_NAME.values()}


def axis_of(name: str) -> Axis:
    """Return an axis by its command ("lat") or its word ("roll"). Raises UnknownNameError."""
    return item_of(_BY_EITHER, name, "axis")


@dataclass(frozen=True, eq=False)
class Curve(Value):
    """A complex response over increasing frequency, rad/s, (n_freq,) each. Read-only.

    Raises InputError if shapes differ, frequencies don't increase, or something isn't finite.
    """

    frequency: NDArray[np.float64]
    response: NDArray[np.complex128]

    def __post_init__(self) -> None:
        check(self, "a curve's")
        frequency = self.frequency
        if frequency.ndim != 1 or self.response.shape != frequency.shape or frequency.size < 2:
            raise InputError(
                "a curve has two points or more, as many responses as frequencies; got shapes "
                f"{frequency.shape} and {self.response.shape}"
            )
        if frequency[0] <= 0.0 or np.any(np.diff(frequency) <= 0.0):
            raise InputError("a curve's frequencies must be positive and increasing, rad/s")

    @property
    def decibel(self) -> NDArray[np.float64]:
        """Magnitude, (n_freq,) dB."""
        return DB_PER_NEPER * np.log(np.abs(self.response))

    @property
    def phase(self) -> NDArray[np.float64]:
        """Phase, (n_freq,) rad, continuous over frequency, the first in (-pi, pi]."""
        return np.unwrap(np.angle(self.response))

    def at(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Return the response, (n_wanted,), at (n_wanted,) rad/s; NoResponse beyond the curve."""
        wanted, own = np.atleast_1d(np.asarray(frequency, dtype=np.float64)), self.frequency
        if wanted.min() < own[0] or wanted.max() > own[-1]:
            raise NoResponse(
                f"the curve is known from {own[0]:g} to {own[-1]:g} rad/s, not at "
                f"{wanted.min():g} to {wanted.max():g}"
            )
        where, known = np.log(wanted), np.log(own)
        size = np.exp(np.interp(where, known, np.log(np.maximum(np.abs(self.response), _LEAST))))
        return (size * np.exp(1j * np.interp(where, known, self.phase))).astype(np.complex128)


@dataclass(frozen=True, eq=False)
class History:
    """Signals over time, s: (n_time,) each, SI."""

    time: NDArray[np.float64]
    signals: Mapping[str, NDArray[np.float64]]


class Loop(Protocol):
    """Responses of a closed loop; each may raise `NoResponse`. Axes as in `axis_of`."""

    @property
    def axes(self) -> tuple[str, ...]:
        """Closed axes, by the names of their commands."""
        ...

    def broken(self, axis: str, at: str = "actuators") -> Curve:
        """Return the loop L of one axis, cut at its "actuators" or "sensors", all others closed."""
        ...

    def disturbance(self, axis: str) -> Curve:
        """Return S = 1 / (1 + L) at the sensors: angle over what is added to it and its rate."""
        ...

    def command(self, axis: str, output: str | None = None) -> Curve:
        """Return an output over the axis's stick: by default its own angle, of heave w."""
        ...

    def turned(self, axis: str, by: str) -> Curve:
        """Return the axis's angle, of heave w, over what is added to the command of axis `by`."""
        ...

    def actuator(self, axis: str, by: str = "stick") -> Curve:
        """Return the axis's servo command over its stick, or over its "disturbance"."""
        ...

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles of the whole closed loop in the s-plane, (n_pole,) rad/s."""
        ...

    def step(self, axis: str, *, size: float, duration: float) -> History:
        """Return stick, commands, angles and rates after a step of a stick, unitised, at 0 s."""
        ...
