"""The base class of criteria, their ratings, and how they scale with a vehicle."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from helisim.base.display import shower
from helisim.base.settings import FrozenMap, Limits, check, convert, setting
from helisim.handling.limit import Level, Limit
from helisim.handling.loop import Loop, axis_of

if TYPE_CHECKING:
    from helisim.base.display import Figure

MOST = 20.0  # largest distance to either side
UH60_ROTOR = 16.36  # m, rotor diameter of the UH-60A, 53 ft 8 in
WHOLE = "all"  # axis of a criterion of the whole loop


def froude_scale(diameter: float) -> float:
    """Return N, the UH-60A's rotor diameter over `diameter`, m: the `scale` of criteria.

    Source: Ivler and Geyer, "Outer Loop Requirements for Vertical Lift Unmanned Aerial System
    Automated Flying Qualities", VFS 80th Annual Forum, 2024. Raises InputError unless above 0.
    """
    return UH60_ROTOR / convert(float, diameter, "a rotor's diameter", Limits("m", above=0.0))


@dataclass(frozen=True)
class Rating:
    """A criterion's rating of a loop: figures by name, in `criterion.units`, level and remark.

    `distance` is 0 at the border of Level 1, positive inside, -1 where Level 2 ends; finite.
    """

    criterion: "Criterion"
    figures: Mapping[str, float]
    level: Level
    distance: float
    remark: str = ""


@dataclass(frozen=True, kw_only=True)
class Criterion(ABC):
    """A requirement on one axis of a loop. Derive, declare the class variables, write `rate`.

    With `scale`, N of `froude_scale`, frequencies of borders grow by sqrt N, times shrink by it.
    """

    axis: str
    scale: float = setting(1.0, above=0.0)

    name: ClassVar[str]
    """Name in files."""
    source: ClassVar[str]
    """Document, paragraph and figure, and which part is a choice of ours."""
    units: ClassVar[Mapping[str, str]]
    """Figure -> unit: SI, or dB."""
    angles: ClassVar[tuple[str, ...]] = ()
    """Fields in radians: a file may give them in degrees, `phase` as `phase_deg`."""
    borders: ClassVar[Mapping[str, tuple[str, int]]] = {}
    """Figure with a border -> its field, and 1 if the border is a frequency, -1 a time, else 0."""
    better: ClassVar[Mapping[str, Literal["more", "less"]]] = {}
    """Field of a border without a default -> whether more or less is better."""

    def __post_init__(self) -> None:
        if not self.axis == getattr(type(self), "axis", "") == WHOLE:
            object.__setattr__(self, "axis", axis_of(self.axis).name)
        check(self, getattr(self, "name", ""))
        for one in fields(self):
            given, usual = getattr(self, one.name), one.default
            more = usual.more_is_better if isinstance(usual, Limit) else None
            more = {"more": True, "less": False}.get(self.better.get(one.name, ""), more)
            if isinstance(given, Limit) and more is not None:
                given.check_direction(one.name, more=more)

    @abstractmethod
    def rate(self, loop: Loop) -> Rating:
        """Return figures, level and distance of a loop. Raises NoResponse."""

    def plot(self, ratings: Any) -> "Figure":
        """Draw ratings on the standard chart: one, several (first nominal), or either by label."""
        return shower().plot_ratings(self, ratings)

    @property
    def limits(self) -> Mapping[str, Limit]:
        """Figure -> borders of its levels, scaled; figures without borders are left out."""
        factors = {1: self.faster, 0: 1.0, -1: 1.0 / self.faster}
        known = ((name, self._border(one), by) for name, (one, by) in self.borders.items())
        return {name: one.scaled(factors[by]) for name, one, by in known if one is not None}

    def _border(self, name: str) -> Limit | None:
        return getattr(self, name)

    @property
    def faster(self) -> float:
        """Factor of its source's frequencies: sqrt N."""
        return math.sqrt(self.scale)

    @property
    def word(self) -> str:
        """The axis as pilots call it."""
        return "whole loop" if self.axis == WHOLE else axis_of(self.axis).word

    def rated(
        self,
        figures: Mapping[str, float],
        distances: Iterable[float] | None = None,
        *,
        remarks: Mapping[str, bool] = FrozenMap({}),
    ) -> Rating:
        """Return a rating by the worst distance; by default of figures to their `limits`.

        `remarks` are sentences, and whether they hold.
        """
        if distances is None:
            distances = [one.distance(figures[name]) for name, one in self.limits.items()]
        distance = min(max(min(distances), -MOST), MOST)
        level: Level = 1 if distance >= 0.0 else 2 if distance >= -1.0 else 3
        said = "; ".join(text for text, holds in remarks.items() if holds)
        return Rating(self, FrozenMap(figures), level, distance, said)
