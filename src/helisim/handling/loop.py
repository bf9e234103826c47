"""Axes, curves and closed loops: a vehicle with its law, seen as responses that criteria ask for.

Signs are the field's: a broken loop is L of negative feedback, and -1 is the critical point.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import HelisimError, InputError, UnknownNameError
from helisim.base.settings import Value
from helisim.base.units import DB_PER_NEPER

GRID = np.geomspace(0.2, 150.0, 400)
"""rad/s, where responses are computed unless others are asked for."""
_LEAST = np.finfo(np.float64).tiny
"""Of a response whose logarithm is taken: none at all has none."""


class NoResponse(HelisimError):
    """A loop does not know a response that a criterion asks for."""


@dataclass(frozen=True)
class Axis:
    """One axis of control.

    Attributes:
        name: of its servo command, IN1, by which it is called everywhere.
        word: what pilots call it.
        stick: IN2.
        angle: what is held and commanded, rad; of heave the velocity down, m/s.
        rate: its derivative, rad/s; of heave None.
    """

    name: str
    word: str
    stick: str
    angle: str
    rate: str | None


BY_NAME = {
    "col": Axis("col", "heave", "COL", "w", None),
    "lon": Axis("lon", "pitch", "LON", "theta", "q"),
    "lat": Axis("lat", "roll", "LAT", "phi", "p"),
    "ped": Axis("ped", "yaw", "PED", "psi", "r"),
}
_BY_WORD = {one.word: one for one in BY_NAME.values()}


def axis_of(name: str) -> Axis:
    """Return an axis by its command ("lat") or its word ("roll"). Raises UnknownNameError."""
    try:
        return BY_NAME.get(name) or _BY_WORD[name]
    except KeyError:
        raise UnknownNameError("axis", name, [*BY_NAME, *_BY_WORD]) from None


@dataclass(frozen=True, eq=False)
class Curve(Value):
    """A complex response over frequency, as criteria read it. Read-only.

    Attributes:
        frequency: (n_freq,) rad/s, increasing.
        response: (n_freq,) complex.

    Raises:
        InputError: shapes differ, frequencies aren't increasing, or something isn't finite.
    """

    frequency: NDArray[np.float64]
    response: NDArray[np.complex128]

    def __post_init__(self) -> None:
        for name, kind in (("frequency", np.float64), ("response", np.complex128)):
            array = np.array(getattr(self, name), dtype=kind)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        frequency = self.frequency
        if frequency.ndim != 1 or self.response.shape != frequency.shape or frequency.size < 2:
            raise InputError(
                "a curve has two points or more, as many responses as frequencies; got shapes "
                f"{frequency.shape} and {self.response.shape}"
            )
        if not (np.all(np.isfinite(frequency)) and np.all(np.isfinite(self.response))):
            raise InputError("a curve holds values that are not finite")
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
        """Return the response between the points, by straight lines of log and phase.

        Args:
            frequency: (n_wanted,) rad/s or one.

        Returns:
            (n_wanted,) complex.

        Raises:
            InputError: a frequency is beyond the curve.
        """
        wanted, own = np.atleast_1d(np.asarray(frequency, dtype=np.float64)), self.frequency
        if wanted.min() < own[0] or wanted.max() > own[-1]:
            raise InputError(
                f"the curve is known from {own[0]:g} to {own[-1]:g} rad/s, not at "
                f"{wanted.min():g} to {wanted.max():g}"
            )
        where, known = np.log(wanted), np.log(own)
        size = np.exp(np.interp(where, known, np.log(np.maximum(np.abs(self.response), _LEAST))))
        return (size * np.exp(1j * np.interp(where, known, self.phase))).astype(np.complex128)


@dataclass(frozen=True, eq=False)
class History:
    """Signals over time.

    Attributes:
        time: (n_time,) s.
        signals: name -> (n_time,), SI.
    """

    time: NDArray[np.float64]
    signals: Mapping[str, NDArray[np.float64]]


class Loop(Protocol):
    """What criteria ask of a closed loop; each may raise `NoResponse`. Axes as in `axis_of`."""

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that are closed, by the names of their commands."""
        ...

    def broken(self, axis: str, at: str = "actuators") -> Curve:
        """Return the loop L of one axis, all others closed.

        Args:
            axis: of control.
            at: "actuators": cut at the axis's servo command. "sensors": cut where its attitude is
                sensed, angle and rate together. Or one sensor, such as "p".
        """
        ...

    def disturbance(self, axis: str) -> Curve:
        """Return the sensed angle over a disturbance of it, S = 1 / (1 + L) at the sensors.

        The disturbance turns what is sensed: d is added to the angle, its derivative to the rate.
        """
        ...

    def command(self, axis: str, output: str | None = None) -> Curve:
        """Return an output over the axis's stick: by default its own angle, of heave w."""
        ...

    def turned(self, axis: str, by: str) -> Curve:
        """Return the axis's angle, of heave w, over what is added to a servo command.

        Args:
            axis: whose angle.
            by: axis of the command, its own or another; all loops stay closed.
        """
        ...

    def actuator(self, axis: str, by: str = "stick") -> Curve:
        """Return the axis's servo command over its stick, or over its "disturbance"."""
        ...

    @property
    def poles(self) -> NDArray[np.complex128]:
        """The poles of the whole closed loop in the s-plane, (n_pole,) rad/s."""
        ...

    def step(self, axis: str, *, size: float, duration: float) -> History:
        """Return stick, commands, angles and rates after a step of a stick.

        Args:
            axis: whose stick.
            size: unitised stick.
            duration: s; the step is at 0.
        """
        ...
