"""Searches for the minimum of a cost: descents from several starts until two of them agree."""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, OptimizeResult, least_squares

from helisim.ident.fitting.approach import approach, inside
from helisim.ident.fitting.cost import Cost
from helisim.ident.fitting.starts import Start, beside, starting_points
from helisim.ident.fitting.waits import Waits

_APPROACH_STEPS = 60
"""Evaluations of the search through relative errors, which only has to find the valley."""

_GOOD_ENOUGH = 100.0
"""Average cost (the guideline's limit) from which a minimum that two starts share is believed."""

_NOISE = 2.0
"""Squared standardised residuals, as a multiple of the expected, up to which noise explains them:
half of it would be 1 if the points' errors were known exactly."""

_NO_NOISE = 1e-2
"""Average cost that is none where nothing is known of the noise: 0.02 dB everywhere."""

_SAME_COST = 1e-4
"""Two searches found the same minimum when their costs agree to this fraction."""


class Minimum(NamedTuple):
    """Where one search ended, and where it began."""

    x: NDArray[np.float64]
    cost: float
    converged: bool
    start: Start


def search(
    cost: Cost, searches: int, seed: int, on_progress: Callable[[str], None]
) -> tuple[Minimum, int]:
    """Search from several starts until two of them end in the same good minimum.

    Where the structure has delays, only starts at different delays count. Where more is left than
    noise, one of the starts must have been chosen from many, and none lead lower from delays well
    beside the minimum.

    Returns:
        The best minimum, and how many starts agree on it.
    """
    enough = _GOOD_ENOUGH * len(cost.points.pairs)
    if not cost.structure.free:
        x = np.empty(0)
        return Minimum(x, float(cost.per_response(x).sum()), True, Start(x, x)), 1
    waits = Waits(cost)
    found: list[Minimum] = []
    for start in starting_points(cost, searches, seed):
        found.append(descend(cost, start))
        on_progress(cost.structure.name)
        best, agreeing = agreed(found, waits)
        if agreeing < 2 or best.cost > enough:
            continue
        if found[0].start.chosen or _only_noise(cost, best):
            break
        if not start.chosen:
            continue
        found += [descend(cost, other) for other in beside(cost, best.x)]
        if agreed(found, waits)[0].cost >= best.cost * (1.0 - _SAME_COST):
            break
    return agreed(found, waits)


def _only_noise(cost: Cost, best: Minimum) -> bool:
    """Return whether a minimum leaves no more than the points' errors."""
    deviation = cost.points.deviation
    if deviation is None or not np.any(deviation > 0.0):
        return best.cost <= _NO_NOISE * len(cost.points.pairs)
    left = float(np.sum(cost.standardised(best.x) ** 2))
    return left <= _NOISE * max(2 * deviation.size - best.x.size, 1)


def agreed(found: list[Minimum], waits: Waits) -> tuple[Minimum, int]:
    """Return the lowest minimum and how many starts, at different delays, ended there."""
    best = min(found, key=lambda minimum: minimum.cost)
    same = [m for m in found if m.cost <= best.cost * (1.0 + _SAME_COST) + 1e-9]
    if waits.index.size == 0:
        return best, len(same)
    counted: list[Minimum] = []
    for minimum in same:
        if all(waits.differ(minimum.start.delays, other.start.delays) for other in counted):
            counted.append(minimum)
    return best, len(counted)


def descend(cost: Cost, start: Start) -> Minimum:
    """Go from a start to a minimum of J: first by relative errors, then by J itself."""
    limits = np.array([parameter.limits for parameter in cost.structure.free]).T
    near = approach(cost, start.x, _APPROACH_STEPS)
    best: Minimum | None = None
    for unwrap in (True, False):
        origin = near if best is None else best.x
        end = _minimum(partial(cost.log, unwrap=unwrap), cost.log_jacobian, origin, limits)
        wrapped = float(np.sum(cost.log(end.x, unwrap=False) ** 2))
        if best is None or wrapped < best.cost:
            best = Minimum(end.x, wrapped, end.status > 0, start)
        if math.isclose(wrapped, 2.0 * float(end.cost), rel_tol=1e-9, abs_tol=1e-12):
            break
    assert best is not None  # the loop ran
    return best


def refine(cost: Cost, best: Minimum) -> Minimum:
    """Go on from a minimum of J to the one where each point counts by its own error."""
    limits = np.array([parameter.limits for parameter in cost.structure.free]).T
    end = _minimum(cost.standardised, cost.standardised_jacobian, best.x, limits)
    return Minimum(
        end.x,
        float(np.sum(cost.log(end.x, unwrap=False) ** 2)),
        best.converged and end.status > 0,
        best.start,
    )


def _minimum(
    residual: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    jacobian: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    origin: NDArray[np.float64],
    limits: NDArray[np.float64],
) -> OptimizeResult:
    """Go from a point near a minimum to the minimum itself."""
    return least_squares(
        residual,
        inside(origin, limits),
        jac=jacobian,  # pyright: ignore[reportArgumentType]
        bounds=Bounds(*limits),
        x_scale="jac",
        ftol=1e-10,
        xtol=1e-10,
        gtol=1e-10,
        max_nfev=300,
    )
