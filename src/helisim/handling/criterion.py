"""What a criterion of a closed loop is, how it rates one, and how it scales with a vehicle."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from helisim.base.display import shower
from helisim.base.errors import InputError
from helisim.base.settings import FrozenMap, check, setting
from helisim.handling.chart import Border, Chart, Level, Limit, above, corner, strip
from helisim.handling.loop import Loop, axis_of

if TYPE_CHECKING:
    from helisim.base.display import Axes, Figure

MOST = 10.0
"""Distances end here to either side: an optimiser needs no more, and none may be infinite."""
UH60_ROTOR = 16.36
"""m, rotor diameter of the UH-60A, 53 ft 8 in: the helicopter that criteria of rotorcraft are
mostly drawn from."""
WHOLE = "all"
"""The axis of a criterion of the whole loop."""


@dataclass(frozen=True)
class Froude:
    """Froude's law: factors of figures for a vehicle that is `ratio` times smaller.

    Two vehicles of one shape are dynamically alike in gravity if speed squared over length and g is
    the same: times are then sqrt N shorter on the smaller one and frequencies sqrt N higher. So
    Ivler and Geyer, "Outer Loop Requirements for Vertical Lift Unmanned Aerial System Automated
    Flying Qualities", VFS 80th Annual Forum, 2024, scale MIL-DTL-32742, which supersedes ADS-33E.

    Attributes:
        ratio: N, length of the vehicle that figures are known of over that of the other.

    Raises:
        InputError: the ratio is not above 0.
    """

    ratio: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.ratio) and self.ratio > 0.0):
            raise InputError(f"a ratio of lengths must be above 0, got {self.ratio!r}")

    @classmethod
    def of(cls, length: float, *, reference: float = UH60_ROTOR) -> "Froude":
        """Return the law for a vehicle by its length and that of the reference.

        Args:
            length: m, of the smaller vehicle; of a helicopter its rotor's diameter.
            reference: m, the same length of the vehicle that figures are known of.

        Raises:
            InputError: a length is not above 0.
        """
        if not (length > 0.0 and reference > 0.0):
            raise InputError(f"lengths must be above 0, got {length!r} and {reference!r}")
        return cls(reference / length)

    @property
    def frequency(self) -> float:
        """Of frequencies, and of angular rates."""
        return math.sqrt(self.ratio)

    @property
    def time(self) -> float:
        """Of times and delays, and of speeds."""
        return 1.0 / math.sqrt(self.ratio)

    speed = time

    @property
    def length(self) -> float:
        """Of lengths and positions."""
        return 1.0 / self.ratio

    @property
    def acceleration(self) -> float:
        """Of accelerations: none, as gravity is the same."""
        return 1.0

    @property
    def angular_acceleration(self) -> float:
        """Of angular accelerations."""
        return self.ratio

    @property
    def mass(self) -> float:
        """Of masses, at the same density."""
        return self.ratio**-3

    @property
    def inertia(self) -> float:
        """Of moments of inertia, at the same density."""
        return self.ratio**-5


@dataclass(frozen=True)
class Rating:
    """What a criterion says of a loop.

    Attributes:
        criterion: that says it.
        figures: name -> value, in the units of `criterion.units`.
        level: 1 (satisfactory), 2 (tolerable) or 3.
        distance: from the border of Level 1: positive inside, 0 there, -1 at the border between
            Levels 2 and 3. Finite, and continuous where the loop's response is.
        remark: what a reader of the figures should know; "" for nothing.
    """

    criterion: "Criterion"
    figures: Mapping[str, float]
    level: Level
    distance: float
    remark: str = ""


@dataclass(frozen=True, kw_only=True)
class Criterion(ABC):
    """What is asked of one axis of a loop. Derive, declare the class variables, write `rate`.

    Attributes:
        axis: of control, by its command or word; `Loop.axes` has those of a loop.
        scale: N, length of the vehicle that the source speaks of over that of the one that is
            rated; 1: borders as printed. By Froude's law frequencies of the borders are
            multiplied by sqrt N and times divided by it. See `Froude`.
    """

    axis: str
    scale: float = setting(1.0, above=0.0)

    name: ClassVar[str]
    """By which files call it."""
    source: ClassVar[str]
    """Document, paragraph and figure, and what of it is a choice of ours."""
    units: ClassVar[Mapping[str, str]]
    """Figure -> unit: SI, or dB."""
    angles: ClassVar[tuple[str, ...]] = ()
    """Fields in radians: a file may give them in degrees, `phase` as `phase_deg`."""
    borders: ClassVar[Mapping[str, tuple[str, int]]] = {}
    """Figure that has a border -> its field, and 1 if the border is a frequency, -1 a time."""
    better: ClassVar[Mapping[str, Literal["more", "less"]]] = {}
    """Field of a border without a default -> what of it is better."""

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
        """Return figures, level and distance of a loop.

        Raises:
            NoResponse: the loop doesn't know what this criterion asks for.
        """

    def chart(self) -> Chart:
        """Return its standard chart, borders scaled."""
        title, *axes = self._axes()
        limits = [self.limits.get(one.figure) for one in axes]
        match limits:
            case [Limit() as one]:
                return strip(title, axes[0], one, self.source)
            case [Limit() as one, Limit() as two]:
                return corner(title, axes[0], axes[1], one, two, self.source)
            case [_, Border() as border]:
                return above(title, axes[0], axes[1], border, self.source)
            case _:
                raise NotImplementedError(f"{type(self).__name__} needs a chart of its own")

    def _axes(self) -> tuple[Any, ...]:
        """Return the chart's title and its axes, one or two, named after figures with borders."""
        raise NotImplementedError(f"{type(self).__name__} needs a `chart`")

    def plot(self, ratings: Any, *, axes: "Axes | None" = None) -> "Figure":
        """Draw ratings on the standard chart.

        Args:
            ratings: one, or several (a cloud of draws), or a mapping from a label to either, of
                several the first the nominal one.
            axes: of Matplotlib, to draw on.
        """
        return shower().plot_ratings(self, ratings, axes)

    @property
    def limits(self) -> Mapping[str, Limit | Border]:
        """Borders of levels by the figure that they are of, scaled; figures without are told."""
        factors = {1: self.faster, 0: 1.0, -1: 1.0 / self.faster}
        known = ((name, self._border(one), by) for name, (one, by) in self.borders.items())
        return {name: one.scaled(factors[by]) for name, one, by in known if one is not None}

    def _border(self, name: str) -> Limit | Border | None:
        return getattr(self, name)

    @property
    def faster(self) -> float:
        """By what frequencies of its source are multiplied: sqrt N."""
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
        remark: str = "",
        along: float = 0.0,
    ) -> Rating:
        """Return a rating: the worst distance, and the level that this is.

        Args:
            figures: all of them.
            distances: of its parts; None: of the figures to their `limits`.
            remark: what a reader of the figures should know.
            along: where a limit that is a `Border` is asked.
        """
        if distances is None:
            distances = [
                limit.distance(figures[name], along)
                if isinstance(limit, Border)
                else limit.distance(figures[name])
                for name, limit in self.limits.items()
            ]
        distance = min(max(min(distances), -MOST), MOST)
        return Rating(self, FrozenMap(figures), level_of(distance), distance, remark)


def level_of(distance: float) -> Level:
    """Return the level that a distance from the border of Level 1 is."""
    if distance >= 0.0:
        return 1
    return 2 if distance >= -1.0 else 3
