"""What stands in the way of a design: the specification that can't be met, and what can."""

from dataclasses import dataclass

import numpy as np

from helisim.base.errors import HelisimError
from helisim.base.units import RAD_PER_DEG
from helisim.design.descent import Goal, Point, Trial, Vector, descend
from helisim.design.problem import Problem
from helisim.handling.criteria import Limit, Rating

_CLOSE = 0.05
"""Distance below which a specification is in the way: it misses Level 1, or holds others off."""
_MET = -1e-3
_STEPS = 60
_RIGID = 200.0
"""By which shortfalls of what holds count beside those of what can't."""


class InfeasibleError(HelisimError):
    """Specifications can't be met. The message says which, and the nearest value that can.

    Attributes:
        nearest: the rating of that specification at its nearest, the others met.
    """

    def __init__(self, message: str, nearest: Rating | None = None) -> None:
        super().__init__(message)
        self.nearest = nearest


@dataclass(frozen=True, eq=False)
class _Relaxed:
    """A specification left out, the others met, and itself as near as may be."""

    spec: int
    rating: Rating


def infeasible(problem: Problem, at: Vector) -> InfeasibleError:
    """Return what to say where the best law of the nominal model misses a level.

    Args:
        problem: that can't be solved.
        at: coordinates of the law whose worst specification is best, (n_free,).
    """
    trial = problem.trial(at, (0,))
    assert trial is not None  # the phases end with a law that is stable
    asked = problem.of_kind("hard", "soft")
    short = np.where(asked, trial.distances, np.inf)
    in_the_way = [int(k) for k in np.argsort(short) if short[k] < _CLOSE]
    soft_first = sorted(in_the_way, key=lambda k: problem.specs[k].kind == "hard")
    found = [one for one in (_relaxed(problem, at, k) for k in soft_first) if one is not None]
    if found:
        best = max(found, key=lambda one: one.rating.distance)
        return InfeasibleError(_one_alone(best.rating), best.rating)
    return _together(problem, at, in_the_way)


def _together(problem: Problem, at: Vector, in_the_way: list[int]) -> InfeasibleError:
    """Return what to say of specifications that no one stands for: all as near as may be."""
    missing = [k for k in in_the_way if problem.specs[k].kind == "soft"] or in_the_way
    trial = problem.trial(at, (0,))
    assert trial is not None
    soft = [k for k in missing if trial.distances[k] < _MET] or missing
    rigour = np.full(len(problem.specs), _RIGID)
    rigour[soft] = 1.0
    goal = Goal(np.where(problem.of_kind("hard", "soft"), 0.0, -np.inf), rigour)

    def worth(there: Vector, near: bool = False) -> Trial | None:
        return problem.trial(there, (0,), near=near)

    point = descend(worth, Point(at, trial), goal, problem.box, steps=_STEPS)
    rated = problem.rate(problem.loops(point.at)[0])
    missed = [rated[k] for k in soft if rated[k].distance < _MET] or [rated[soft[0]]]
    names = ", ".join(_name(one) for one in missed)
    told = "; ".join(f"{_figures(one)} instead of {_limits(one)}" for one in missed)
    return InfeasibleError(f"{names} can't be met together: the nearest that can are {told}")


def _relaxed(problem: Problem, at: Vector, spec: int) -> _Relaxed | None:
    """Return one specification at its nearest while the others hold; None if they don't."""
    asked = problem.of_kind("hard", "soft")
    wanted = np.where(asked, 0.0, -np.inf)
    wanted[spec] = -np.inf
    goal = Goal(wanted, np.ones(wanted.size), 0.0)

    def worth(there: Vector, near: bool = False) -> Trial | None:
        trial = problem.trial(there, (0,), near=near)
        return None if trial is None else Trial(trial.distances, -float(trial.distances[spec]))

    def as_rated(there: Vector, near: bool = False) -> Trial | None:
        trial = problem.trial(there, (0,), near=near)
        if trial is None:
            return None
        rating = problem.specs[spec].criterion.rate(problem.loops(there)[0])
        return Trial(trial.distances, -rating.distance)

    trial = worth(at)
    assert trial is not None
    point = descend(worth, Point(at, trial), goal, problem.box, steps=_STEPS)
    if goal.shortfall(point.trial) > -_MET:
        return None
    nearest = Goal(wanted, np.ones(wanted.size), 1.0)
    point = descend(worth, point, nearest, problem.box, steps=_STEPS)
    start = as_rated(point.at)
    assert start is not None
    point = descend(as_rated, Point(point.at, start), nearest, problem.box, steps=_STEPS)
    return _Relaxed(spec, problem.rate(problem.loops(point.at)[0])[spec])


def _one_alone(rating: Rating) -> str:
    return (
        f"{_name(rating)} can't be met with the others: the nearest that can is "
        f"{_figures(rating)} instead of {_limits(rating)}"
    )


def _name(rating: Rating) -> str:
    return f"{rating.criterion.name} of {rating.criterion.word}"


def _figures(rating: Rating) -> str:
    """Return the figures that miss their limits."""
    return ", ".join(_told(name, rating.figures[name], rating) for name in _missed(rating))


def _limits(rating: Rating) -> str:
    """Return where Level 1 begins, of limits that don't depend on another figure."""
    borders = rating.criterion.limits
    limits = {name: borders[name] for name in _missed(rating)}
    told = [
        _told(name, one.level1, rating) for name, one in limits.items() if isinstance(one, Limit)
    ]
    return ", ".join(told) or "Level 1"


def _missed(rating: Rating) -> list[str]:
    """Return the figures that are limited and miss it; all of them where none does by itself."""
    limits = rating.criterion.limits
    shown = [name for name in limits if name in rating.figures]
    missed = [
        name
        for name in shown
        if not isinstance(one := limits[name], Limit) or one.distance(rating.figures[name]) < 0.0
    ]
    return missed or shown


def _told(name: str, value: float, rating: Rating) -> str:
    unit = rating.criterion.units.get(name, "")
    if unit == "rad":
        value, unit = value / RAD_PER_DEG, "deg"
    return f"{name} {value:.3g} {unit}".rstrip()
