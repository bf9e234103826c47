"""A design as a problem: distances of a law in each model, and the phases of the search.

Constraints, then levels, then cost: Tischler, Berger, Ivler, Mansur, Cheung and Soong, Practical
Methods for Aircraft and Rotorcraft Flight Control Design, AIAA 2017, chapter 3.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Real
from helisim.base.errors import HelisimError, InputError, check_known
from helisim.base.linear import Linear, Response
from helisim.base.units import RAD_PER_DEG
from helisim.design.descent import Goal, Objective, Trial, descend
from helisim.design.laws.law import Law
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import Crossover, DisturbanceRejection, PoleLimits
from helisim.handling.criterion import Criterion, Rating
from helisim.handling.figures import HALF_POWER
from helisim.handling.loop import Loop
from helisim.handling.spec import Spec

Ratings = tuple[Rating, ...]

FREQUENCY = np.geomspace(0.3, 120.0, 120)
"""rad/s, at which laws are tried; results are computed on the finer grid of loops."""
_AT_REST = 1e-4  # rad/s, of an integrator that stands at 0 but for rounding
_SPAN = 4.0  # length in coordinates of a range around zero
_REACH = 30.0  # factor up and down from a start, where no range is stated
_HUMP = 15.0  # dB of |S| below 1 / sqrt 2 that count as one unit of distance
_STEPS = {"stable": 40, "hard": 40, "soft": 60, "margin": 30, "cost": 40, "nearest": 60}
_RIGOUR = 10.0  # weight of a shortfall of a hard constraint, 1 that of a level
_RIGID = 200.0  # weight of shortfalls of what holds, 1 that of what can't be met
# _STABLE: rad/s, to the left of which every pole is moved first
# _HELD: distance by which a met goal may be missed
_STABLE, _HELD = 0.3, 1e-3
_STARTS, _MOST_STARTS = 3, 9  # always, and while none of them meets all that is asked
_AROUND, _NEARER = 0.7, 0.35  # largest difference of coordinates: from the start, from the best
_ROUNDS = 4


class UnstableError(HelisimError):
    """No law of this structure makes every loop stable."""


class InfeasibleError(HelisimError):
    """Specifications can't be met: which, and the nearest values that can."""


@dataclass(frozen=True)
class Free:
    """A parameter that is moved, by its logarithm if its range is positive; InputError if empty."""

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
        """Return the coordinate of a value, clipped to the range."""
        inside = min(max(value, self.low), self.high)
        return (
            math.log(inside)
            if self.low > 0.0
            else _SPAN * (inside - self.low) / (self.high - self.low)
        )

    def value(self, coordinate: float) -> float:
        """Return the value at a coordinate."""
        return (
            math.exp(coordinate)
            if self.low > 0.0
            else self.low + (self.high - self.low) * coordinate / _SPAN
        )


def free_parameters(
    parameters: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    only: Sequence[str] | None = None,
) -> tuple[Free, ...]:
    """Return the parameters of a law that may be moved: `only` those named, by default all.

    Without bounds the range is a factor of 30 both ways, and 0 stays. Raises UnknownNameError, or
    InputError if nothing is left to move.
    """
    check_known("parameter of the law", (*bounds, *(only or ())), parameters)
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
    def __init__(self, source: Linear) -> None:
        self._source, self._known = source, dict[bytes, Response]()

    def response(self, frequency: Real) -> Response:
        key = np.ascontiguousarray(frequency).tobytes()
        if key not in self._known:
            self._known[key] = np.array(self._source.response(frequency))
        return self._known[key]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._source, name)


@dataclass(frozen=True, eq=False)
class Problem:
    """Laws by free parameters in several models, the nominal one first; `period` of ticks in s."""

    law: Law
    specs: tuple[Spec, ...]
    models: tuple[Linear, ...]
    free: tuple[Free, ...]
    period: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "models", tuple(map(_Cached, self.models)))

    @cached_property
    def start(self) -> Real:
        """Coordinates of the start, (n_free,)."""
        parameters = self.law.parameters()
        return np.array([one.coordinate(parameters[one.name]) for one in self.free])

    @cached_property
    def box(self) -> tuple[Real, Real]:
        """The lowest and the highest coordinates, (n_free,) each."""
        low = np.array([one.coordinate(one.low) for one in self.free])
        return low, np.array([one.coordinate(one.high) for one in self.free])

    def law_at(self, at: Real) -> Law:
        """Return the law at coordinates, (n_free,)."""
        return self.law.replace({one.name: one.value(x) for one, x in zip(self.free, at.tolist())})

    def loops(self, at: Real, which: Sequence[int] = (0,)) -> list[Loop]:
        """Return the loops that a law closes with some models."""
        law: Any = _Cached(self.law_at(at).linear(self.period))
        return [ClosedLoop(self.models[k], law, FREQUENCY) for k in which]

    def rate(self, loop: Loop) -> Ratings:
        """Return the rating of a loop by each specification."""
        return tuple(one.criterion.rate(loop) for one in self.specs)

    def trial(self, at: Real, which: Sequence[int], *, near: bool = False) -> Trial | None:
        """Return distances by model and specification, and the first model's cost, at (n_free,).

        None if a loop is unstable, which isn't looked for `near` a stable law.
        """
        loops = self.loops(at, which)
        if not near and any(growth(loop) > 0.0 for loop in loops):
            return None
        asked = np.flatnonzero(self.of_kind("hard", "soft"))
        distances = np.full((len(loops), len(self.specs)), np.inf)
        for row, loop in zip(distances, loops):
            row[asked] = [distance(self.specs[k].criterion, loop) for k in asked]
        aims = [one.criterion for one in self.specs if one.kind == "objective"]
        return Trial(at, distances.ravel(), -sum(one.rate(loops[0]).distance for one in aims))

    @cached_property
    def widened(self) -> NDArray[np.bool_]:
        """Specifications with a design margin, (n_spec,): all but those of poles."""
        return np.array([not isinstance(one.criterion, PoleLimits) for one in self.specs])

    def of_kind(self, *kinds: str) -> NDArray[np.bool_]:
        """Return which specifications are of some kinds, (n_spec,)."""
        return np.array([one.kind in kinds for one in self.specs])


def growth(loop: Loop) -> float:
    """Return the largest real part of a loop's poles, rad/s, positive where it is unstable."""
    return float(np.max(loop.poles.real)) - _AT_REST


def distance(criterion: Criterion, loop: Loop) -> float:
    """Return a rating's distance; of crossover and disturbance rejection one that is continuous.

    Humps make both jump: |S| must also stay below 1 / sqrt 2 up to the border, and the broken
    loop's gain below one from half an octave beyond it.
    """
    own, limits = criterion.rate(loop).distance, criterion.limits
    match criterion:
        case DisturbanceRejection():
            # a hump is lower than where |S| crosses: just below the border the bandwidth speaks
            seen, highest = loop.disturbance(criterion.axis), HALF_POWER
            near = seen.frequency < 0.7 * limits["drb"].level1
        case Crossover():
            seen, highest = loop.broken(criterion.axis, criterion.at), 0.0
            near = seen.frequency > 1.4 * limits["crossover"].level1
        case _:
            return own
    return min(own, (highest - float(np.max(seen.decibel[near], initial=-np.inf))) / _HUMP)


class Search:
    """Runs the phases on a problem in `models`, nominal one first, for a `margin`, a distance."""

    def __init__(
        self, problem: Problem, *, margin: float, seed: int, tell: Callable[[str], None]
    ) -> None:
        self._problem, self._margin, self._seed, self._tell = problem, margin, seed, tell
        self.models: tuple[int, ...] = (0,)
        self._hard, self._soft = problem.of_kind("hard"), problem.of_kind("soft")

    def run(self) -> tuple[Real, float]:
        """Return the law's coordinates, (n_free,), and its margin in `models`, or UnstableError."""
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

    def _nominal(self) -> tuple[Real, float]:
        rng, own = np.random.default_rng(self._seed), self._problem.start
        found: list[tuple[float, float, Real]] = []
        for k in range(_MOST_STARTS):
            best = max(found, key=lambda one: one[:2], default=None)
            if best and k >= _STARTS and best[0] >= 0.0:
                break
            around, most = (own, _AROUND) if k < _STARTS or not best else (best[2], _NEARER)
            away = rng.uniform(-most, most, own.size) if k else 0.0
            start = np.clip(around + away, *self._problem.box)
            if k and self._objective(start) is None:
                continue
            at, margin = self._solved(self._stabilised(start))
            trial = self._objective(at)
            assert trial is not None  # the descent keeps to stable laws
            found.append((round(margin, 3), -trial.cost, at))
        margin, _, at = max(found, key=lambda one: one[:2])
        return at, margin

    def _solved(self, at: Real) -> tuple[Real, float]:
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
        self, phase: str, at: Real, goal: Goal, objective: Objective | None = None
    ) -> Real:
        objective = objective or self._objective
        trial = objective(at, False)
        assert trial is not None  # stable from the first phase on

        return descend(
            objective,
            trial,
            goal,
            self._problem.box,
            steps=_STEPS[phase],
            on_step=lambda one: self._tell(f"{phase}: worst {np.min(one.distances):+.2f}"),
        ).at

    def _goal(
        self, *, hard: float, soft: float = -np.inf, cost: float = 0.0, rigour: float = _RIGOUR
    ) -> Goal:
        wanted = np.where(self._hard, hard, np.where(self._soft, soft, -np.inf))
        wanted = np.where(self._problem.widened, wanted, np.minimum(wanted, -_HELD))
        counts, models = np.where(self._hard, rigour, 1.0), len(self.models)
        return Goal(np.tile(wanted, models), np.tile(counts, models), cost)

    def _objective(self, at: Real, near: bool = False) -> Trial | None:
        return self._problem.trial(at, self.models, near=near)

    def _worst(self, at: Real) -> float:
        trial = self._objective(at)
        return -np.inf if trial is None else float(np.min(self._asked(trial)))

    def _asked(self, trial: Trial) -> Real:
        count = trial.distances.size // len(self._hard)
        kept = ~np.tile(self._problem.widened, count) & (trial.distances >= -_HELD)
        return np.where(np.tile(self._hard | self._soft, count) & ~kept, trial.distances, np.inf)

    def _worse(self, at: Real, margin: float) -> tuple[int, ...]:
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

    def _stabilised(self, at: Real) -> Real:
        if self._objective(at) is not None:
            return at

        def leftness(there: Real, near: bool = False) -> Trial:
            loops = self._problem.loops(there, self.models)
            return Trial(there, np.array([-growth(loop) for loop in loops]), 0.0)

        models = len(self.models)
        goal = Goal(np.full(models, _STABLE), np.ones(models))
        found = self._descended("stable", at, goal, leftness)
        if self._objective(found) is None:
            least = float(np.min(leftness(found).distances))
            raise UnstableError(
                f"no values of {', '.join(one.name for one in self._problem.free)} within their "
                f"ranges make every loop stable: a pole stays at {-least:+.3g} rad/s; give "
                "the law another start, another structure or wider ranges"
            )
        return found


def infeasible(problem: Problem, at: Real) -> InfeasibleError:
    """Return the error of a best law, (n_free,), that misses levels, with the nearest values."""

    def trial(there: Real, near: bool = False) -> Trial | None:
        return problem.trial(there, (0,), near=near)

    asked, here = problem.of_kind("hard", "soft"), trial(at)
    assert here is not None  # the phases end with a law that is stable
    misses = asked & (here.distances < -_HELD)
    if np.any(misses & problem.of_kind("soft")):
        misses &= problem.of_kind("soft")
    goal = Goal(np.where(asked, 0.0, -np.inf), np.where(misses, 1.0, _RIGID))
    nearest = descend(trial, here, goal, problem.box, steps=_STEPS["nearest"])
    rated = problem.rate(problem.loops(nearest.at)[0])
    missed = [one for one, counts in zip(rated, asked) if counts and one.distance < -_HELD] or [
        rated[int(np.argmin(np.where(asked, here.distances, np.inf)))]
    ]
    names = ", ".join(f"{one.criterion.name} of {one.criterion.word}" for one in missed)
    return InfeasibleError(
        f"{names} can't be met{' together' if len(missed) > 1 else ' with the others'}: the "
        f"nearest that can is {'; '.join(map(_told, missed))}"
    )


def _told(rating: Rating) -> str:
    limits = rating.criterion.limits
    short = [name for name, one in limits.items() if one.distance(rating.figures[name]) < 0.0]

    def words(values: Mapping[str, float]) -> str:
        units = rating.criterion.units
        return ", ".join(
            f"{name} {value / RAD_PER_DEG:.3g} deg"
            if units[name] == "rad"
            else f"{name} {value:.3g} {units[name]}".rstrip()
            for name, value in values.items()
        )

    asked = words({name: limits[name].level1 for name in short or limits})
    return f"{words({name: rating.figures[name] for name in short or limits})} instead of {asked}"
