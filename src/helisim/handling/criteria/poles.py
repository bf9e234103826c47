"""Damping, and where the poles of the whole closed loop may lie."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Limit
from helisim.handling.criteria.regions import strip
from helisim.handling.figures.poles import fastest, least_damped, slowest
from helisim.handling.loop import Loop

RATIO = Limit(0.35, 0.19)
GROWTH = Limit(1e-3, 0.05)
"""1/s: integrals stand at 0, but for rounding; a double amplitude in 14 s ends Level 2."""
WHOLE = "all"
"""The axis of a criterion of the whole loop."""


@dataclass(frozen=True, kw_only=True)
class _OfPoles(Criterion):
    """Base of criteria of all poles at once."""

    axis: str = WHOLE

    def __post_init__(self) -> None:
        if self.axis == WHOLE:
            object.__setattr__(self, "axis", "lat")
            super().__post_init__()
            object.__setattr__(self, "axis", WHOLE)
        else:
            super().__post_init__()

    @property
    def word(self) -> str:
        """What it is of."""
        return "whole loop" if self.axis == WHOLE else super().word


@dataclass(frozen=True, kw_only=True)
class Damping(_OfPoles):
    """The damping ratio of the least damped pole within a band of natural frequencies.

    Attributes:
        axis: "all": it is of the whole loop, whatever stands here.
        low: rad/s, of the band, of a full-scale helicopter.
        high: rad/s, likewise.
        ratio: its borders.
    """

    low: float = 0.5
    high: float = 50.0
    ratio: Limit = RATIO

    name: ClassVar[str] = "damping"
    source: ClassVar[str] = (
        "ADS-33E-PRF, 3.3.2.3 and 3.3.5.2, mid-term response: 0.35 of all oscillations above "
        "0.5 rad/s, 0.19 for Level 1 in yaw; that the latter ends Level 2 is a choice of ours"
    )
    units: ClassVar[Mapping[str, str]] = {"damping": "", "frequency": "rad/s"}

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of the damping ratio."""
        return {"damping": self.ratio}

    def rate(self, loop: Loop) -> Rating:
        """Return the damping ratio and the natural frequency of the pole."""
        band = {"low": self.low * self.faster, "high": self.high * self.faster}
        found = least_damped(loop.poles, **band)
        figures = {"damping": found.damping, "frequency": found.frequency}
        return self.rated(figures)

    def chart(self) -> Chart:
        """Return a strip of the damping ratio."""
        axis = ChartAxis("damping", "damping ratio", "", -0.2, 1.0)
        return strip(f"Damping, {self.word}", axis, self.ratio, self.source)


@dataclass(frozen=True, kw_only=True)
class PoleLimits(_OfPoles):
    """How far right, and if asked how far out, the poles may lie.

    Attributes:
        axis: "all": it is of the whole loop, whatever stands here.
        low: rad/s, of natural frequencies that count, of a full-scale helicopter: what is slower
            is left to the pilot or to an outer loop.
        growth: 1/s, of the real part.
        fastest: rad/s, of the natural frequency; None: no limit. Of the law's sampling, so not
            scaled.
    """

    low: float = 0.0
    growth: Limit = GROWTH
    fastest: Limit | None = None

    name: ClassVar[str] = "pole_limits"
    source: ClassVar[str] = (
        "a stable loop: ADS-33E-PRF, 3.3.2.3, and MIL-DTL-9490E; the borders are a choice of ours"
    )
    units: ClassVar[Mapping[str, str]] = {"growth": "1/s", "fastest": "rad/s"}

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of growth, and of the fastest pole if that is limited."""
        return {"growth": self.growth.scaled(self.faster)} | (
            {} if self.fastest is None else {"fastest": self.fastest}
        )

    def rate(self, loop: Loop) -> Rating:
        """Return the greatest real part and the highest natural frequency."""
        poles = loop.poles
        growth, quick = slowest(poles, low=self.low * self.faster), fastest(poles)
        return self.rated({"growth": growth, "fastest": quick})

    def chart(self) -> Chart:
        """Return a strip of the greatest real part."""
        axis = ChartAxis("growth", "greatest real part of a pole", "1/s", -2.0, 1.0)
        return strip(f"Poles, {self.word}", axis, self.limits["growth"], self.source)
