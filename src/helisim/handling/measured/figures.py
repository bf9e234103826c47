"""The figures that are told of a measured loop, not a number where its band doesn't hold them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from helisim.handling.axis import axis_of
from helisim.handling.curve import Curve
from helisim.handling.figures.bandwidth import bandwidth
from helisim.handling.figures.margins import margins
from helisim.handling.figures.rejection import HALF_POWER, rejection
from helisim.handling.loop import Loop

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


def of_broken(curve: Curve) -> dict[str, float]:
    """Return crossover, phase margin (deg) and gain margin (dB) of a broken loop."""
    found = margins(curve)
    return {
        "crossover": found.crossover if found.phase else np.nan,
        "phase_margin": float(np.degrees(found.least_phase)) if found.phase else np.nan,
        "gain_margin": found.least_gain if found.gain else np.nan,
    }


def of_disturbance(curve: Curve) -> dict[str, float]:
    """Return DRB and DRP of a sensitivity."""
    found = rejection(curve)
    inside = curve.frequency[0] < found.bandwidth < curve.frequency[-1]
    crossed = inside and curve.decibel.min() < HALF_POWER
    peaked = curve.frequency[0] < found.peak_frequency < curve.frequency[-1]
    return {
        "DRB": found.bandwidth if crossed else np.nan,
        "DRP": found.peak if peaked else np.nan,
    }


def of_command(curve: Curve) -> dict[str, float]:
    """Return bandwidth (of a rate response) and phase delay of an angle over its stick."""
    found = bandwidth(curve)
    inside = curve.frequency[0] < found.rate and found.neutral < curve.frequency[-1]
    return {
        "bandwidth": found.rate if inside else np.nan,
        "phase_delay": found.delay if 2.0 * found.neutral <= curve.frequency[-1] else np.nan,
    }


def asked_of(axis: str, at: str) -> list[Asked]:
    """Return what a cut of an axis's loop can be asked."""
    broken = Asked("broken", axis_of(axis).name, at)
    return [broken, Asked("disturbance", broken.axis, at)] if at == "sensors" else [broken]
