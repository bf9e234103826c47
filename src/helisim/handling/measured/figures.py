"""The figures that are told of a measured loop, not a number where its band doesn't hold them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from helisim.handling.figures import HALF_POWER, bandwidth, margins, rejection
from helisim.handling.loop import Curve, Loop
from helisim.handling.measured.cut import Cut

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


@dataclass(frozen=True)
class Asked:
    """What is asked of a loop.

    Attributes:
        kind: "broken", "disturbance" or "command".
        axis: of control.
        at: where the loop is cut.
    """

    kind: str
    axis: str
    at: str

    def __call__(self, loop: Loop) -> dict[str, float]:
        """Return the figures. Raises NoResponse."""
        if self.kind == "broken":
            return of_broken(loop.broken(self.axis, self.at))
        if self.kind == "disturbance":
            return of_disturbance(loop.disturbance(self.axis))
        return of_command(loop.command(self.axis))


_EDGE = 1.05
"""What lies nearer to an end of a curve's band, as a ratio, is not seen: noise may have made it."""


def _inside(curve: Curve, frequency: float) -> bool:
    own = curve.frequency
    return bool(own[0] * _EDGE < frequency < own[-1] / _EDGE)


def of_broken(curve: Curve) -> dict[str, float]:
    """Return crossover, phase margin (deg) and gain margin (dB) of a broken loop.

    Of the crossings that were seen alone: how near -1 the curve may come beyond its band is a
    bound, no measurement.
    """
    found = margins(curve)
    gain, phase = (
        min(all_, key=lambda one: abs(one[1]), default=(np.nan, np.nan))
        for all_ in (found.gain, found.phase)
    )
    sign = 1.0 if found.stable else -1.0
    crossed = found.phase and _inside(curve, found.crossover)
    return {
        "crossover": found.crossover if crossed else np.nan,
        "phase_margin": sign * np.degrees(abs(phase[1])) if _inside(curve, phase[0]) else np.nan,
        "gain_margin": sign * abs(gain[1]) if _inside(curve, gain[0]) else np.nan,
    }


def of_disturbance(curve: Curve) -> dict[str, float]:
    """Return DRB and DRP of a sensitivity."""
    found = rejection(curve)
    crossed = _inside(curve, found.bandwidth) and curve.decibel.min() < HALF_POWER
    return {
        "DRB": found.bandwidth if crossed else np.nan,
        "DRP": found.peak if _inside(curve, found.peak_frequency) else np.nan,
    }


def of_command(curve: Curve) -> dict[str, float]:
    """Return bandwidth (of a rate response) and phase delay of an angle over its stick."""
    found = bandwidth(curve)
    inside = _inside(curve, found.rate) and _inside(curve, found.neutral)
    return {
        "bandwidth": found.rate if inside else np.nan,
        "phase_delay": found.delay if 2.0 * found.neutral <= curve.frequency[-1] else np.nan,
    }


def asked_of(cut: Cut) -> list[Asked]:
    """Return what a cut of an axis's loop can be asked."""
    broken = Asked("broken", cut.axis, cut.at)
    turned = cut.at == "sensors" or (cut.alone and cut.at == "actuators")
    return [broken, Asked("disturbance", cut.axis, cut.at)] if turned else [broken]
