"""Attitude quickness: how quickly attitudes of moderate size change."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from helisim.base.errors import InputError
from helisim.base.units import RAD_PER_DEG
from helisim.handling.axis import axis_of
from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Border
from helisim.handling.criteria.regions import above
from helisim.handling.figures.history import changed
from helisim.handling.loop import Loop, NoResponse


def _border(
    along: tuple[float, ...], level1: tuple[float, ...], level2: tuple[float, ...]
) -> Border:
    return Border(tuple(one * RAD_PER_DEG for one in along), level1, level2)


BORDERS = {
    "lon": _border(
        (5.0, 10.0, 15.0, 20.0, 25.0, 30.0),
        (1.60, 1.41, 1.24, 1.12, 1.02, 0.95),
        (0.42, 0.40, 0.386, 0.376, 0.357, 0.344),
    ),
    "lat": _border(
        (10.0, 15.0, 20.0, 30.0, 38.0, 50.0),
        (2.41, 2.17, 1.95, 1.50, 1.30, 1.01),
        (1.61, 1.54, 1.48, 1.36, 1.265, 1.00),
    ),
    "ped": _border(
        (10.0, 20.0, 30.0, 40.0, 50.0, 60.0),
        (1.76, 1.51, 1.25, 1.17, 1.095, 1.02),
        (0.595, 0.564, 0.533, 0.497, 0.466, 0.425),
    ),
}
"""Axis -> quickness, 1/s, along the least change of attitude, rad, of a full-scale helicopter."""


CHANGE = 20.0 * RAD_PER_DEG


@dataclass(frozen=True, kw_only=True)
class AttitudeQuickness(Criterion):
    """The peak rate over the peak change of an attitude, by a step of the stick or a pulse.

    Attributes:
        change: rad, of attitude; less if all of the stick doesn't reach it.
        size: unitised stick: 0.5 is all of it to one side.
        duration: s, that is looked at, of a full-scale helicopter.
        border: quickness along the least change after the peak; None: of the axis.
    """

    change: float = CHANGE
    size: float = 0.5
    duration: float = 5.0
    border: Border | None = None

    name: ClassVar[str] = "attitude_quickness"
    source: ClassVar[str] = (
        "ADS-33E-PRF, 3.3.3 and 3.3.6, hover and low speed; the figures' borders as digitised by "
        "Prencipe, MSc thesis, Delft University of Technology (github.com/YPrencipe/CCHThesis: "
        "qpitchhq1, prollhq1, ryawhq1 and 2), to about 0.02 1/s"
    )
    angles: ClassVar[tuple[str, ...]] = ("change",)
    units: ClassVar[Mapping[str, str]] = {"quickness": "1/s", "least": "rad", "peak": "rad"}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.border is None and self.axis not in BORDERS:
            raise InputError(
                f"ADS-33 has no quickness of {self.word}: give a border, or rate roll, pitch or yaw"
            )

    @property
    def limits(self) -> Mapping[str, Border]:
        """Of quickness, along the least change."""
        return {"quickness": (self.border or BORDERS[self.axis]).scaled(value=self.faster)}

    def rate(self, loop: Loop) -> Rating:
        """Return the quickness, and the changes of attitude that it is of."""
        seen = loop.step(self.axis, size=self.size, duration=self.duration / self.faster)
        one = axis_of(self.axis)
        angle, rate = (seen.signals.get(name or "") for name in (one.angle, one.rate))
        if angle is None or rate is None:
            raise NoResponse(f"a step of {self.axis} shows no {one.angle} and {one.rate}")
        found = changed(seen.time, angle, rate, change=self.change)
        figures = {"quickness": found.ratio, "least": found.least, "peak": found.peak}
        return self.rated(figures, along=found.least)

    def chart(self) -> Chart:
        """Return quickness over the least change of attitude."""
        border = self.limits["quickness"]
        across = ChartAxis("least", "least change of attitude", "rad", 0.0, border.along[-1])
        up = ChartAxis("quickness", "quickness", "1/s", 0.0, 2.0 * max(border.level1))
        return above(f"Attitude quickness, {self.word}", across, up, border, self.source)
