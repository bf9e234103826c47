"""Descent by linear programs: the worst of many distances, and a cost, within a trust region.

Distances to specifications are a worst case over axes and models: not smooth where the worst
changes hands. A linear program takes them as they are, each linearised by itself (Madsen, An
algorithm for minimax solution of overdetermined systems of non-linear equations, J. Inst. Maths
Applics 16, 1975, 321-328; with a cost, Fletcher and Sainz de la Maza, Nonlinear programming and
nonsmooth optimization by successive linear programming, Mathematical Programming 43, 1989).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

Vector = NDArray[np.float64]

_DIFFERENCE = 1e-4
"""Of a coordinate: a curve is read between its points to some 1e-9 of it."""
_PENALTY = 100.0
"""Of the worst shortfall beside the cost: above any sum of multipliers met, so that it is exact."""
_EACH = 0.1
"""Weight of each shortfall beside the worst: axes that are not the worst go on meanwhile."""
_SHORTEST = 1e-2
"""Weight of a step's length, in units of what is descended: what changes nothing stays."""
_FIRST, _LARGEST, _LEAST = 0.25, 0.8, 2e-3
"""Radius of trust: at first, at most, and where the descent ends."""
_ACCEPTED, _GOOD = 0.05, 0.6
"""Share of the improvement foreseen from which on a step is taken, and the radius doubled."""
_WORTHWHILE = 1e-4
"""Improvement foreseen below which the descent ends, in units of distance."""


@dataclass(frozen=True, eq=False)
class Trial:
    """What one law is worth.

    Attributes:
        distances: (n_distance,) of each specification in each model, positive inside Level 1;
            inf where it isn't asked for.
        cost: to be made small where the distances allow it.
    """

    distances: Vector
    cost: float


class Objective(Protocol):
    """What coordinates, (n,), are worth; None where a loop is unstable: distances mean nothing."""

    def __call__(self, at: Vector, /, near: bool = False) -> Trial | None:
        """Return it; `near` is a point beside one that is stable."""
        ...


@dataclass(frozen=True, eq=False)
class Goal:
    """What distances are wanted.

    Attributes:
        distances: (n_distance,) wanted; -inf asks for nothing.
        rigour: (n_distance,) by which a shortfall counts.
        cost: by which the cost counts, 0 where only shortfalls do.
    """

    distances: Vector
    rigour: Vector
    cost: float = 0.0

    def shortfalls(self, trial: Trial) -> Vector:
        """Return every shortfall, (n_distance,), 0 where nothing is short."""
        asked = np.isfinite(self.distances)
        short = np.zeros(asked.size)
        short[asked] = (self.distances - trial.distances)[asked]
        return np.maximum(0.0, self.rigour * short)

    def shortfall(self, trial: Trial) -> float:
        """Return the worst shortfall, 0 where nothing is short."""
        return float(np.max(self.shortfalls(trial)))

    def merit(self, trial: Trial) -> float:
        """Return what is descended: cost, the worst shortfall, and a little of each."""
        short = self.shortfalls(trial)
        penalty = _PENALTY * (float(np.max(short)) + _EACH * float(np.sum(short)))
        return self.cost * trial.cost + penalty


@dataclass(frozen=True, eq=False)
class Point:
    """Coordinates, (n,), and what they are worth."""

    at: Vector
    trial: Trial


def descend(
    objective: Objective,
    start: Point,
    goal: Goal,
    box: tuple[Vector, Vector],
    *,
    steps: int,
    on_step: Callable[[Point], None] | None = None,
) -> Point:
    """Return the best point that is reached from a start.

    Without a cost it ends as soon as nothing is short.

    Args:
        objective: of coordinates.
        start: where every loop is stable.
        goal: what is wanted.
        box: lowest and highest coordinates, (n,) each.
        steps: at most.
        on_step: called with each point that is accepted.
    """
    here, radius = start, _FIRST
    slopes: tuple[NDArray[np.float64], Vector] | None = None
    for _ in range(steps):
        if goal.cost == 0.0 and goal.shortfall(here.trial) == 0.0:
            break
        if slopes is None:
            slopes = _slopes(objective, here, box)
        step, foreseen = _step(here, slopes, goal, box, radius)
        if foreseen < _WORTHWHILE:
            break
        there, gained = _taken(objective, here, step, goal, box)
        if there is not None and gained <= _ACCEPTED * foreseen:
            bent = _over(there.trial.distances, here.trial.distances) - slopes[0] @ step
            step, _ = _step(here, slopes, goal, box, radius, bent)
            there, gained = _taken(objective, here, step, goal, box)
        if there is not None and gained > _ACCEPTED * foreseen:
            here, slopes = there, None
            if on_step is not None:
                on_step(here)
            if gained > _GOOD * foreseen:
                radius = min(2.0 * radius, _LARGEST)
        else:
            radius = 0.4 * min(radius, float(np.max(np.abs(step))))
            if radius < _LEAST:
                break
    return here


def _taken(
    objective: Objective, here: Point, step: Vector, goal: Goal, box: tuple[Vector, Vector]
) -> tuple[Point | None, float]:
    """Return the point that a step leads to, None where it is unstable, and what is gained."""
    there = np.clip(here.at + step, *box)
    trial = objective(there)
    if trial is None:
        return None, -np.inf
    return Point(there, trial), goal.merit(here.trial) - goal.merit(trial)


def _over(after: Vector, before: Vector) -> Vector:
    """Return by how much distances, (n_distance,), grew, 0 where they aren't asked for."""
    found = np.zeros(after.size)
    known = np.isfinite(after)
    found[known] = after[known] - before[known]
    return found


def _slopes(
    objective: Objective, here: Point, box: tuple[Vector, Vector]
) -> tuple[NDArray[np.float64], Vector]:
    """Return the derivatives of distances, (n_distance, n), and of the cost, (n,)."""
    n = here.at.size
    jacobian, gradient = np.zeros((here.trial.distances.size, n)), np.zeros(n)
    for k in range(n):
        forward = here.at[k] + _DIFFERENCE <= box[1][k]
        for step in (_DIFFERENCE, -_DIFFERENCE) if forward else (-_DIFFERENCE,):
            there = here.at.copy()
            there[k] += step
            trial = objective(there, near=True)
            if trial is not None:
                jacobian[:, k] = _over(trial.distances, here.trial.distances) / step
                gradient[k] = (trial.cost - here.trial.cost) / step
                break
    return jacobian, gradient


def _step(
    here: Point,
    slopes: tuple[NDArray[np.float64], Vector],
    goal: Goal,
    box: tuple[Vector, Vector],
    radius: float,
    bent: Vector | None = None,
) -> tuple[Vector, float]:
    """Return the step that the linear program asks for, and the improvement it foresees."""
    jacobian, gradient = slopes
    wanted = np.isfinite(goal.distances)
    short = goal.distances[wanted] - here.trial.distances[wanted]
    if bent is not None:
        short = short - bent[wanted]
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
    return step, goal.merit(here.trial) - goal.cost * here.trial.cost - after
