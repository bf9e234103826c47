"""Margins that a loop keeps to instability."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from helisim.handling.axis import axis_of
from helisim.handling.chart import Chart, ChartAxis, Level, Region
from helisim.handling.criteria.criterion import Criterion, Limit, Rating
from helisim.handling.figures.margins import margins
from helisim.handling.loop import Loop
from helisim.units import RAD_PER_DEG

GAIN = Limit(6.0, 3.0)
"""dB."""
PHASE = Limit(45.0 * RAD_PER_DEG, 22.5 * RAD_PER_DEG)
"""rad."""


@dataclass(frozen=True, kw_only=True)
class StabilityMargins(Criterion):
    """Gain and phase margin of a broken loop, all others closed.

    Attributes:
        at: where the loop is cut, as in `Loop.broken`.
        gain: dB, of the margin of gain to either side.
        phase: rad, of the margin of phase to either side.
    """

    at: str = "actuators"
    gain: Limit = GAIN
    phase: Limit = PHASE

    name: ClassVar[str] = "stability_margins"
    source: ClassVar[str] = (
        "MIL-DTL-9490E and SAE AS94900, 3.1.3.6: 6 dB and 45 deg; half of it ends Level 2"
    )
    units: ClassVar[Mapping[str, str]] = {
        "gain_margin": "dB",
        "phase_margin": "rad",
        "crossover": "rad/s",
    }

    def rate(self, loop: Loop) -> Rating:
        """Return margins and crossover; see `figures.margins`."""
        found = margins(loop.broken(self.axis, self.at))
        gain, phase = found.least_gain, found.least_phase
        figures = {"gain_margin": gain, "phase_margin": phase, "crossover": found.crossover}
        return self.rated(figures, (self.gain.distance(gain), self.phase.distance(phase)))

    def chart(self) -> Chart:
        """Return phase margin over gain margin."""
        across = ChartAxis("gain_margin", "gain margin", "dB", 0.0, 20.0)
        up = ChartAxis("phase_margin", "phase margin", "rad", 0.0, np.pi / 2.0)
        gain, phase = self.gain, self.phase
        return Chart(
            f"Stability margins, {axis_of(self.axis).word}, cut at {self.at}",
            across,
            up,
            regions=(
                quadrant(1, gain.level1, phase.level1),
                quadrant_less(2, gain.level2, phase.level2, gain.level1, phase.level1),
                lower_left(3, gain.level2, phase.level2),
            ),
            source=self.source,
        )


def quadrant(level: Level, x: float, y: float) -> Region:
    """Return all that is above a corner in both figures."""
    far = np.inf
    return Region(level, np.array([x, far, far, x]), np.array([y, y, far, far]))


def quadrant_less(level: Level, x: float, y: float, x1: float, y1: float) -> Region:
    """Return the quadrant above a corner less that above a better one."""
    far = np.inf
    across = np.array([x, far, far, x1, x1, x])
    return Region(level, across, np.array([y, y, y1, y1, far, far]))


def lower_left(level: Level, x: float, y: float) -> Region:
    """Return all that is not above a corner in both figures."""
    far = np.inf
    across = np.array([-far, far, far, x, x, -far])
    return Region(level, across, np.array([-far, -far, y, y, far, far]))
