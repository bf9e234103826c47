"""Rejection of loads: how far what a gust does to the rotors turns the vehicle."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from helisim.errors import InputError
from helisim.handling.axis import axis_of
from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Limit
from helisim.handling.criteria.regions import strip
from helisim.handling.loop import Loop, NoResponse
from helisim.units import DB_PER_NEPER

_LEAST = 1e-12
"""rad a unit of command: less turns nothing, and figures are finite."""


@dataclass(frozen=True, kw_only=True)
class LoadRejection(Criterion):
    """How far a slow load turns the vehicle: a disturbance that is added to servo commands.

    Disturbance rejection bandwidth says where the loop begins to reject, not how much it does: a
    loop whose gain stays near one for a decade has a high bandwidth, and gives way to gusts.

    Attributes:
        frequency: rad/s, of the load.
        turned: dB of rad, or in heave of m/s, a unit of command.
        by: axes whose commands are disturbed, one after the other, as "lat+lon": the angle is the
            root of the sum of squares. Its own alone where it is empty.

    Raises:
        InputError: the frequency is not above 0, or Level 1 ends above Level 2.
        UnknownNameError: there is no such axis.
    """

    frequency: float
    turned: Limit
    by: str = ""

    name: ClassVar[str] = "load_rejection"
    source: ClassVar[str] = (
        "The closed loop's compliance, angle over load, as of any servomechanism; borders are the "
        "user's, such as what the law before gives way"
    )
    units: ClassVar[Mapping[str, str]] = {"turned": "dB"}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.turned.check_direction("turned", more=False)
        loads = [axis_of(one.strip()).name for one in (self.by or self.axis).split("+")]
        object.__setattr__(self, "by", "+".join(loads))
        if not (math.isfinite(self.frequency) and self.frequency > 0.0):
            raise InputError(f"frequency must be above 0 rad/s, got {self.frequency!r}")

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of the angle."""
        return {"turned": self.turned}

    @property
    def asked_at(self) -> float:
        """The load's frequency, scaled, rad/s."""
        return self.frequency * self.faster

    def rate(self, loop: Loop) -> Rating:
        """Return how far the load turns the vehicle."""
        size = math.hypot(*(self._turned(loop, by) for by in self.by.split("+")))
        return self.rated({"turned": DB_PER_NEPER * math.log(max(size, _LEAST))})

    def _turned(self, loop: Loop, by: str) -> float:
        seen = loop.turned(self.axis, by)
        low, high = seen.frequency[0], seen.frequency[-1]
        if not low <= self.asked_at <= high:
            raise NoResponse(
                f"what a load on {by} does to {self.word} is known from {low:g} to {high:g} "
                f"rad/s, not at {self.asked_at:g}"
            )
        # a load that turns nothing has no logarithm, so its size itself is interpolated
        where, size = np.log(seen.frequency), np.abs(seen.response)
        return float(np.interp(math.log(self.asked_at), where, size))

    def chart(self) -> Chart:
        """Return a strip of the angle."""
        label = f"angle a unit of command at {self.asked_at:.3g} rad/s"
        ends = self.turned.level1 - 20.0, self.turned.level2 + 10.0
        return strip(
            f"Loads, {self.word}", ChartAxis("turned", label, "dB", *ends), self.turned, self.source
        )
