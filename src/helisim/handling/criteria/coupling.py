"""Coupling between axes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from helisim.base.errors import InputError
from helisim.handling.axis import axis_of
from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Limit
from helisim.handling.criteria.regions import strip
from helisim.handling.figures.history import coupling
from helisim.handling.loop import Loop, NoResponse

RATIO = Limit(0.25, 0.60)
AFTER = 4.0
"""s, of a full-scale helicopter."""


@dataclass(frozen=True, kw_only=True)
class Coupling(Criterion):
    """What a step of one stick does to another attitude.

    Attributes:
        axis: whose stick.
        onto: the other axis.
        size: unitised stick.
        after: s, of a full-scale helicopter.
        ratio: peak of the other attitude within that time over the commanded one at its end.
    """

    onto: str = ""
    size: float = 0.1
    after: float = AFTER
    ratio: Limit = RATIO

    name: ClassVar[str] = "coupling"
    source: ClassVar[str] = (
        "ADS-33E-PRF, 3.3.9.2: pitch due to roll and roll due to pitch, 0.25 and 0.60 within 4 s"
    )
    units: ClassVar[Mapping[str, str]] = {"ratio": ""}

    def __post_init__(self) -> None:
        super().__post_init__()
        usual = {"lat": "lon", "lon": "lat"}.get(self.axis)
        other = axis_of(self.onto).name if self.onto else usual
        if other is None or other == self.axis:
            raise InputError(f"coupling of {self.word} onto what? give another axis as `onto`")
        object.__setattr__(self, "onto", other)

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of the ratio."""
        return {"ratio": self.ratio}

    def rate(self, loop: Loop) -> Rating:
        """Return the ratio."""
        after = self.after / self.faster
        seen = loop.step(self.axis, size=self.size, duration=after)
        own, other = axis_of(self.axis).angle, axis_of(self.onto).angle
        if own not in seen.signals or other not in seen.signals:
            raise NoResponse(f"a step of {self.axis} shows no {own} and {other}")
        found = coupling(seen.time, seen.signals[own], seen.signals[other], after=after)
        return self.rated({"ratio": found})

    def chart(self) -> Chart:
        """Return a strip of the ratio."""
        other = axis_of(self.onto).word
        axis = ChartAxis("ratio", f"{other} over {self.word}", "", 0.0, 1.0)
        return strip(f"Coupling of {self.word} onto {other}", axis, self.ratio, self.source)
