"""Finds fits that have more than the data: dynamics beyond the band, or cancelled, or not needed.

A transfer function with a pole to spare puts it where it does no harm: at a million rad/s, or onto
a zero. Its coefficients then mean nothing alone, and its delay has taken over what the pole stands
for, however small their bounds. Such a fit is compared with transfer functions of lower order: the
lowest that leaves no more than noise can explain is what the data support.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals
from scipy.special import fdtri

from helisim.ident.fitting.cost import Cost
from helisim.ident.fitting.search import Minimum
from helisim.ident.model.evaluate import matrices
from helisim.ident.model.transfer import Coefficients, coefficients, transfer_function

_NOT_KNOWN = 1.0
"""A bound as large as the value itself: only then are lower orders tried."""

_BELIEVED = 0.999
"""Probability up to which noise alone explains what a higher order gains: a cancelling pair looks
for the frequency where noise makes it most useful, so 95 % would believe too much."""

_NOTHING = 1e-4
"""Rise of the average cost that is none, however little noise there is: 0.002 dB."""

_FAR = 5.0
"""A pole so many times above the band's top is not in the data, unless its errors say so."""


class Degenerate(NamedTuple):
    """What is degenerate in a fit: what to do, a line each, and the parameters concerned."""

    advice: tuple[str, ...]
    names: frozenset[str]


def degenerate(
    cost: Cost,
    best: Minimum,
    bounds: NDArray[np.float64],
    squares: Callable[[Cost, Minimum], float],
    fitted: Callable[[Cost], Minimum],
) -> Degenerate:
    """Return what is degenerate in a fit.

    Args:
        cost: the fit's.
        best: where it ended.
        bounds: (n_free,) Cramér-Rao bounds.
        squares: returns the sum of the squared residuals that the fit minimised.
        fitted: fits another structure to the same points, likewise.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        unknown = bounds >= _NOT_KNOWN * np.abs(best.x)
    if not np.any(unknown):
        return Degenerate((), frozenset())
    form = coefficients(cost.structure)
    if form is None or any(parameter.fixed for parameter in cost.structure.parameters):
        return _far_poles(cost, best.x, unknown)
    lower = _lower_order(cost, best, form, squares, fitted)
    if lower is None:
        return Degenerate((), frozenset())
    (zeros, poles), average = lower
    advice = (
        f"degenerate: {_reason(cost, best.x, form)}; fit tf:{zeros}/{poles} instead, whose J of "
        f"{average:.4g} is no worse but for noise"
    )
    return Degenerate((advice,), frozenset(cost.structure.names))


def _lower_order(
    cost: Cost,
    best: Minimum,
    form: Coefficients,
    squares: Callable[[Cost, Minimum], float],
    fitted: Callable[[Cost], Minimum],
) -> tuple[tuple[int, int], float] | None:
    """Return zeros, poles and J of the lowest order that is as good, None if there is none."""
    structure = cost.structure
    full = squares(cost, best)
    residuals = 2 * cost.points.weight.size
    freedom = max(residuals - best.x.size, 1)
    nothing = _NOTHING * len(cost.points.pairs)
    found, seen = None, set()
    order = (len(form.numerator) - 1, len(form.denominator))
    open_ones = [order]
    while open_ones:
        zeros, poles = open_ones.pop(0)
        for lower in ((zeros, poles - 1), (zeros - 1, poles), (zeros - 1, poles - 1)):
            if lower in seen or not 0 <= lower[0] <= lower[1]:
                continue
            seen.add(lower)
            smaller = transfer_function(
                zeros=lower[0],
                poles=lower[1],
                input=structure.inputs[0],
                output=structure.outputs[0],
                delay=form.delay,
            )
            other = Cost(smaller, cost.points)
            end = fitted(other)
            given_up = sum(order) - sum(lower)
            allowed = float(fdtri(given_up, freedom, _BELIEVED)) * given_up / freedom
            if squares(other, end) <= full * (1.0 + allowed) + nothing:
                open_ones.append(lower)
                if found is None or sum(lower) < sum(found[0]):
                    found = (lower, end.cost / len(cost.points.pairs))
    return found


def _reason(cost: Cost, x: NDArray[np.float64], form: Coefficients) -> str:
    """Return what is wrong with a transfer function that a lower order replaces."""
    values = cost.values(x)
    poles = np.roots([1.0, *(values[name] for name in reversed(form.denominator))])
    zeros = np.roots([values[name] for name in reversed(form.numerator)])
    top = float(np.max(cost.points.frequency))
    far = [root for root in (*poles, *zeros) if np.abs(root) > _FAR * top]
    if far:
        worst = max(np.abs(root) for root in far)
        kind = "pole" if any(np.abs(root) == worst for root in poles) else "zero"
        return f"a {kind} at {worst:.3g} rad/s is far above the band's {top:.3g} rad/s"
    if zeros.size and poles.size:
        gap = np.abs(zeros[:, None] - poles[None, :]) / np.abs(poles)[None, :]
        z, p = np.unravel_index(np.argmin(gap), gap.shape)
        if gap[z, p] < 0.1:
            return f"a zero cancels the pole at {np.abs(poles[p]):.3g} rad/s"
    return "the data do not see all of its coefficients"


def _far_poles(cost: Cost, x: NDArray[np.float64], unknown: NDArray[np.bool_]) -> Degenerate:
    """Return poles beyond the band that parameters of no known value have put there."""
    structure, top = cost.structure, float(np.max(cost.points.frequency))
    values = cost.values(x)
    delays = {
        name
        for entry in structure.entries
        if entry.matrix.endswith("delays")
        for name in entry.expression.names
    }
    free = [parameter.name for parameter in structure.free]

    def fastest(at: dict[str, float]) -> float:
        numbers = matrices(structure, at)
        if not (np.all(np.isfinite(numbers.M)) and np.all(np.isfinite(numbers.F))):
            return np.nan
        poles = np.abs(eigvals(numbers.F, numbers.M)) if numbers.F.size else np.zeros(1)
        return float(np.max(poles))

    worst = fastest(values)
    if not worst > _FAR * top:
        return Degenerate((), frozenset())
    moving = []
    for name, lost in zip(free, unknown):
        step = 1e-3 * (abs(values[name]) or structure.parameter(name).magnitude)
        moved = fastest({**values, name: values[name] + step})
        if lost and name not in delays and not abs(moved - worst) <= 1e-4 * worst:
            moving.append(name)
    if not moving:
        return Degenerate((), frozenset())
    advice = (
        f"degenerate: a pole at {worst:.3g} rad/s is far above the band's {top:.3g} rad/s, and the "
        f"data do not see what puts it there; fix {' or '.join(moving)} (--fix NAME=VALUE), or "
        "leave that lag out"
    )
    return Degenerate((advice,), frozenset([*moving, *(set(free) & delays)]))
