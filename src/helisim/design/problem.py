"""A design as a problem: what a law is worth in each model, and the phases that make it better.

Hard constraints come first, then levels, then cost, as in CONDUIT: Tischler, Berger, Ivler, Mansur,
Cheung and Soong, Practical Methods for Aircraft and Rotorcraft Flight Control Design: An
Optimization-Based Approach, AIAA 2017, chapter 3.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, OptimizeResult, differential_evolution

from helisim.base.errors import HelisimError, InputError, UnknownNameError
from helisim.base.linear import Linear, Response
from helisim.base.units import RAD_PER_DEG
from helisim.design.descent import Goal, Objective, Point, Trial, Vector, descend
from helisim.design.laws.law import Law
from helisim.handling.chart import Limit
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import Crossover, DisturbanceRejection, PoleLimits
from helisim.handling.criterion import Criterion, Rating
from helisim.handling.figures import HALF_POWER
from helisim.handling.loop import Loop
from helisim.handling.spec import Spec

Close = Callable[[Linear, Linear, Vector], Loop]
Ratings = tuple[Rating, ...]

FREQUENCY = np.geomspace(0.3, 120.0, 120)
"""rad/s, at which laws are tried: 5 % apart, between which curves are read by straight lines of
log and phase. What is reported is computed on the finer grid of loops."""
_AT_REST = 1e-4
"""rad/s: an integrator that no law closes, such as of the heading, stands at 0 but for rounding."""
_SPAN = 4.0
"""Coordinates that a range around zero is long: as much as a factor of 55."""
_REACH = 30.0
"""Factor up and down from a start, where no range is stated."""
_HUMP = 15.0
"""dB of |S| below 1 / sqrt 2 that count as one unit of distance. A design margin of 0.1 is 1.5 dB:
more than |S| is off in another model, or as measured in flight."""
_STEPS = {"stable": 40, "hard": 40, "soft": 60, "margin": 30, "cost": 40, "nearest": 60}
"""Steps of each phase, at most."""
_RIGOUR = 10.0
"""By which a shortfall of a hard constraint counts beside one of a level."""
_RIGID = 200.0
"""By which shortfalls of what holds count beside those of what can't be met."""
_STABLE = 0.3
"""rad/s by which every pole is moved to the left before anything else is asked for."""
_HELD = 1e-3
"""Distance by which a goal may be missed and still count as met."""
_CLOSE = 0.05
"""Distance below which a specification is in the way: it misses Level 1, or holds others off."""
_STARTS = 5
"""Of the nominal model: the given one and others, since more than one law may be locally best."""
_AROUND = 0.7
"""By which coordinates of others differ: a factor of 2 where logarithms are moved."""
_ROUNDS = 4
"""Of models added, until no sampled one is worse than those designed with."""


class UnstableError(HelisimError):
    """No law of this structure makes every loop stable."""


class InfeasibleError(HelisimError):
    """Specifications can't be met. The message says which, and the nearest value that can.

    Attributes:
        nearest: the rating of that specification at its nearest, the others met.
    """

    def __init__(self, message: str, nearest: Rating | None = None) -> None:
        super().__init__(message)
        self.nearest = nearest


@dataclass(frozen=True)
class Free:
    """A parameter that may be moved within a range.

    Where the whole range is positive its logarithm is what is moved, so that steps are relative.

    Attributes:
        name: such as "lat.k_rate".
        low: least value.
        high: largest value.

    Raises:
        InputError: the range is empty, or not finite.
    """

    name: str
    low: float
    high: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise InputError(
                f"{self.name} can't be moved from {self.low:g} to {self.high:g}: give the lower "
                "value first, both finite"
            )

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value, that of the range's end where it is outside."""
        inside = min(max(value, self.low), self.high)
        if self.low > 0.0:
            return math.log(inside)
        return _SPAN * (inside - self.low) / (self.high - self.low)

    def value(self, coordinate: float) -> float:
        """Return the value at a coordinate."""
        if self.low > 0.0:
            return math.exp(coordinate)
        return self.low + (self.high - self.low) * coordinate / _SPAN


def free_parameters(
    parameters: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    only: Sequence[str] | None = None,
) -> tuple[Free, ...]:
    """Return what may be moved of a law.

    Args:
        parameters: of the law, by name.
        bounds: least and largest value, by name; of another parameter a factor of 30 both ways,
            and one that is 0 stays.
        only: names of those that are moved; by default all.

    Raises:
        UnknownNameError: a name that the law doesn't have.
        InputError: a range is empty, or nothing is left to move.
    """
    for name in (*bounds, *(only or ())):
        if name not in parameters:
            raise UnknownNameError("parameter of the law", name, parameters)
    named = {name: parameters[name] for name in (parameters if only is None else only)}
    found = tuple(
        Free(name, *(bounds.get(name) or sorted((value / _REACH, value * _REACH))))
        for name, value in named.items()
        if name in bounds or value != 0.0
    )
    if not found:
        raise InputError(
            "the law leaves nothing to design: none of its parameters has a value or a range"
        )
    return found


class _Cached:
    """A linear system whose responses are computed once: a design asks for them again and again."""

    def __init__(self, source: Linear) -> None:
        self._source, self._known = source, dict[bytes, Response]()

    def response(self, frequency: Vector) -> Response:
        key = np.ascontiguousarray(frequency).tobytes()
        if key not in self._known:
            self._known[key] = np.array(self._source.response(frequency))
        return self._known[key]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._source, name)


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
    """

    law: Law
    specs: tuple[Spec, ...]
    models: tuple[Linear, ...]
    free: tuple[Free, ...]
    period: float
    close: Close = ClosedLoop

    def __post_init__(self) -> None:
        object.__setattr__(self, "models", tuple(map(_Cached, self.models)))

    @cached_property
    def start(self) -> Vector:
        """Coordinates of the law that it starts from, (n_free,)."""
        parameters = self.law.parameters()
        return np.array([one.coordinate(parameters[one.name]) for one in self.free])

    @cached_property
    def box(self) -> tuple[Vector, Vector]:
        """The lowest and the highest coordinates, (n_free,) each."""
        low = np.array([one.coordinate(one.low) for one in self.free])
        return low, np.array([one.coordinate(one.high) for one in self.free])

    def law_at(self, at: Vector) -> Law:
        """Return the law at coordinates, (n_free,)."""
        moved = zip(self.free, at.tolist())
        return self.law.replace({one.name: one.value(where) for one, where in moved})

    def loops(
        self, at: Vector, which: Sequence[int] = (0,), frequency: Vector = FREQUENCY
    ) -> list[Loop]:
        """Return the loops that a law closes."""
        law: Any = _Cached(self.law_at(at).linear(self.period))
        return [self.close(self.models[k], law, frequency) for k in which]

    def rate(self, loop: Loop) -> Ratings:
        """Return the rating of a loop by each specification."""
        return tuple(one.criterion.rate(loop) for one in self.specs)

    def trial(self, at: Vector, which: Sequence[int], *, near: bool = False) -> Trial | None:
        """Return what a law is worth: distances by model and specification, one after the other.

        Args:
            at: coordinates of the law, (n_free,).
            which: of the models; the cost, how far objectives are from their borders, is that in
                the first.
            near: True beside a law that is stable, where stability isn't asked for again.

        Returns:
            None where a loop is unstable.
        """
        loops = self.loops(at, which)
        if not near and any(growth(loop) > 0.0 for loop in loops):
            return None
        asked = np.flatnonzero(self.of_kind("hard", "soft"))
        distances = np.full((len(loops), len(self.specs)), np.inf)
        for row, loop in zip(distances, loops):
            row[asked] = [distance(self.specs[k].criterion, loop) for k in asked]
        aims = [one.criterion for one in self.specs if one.kind == "objective"]
        return Trial(distances.ravel(), -sum(one.rate(loops[0]).distance for one in aims))

    @cached_property
    def widened(self) -> NDArray[np.bool_]:
        """Which specifications a design margin is asked of, (n_spec,).

        Not of poles: integrals of what is commanded stand at 0 whatever the law does.
        """
        return np.array([not isinstance(one.criterion, PoleLimits) for one in self.specs])

    def of_kind(self, *kinds: str) -> NDArray[np.bool_]:
        """Return which specifications are of some kinds, (n_spec,)."""
        return np.array([one.kind in kinds for one in self.specs])


def growth(loop: Loop) -> float:
    """Return the largest real part of a loop's poles, rad/s, positive where it is unstable."""
    return float(np.max(loop.poles.real)) - _AT_REST


def distance(criterion: Criterion, loop: Loop) -> float:
    """Return a rating's distance; of figures that jump, one that goes there steadily.

    The bandwidth of disturbance rejection is the lowest frequency at which |S| rises through
    1 / sqrt 2. Where |S| has a hump just below that, the least change of the aircraft moves the
    bandwidth to the hump. That |S| stays below 1 / sqrt 2 up to the border asks for the same, and
    knows how far the hump is.

    The crossover is the highest frequency at which the gain falls through one. Where the gain dips
    below one on its way it jumps from one side of the dip to the other. That the gain is one
    somewhere above the border asks for the same, and knows how far it is from that.
    """
    own = criterion.rate(loop).distance
    match criterion:
        case DisturbanceRejection():
            seen, border = loop.disturbance(criterion.axis), criterion.limits["drb"]
            assert isinstance(border, Limit)
            # a hump is lower than where |S| crosses: just below the border the bandwidth speaks
            below = seen.decibel[seen.frequency < 0.7 * border.level1]
            return min(own, (HALF_POWER - float(np.max(below, initial=-np.inf))) / _HUMP)
        case Crossover() if own < 0.0:
            seen, border = loop.broken(criterion.axis, criterion.at), criterion.limits["crossover"]
            assert isinstance(border, Limit)
            above = seen.decibel[seen.frequency >= border.level1]
            if border.more_is_better and above.size:  # a slow one doesn't jump where it is short
                return max(own, min(0.0, float(np.max(above)) / _HUMP))
    return own


@dataclass(frozen=True)
class Step:
    """One law on the way.

    Attributes:
        phase: "stable", "hard", "soft", "margin" or "cost".
        models: how many were designed with.
        hard: worst distance of the hard constraints; inf if there is none.
        soft: worst distance of the soft specifications; inf if there is none.
        cost: the summed objective.
    """

    phase: str
    models: int
    hard: float
    soft: float
    cost: float


class Search:
    """Runs the phases on a problem.

    Args:
        problem: what is asked.
        margin: design margin that is wanted, distance.
        seed: of the search for a stable law.
        on_step: called with every step.

    Attributes:
        history: every law on the way.
        models: that were designed with, the nominal one first.
    """

    def __init__(
        self, problem: Problem, *, margin: float, seed: int, on_step: Callable[[Step], None]
    ) -> None:
        self._problem, self._margin, self._seed, self._on_step = problem, margin, seed, on_step
        self.models: tuple[int, ...] = (0,)
        self.history: list[Step] = []
        self._hard, self._soft = problem.of_kind("hard"), problem.of_kind("soft")

    def run(self) -> tuple[Vector, float]:
        """Return the law's coordinates, (n_free,), and the design margin that it keeps.

        That is in all models designed with; negative where the levels are missed. Models are
        added as long as one is worse than goals allow.

        Raises:
            UnstableError: no law makes every loop stable.
        """
        at, margin = self._nominal()
        for _ in range(_ROUNDS):
            if margin < 0.0 and self.models == (0,):
                break
            worse = self._worse(at, margin)
            if not worse:
                break
            self.models = (*self.models, *worse)
            at, margin = self._solved(self._stabilised(at))
        return at, margin

    def _nominal(self) -> tuple[Vector, float]:
        """Return the best law of the nominal model that several starts lead to, and its margin.

        That with the largest margin, of those as large the cheapest. A start away from the given
        one that is unstable is not followed.
        """
        rng, own = np.random.default_rng(self._seed), self._problem.start
        steps = rng.uniform(-_AROUND, _AROUND, (_STARTS - 1, own.size))
        found = []
        for k, start in enumerate([own, *np.clip(own + steps, *self._problem.box)]):
            if k and self._objective(start) is None:
                continue
            at, margin = self._solved(self._stabilised(start))
            found.append((round(margin, 3), -self._trial(at).cost, at))
        margin, _, at = max(found, key=lambda one: one[:2])
        return at, margin

    def _solved(self, at: Vector) -> tuple[Vector, float]:
        """Return a law by which constraints, levels and the margin hold, and which margin does."""
        at = self._descended("hard", at, self._goal(hard=0.0))
        at = self._descended("soft", at, self._goal(hard=0.0, soft=0.0))
        worst = self._worst(at)
        if worst >= -_HELD:
            wanted = {"hard": self._margin, "soft": self._margin, "rigour": 1.0}
            at = self._descended("margin", at, self._goal(**wanted))
            worst = self._worst(at)
        margin = min(self._margin, worst if abs(worst) > _HELD else 0.0)
        if margin >= 0.0:
            at = self._descended("cost", at, self._goal(hard=margin, soft=margin, cost=1.0))
        return at, margin

    def _descended(
        self, phase: str, at: Vector, goal: Goal, objective: Objective | None = None
    ) -> Vector:
        objective = objective or self._objective
        trial = objective(at)
        assert trial is not None  # stable from the first phase on

        def note(point: Point) -> None:
            if phase != "stable":
                self._note(phase, point.trial)

        start, box = Point(at, trial), self._problem.box
        return descend(objective, start, goal, box, steps=_STEPS[phase], on_step=note).at

    def _goal(
        self, *, hard: float, soft: float = -np.inf, cost: float = 0.0, rigour: float = _RIGOUR
    ) -> Goal:
        wanted = np.where(self._hard, hard, np.where(self._soft, soft, -np.inf))
        wanted = np.where(self._problem.widened, wanted, np.minimum(wanted, -_HELD))
        counts, models = np.where(self._hard, rigour, 1.0), len(self.models)
        return Goal(np.tile(wanted, models), np.tile(counts, models), cost)

    def _objective(self, at: Vector, near: bool = False) -> Trial | None:
        return self._problem.trial(at, self.models, near=near)

    def _trial(self, at: Vector) -> Trial:
        found = self._objective(at)
        assert found is not None  # the descent keeps to stable laws
        return found

    def _worst(self, at: Vector) -> float:
        """Return the worst distance of what is hard or soft, in the models designed with."""
        trial = self._objective(at)
        return -np.inf if trial is None else float(np.min(self._asked(trial)))

    def _asked(self, trial: Trial) -> Vector:
        """Return the distances that count, (n_distance,): inf where nothing more is wanted."""
        count = trial.distances.size // len(self._hard)
        kept = ~np.tile(self._problem.widened, count) & (trial.distances >= -_HELD)
        counts = np.tile(self._hard | self._soft, count) & ~kept
        return np.where(counts, trial.distances, np.inf)

    def _worse(self, at: Vector, margin: float) -> tuple[int, ...]:
        """Return the models that miss a margin in which no other is worse."""
        found: dict[int, tuple[float, int]] = {}
        for k in range(len(self._problem.models)):
            if k in self.models:
                continue
            trial = self._problem.trial(at, (k,))
            if trial is None:
                return (k,)
            asked = self._asked(trial)
            for spec in np.flatnonzero(asked < margin - _HELD).tolist():
                found[spec] = min(found.get(spec, (np.inf, k)), (float(asked[spec]), k))
        return tuple(sorted({k for _, k in found.values()}))

    def _note(self, phase: str, trial: Trial) -> None:
        count = len(self.models)
        hard, soft = (
            float(np.min(trial.distances[np.tile(which, count)], initial=np.inf))
            for which in (self._hard, self._soft)
        )
        self.history.append(Step(phase, count, hard, soft, trial.cost))
        self._on_step(self.history[-1])

    def _stabilised(self, at: Vector) -> Vector:
        """Return a law by which every pole is to the left. Raises UnstableError."""
        if self._objective(at) is not None:
            return at

        def leftness(there: Vector, near: bool = False) -> Trial:
            loops = self._problem.loops(there, self.models)
            return Trial(np.array([-growth(loop) for loop in loops]), 0.0)

        def least(there: Vector) -> float:
            return float(np.min(leftness(there).distances))

        models = len(self.models)
        goal = Goal(np.full(models, _STABLE), np.ones(models))
        found = self._descended("stable", at, goal, leftness)
        if self._objective(found) is None:
            found = differential_evolution(
                lambda there: -least(there),
                Bounds(*self._problem.box),
                x0=found,
                popsize=4,
                maxiter=25,
                init="sobol",
                polish=False,
                rng=self._seed,
                callback=_enough,
            ).x
        trial = self._objective(found)
        if trial is None:
            raise UnstableError(
                f"no values of {', '.join(one.name for one in self._problem.free)} within their "
                f"ranges make every loop stable: a pole stays at {-least(found):+.3g} rad/s; give "
                "the law another structure or wider ranges"
            )
        self._note("stable", trial)
        return found


def _enough(intermediate_result: OptimizeResult) -> None:
    """End the search for a stable law where it has found one."""
    if intermediate_result.fun < -_STABLE:
        raise StopIteration


def infeasible(problem: Problem, at: Vector) -> InfeasibleError:
    """Return what to say where the best law of the nominal model misses a level.

    One specification that alone can't be met while the others hold; or else all that stand in each
    other's way, as near as may be.
    """

    def trial(there: Vector, near: bool = False) -> Trial | None:
        return problem.trial(there, (0,), near=near)

    def nearest(objective: Objective, start: Vector, goal: Goal) -> Point:
        there = objective(start)
        assert there is not None  # the phases end with a law that is stable
        return descend(objective, Point(start, there), goal, problem.box, steps=_STEPS["nearest"])

    def relaxed(spec: int) -> Rating | None:
        """Return one specification at its nearest while the others hold; None if they don't."""
        wanted = np.where(asked, 0.0, -np.inf)
        wanted[spec] = -np.inf

        def guarded(there: Vector, near: bool = False) -> Trial | None:
            one = trial(there, near)
            return None if one is None else Trial(one.distances, -float(one.distances[spec]))

        def as_rated(there: Vector, near: bool = False) -> Trial | None:
            one = trial(there, near)
            if one is None:
                return None
            rating = problem.specs[spec].criterion.rate(problem.loops(there)[0])
            return Trial(one.distances, -rating.distance)

        met, best = (Goal(wanted, np.ones(wanted.size), cost) for cost in (0.0, 1.0))
        point = nearest(guarded, at, met)
        if met.shortfall(point.trial) > _HELD:
            return None
        point = nearest(as_rated, nearest(guarded, point.at, best).at, best)
        return problem.rate(problem.loops(point.at)[0])[spec]

    asked, here = problem.of_kind("hard", "soft"), trial(at)
    assert here is not None
    short = np.where(asked, here.distances, np.inf)
    in_the_way = [int(k) for k in np.argsort(short) if short[k] < _CLOSE]
    soft_first = sorted(in_the_way, key=lambda k: problem.specs[k].kind == "hard")
    found = [one for one in map(relaxed, soft_first) if one is not None]
    if found:
        best = max(found, key=lambda one: one.distance)
        return InfeasibleError(
            f"{_name(best)} can't be met with the others: the nearest that can is {_told(best)}",
            best,
        )
    missing = [k for k in in_the_way if problem.specs[k].kind == "soft"] or in_the_way
    soft = [k for k in missing if here.distances[k] < -_HELD] or missing
    rigour = np.full(len(problem.specs), _RIGID)
    rigour[soft] = 1.0
    point = nearest(trial, at, Goal(np.where(asked, 0.0, -np.inf), rigour))
    rated = problem.rate(problem.loops(point.at)[0])
    missed = [rated[k] for k in soft if rated[k].distance < -_HELD] or [rated[soft[0]]]
    names, told = ", ".join(map(_name, missed)), "; ".join(map(_told, missed))
    return InfeasibleError(f"{names} can't be met together: the nearest that can are {told}")


def _name(rating: Rating) -> str:
    return f"{rating.criterion.name} of {rating.criterion.word}"


def _told(rating: Rating) -> str:
    """Return the figures that miss their limits, all if none does, and where Level 1 begins."""
    limits = {k: one for k, one in rating.criterion.limits.items() if k in rating.figures}
    missed = {
        name: one
        for name, one in limits.items()
        if not isinstance(one, Limit) or one.distance(rating.figures[name]) < 0.0
    } or limits

    def words(values: Mapping[str, float]) -> str:
        units = {name: rating.criterion.units.get(name, "") for name in values}
        return ", ".join(
            f"{name} {value / RAD_PER_DEG:.3g} deg"
            if units[name] == "rad"
            else f"{name} {value:.3g} {units[name]}".rstrip()
            for name, value in values.items()
        )

    asked = words({name: one.level1 for name, one in missed.items() if isinstance(one, Limit)})
    return (
        f"{words({name: rating.figures[name] for name in missed})} instead of {asked or 'Level 1'}"
    )
