"""One frequency response as a criterion reads it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import InputError
from helisim.base.units import DB_PER_NEPER
from helisim.base.value import Value

_LEAST = np.finfo(np.float64).tiny
"""Of a response whose logarithm is taken: none at all has none."""


@dataclass(frozen=True, eq=False)
class Curve(Value):
    """A complex response over frequency. Read-only.

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
