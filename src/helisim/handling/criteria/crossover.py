"""Crossover: how fast a loop is, and whether it is there as K/s."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from helisim.handling.chart import Chart, ChartAxis
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.limit import Limit
from helisim.handling.criteria.regions import strip
from helisim.handling.figures.margins import margins, slope_order
from helisim.handling.loop import Loop

ORDER = Limit(0.5, 1.0)
"""Of the departure of the order from 1."""


@dataclass(frozen=True, kw_only=True)
class Crossover(Criterion):
    """The highest frequency at which the gain of a broken loop falls through one.

    Attributes:
        at: where the loop is cut, as in `Loop.broken`.
        frequency: rad/s. Level 1 above Level 2 asks for a fast loop; below it, for one that
            doesn't pay for speed, as an objective does.
    """

    at: str = "actuators"
    frequency: Limit

    name: ClassVar[str] = "crossover"
    source: ClassVar[str] = (
        "Tischler, Berger, Ivler, Mansur, Cheung and Soong, Practical Methods for Aircraft and "
        "Rotorcraft Flight Control Design, AIAA, 2017; the borders are the user's"
    )
    units: ClassVar[Mapping[str, str]] = {"crossover": "rad/s"}

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of the crossover."""
        return {"crossover": self.frequency.scaled(self.faster)}

    def rate(self, loop: Loop) -> Rating:
        """Return the crossover, continued beyond the band."""
        found = margins(loop.broken(self.axis, self.at))
        remark = "" if found.crosses else "the gain does not fall through one in its band: extended"
        return self.rated({"crossover": found.crossover}, remark=remark)

    def chart(self) -> Chart:
        """Return a strip of frequency."""
        limit = self.limits["crossover"]
        top = 2.0 * max(limit.level1, limit.level2)
        axis = ChartAxis("crossover", "crossover frequency", "rad/s", 0.0, top)
        return strip(f"Crossover, {self.word}, cut at {self.at}", axis, limit, self.source)


@dataclass(frozen=True, kw_only=True)
class CrossoverOrder(Criterion):
    """How near a broken loop is to K/s around its crossover.

    Attributes:
        at: where the loop is cut, as in `Loop.broken`.
        span: the line is fitted from crossover / span to crossover * span.
        departure: of the order from 1, to either side.
    """

    at: str = "actuators"
    span: float = 2.0
    departure: Limit = ORDER

    name: ClassVar[str] = "crossover_order"
    source: ClassVar[str] = (
        "McRuer and Jex, A Review of Quasi-Linear Pilot Models, IEEE Transactions on Human "
        "Factors in Electronics 8 (3), 1967: K/s about crossover; the borders are a choice of ours"
    )
    units: ClassVar[Mapping[str, str]] = {"order": "", "departure": "", "crossover": "rad/s"}

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Of the departure."""
        return {"departure": self.departure}

    def rate(self, loop: Loop) -> Rating:
        """Return the slope over -20 dB a decade, and how far it is from 1."""
        broken = loop.broken(self.axis, self.at)
        middle = margins(broken).crossover
        order = slope_order(broken, middle, span=self.span)
        figures = {"order": order, "departure": abs(order - 1.0), "crossover": middle}
        return self.rated(figures)

    def chart(self) -> Chart:
        """Return a strip of the departure."""
        axis = ChartAxis("departure", "departure of the order from 1", "", 0.0, 2.0)
        title = f"Slope at crossover, {self.word}, cut at {self.at}"
        return strip(title, axis, self.departure, self.source)
