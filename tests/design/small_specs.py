"""Specifications of the small aircraft; see `small_design`."""

from dataclasses import dataclass
from typing import ClassVar

from helisim.handling.chart import ChartAxis, strip
from helisim.handling.criteria import Criterion, Limit, Rating, StabilityMargins
from helisim.handling.figures import margins, rejection
from helisim.handling.spec import Spec


@dataclass(frozen=True, kw_only=True)
class Rejects(Criterion):
    """Bandwidth of disturbance rejection alone."""

    bandwidth: Limit
    name: ClassVar[str] = "rejects"
    units: ClassVar[dict[str, str]] = {"bandwidth": "rad/s"}

    def rate(self, loop) -> Rating:
        """Return the bandwidth."""
        found = rejection(loop.disturbance(self.axis)).bandwidth
        return self.rated({"bandwidth": found})

    @property
    def limits(self):
        """Of the bandwidth."""
        return {"bandwidth": self.bandwidth}

    def chart(self):
        """Return a strip."""
        axis = ChartAxis("bandwidth", "", "rad/s", 0.0, 50.0)
        return strip("", axis, self.bandwidth, "")


@dataclass(frozen=True, kw_only=True)
class Crosses(Criterion):
    """Crossover at the actuator."""

    crossover: Limit
    name: ClassVar[str] = "crosses"
    units: ClassVar[dict[str, str]] = {"crossover": "rad/s"}

    def rate(self, loop) -> Rating:
        """Return the crossover."""
        found = margins(loop.broken(self.axis)).crossover
        return self.rated({"crossover": found})

    @property
    def limits(self):
        """Of the crossover."""
        return {"crossover": self.crossover}

    def chart(self):
        """Return a strip."""
        axis = ChartAxis("crossover", "", "rad/s", 0.0, 50.0)
        return strip("", axis, self.crossover, "")


def small_specs(*, lat: float = 16.0, lon: float = 11.0) -> tuple[Spec, ...]:
    """Margins of both axes, rejection, least crossover.

    Args:
        lat: rad/s, least bandwidth of rejection in roll.
        lon: rad/s, in pitch.
    """
    wanted = {"lat": Limit(lat, 0.5 * lat), "lon": Limit(lon, 0.5 * lon)}
    return (
        *(Spec(StabilityMargins(axis=axis), "hard") for axis in wanted),
        *(Spec(Rejects(axis=axis, bandwidth=limit), "soft") for axis, limit in wanted.items()),
        *(Spec(Crosses(axis=axis, crossover=Limit(20.0, 40.0)), "objective") for axis in wanted),
    )
