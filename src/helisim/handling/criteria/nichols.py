"""Exclusion zones about the critical point: on a Nichols chart, and as a disk."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import UnknownNameError
from helisim.base.units import RAD_PER_DEG
from helisim.handling.chart import Chart, ChartAxis, Region
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Limit
from helisim.handling.criteria.regions import everywhere, strip
from helisim.handling.figures.margins import disk_margin
from helisim.handling.figures.nichols import Gauge, approach, ellipse, hexagon
from helisim.handling.loop import Loop

Real = NDArray[np.float64]

SIZE = Limit(1.0, 0.5)
"""Of the zone of Level 1."""
ALPHA = Limit(0.5, 0.25)
"""Disk margin."""
SHAPES = ("hexagon", "ellipse")


@dataclass(frozen=True, kw_only=True)
class NicholsExclusion(Criterion):
    """How far a broken loop stays from -1 in gain and phase at once.

    Attributes:
        at: where the loop is cut, as in `Loop.broken`.
        gain: dB, half the height of Level 1's zone.
        phase: rad, half its width.
        shape: "hexagon" (its upright sides half as high as its tips) or "ellipse".
        size: of the zone that the loop touches, over that of Level 1's.
    """

    at: str = "actuators"
    gain: float = 6.0
    phase: float = 45.0 * RAD_PER_DEG
    shape: str = "hexagon"
    size: Limit = SIZE

    name: ClassVar[str] = "nichols_exclusion"
    source: ClassVar[str] = (
        "the zone is made of the margins of SAE AS94900, 6 dB and 45 deg; its shape after the "
        "exclusion zones of Fielding, Varga, Bennani and Selier (eds.), Advanced Techniques for "
        "Clearance of Flight Control Laws, Springer, 2002, and half of it ends Level 2, both a "
        "choice of ours"
    )
    angles: ClassVar[tuple[str, ...]] = ("phase",)
    units: ClassVar[Mapping[str, str]] = {"size": "", "frequency": "rad/s"}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shape not in SHAPES:
            raise UnknownNameError("shape of a zone", self.shape, SHAPES)

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of the zone."""
        return {"size": self.size}

    def rate(self, loop: Loop) -> Rating:
        """Return the zone that the loop touches, and where it does."""
        found = approach(loop.broken(self.axis, self.at), self.gauge)
        figures = {"size": found.size, "frequency": found.frequency}
        return self.rated(figures)

    @property
    def gauge(self) -> Gauge:
        """The zone; see `figures.nichols`."""
        return (hexagon if self.shape == "hexagon" else ellipse)(self.gain, self.phase)

    def chart(self) -> Chart:
        """Return the zones of Levels 1 and 2 on a Nichols chart."""
        across = ChartAxis("", "phase", "rad", -2.0 * np.pi, 0.0)
        up = ChartAxis("", "gain", "dB", -30.0, 30.0)
        one, two = (self._zone(size) for size in (self.size.level1, self.size.level2))
        regions = (everywhere(1), Region(2, *one), Region(3, *two))
        title = f"Nichols exclusion zone, {self.word}, cut at {self.at}"
        return Chart(title, across, up, regions, source=self.source)

    def _zone(self, size: float) -> tuple[Real, Real]:
        """Return the outline of a zone, starting at its upper tip."""
        if self.shape == "hexagon":
            x, y = (
                np.array([0.0, 1.0, 1.0, 0.0, -1.0, -1.0]),
                np.array([1, 0.5, -0.5, -1, -0.5, 0.5]),
            )
        else:
            turn = np.linspace(0.0, 2.0 * np.pi, 73)[:-1]
            x, y = np.sin(turn), np.cos(turn)
        return -np.pi + size * self.phase * x, size * self.gain * y


@dataclass(frozen=True, kw_only=True)
class DiskMargin(Criterion):
    """Gain and phase changing at once: the disk margin of a broken loop.

    Attributes:
        at: where the loop is cut, as in `Loop.broken`.
        skew: 0: changes to either side alike; see `figures.margins`.
        alpha: size of the disk; 0.5 allows 4.4 dB, or 28 deg.
    """

    at: str = "actuators"
    skew: float = 0.0
    alpha: Limit = ALPHA

    name: ClassVar[str] = "disk_margin"
    source: ClassVar[str] = (
        "Seiler, Packard and Gahinet, An Introduction to Disk Margins, IEEE Control Systems "
        "Magazine 40 (5), 2020; the borders are a choice of ours"
    )
    units: ClassVar[Mapping[str, str]] = {
        "alpha": "",
        "gain": "dB",
        "phase": "rad",
        "frequency": "rad/s",
    }

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of the disk."""
        return {"alpha": self.alpha}

    def rate(self, loop: Loop) -> Rating:
        """Return the disk, what it allows of gain and of phase alone, and where it is met."""
        found = disk_margin(loop.broken(self.axis, self.at), skew=self.skew)
        figures = {
            "alpha": found.alpha,
            "gain": found.gain,
            "phase": found.phase,
            "frequency": found.frequency,
        }
        return self.rated(figures)

    def chart(self) -> Chart:
        """Return a strip of the disk's size."""
        axis = ChartAxis("alpha", "disk margin", "", 0.0, 2.0)
        return strip(f"Disk margin, {self.word}, cut at {self.at}", axis, self.alpha, self.source)
