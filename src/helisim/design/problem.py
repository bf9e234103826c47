"""A design as a problem: what a law is worth in each model, by every specification."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from helisim.base.linear import Linear
from helisim.design.descent import Trial
from helisim.design.free import Free, box, coordinates, values
from helisim.design.guarded import distance
from helisim.design.kept import Kept
from helisim.design.laws.law import Law
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import PoleLimits, Rating
from helisim.handling.loop import Loop
from helisim.handling.spec import Spec

Vector = NDArray[np.float64]
Ratings = tuple[Rating, ...]

FREQUENCY = np.geomspace(0.3, 120.0, 120)
"""rad/s, at which laws are tried: 5 % apart, between which curves are read by straight lines of
log and phase. What is reported is computed on the finer grid of loops."""
_AT_REST = 1e-4
"""rad/s: an integrator that no law closes, such as of the heading, stands at 0 but for rounding."""

Close = Callable[[Linear, Linear, Vector], Loop]


def closed(plant: Linear, law: Linear, frequency: Vector) -> Loop:
    """Return the loop that a model and a law's linear form close at frequencies, (n_freq,)."""
    return ClosedLoop(plant, law, frequency)


@dataclass(frozen=True, eq=False)
class Problem:
    """Laws of one structure, by their free parameters, in several models of one aircraft.

    Attributes:
        law: where the search starts.
        specs: that are asked for.
        models: the nominal one first, each from commands to what is sensed.
        free: the parameters that may be moved.
        period: s, between the ticks of the law.
        close: closes a loop of a model and a law's linear form at frequencies, (n_freq,) rad/s.
        frequency: (n_freq,) rad/s.
    """

    law: Law
    specs: tuple[Spec, ...]
    models: tuple[Linear, ...]
    free: tuple[Free, ...]
    period: float
    close: Close = closed
    frequency: Vector = field(default_factory=lambda: FREQUENCY)

    def __post_init__(self) -> None:
        kept = tuple(one if isinstance(one, Kept) else Kept(one) for one in self.models)
        object.__setattr__(self, "models", kept)

    @cached_property
    def start(self) -> Vector:
        """Coordinates of the law that it starts from, (n_free,)."""
        return coordinates(self.free, self.law.parameters())

    @cached_property
    def box(self) -> tuple[Vector, Vector]:
        """The lowest and the highest coordinates, (n_free,) each."""
        return box(self.free)

    def law_at(self, at: Vector) -> Law:
        """Return the law at coordinates, (n_free,)."""
        return self.law.replace(values(self.free, at))

    def loops(
        self, at: Vector, which: Sequence[int] = (0,), frequency: Vector | None = None
    ) -> list[Loop]:
        """Return the loops that a law closes.

        Args:
            at: coordinates of the law, (n_free,).
            which: of the models.
            frequency: (n_freq,) rad/s; by default those at which laws are tried.
        """
        wanted = self.frequency if frequency is None else frequency
        law = Kept(self.law_at(at).linear(self.period))
        return [self.close(self.models[k], law, wanted) for k in which]

    def rate(self, loop: Loop) -> Ratings:
        """Return the rating of a loop by each specification."""
        return tuple(one.criterion.rate(loop) for one in self.specs)

    def trial(self, at: Vector, which: Sequence[int], *, near: bool = False) -> Trial | None:
        """Return what a law is worth: distances by model and specification, one after the other.

        Args:
            at: coordinates of the law, (n_free,).
            which: of the models; the cost is that in the first.
            near: True beside a law that is stable, where stability isn't asked for again.

        Returns:
            None where a loop is unstable.
        """
        loops = self.loops(at, which)
        if not near and any(slowest(loop) > 0.0 for loop in loops):
            return None
        asked = np.flatnonzero(self.of_kind("hard", "soft"))
        distances = np.full((len(loops), len(self.specs)), np.inf)
        for row, loop in zip(distances, loops):
            row[asked] = [distance(self.specs[k].criterion, loop) for k in asked]
        return Trial(distances.ravel(), self.cost(loops[0]))

    def cost(self, loop: Loop) -> float:
        """Return the summed objective: how far objectives are from their borders, inside < 0."""
        aims = [one.criterion for one in self.specs if one.kind == "objective"]
        return -sum(one.rate(loop).distance for one in aims)

    @property
    def widened(self) -> NDArray[np.bool_]:
        """Which specifications a design margin is asked of, (n_spec,).

        Not of poles: integrals of what is commanded stand at 0 whatever the law does.
        """
        return np.array([not isinstance(one.criterion, PoleLimits) for one in self.specs])

    def of_kind(self, *kinds: str) -> NDArray[np.bool_]:
        """Return which specifications are of some kinds, (n_spec,)."""
        return np.array([one.kind in kinds for one in self.specs])


def slowest(loop: Loop) -> float:
    """Return the largest real part of a loop's poles, rad/s, positive where it is unstable."""
    return float(np.max(loop.poles.real)) - _AT_REST
