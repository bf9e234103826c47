"""Figures of a measured loop with intervals of 95 %, from the draws of its measurement."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

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
    "loop_delay": "s",
    "set_FF": "s/rad",
    "flown_FF": "s/rad",
}
# _TAIL: share of the draws beyond either end
# _LOST: largest share of draws without the figure
_TAIL, _LOST = 0.025, 0.1
_EDGE = 1.05  # ratio of frequencies: nearer to an end of a curve's band nothing is seen


@dataclass(frozen=True)
class Interval:
    """A measured figure with its 95 % interval, not finite where the records don't bound it."""

    value: float
    low: float
    high: float

    def to_dict(self) -> dict[str, float | None]:
        """Return plain data for JSON; null for an end that the records don't bound."""
        return {name: one if np.isfinite(one) else None for name, one in vars(self).items()}


def interval(value: float, samples: NDArray[np.float64]) -> Interval:
    """Return the interval of a figure between percentiles of its samples, (n_draw,).

    Ends are the outer ones of plain and bias-corrected percentiles: B. Efron, "Nonparametric
    standard errors and confidence intervals", Canadian Journal of Statistics 9, 1981, section 7.
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
    """Return figures of a `MeasuredLoop` with their intervals. Raises NoResponse.

    `of` returns the figures of a loop, such as `lambda one: criterion.rate(one).figures`.
    """

    def asked(one: Any) -> Mapping[str, float]:
        try:
            return of(one)
        except NoResponse:
            return {}

    nominal, samples = of(loop), [asked(one) for one in loop.draws]
    return {
        name: interval(value, np.array([one.get(name, np.nan) for one in samples]))
        for name, value in nominal.items()
    }


def curve_of(loop: Loop, kind: str, axis: str, at: str = "actuators") -> Curve:
    """Return the response of a `kind`, "broken", "disturbance" or "command". Raises NoResponse."""
    return loop.broken(axis, at) if kind == "broken" else getattr(loop, kind)(axis)


def figures_of(loop: Loop, kind: str, axis: str, at: str = "actuators") -> dict[str, float]:
    """Return a response's figures, NaN outside of the curve's band. Raises NoResponse.

    `kind` is as for `curve_of`; `at` is where a broken loop is cut.
    """
    curve = curve_of(loop, kind, axis, at)
    own = curve.frequency

    def inside(frequency: float) -> bool:
        return bool(own[0] * _EDGE < frequency < own[-1] / _EDGE)

    match kind:
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
