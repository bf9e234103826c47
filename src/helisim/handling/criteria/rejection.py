"""Disturbance rejection: bandwidth and peak."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Limit
from helisim.handling.criteria.regions import corner
from helisim.handling.figures.rejection import rejection
from helisim.handling.loop import Loop

BANDWIDTH = {
    "lat": Limit(0.9, 0.45),
    "lon": Limit(0.5, 0.25),
    "ped": Limit(0.7, 0.35),
    "col": Limit(1.0, 0.5),
}
"""rad/s, of a full-scale helicopter."""
PEAK = Limit(5.0, 8.0)
"""dB."""


@dataclass(frozen=True, kw_only=True)
class DisturbanceRejection(Criterion):
    """How fast a disturbance of attitude is brought back, and how much is amplified.

    Attributes:
        bandwidth: rad/s, of DRB; None: of the axis, by the source.
        peak: dB, of DRP.
    """

    bandwidth: Limit | None = None
    peak: Limit = PEAK

    name: ClassVar[str] = "disturbance_rejection"
    source: ClassVar[str] = (
        "Berger, Ivler, Berrios, Tischler and Miller, Disturbance Rejection Handling-Qualities "
        "Criteria for Rotorcraft, 72nd Annual Forum of the AHS, 2016, and Blanken, Tischler, "
        "Lusardi and Ivler, AHS Rotorcraft Handling Qualities Technical Meeting, 2014: roll 0.9, "
        "pitch 0.5, yaw 0.7, heave 1.0 rad/s, 5 dB; where Level 2 ends is a choice of ours"
    )
    units: ClassVar[Mapping[str, str]] = {"drb": "rad/s", "drp": "dB", "peak_frequency": "rad/s"}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bandwidth is not None:
            self.bandwidth.check_direction("bandwidth", more=True)

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of DRB and DRP."""
        return {
            "drb": (self.bandwidth or BANDWIDTH[self.axis]).scaled(self.faster),
            "drp": self.peak,
        }

    def rate(self, loop: Loop) -> Rating:
        """Return DRB and DRP; see `figures.rejection`."""
        found = rejection(loop.disturbance(self.axis))
        figures = {
            "drb": found.bandwidth,
            "drp": found.peak,
            "peak_frequency": found.peak_frequency,
        }
        remark = (
            "" if found.seen else "|S| rises through -3 dB outside of its band: DRB is extended"
        )
        return self.rated(figures, remark=remark)

    def chart(self) -> Chart:
        """Return DRP over DRB."""
        limit = self.limits["drb"]
        across = ChartAxis(
            "drb", "disturbance rejection bandwidth", "rad/s", 0.0, 4.0 * limit.level1
        )
        up = ChartAxis("drp", "disturbance rejection peak", "dB", 0.0, 10.0)
        title = f"Disturbance rejection, {self.word}"
        return corner(title, across, up, limit, self.peak, self.source)
