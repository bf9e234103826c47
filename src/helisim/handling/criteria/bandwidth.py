"""Bandwidth and phase delay of the answer to small stick inputs, as ADS-33."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from helisim.base.errors import InputError, UnknownNameError
from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Limit
from helisim.handling.criteria.regions import corner
from helisim.handling.figures.bandwidth import bandwidth
from helisim.handling.loop import Loop

TASKS = {
    "target_acquisition": {
        "lon": Limit(2.0, 1.0),
        "lat": Limit(2.5, 1.0),
        "ped": Limit(3.5, 2.0),
    },
    "other": {"lon": Limit(1.0, 0.5), "lat": Limit(1.0, 0.5), "ped": Limit(2.0, 0.5)},
    "other_divided": {"lon": Limit(2.0, 0.5), "lat": Limit(2.0, 0.5), "ped": Limit(2.0, 0.5)},
}
"""Task -> axis -> bandwidth, rad/s, of a full-scale helicopter in hover and at low speed:
target acquisition and tracking; all others with full attention and a usable cue environment of 1;
all others with divided attention or worse cues."""
DELAY = Limit(0.2, 0.3)
"""s, of a full-scale helicopter."""
KINDS = ("attitude", "rate")


@dataclass(frozen=True, kw_only=True)
class AttitudeBandwidth(Criterion):
    """How quickly an attitude follows small inputs of the stick, and how its lag goes on growing.

    Attributes:
        task: "target_acquisition", "other" or "other_divided", as in ADS-33.
        command: what the stick commands: "attitude" counts the bandwidth of phase alone, "rate"
            the lesser of those of phase and gain. None: attitude in roll and pitch, rate in yaw.
        bandwidth: rad/s; None: of the task and axis.
        delay: s, of phase delay.
        fit: phase delay by least squares, as the standard asks if phase isn't straight.
        sign: -1 if the angle answers a positive stick by falling.
    """

    task: str = "other"
    command: str | None = None
    bandwidth: Limit | None = None
    delay: Limit = DELAY
    fit: bool = False
    sign: int = 1

    name: ClassVar[str] = "attitude_bandwidth"
    source: ClassVar[str] = (
        "ADS-33E-PRF, 3.3.2.1 and 3.3.5.1, hover and low speed: least bandwidth "
        "at small phase delay. The figures' borders lean to more bandwidth as phase delay grows; "
        "here a phase delay of its own ends the levels, a choice of ours"
    )
    units: ClassVar[Mapping[str, str]] = {
        "bandwidth": "rad/s",
        "phase_delay": "s",
        "phase_bandwidth": "rad/s",
        "gain_bandwidth": "rad/s",
        "neutral": "rad/s",
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bandwidth is not None:
            self.bandwidth.check_direction("bandwidth", more=True)
        if self.task not in TASKS:
            raise UnknownNameError("task", self.task, TASKS)
        if self.command is not None and self.command not in KINDS:
            raise UnknownNameError("command", self.command, KINDS)
        if self.bandwidth is None and self.axis not in TASKS[self.task]:
            raise InputError(
                f"ADS-33 has no bandwidth of {self.word}: give one as `bandwidth`, or rate "
                "roll, pitch or yaw"
            )

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of bandwidth and phase delay."""
        return {
            "bandwidth": (self.bandwidth or TASKS[self.task][self.axis]).scaled(self.faster),
            "phase_delay": self.delay.scaled(1.0 / self.faster),
        }

    def rate(self, loop: Loop) -> Rating:
        """Return bandwidths, phase delay and the frequency of -180 deg."""
        found = bandwidth(loop.command(self.axis), fit=self.fit, sign=self.sign)
        attitude = (self.command or ("rate" if self.axis == "ped" else "attitude")) == "attitude"
        counted = found.attitude if attitude else found.rate
        figures = {
            "bandwidth": counted,
            "phase_delay": found.delay,
            "phase_bandwidth": found.phase,
            "gain_bandwidth": found.gain,
            "neutral": found.neutral,
        }
        remarks = []
        if not found.complete:
            remarks.append("the response ends before all is seen: what is missing was continued")
        if attitude and found.gain_limited:
            remarks.append("the gain's bandwidth is below the phase's: look for oscillations")
        return self.rated(figures, remark="; ".join(remarks))

    def chart(self) -> Chart:
        """Return phase delay over bandwidth."""
        least, most = self.limits["bandwidth"], self.limits["phase_delay"]
        across = ChartAxis("bandwidth", "bandwidth", "rad/s", 0.0, 3.0 * least.level1)
        up = ChartAxis("phase_delay", "phase delay", "s", 0.0, 1.5 * most.level2)
        title = f"Bandwidth, {self.word}, {self.task.replace('_', ' ')}"
        return corner(title, across, up, least, most, self.source)
