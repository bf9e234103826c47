"""Figures of a measured loop with intervals of 95 %, from the draws of its measurement."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from helisim.handling import figures
from helisim.handling.loop import Curve, Loop, NoResponse

UNITS: Mapping[str, str] = {
    "crossover": "rad/s",
    "phase_margin": "deg",
    "gain_margin": "dB",
    "DRB": "rad/s",
    "DRP": "dB",
    "bandwidth": "rad/s",
    "phase_delay": "s",
}
"""Figure -> unit."""
_TAIL = 0.025
"""Share of the draws beyond either end. A figure of a flat curve, such as the crossover of a loop
whose gain stays near one, scatters far from normally: an interval of standard deviations holds 68
to 90 % of such, one reflected about the value 47 %, percentiles 94 % and more."""
_LOST = 0.1
"""Where a larger share of the draws don't have the figure, it has no interval."""
_EDGE = 1.05
"""What lies nearer to an end of a curve's band, as a ratio, is not seen: noise may have made it."""


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


def interval(value: float, samples: NDArray[np.float64]) -> Interval:
    """Return the interval of a figure: between percentiles of its samples.

    A highest value, such as DRP, is too high by noise already, and in the draws once more: the ends
    are the outer ones of the percentiles and of those corrected for bias (B. Efron, "Nonparametric
    standard errors and confidence intervals", Canadian Journal of Statistics 9, 1981, section 7).

    Args:
        value: as measured.
        samples: (n_draw,) of the draws; not finite where one doesn't have the figure.
    """
    there = samples[np.isfinite(samples)]
    if there.size < (1.0 - _LOST) * samples.size:
        return Interval(value, -np.inf, np.inf)
    below = np.mean(there < value) + 0.5 * np.mean(there == value)
    shift = 2.0 * ndtri(np.clip(below, _TAIL, 1.0 - _TAIL))
    ends = ndtri([_TAIL, 1.0 - _TAIL])
    plain, corrected = (np.quantile(there, ndtr(ends + one)) for one in (0.0, shift))
    return Interval(value, float(min(plain[0], corrected[0])), float(max(plain[1], corrected[1])))


def intervals(loop: Any, of: Callable[[Any], Mapping[str, float]]) -> dict[str, Interval]:
    """Return figures of a loop with their intervals.

    Args:
        loop: measured, a `MeasuredLoop`.
        of: what is asked of a loop, such as `lambda one: criterion.rate(one).figures`.

    Raises:
        NoResponse: the loop doesn't know what they ask for.
    """
    nominal = of(loop)
    each: dict[str, list[float]] = {name: [] for name in nominal}
    for one in loop.draws:
        try:
            found = of(one)
        except NoResponse:
            found = {}
        for name, values in each.items():
            values.append(found.get(name, np.nan))
    return {name: interval(value, np.array(each[name])) for name, value in nominal.items()}


class Asked(NamedTuple):
    """A response of a loop, and what is asked of it.

    Attributes:
        kind: "broken", "disturbance" or "command".
        axis: of control.
        at: where the loop is cut.
    """

    kind: str
    axis: str
    at: str

    def curve(self, loop: Loop) -> Curve:
        """Return the response. Raises NoResponse."""
        if self.kind == "broken":
            return loop.broken(self.axis, self.at)
        return getattr(loop, self.kind)(self.axis)

    def __call__(self, loop: Loop) -> dict[str, float]:
        """Return the figures, NaN where the curve's band doesn't hold them. Raises NoResponse."""
        curve = self.curve(loop)
        own = curve.frequency

        def inside(frequency: float) -> bool:
            return bool(own[0] * _EDGE < frequency < own[-1] / _EDGE)

        match self.kind:
            case "broken":
                # of the crossings that were seen alone: how near -1 the curve may come beyond its
                # band is a bound, no measurement
                found = figures.margins(curve)
                gain, phase = (
                    min(all_, key=lambda one: abs(one[1]), default=(np.nan, np.nan))
                    for all_ in (found.gain, found.phase)
                )
                sign = 1.0 if found.stable else -1.0
                told = {
                    "crossover": (found.crossover, bool(found.phase) and inside(found.crossover)),
                    "phase_margin": (sign * np.degrees(abs(phase[1])), inside(phase[0])),
                    "gain_margin": (sign * abs(gain[1]), inside(gain[0])),
                }
            case "disturbance":
                seen = figures.rejection(curve)
                crossed = inside(seen.bandwidth) and curve.decibel.min() < figures.HALF_POWER
                told = {
                    "DRB": (seen.bandwidth, crossed),
                    "DRP": (seen.peak, inside(seen.peak_frequency)),
                }
            case _:
                quick = figures.bandwidth(curve)
                told = {
                    "bandwidth": (quick.rate, inside(quick.rate) and inside(quick.neutral)),
                    "phase_delay": (quick.delay, 2.0 * quick.neutral <= own[-1]),
                }
        return {name: float(value) if known else np.nan for name, (value, known) in told.items()}
