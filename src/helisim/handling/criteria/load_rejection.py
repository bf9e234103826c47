"""Rejection of loads: how far what a gust does to the rotors turns the vehicle."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from helisim.base.errors import InputError
from helisim.base.units import DB_PER_NEPER
from helisim.handling.axis import axis_of
from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Limit
from helisim.handling.criteria.regions import strip
from helisim.handling.loop import Loop, NoResponse

_LEAST = 1e-12
"""rad a unit of command: less turns nothing, and figures are finite."""


@dataclass(frozen=True, kw_only=True)
class LoadRejection(Criterion):
    """How far a slow load turns the vehicle: a disturbance that is added to a servo command.

    Disturbance rejection bandwidth says where the loop begins to reject, not how much it does: a
    loop whose gain stays near one for a decade has a high bandwidth, and gives way to gusts.

    Attributes:
        low: rad/s, of the slowest load.
        high: rad/s, of the fastest.
        turned: dB of rad, or in heave of m/s, a unit of command: the most that is turned.
        by: axis whose command is disturbed; its own where it is empty. A rotor turns what is done
            to one axis into another.

    Raises:
        InputError: not 0 < low < high, or Level 1 ends above Level 2.
        UnknownNameError: there is no such axis.
    """

    low: float = 0.3
    high: float
    turned: Limit
    by: str = ""

    name: ClassVar[str] = "load_rejection"
    source: ClassVar[str] = (
        "The closed loop's compliance, angle over load, as of any servomechanism; borders are the "
        "user's, such as what the law before gives way"
    )
    units: ClassVar[Mapping[str, str]] = {"turned": "dB", "frequency": "rad/s"}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.turned.check_direction("turned", more=False)
        object.__setattr__(self, "by", axis_of(self.by or self.axis).name)
        if not (math.isfinite(self.high) and 0.0 < self.low < self.high):
            raise InputError(f"loads go from low to high, 0 < low < high; got {self.band} rad/s")

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of the angle."""
        return {"turned": self.turned}

    @property
    def band(self) -> tuple[float, float]:
        """Of the loads, scaled, rad/s."""
        return self.low * self.faster, self.high * self.faster

    def rate(self, loop: Loop) -> Rating:
        """Return the most that loads turn the vehicle, and at which frequency."""
        seen, (low, high) = loop.turned(self.axis, self.by), self.band
        there = (seen.frequency >= low) & (seen.frequency <= high)
        if not (seen.frequency[0] <= low and high <= seen.frequency[-1] and there.any()):
            raise NoResponse(
                f"what a load on {self.by} does to {self.word} is known from "
                f"{seen.frequency[0]:g} to {seen.frequency[-1]:g} rad/s, not from {low:g} to "
                f"{high:g}"
            )
        size = np.abs(seen.response[there])
        most = int(np.argmax(size))
        turned = DB_PER_NEPER * math.log(max(float(size[most]), _LEAST))
        return self.rated({"turned": turned, "frequency": float(seen.frequency[there][most])})

    def chart(self) -> Chart:
        """Return a strip of the angle."""
        label = f"angle a unit of command on {axis_of(self.by).word}"
        ends = self.turned.level1 - 20.0, self.turned.level2 + 10.0
        axis = ChartAxis("turned", label, "dB", *ends)
        return strip(f"Loads, {self.word}", axis, self.turned, self.source)
