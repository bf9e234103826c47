"""Gain and phase margin."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from helisim.base.units import RAD_PER_DEG
from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Limit
from helisim.handling.criteria.regions import corner
from helisim.handling.figures.margins import margins
from helisim.handling.loop import Loop

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
        "MIL-DTL-9490E, 3.1.3.6.1, and SAE AS94900: 6 dB and 45 deg below the first "
        "aeroelastic mode; that half of it ends Level 2 is a choice of ours"
    )
    angles: ClassVar[tuple[str, ...]] = ("phase",)
    units: ClassVar[Mapping[str, str]] = {
        "gain_margin": "dB",
        "phase_margin": "rad",
        "crossover": "rad/s",
    }

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of both margins."""
        return {"gain_margin": self.gain, "phase_margin": self.phase}

    def rate(self, loop: Loop) -> Rating:
        """Return margins and crossover; see `figures.margins`."""
        found = margins(loop.broken(self.axis, self.at))
        gain, phase = found.least_gain, found.least_phase
        figures = {"gain_margin": gain, "phase_margin": phase, "crossover": found.crossover}
        remarks = []
        if not found.crosses:
            remarks.append("the gain does not fall through one in its band: crossover is extended")
        if abs(gain) == found.open_gain:
            remarks.append("-180 deg lies outside of the band: the gain margin is extended")
        return self.rated(figures, remark="; ".join(remarks))

    def chart(self) -> Chart:
        """Return phase margin over gain margin."""
        across = ChartAxis("gain_margin", "gain margin", "dB", 0.0, 20.0)
        up = ChartAxis("phase_margin", "phase margin", "rad", 0.0, np.pi / 2.0)
        title = f"Stability margins, {self.word}, cut at {self.at}"
        return corner(title, across, up, self.gain, self.phase, self.source)
