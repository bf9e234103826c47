"""Descent by linear programs: the worst of many distances, and a cost, within a trust region.

Madsen, J. Inst. Maths Applics 16, 1975, 321-328; with a cost, Fletcher and Sainz de la Maza,
Mathematical Programming 43, 1989.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from helisim.base.arrays import Real

# _DIFFERENCE: step of a coordinate for derivatives
# _PENALTY: weight of the worst shortfall beside the cost
_DIFFERENCE, _PENALTY = 1e-4, 100.0
_EACH, _SHORTEST = 0.1, 1e-2  # weight of each shortfall beside the worst; weight of a step's length
_FIRST, _LARGEST, _LEAST = 0.25, 0.8, 2e-3
"""Radius of trust: at first, at most, and where the descent ends."""
_ACCEPTED, _GOOD = 0.05, 0.6
"""Share of the improvement foreseen from which on a step is taken, and the radius doubled."""
_WORTHWHILE = 1e-4  # improvement foreseen below which the descent ends, in units of distance


@dataclass(frozen=True, eq=False)
class Trial:
    """Coordinates, (n,); their distances, (n_distance,), positive in Level 1, inf: none; cost."""

    at: Real
    distances: Real
    cost: float


Objective = Callable[[Real, bool], Trial | None]
"""Coordinates, (n,), and whether beside a stable point -> trial; else None of an unstable loop."""


@dataclass(frozen=True, eq=False)
class Goal:
    """Wanted distances (-inf: none) and their weights, (n_distance,) each; weight of the cost."""

    distances: Real
    rigour: Real
    cost: float = 0.0

    def shortfalls(self, trial: Trial) -> Real:
        """Return every shortfall, (n_distance,), 0 where nothing is short."""
        return np.maximum(0.0, self.rigour * _less(self.distances, trial.distances))

    def merit(self, trial: Trial) -> float:
        """Return the descended sum of cost and shortfalls."""
        short = self.shortfalls(trial)
        penalty = _PENALTY * (float(np.max(short)) + _EACH * float(np.sum(short)))
        return self.cost * trial.cost + penalty


def descend(
    objective: Objective,
    here: Trial,
    goal: Goal,
    box: tuple[Real, Real],
    *,
    steps: int,
    on_step: Callable[[Trial], None] = lambda _: None,
) -> Trial:
    """Return the best trial from a stable one in `box`, lowest and highest, (n,) each.

    Without a cost it ends as soon as nothing is short; `on_step` sees accepted trials.
    """
    radius, straight = _FIRST, np.zeros(here.distances.size)
    slopes: tuple[NDArray[np.float64], Real] | None = None
    for _ in range(steps):
        if goal.cost == 0.0 and not np.any(goal.shortfalls(here)):
            break
        if slopes is None:
            slopes = _slopes(objective, here, box)
        step, foreseen = _step(here, slopes, goal, box, radius, straight)
        if foreseen < _WORTHWHILE:
            break
        there, gained = _taken(objective, here, step, goal, box)
        if there is not None and gained <= _ACCEPTED * foreseen:
            bent = _less(there.distances, here.distances) - slopes[0] @ step
            step, _ = _step(here, slopes, goal, box, radius, bent)
            there, gained = _taken(objective, here, step, goal, box)
        if there is not None and gained > _ACCEPTED * foreseen:
            here, slopes = there, None
            on_step(here)
            if gained > _GOOD * foreseen:
                radius = min(2.0 * radius, _LARGEST)
        else:
            radius = 0.4 * min(radius, float(np.max(np.abs(step))))
            if radius < _LEAST:
                break
    return here


def _taken(
    objective: Objective, here: Trial, step: Real, goal: Goal, box: tuple[Real, Real]
) -> tuple[Trial | None, float]:
    trial = objective(np.clip(here.at + step, *box), False)
    return trial, -np.inf if trial is None else goal.merit(here) - goal.merit(trial)


def _less(one: Real, other: Real) -> Real:
    """Return the difference where the first is finite, else 0."""
    return np.subtract(one, other, out=np.zeros(one.size), where=np.isfinite(one))


def _slopes(
    objective: Objective, here: Trial, box: tuple[Real, Real]
) -> tuple[NDArray[np.float64], Real]:
    """Return the derivatives of distances, (n_distance, n), and of the cost, (n,)."""
    n = here.at.size
    jacobian, gradient = np.zeros((here.distances.size, n)), np.zeros(n)
    for k in range(n):
        step = _DIFFERENCE if here.at[k] + _DIFFERENCE <= box[1][k] else -_DIFFERENCE
        trial = objective(here.at + step * (np.arange(n) == k), True)
        assert trial is not None  # beside a stable point
        jacobian[:, k] = _less(trial.distances, here.distances) / step
        gradient[k] = (trial.cost - here.cost) / step
    return jacobian, gradient


def _step(
    here: Trial,
    slopes: tuple[NDArray[np.float64], Real],
    goal: Goal,
    box: tuple[Real, Real],
    radius: float,
    bent: Real,
) -> tuple[Real, float]:
    jacobian, gradient = slopes
    wanted = np.isfinite(goal.distances)
    short = goal.distances[wanted] - here.distances[wanted] - bent[wanted]
    rigour = goal.rigour[wanted]
    n, m = here.at.size, short.size
    # the unknowns: steps up, steps down, the worst shortfall, each shortfall
    moved = -jacobian[wanted] * rigour[:, None]
    worst = np.hstack([moved, -moved, -np.ones((m, 1)), np.zeros((m, m))])
    each = np.hstack([moved, -moved, np.zeros((m, 1)), -np.eye(m)])
    down = np.minimum(radius, here.at - box[0])
    up = np.minimum(radius, box[1] - here.at)
    length = np.full(n, _SHORTEST * (1.0 if goal.cost else _PENALTY))
    weighed = goal.cost * gradient
    price = np.concatenate(
        [length + weighed, length - weighed, [_PENALTY], np.full(m, _PENALTY * _EACH)]
    )
    found = linprog(
        price,
        A_ub=np.vstack([worst, each]),
        b_ub=np.tile(-rigour * short, 2),
        bounds=[*((0.0, one) for one in (*up.tolist(), *down.tolist())), *[(0.0, None)] * (m + 1)],
        method="highs",
    )
    if found.x is None:
        return np.zeros(n), 0.0
    step = np.asarray(found.x[:n] - found.x[n : 2 * n], dtype=np.float64)
    after = float(price[2 * n :] @ found.x[2 * n :]) + float(weighed @ step)
    return step, goal.merit(here) - goal.cost * here.cost - after
