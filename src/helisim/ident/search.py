"""Searches for the minimum of a cost: descents from several starts until two of them agree.

A search finds a minimum only from a delay that turns the phase less than about half a turn too
far, so delays are scanned: of a transfer function with the rational fit of the data at each delay,
of any other structure with the gains solved from the data at each. Then come scattered starts.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, OptimizeResult, least_squares

from helisim.ident.cost import Cost
from helisim.ident.rational import STEP, delay_grid, rational_fits
from helisim.ident.structure import DELAYS, Structure
from helisim.ident.transfer import Rational, rational_form

_APPROACH_STEPS = 60
"""Evaluations of the search through relative errors, which only has to find the valley."""
_GOOD_ENOUGH, _NO_NOISE = 100.0, 1e-2
"""Average cost from which a minimum that two starts share is believed, the guideline's limit; and
that is none where nothing is known of the noise: 0.02 dB everywhere."""
_NOISE = 2.0
"""Squared standardised residuals, as a multiple of the expected, up to which noise explains them:
half of it would be 1 if the points' errors were known exactly."""
_SAME_COST = 1e-4
"""Two searches found the same minimum when their costs agree to this fraction."""
_SPREAD, _FLIPPED = 0.7, 0.2
"""Standard deviation of the starts' natural logarithm: a factor of 2 either way; and the share of
the unbounded parameters that a race tries with the other sign."""
_HANDFUL, _CROWD, _LAP = 8, 16, 6
"""Scattered starts of which the best one is searched from, each costs as much as one step; that
race each other, from the third start on; and steps of a race at which the slower half drops out."""
_BESIDE = 4
"""Steps of the delays by which a minimum is looked past: two radians at the top of the band."""
_VALLEYS, _NEARLY = 4, 1.5
"""Different rational fits that are searched from, and of what error over the best one's."""

Real = NDArray[np.float64]


class Start(NamedTuple):
    """Where a search begins.

    Attributes:
        x: (n_free,) the free parameters.
        delays: (n_delay,) s, from which x was found.
        chosen: from so many others that it needs no further one beside it: by a race, or from the
            rational fits of all delays.
    """

    x: Real
    delays: Real
    chosen: bool = False


class Minimum(NamedTuple):
    """Where one search ended, and where it began."""

    x: Real
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
    delays = Delays(cost)
    found: list[Minimum] = []
    for start in starting_points(cost, searches, seed):
        found.append(descend(cost, start))
        on_progress(cost.structure.name)
        best, agreeing = agreed(found, delays)
        if agreeing < 2 or best.cost > enough:
            continue
        if found[0].start.chosen or _only_noise(cost, best):
            break
        if not start.chosen:
            continue
        found += [descend(cost, other) for other in beside(cost, best.x)]
        if agreed(found, delays)[0].cost >= best.cost * (1.0 - _SAME_COST):
            break
    return agreed(found, delays)


def _only_noise(cost: Cost, best: Minimum) -> bool:
    """Return whether a minimum leaves no more than the points' errors."""
    if not cost.noisy:
        return best.cost <= _NO_NOISE * len(cost.points.pairs)
    left = cost.standardised(best.x)
    return float(np.sum(left**2)) <= _NOISE * max(left.size - best.x.size, 1)


def agreed(found: Sequence[Minimum], delays: "Delays") -> tuple[Minimum, int]:
    """Return the lowest minimum and how many starts, at different delays, ended there."""
    best = min(found, key=lambda minimum: minimum.cost)
    counted: list[Minimum] = []
    for one in found:
        same = one.cost <= best.cost * (1.0 + _SAME_COST) + 1e-9
        apart = all(delays.differ(one.start.delays, other.start.delays) for other in counted)
        if same and (apart or not delays.index.size):
            counted.append(one)
    return best, len(counted)


def descend(cost: Cost, start: Start) -> Minimum:
    """Go from a start to a minimum of J: first by relative errors, then by J itself."""
    near = _approach(cost, start.x, _APPROACH_STEPS)
    best: Minimum | None = None
    for unwrap in (True, False):
        origin = near if best is None else best.x
        end = _minimum(cost, partial(cost.log, unwrap=unwrap), cost.log_jacobian, origin)
        wrapped = float(np.sum(cost.log(end.x, unwrap=False) ** 2))
        if best is None or wrapped < best.cost:
            best = Minimum(end.x, wrapped, end.status > 0, start)
        if math.isclose(wrapped, 2.0 * float(end.cost), rel_tol=1e-9, abs_tol=1e-12):
            break
    assert best is not None  # the loop ran
    return best


def refine(cost: Cost, best: Minimum) -> Minimum:
    """Go on from a minimum of J to the one where each point counts by its own error."""
    end = _minimum(cost, cost.standardised, cost.standardised_jacobian, best.x)
    wrapped = float(np.sum(cost.log(end.x, unwrap=False) ** 2))
    return Minimum(end.x, wrapped, best.converged and end.status > 0, best.start)


def _approach(cost: Cost, x: Real, steps: int) -> Real:
    """Return where at most `steps` steps lead from x to fewer relative errors, smooth at zero."""
    return _minimum(cost, cost.relative, cost.relative_jacobian, x, 1e-4, 1e-8, steps).x


def _minimum(
    cost: Cost,
    residual: Callable[[Real], Real],
    jacobian: Callable[[Real], Real],
    origin: Real,
    tolerance: float = 1e-10,
    gradient: float = 1e-10,
    steps: int = 300,
) -> OptimizeResult:
    """Go from a point towards a minimum, strictly within the limits as a trust region has to."""
    low, high = cost.limits
    margin = np.where(np.isfinite(high - low), 1e-9 * (high - low), 0.0)
    return least_squares(
        residual,
        np.clip(origin, low + margin, high - margin),
        jac=jacobian,  # pyright: ignore[reportArgumentType]
        bounds=Bounds(low, high),
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        gtol=gradient,
        max_nfev=steps,
    )


def starting_points(cost: Cost, count: int, seed: int) -> Iterator[Start]:
    """Yield `count` starts, the most likely one first."""
    random = np.random.default_rng(seed)
    delays, gains = Delays(cost), linear_parameters(cost.structure)
    form = rational_form(cost.structure)
    direct = [] if form is None else _rational_starts(cost, form)
    yield from direct[:count]
    taken: list[Real] = []

    def solved(x: Real) -> Start:
        x = np.clip(x, *cost.limits)
        if delays.index.size:
            x = delays.scan(x, gains, taken[-1:])
        x = _solve_gains(cost, x, gains)
        return Start(np.clip(x, *cost.limits), x[delays.index])

    def distance(start: Start) -> float:
        return float(np.sum(cost.relative(start.x) ** 2))

    for number in range(count - len(direct)):
        if number == 0:
            best = solved(np.array([parameter.start for parameter in cost.structure.free]))
        elif number == 1:
            crowd = [solved(scattered(cost.structure, random, 0.0)) for _ in range(_HANDFUL)]
            best = min(crowd, key=distance)
        else:  # a race, in which the slower half drops out at each lap
            crowd = [solved(scattered(cost.structure, random, _FLIPPED)) for _ in range(_CROWD)]
            while len(crowd) > 1:
                crowd = [Start(_approach(cost, one.x, _LAP), one.delays) for one in crowd]
                crowd = sorted(crowd, key=distance)[: len(crowd) // 2]
            best = crowd[0]._replace(chosen=True)
        taken.append(best.delays)
        yield best


def beside(cost: Cost, x: Real) -> list[Start]:
    """Return starts on either side of a minimum x, (n_free,): all delays moved, gains solved.

    A wrong delay often has a wrong sign or a zero on the wrong side with it, which hold it there.
    """
    delays, gains = Delays(cost), linear_parameters(cost.structure)
    found = []
    for steps in (-_BESIDE, _BESIDE) if delays.index.size else ():
        moved = x.copy()
        moved[delays.index] += steps * delays.apart
        moved = _solve_gains(cost, np.clip(moved, *cost.limits), gains)
        moved = np.clip(moved, *cost.limits)
        found.append(Start(moved, moved[delays.index]))
    return found


def _rational_starts(cost: Cost, form: Rational) -> list[Start]:
    """Return starts from the rational fits of the only response, the best first.

    First come the different fits that are nearly as good as the best, then those that ended there
    from another delay.
    """
    frequency, structure = cost.points.frequency, cost.structure
    parameter = None if form.delay is None else structure.parameter(form.delay)
    grid, fixed = np.array([0.0]), True
    if parameter is not None:
        fixed = parameter.fixed
        low, high = parameter.limits
        grid = np.array([parameter.start]) if fixed else delay_grid(frequency, low, high)
    starts = {**structure.starts, **dict.fromkeys(cost.names, np.nan)}
    fits = rational_fits(
        frequency,
        cost.points.measured * (1j * frequency) ** form.power,
        cost.certainty,
        zeros=form.zeros,
        poles=form.poles,
        delays=grid,
        fixed=fixed,
        known=np.array([starts[name] for name in form.names]) if form.names else None,
    )
    first: list[Start] = []
    again: list[Start] = []
    resolution = STEP / float(np.max(frequency))
    ends: list[tuple[float, float]] = []
    for k in np.argsort(fits.errors, kind="stable"):
        end = (float(fits.errors[k]), float(fits.delays[k]))
        if end[0] > _NEARLY * fits.errors.min():
            break
        values = form.values(fits.numerators[k], fits.denominators[k])
        if form.delay is not None:
            values[form.delay] = end[1]
        x = np.clip(np.array([values[name] for name in cost.names]), *cost.limits)
        begun = np.zeros(0) if fixed else fits.begun[k : k + 1]
        known = any(
            np.isclose(end[0], error, rtol=1e-3) and abs(end[1] - delay) <= 0.1 * resolution
            for error, delay in ends
        )
        ends.append(end)
        (again if known else first).append(Start(x, begun, chosen=True))
    return [*first[:_VALLEYS], *again[:_VALLEYS]]


def scattered(structure: Structure, random: np.random.Generator, flipped: float) -> Real:
    """Return scattered free parameters, (n_free,), a share of the unbounded of the other sign."""
    own = np.array([parameter.start for parameter in structure.free])
    size = np.array([parameter.magnitude for parameter in structure.free])
    factor = np.exp(_SPREAD * random.standard_normal(own.size))
    shift = size * random.standard_normal(own.size)
    free = np.array([parameter.bounds is None for parameter in structure.free])
    sign = np.where(free & (random.random(own.size) < flipped), -1.0, 1.0)
    return np.where(own != 0.0, own * factor * sign, shift)


def linear_parameters(structure: Structure) -> NDArray[np.intp]:
    """Return which free parameters act linearly, (n_gain,): they stand in G, D and D1 only.

    They may also stand between known dynamics at an input, such as a servo's, and the rest.
    """
    upstream = _upstream(structure)
    elsewhere: set[str] = set()
    within: set[str] = set()
    for entry in structure.entries:
        between = (
            entry.matrix in ("F", "M") and entry.column in upstream and entry.row not in upstream
        )
        gain = entry.matrix in ("D", "D1") or (entry.matrix == "G" and entry.row not in upstream)
        (within if gain or between else elsewhere).update(entry.expression.names)
    gains = within - elsewhere
    return np.flatnonzero([parameter.name in gains for parameter in structure.free])


def _upstream(structure: Structure) -> set[int]:
    """Return the states between an input and the rest that nothing but known numbers drives."""
    size = len(structure.states)
    reaches = np.eye(size, dtype=np.bool_)
    free = {parameter.name for parameter in structure.free}
    driven: set[int] = set()
    for entry in structure.entries:
        if entry.matrix in ("F", "M"):
            reaches[entry.row, entry.column] = True
        elif entry.matrix == "G" and not entry.expression.names.isdisjoint(free):
            driven.add(entry.row)
    for k in range(size):
        reaches |= np.outer(reaches[:, k], reaches[k])
    found: set[int] = set()
    for state in range(size):
        behind = set(np.flatnonzero(reaches[state]).tolist())
        if driven.isdisjoint(behind) and all(reaches[other, state] for other in behind):
            found |= behind
    return found if len(found) < size else set()


def _solve_gains(cost: Cost, x: Real, gains: NDArray[np.intp]) -> Real:
    """Return x with the gains that fit the measured response best, all else given."""
    if gains.size == 0:
        return x
    residual, jacobian = cost.relative(x), cost.relative_jacobian(x)[:, gains]
    if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(jacobian))):
        return x
    solved = x.copy()
    solved[gains] -= np.linalg.lstsq(jacobian, residual, rcond=1e-9)[0]
    return solved


class Delays:
    """The free delays of a structure: which they are, where to look, and what they fit best.

    Attributes:
        index: (n_delay,) where they are among the free parameters.
        grids: the values to look at of each, s.
        apart: (n_delay,) s, by which two must differ to be different starts: what turns the top
            of the band by half a radian, or half of what the bounds leave.
    """

    def __init__(self, cost: Cost) -> None:
        structure, points = cost.structure, cost.points
        known = {**structure.constants, **structure.starts}
        slope = np.zeros((len(cost.names), len(structure.outputs), len(structure.inputs)))
        everything = slice(None)
        for matrix, row, column, expression in structure.entries:
            place = {
                "input_delays": (everything, column),
                "output_delays": (row, everything),
            }.get(matrix, (row, column))
            slopes = expression.evaluate(known)[1] if matrix in DELAYS else {}
            for name, derivative in slopes.items():
                if name in cost.names:
                    slope[cost.names.index(name), *place] += derivative
        self._cost = cost
        self.index = np.flatnonzero(np.any(slope != 0.0, axis=(1, 2)))
        limits = cost.limits[:, self.index].T
        self.grids = [delay_grid(points.frequency, low, high) for low, high in limits]
        step = STEP / float(np.max(points.frequency))
        self.apart = np.array([min(step, 0.5 * np.ptp(grid)) for grid in self.grids])
        # rad by which a second of each delay turns each point
        self._turn = points.frequency * slope[self.index][:, points.output, points.input]

    def differ(self, one: Real, other: Real) -> bool:
        """Return whether two vectors of delays, each (n_delay,) s, are a step apart."""
        return bool(np.any(np.abs(one - other) >= 0.99 * self.apart))

    def scan(self, x: Real, gains: NDArray[np.intp], taken: Sequence[Real] = ()) -> Real:
        """Return free parameters with the best delays: all alike first, then one at a time.

        The gains are solved at each. A delay turns the response that is known at x, so nothing is
        evaluated but that.

        Args:
            x: (n_free,) the free parameters.
            gains: which of them act linearly, (n_gain,).
            taken: delays to stay a step away from, each (n_delay,) s, where the bounds allow it.

        Returns:
            (n_free,).
        """
        z, slope = self._cost.ratio(x)
        if not (np.all(np.isfinite(z)) and np.all(np.isfinite(slope))):
            return x
        here = x[self.index]
        root = np.sqrt(self._cost.certainty)
        linear = _real(root * slope[gains])
        rest = z - x[gains] @ slope[gains]
        size = np.linalg.norm(linear, axis=1)
        size[size == 0.0] = 1.0
        seen = np.linalg.svd(linear / size[:, None], full_matrices=False)
        basis = seen.Vh[1e-9 * np.max(seen.S, initial=0.0) < seen.S]

        def best(delays: Real) -> Real | None:
            apart = [all(self.differ(one, other) for other in taken) for one in delays]
            delays = delays[apart]
            # |turn (g s + rest) - 1| = |g s + rest - 1 / turn|, so what gains can do never changes
            back = np.exp(1j * ((delays - here) @ self._turn))
            target = _real(root * (back - rest))
            squares = np.sum(target**2, axis=1) - np.sum((target @ basis.T) ** 2, axis=1)
            return delays[np.argmin(squares)] if delays.size else None

        longest = max(self.grids, key=len)
        limits = np.array([(grid[0], grid[-1]) for grid in self.grids])
        alike = np.clip(np.repeat(longest[:, None], here.size, axis=1), *limits.T)
        chosen = best(np.concatenate([alike, here[None, :]]))
        if chosen is None:
            return x
        for k, grid in [*enumerate(self.grids)] * (2 if here.size > 1 else 0):
            each = np.repeat(chosen[None, :], grid.size, axis=0)
            each[:, k] = grid
            better = best(each)
            chosen = chosen if better is None else better
        found = x.copy()
        found[self.index] = chosen
        return found


def _real(rows: NDArray[np.complex128]) -> Real:
    return np.concatenate([rows.real, rows.imag], axis=-1)
