"""The phases of a design, as CONDUIT has them: hard constraints, then levels, then cost.

Tischler, Berger, Ivler, Mansur, Cheung and Soong: Practical Methods for Aircraft and Rotorcraft
Flight Control Design: An Optimization-Based Approach, AIAA 2017, chapter 3.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, OptimizeResult, differential_evolution

from helisim.base.errors import HelisimError
from helisim.design.descent import Goal, Point, Trial, descend
from helisim.design.problem import Problem, slowest

Vector = NDArray[np.float64]

_STEPS = {"stable": 40, "hard": 40, "soft": 60, "margin": 30, "cost": 40}
"""Steps of each phase, at most."""
_RIGOUR = 10.0
"""By which a shortfall of a hard constraint counts beside one of a level."""
_STABLE = 0.3
"""rad/s by which every pole is moved to the left before anything else is asked for."""
_HELD = 1e-3
"""Distance by which a goal may be missed and still count as met."""
_STARTS = 5
"""Of the nominal model: the given one and others, since more than one law may be locally best."""
_AROUND = 0.7
"""By which coordinates of others differ: a factor of 2 where logarithms are moved."""
_ROUNDS = 4
"""Of models added, until no sampled one is worse than those designed with."""


class UnstableError(HelisimError):
    """No law of this structure makes every loop stable."""


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


OnStep = Callable[[Step], None]


@dataclass(frozen=True, eq=False)
class Found:
    """Where the phases ended.

    Attributes:
        at: coordinates of the law, (n_free,).
        margin: design margin that all specifications keep in all models designed with, distance;
            negative where the levels are missed.
        models: that were designed with, the nominal one first.
        history: every law on the way.
    """

    at: Vector
    margin: float
    models: tuple[int, ...]
    history: tuple[Step, ...]


class Phases:
    """Runs the phases on a problem.

    Args:
        problem: what is asked.
        margin: design margin that is wanted, distance.
        seed: of the search for a stable law.
        on_step: called with every step.
    """

    def __init__(
        self, problem: Problem, *, margin: float, seed: int = 1, on_step: OnStep | None = None
    ) -> None:
        self._problem, self._margin, self._seed = problem, margin, seed
        self._on_step = on_step or (lambda _: None)
        self._which: tuple[int, ...] = (0,)
        self._history: list[Step] = []
        self._hard = problem.of_kind("hard")
        self._soft = problem.of_kind("soft")

    def run(self) -> Found:
        """Return where the phases end, models added as long as one is worse than goals allow.

        Raises:
            UnstableError: no law makes every loop stable.
        """
        at, margin = self._nominal()
        for _ in range(_ROUNDS):
            if margin < 0.0 and self._which == (0,):
                break
            worse = self._worse(at, margin)
            if not worse:
                break
            self._which = (*self._which, *worse)
            at, margin = self._solved(self._stabilised(at))
        return Found(at, margin, self._which, tuple(self._history))

    def _nominal(self) -> tuple[Vector, float]:
        """Return the best law of the nominal model that several starts lead to, and its margin.

        That with the largest margin, of those as large the cheapest. A start away from the given
        one that is unstable is not followed.
        """
        best: tuple[float, float, Vector] | None = None
        for k, start in enumerate(self._starts()):
            if k and self._worth(start) is None:
                continue
            at, margin = self._solved(self._stabilised(start))
            trial = self._worth(at)
            assert trial is not None  # the descent keeps to stable laws
            if best is None or (round(margin, 3), -trial.cost) > best[:2]:
                best = (round(margin, 3), -trial.cost, at)
        assert best is not None  # the first start is always followed
        return best[2], best[0]

    def _starts(self) -> list[Vector]:
        """Return the given start, and others about it within the box, (n_free,) each."""
        rng, (low, high) = np.random.default_rng(self._seed), self._problem.box
        own = self._problem.start
        steps = rng.uniform(-_AROUND, _AROUND, (_STARTS - 1, own.size))
        return [own, *np.clip(own + steps, low, high)]

    def _solved(self, at: Vector) -> tuple[Vector, float]:
        at, margin = self._levels(at)
        return (self._cheaper(at, margin) if margin >= 0.0 else at), margin

    def _levels(self, at: Vector) -> tuple[Vector, float]:
        """Return a law by which constraints, then levels, then the margin hold, and that margin."""
        at = self._descended("hard", at, self._goal(hard=0.0))
        at = self._descended("soft", at, self._goal(hard=0.0, soft=0.0))
        worst = self._worst(at)
        if worst >= -_HELD:
            goal = self._goal(hard=self._margin, soft=self._margin, rigour=1.0)
            at = self._descended("margin", at, goal)
            worst = self._worst(at)
        return at, min(self._margin, worst if abs(worst) > _HELD else 0.0)

    def _cheaper(self, at: Vector, margin: float) -> Vector:
        return self._descended("cost", at, self._goal(hard=margin, soft=margin, cost=1.0))

    def _descended(self, phase: str, at: Vector, goal: Goal) -> Vector:
        trial = self._worth(at)
        assert trial is not None  # stable from the first phase on
        found = descend(
            self._worth,
            Point(at, trial),
            goal,
            self._problem.box,
            steps=_STEPS[phase],
            on_step=lambda point: self._note(phase, point.trial),
        )
        return found.at

    def _goal(
        self,
        *,
        hard: float,
        soft: float = -np.inf,
        cost: float = 0.0,
        rigour: float = _RIGOUR,
    ) -> Goal:
        wanted = np.where(self._hard, hard, np.where(self._soft, soft, -np.inf))
        wanted = np.where(self._problem.widened, wanted, np.minimum(wanted, -_HELD))
        counts = np.where(self._hard, rigour, 1.0)
        models = len(self._which)
        return Goal(np.tile(wanted, models), np.tile(counts, models), cost)

    def _worth(self, at: Vector, near: bool = False) -> Trial | None:
        return self._problem.trial(at, self._which, near=near)

    def _worst(self, at: Vector) -> float:
        """Return the worst distance of what is hard or soft, in the models designed with."""
        trial = self._worth(at)
        if trial is None:
            return -np.inf
        return float(np.min(self._asked(trial)))

    def _asked(self, trial: Trial) -> Vector:
        """Return the distances that count, (n_distance,): inf where nothing more is wanted."""
        count = trial.distances.size // len(self._hard)
        kept = ~np.tile(self._problem.widened, count) & (trial.distances >= -_HELD)
        counts = np.tile(self._hard | self._soft, count) & ~kept
        return np.where(counts, trial.distances, np.inf)

    def _worse(self, at: Vector, margin: float) -> tuple[int, ...]:
        """Return the models that miss a margin in which no other is worse."""
        others = [k for k in range(len(self._problem.models)) if k not in self._which]
        found: dict[int, tuple[float, int]] = {}
        for k in others:
            trial = self._problem.trial(at, (k,))
            if trial is None:
                return (k,)
            asked = self._asked(trial)
            for spec in np.flatnonzero(asked < margin - _HELD).tolist():
                found[spec] = min(found.get(spec, (np.inf, k)), (float(asked[spec]), k))
        return tuple(sorted({k for _, k in found.values()}))

    def _note(self, phase: str, trial: Trial) -> None:
        count = len(self._which)

        def worst(which: NDArray[np.bool_]) -> float:
            return float(np.min(trial.distances[np.tile(which, count)], initial=np.inf))

        step = Step(phase, count, worst(self._hard), worst(self._soft), trial.cost)
        self._history.append(step)
        self._on_step(step)

    def _stabilised(self, at: Vector) -> Vector:
        """Return a law by which every pole is to the left. Raises UnstableError."""
        if self._worth(at) is not None:
            return at
        trial = self._leftness(at)
        goal = Goal(np.full(trial.distances.size, _STABLE), np.ones(trial.distances.size))
        box = self._problem.box
        found = descend(
            lambda there, near=False: self._leftness(there),
            Point(at, trial),
            goal,
            box,
            steps=_STEPS["stable"],
        ).at
        if self._worth(found) is None:
            found = differential_evolution(
                lambda there: -float(np.min(self._leftness(there).distances)),
                Bounds(*box),
                x0=found,
                popsize=4,
                maxiter=25,
                init="sobol",
                polish=False,
                rng=self._seed,
                callback=_enough,
            ).x
        trial = self._worth(found)
        if trial is None:
            left = float(np.min(self._leftness(found).distances))
            raise UnstableError(
                f"no values of {', '.join(one.name for one in self._problem.free)} within their "
                f"ranges make every loop stable: a pole stays at {-left:+.3g} rad/s; give the law "
                "another structure or wider ranges"
            )
        self._note("stable", trial)
        return found

    def _leftness(self, at: Vector) -> Trial:
        loops = self._problem.loops(at, self._which)
        return Trial(np.array([-slowest(loop) for loop in loops]), 0.0)


def _enough(intermediate_result: OptimizeResult) -> None:
    """End the search for a stable law where it has found one."""
    if intermediate_result.fun < -_STABLE:
        raise StopIteration
