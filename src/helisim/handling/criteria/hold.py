"""Attitude hold: how soon an attitude that was disturbed is back."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Limit
from helisim.handling.criteria.regions import strip
from helisim.handling.figures.history import held
from helisim.handling.loop import Loop

TIME = Limit(10.0, 20.0)


@dataclass(frozen=True, kw_only=True)
class AttitudeHold(Criterion):
    """The time after which a disturbed attitude stays within a share of the disturbance.

    Attributes:
        share: of the disturbance, such as 0.1.
        time: s.
    """

    share: float = 0.1
    time: Limit = TIME

    name: ClassVar[str] = "attitude_hold"
    source: ClassVar[str] = (
        "ADS-33E-PRF, 3.2.7: back within 10 percent of the peak in 20 s, or in 10 s where cues "
        "are poor, after a pulse into the actuator. Here after a step of the attitude's "
        "disturbance, which has the same modes; that 20 s ends Level 2 is a choice of ours"
    )
    units: ClassVar[Mapping[str, str]] = {"time": "s"}

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of the time."""
        return {"time": self.time.scaled(1.0 / self.faster)}

    def rate(self, loop: Loop) -> Rating:
        """Return the time; see `figures.history.held`."""
        limit = self.limits["time"]
        longest = 1.5 * max(limit.level1, limit.level2)
        found = held(loop.disturbance(self.axis), share=self.share, longest=longest)
        return self.rated({"time": found})

    def chart(self) -> Chart:
        """Return a strip of time."""
        limit = self.limits["time"]
        top = 1.5 * max(limit.level1, limit.level2)
        axis = ChartAxis("time", f"time to within {self.share:.0%}", "s", 0.0, top)
        return strip(f"Attitude hold, {self.word}", axis, limit, self.source)
