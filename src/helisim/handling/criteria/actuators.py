"""Actuators: whether a rate limit met by a large input is dangerous, and how much they move."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from helisim.base.units import RAD_PER_DEG
from helisim.handling.chart import Chart, ChartAxis, ChartLine, Level, Region
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Limit
from helisim.handling.criteria.regions import corner, everywhere
from helisim.handling.figures.actuators import coloured, limited, motion, onset
from helisim.handling.loop import Loop

MARGIN = Limit(0.0, -6.0)
"""dB, below the border."""
POSITION = Limit(1.0 / 3.0, 1.0)
RATE = Limit(1.0 / 3.0, 1.0)
"""rms over limit: at a third of it the limit is met at three standard deviations."""

_EXCESS = np.concatenate([[1.0], np.geomspace(1.05, 40.0, 60)])
_LIMITED = -1.0 / limited(_EXCESS)
_PHASE = np.maximum.accumulate(np.angle(-_LIMITED))
_GAIN = np.maximum.accumulate(20.0 * np.log10(np.abs(_LIMITED)))


@dataclass(frozen=True, kw_only=True)
class ActuatorOnset(Criterion):
    """The open loop onset point: how the loop stands where a stick meets the actuator's rate limit.

    Attributes:
        amplitude: of the stick, unitised: 0.5 is all of it.
        rate_limit: of the servo's command, unitised, a second.
        margin: dB, by which the point is below the border.
    """

    amplitude: float = 0.5
    rate_limit: float
    margin: Limit = MARGIN

    name: ClassVar[str] = "actuator_onset"
    source: ClassVar[str] = (
        "Duda, Prediction of Pilot-in-the-Loop Oscillations Due to Rate Saturation, Journal of "
        "Guidance, Control, and Dynamics 20 (3), 1997, of the point. The border is where the rate "
        "limit's describing function, -1/N, could hold an oscillation; the paper's own border "
        "could not be read. That 6 dB above ends Level 2 is a choice of ours"
    )
    units: ClassVar[Mapping[str, str]] = {
        "margin": "dB",
        "frequency": "rad/s",
        "phase": "rad",
        "gain": "dB",
    }

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of the margin."""
        return {"margin": self.margin}

    def rate(self, loop: Loop) -> Rating:
        """Return the point, and how far it is below the border."""
        found = onset(
            loop.broken(self.axis),
            loop.actuator(self.axis),
            amplitude=self.amplitude,
            rate_limit=self.rate_limit,
        )
        below = float(np.interp(found.phase, _PHASE, _GAIN)) - found.gain
        figures = {
            "margin": below,
            "frequency": found.frequency,
            "phase": found.phase - np.pi,
            "gain": found.gain,
        }
        remark = "" if found.reached else "the rate limit is not met: the worst frequency counts"
        return self.rated(figures, remark=remark)

    def chart(self) -> Chart:
        """Return the border on a Nichols chart."""
        across = ChartAxis("phase", "phase", "rad", -np.pi, -0.5 * np.pi)
        up = ChartAxis("gain", "gain", "dB", -20.0, 20.0)
        one, two = (_GAIN - limit for limit in (self.margin.level1, self.margin.level2))
        x = np.concatenate([[-2.0 * np.pi], _PHASE - np.pi, [0.0]])
        lines = tuple(ChartLine(x, np.concatenate([y[:1], y, y[-1:]])) for y in (one, two))
        regions = (everywhere(1), _over(2, lines[0]), _over(3, lines[1]))
        title = f"Open loop onset point, {self.word}"
        return Chart(title, across, up, regions, lines, self.source)


@dataclass(frozen=True, kw_only=True)
class ActuatorUse(Criterion):
    """How much of its travel and of its rate an actuator uses while attitude is disturbed.

    Attributes:
        rms: rad, of the disturbance: white noise behind two equal lags.
        corner: rad/s, of the lags, of a full-scale helicopter.
        travel: of the servo's command to either side, unitised.
        rate_limit: of the servo's command, unitised, a second.
        position: rms of position over travel.
        rate_share: rms of rate over rate limit.
    """

    rms: float = 1.0 * RAD_PER_DEG
    corner: float = 1.0
    travel: float = 0.5
    rate_limit: float
    position: Limit = POSITION
    rate_share: Limit = RATE

    name: ClassVar[str] = "actuator_use"
    source: ClassVar[str] = (
        "rms of actuator position and rate in a disturbance, as CONDUIT's objectives; Tischler, "
        "Berger, Ivler, Mansur, Cheung and Soong, Practical Methods for Aircraft and Rotorcraft "
        "Flight Control Design, AIAA, 2017; disturbance and borders are a choice of ours"
    )
    angles: ClassVar[tuple[str, ...]] = ("rms",)
    units: ClassVar[Mapping[str, str]] = {"position": "", "rate": ""}

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of both shares."""
        return {"position": self.position, "rate": self.rate_share}

    def rate(self, loop: Loop) -> Rating:
        """Return rms of position and rate, over their limits, within the response's band."""
        moved = loop.actuator(self.axis, by="disturbance")
        noise = coloured(moved.frequency, rms=self.rms, corner=self.corner * self.faster)
        found = motion(moved, noise)
        position, rate = found.position / self.travel, found.rate / self.rate_limit
        return self.rated({"position": position, "rate": rate})

    def chart(self) -> Chart:
        """Return the share of rate over that of position."""
        across = ChartAxis("position", "rms of position over travel", "", 0.0, 1.0)
        up = ChartAxis("rate", "rms of rate over its limit", "", 0.0, 1.0)
        title = f"Actuator use, {self.word}"
        return corner(title, across, up, self.position, self.rate_share, self.source)


def _over(level: Level, line: ChartLine) -> Region:
    """Return all that lies above a line."""
    across = np.concatenate([line.across, line.across[[-1, 0]]])
    return Region(level, across, np.concatenate([line.up, [np.inf, np.inf]]))
