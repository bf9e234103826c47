"""A measured curve: as estimated, and as it may as well be."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.base.value import Value
from helisim.handling.loop import Curve, NoResponse
from helisim.handling.measured.driven import Complex

_KNOWN = 0.15
"""A point of a curve is of use where half of its draws are off by less than this share of it."""


@dataclass(frozen=True, eq=False)
class MeasuredCurve(Value):
    """A curve, and samples of it by the errors of its measurement.

    Attributes:
        frequency: (n_freq,) rad/s, where it is known well enough.
        response: (n_freq,).
        drawn: (n_draw, n_freq).
    """

    frequency: NDArray[np.float64]
    response: Complex
    drawn: Complex

    @classmethod
    def of(
        cls,
        name: str,
        frequency: NDArray[np.float64],
        response: Complex,
        drawn: Complex,
    ) -> "MeasuredCurve":
        """Return a curve over the longest band in which it is known.

        Args:
            name: of the curve, for messages.
            frequency: (n_freq,) rad/s.
            response: (n_freq,).
            drawn: (n_draw, n_freq).

        Raises:
            NoResponse: it is known nowhere.
        """
        with np.errstate(all="ignore"):
            off = np.median(np.abs(drawn / response - 1.0), axis=0)
        known = np.isfinite(response) & np.all(np.isfinite(drawn), axis=0) & (off < _KNOWN)
        first, last = _longest(known)
        if last - first < 2:
            raise NoResponse(
                f"{name} is lost in noise between {frequency[0]:.3g} and {frequency[-1]:.3g} "
                "rad/s: inject more, or fly longer"
            )
        return cls(frequency[first:last], response[first:last], drawn[:, first:last])

    def curve(self, draw: int | None = None) -> Curve:
        """Return the curve as estimated, or one of its draws."""
        return Curve(self.frequency, self.response if draw is None else self.drawn[draw])


def _longest(known: NDArray[np.bool_]) -> tuple[int, int]:
    """Return where the longest run of True begins and ends."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    if not starts.size:
        return 0, 0
    best = int(np.argmax(stops - starts))
    return int(starts[best]), int(stops[best])
