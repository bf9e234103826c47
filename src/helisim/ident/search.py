"""Searches for the minimum of a cost: descents from several starts until two of them agree."""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, OptimizeResult, least_squares

from helisim.base.arrays import Real
from helisim.ident.cost import Cost
from helisim.ident.expression import value_at
from helisim.ident.rational import STEP, delay_grid, rational_fits
from helisim.ident.structure import DELAYS, Structure
from helisim.ident.structures import Rational, rational_form

_APPROACH_STEPS = 60  # evaluations by relative errors, which only have to find the valley
# Average cost at which a minimum that two starts share is believed: the guideline's limit; and the
# average cost that is none where the noise isn't known: 0.02 dB everywhere
_GOOD_ENOUGH, _NO_NOISE = 100.0, 1e-2
# _NOISE: squared standardised residuals over the expected, explained by noise
# _SAME_COST: relative difference of equal costs
_NOISE, _SAME_COST = 2.0, 1e-4
# Standard deviation of the starts' logarithm, a factor of 2 either way; and the share of the
# unbounded parameters that a race tries with the other sign
_SPREAD, _FLIPPED = 0.7, 0.2
# Scattered starts of which the best is searched from, each as dear as one step; starts that race
# from the third search on; and steps of a lap, after which the slower half drops out
_HANDFUL, _CROWD, _LAP = 8, 16, 6
_BESIDE = 4  # steps of the delays by which starts beside a minimum differ
_VALLEYS, _NEARLY = 4, 1.5  # Rational fits to search from; their largest error over the best one's


class Start(NamedTuple):
    """Start of a search, (n_free,), and its delays, (n_delay,) s; `chosen` if the best of many."""

    x: Real
    delays: Real
    chosen: bool = False


class Minimum(NamedTuple):
    """End of a search, and its start."""

    x: Real
    cost: float
    converged: bool
    start: Start


def search(
    cost: Cost, searches: int, seed: int, on_progress: Callable[[str], None]
) -> tuple[Minimum, int]:
    """Return the best minimum and the number of starts, at different delays, that agree on it."""
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
    if not cost.noisy:
        return best.cost <= _NO_NOISE * len(cost.points.pairs)
    left = cost.standardised(best.x)
    return float(np.sum(left**2)) <= _NOISE * max(left.size - best.x.size, 1)


def agreed(found: Sequence[Minimum], delays: "Delays") -> tuple[Minimum, int]:
    """Return the lowest minimum and the number of starts, at different delays, that reached it."""
    best = min(found, key=lambda minimum: minimum.cost)
    counted: list[Minimum] = []
    for one in found:
        same = one.cost <= best.cost * (1.0 + _SAME_COST) + 1e-9
        apart = all(delays.differ(one.start.delays, other.start.delays) for other in counted)
        if same and (apart or not delays.index.size):
            counted.append(one)
    return best, len(counted)


def descend(cost: Cost, start: Start) -> Minimum:
    """Descend from a start to a minimum of J: first by relative errors, then by J."""
    nearer = cost.limits, cost.relative, cost.relative_jacobian, start.x
    best = Minimum(minimum(*nearer, 1e-4, 1e-8, _APPROACH_STEPS).x, math.inf, False, start)
    for unwrap in (True, False):
        end = minimum(cost.limits, partial(cost.log, unwrap=unwrap), cost.log_jacobian, best.x)
        wrapped = float(np.sum(cost.log(end.x, unwrap=False) ** 2))
        if wrapped < best.cost:
            best = Minimum(end.x, wrapped, end.status > 0, start)
        if math.isclose(wrapped, 2.0 * float(end.cost), rel_tol=1e-9, abs_tol=1e-12):
            break
    return best


def refine(cost: Cost, best: Minimum) -> Minimum:
    """Descend from a minimum of J to the one weighed by each point's own error."""
    end = minimum(cost.limits, cost.standardised, cost.standardised_jacobian, best.x)
    wrapped = float(np.sum(cost.log(end.x, unwrap=False) ** 2))
    return Minimum(end.x, wrapped, best.converged and end.status > 0, best.start)


def minimum(
    limits: Real,
    residual: Callable[[Real], Real],
    jacobian: Callable[[Real], Real],
    origin: Real,
    tolerance: float = 1e-10,
    gradient: float = 1e-10,
    steps: int = 300,
) -> OptimizeResult:
    """Descend from `origin`, (n_free,), by least squares within `limits`, (2, n_free)."""
    low, high = limits
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
    """Yield `count` starts, the most likely first."""
    random = np.random.default_rng(seed)
    delays, gains = Delays(cost), linear_parameters(cost.structure)
    form = rational_form(cost.structure)
    direct = [] if form is None else _rational_starts(cost, form)
    yield from direct[:count]
    taken, rough = list[Real](), (cost.limits, cost.relative, cost.relative_jacobian)

    def solved(x: Real) -> Start:
        x = np.clip(x, *cost.limits)
        x = delays.scan(x, gains, taken[-1:]) if delays.index.size else x
        return _solved(cost, x, gains, delays)

    def distance(start: Start) -> float:
        return float(np.sum(cost.relative(start.x) ** 2))

    for number in range(count - len(direct)):
        if number == 0:
            best = solved(np.array([parameter.start for parameter in cost.structure.free]))
        elif number == 1:
            crowd = [solved(scattered(cost.structure, random, 0.0)) for _ in range(_HANDFUL)]
            best = min(crowd, key=distance)
        else:  # a race: the slower half drops out at each lap
            crowd = [solved(scattered(cost.structure, random, _FLIPPED)) for _ in range(_CROWD)]
            while len(crowd) > 1:
                crowd = [
                    Start(minimum(*rough, one.x, 1e-4, 1e-8, _LAP).x, one.delays) for one in crowd
                ]
                crowd = sorted(crowd, key=distance)[: len(crowd) // 2]
            best = crowd[0]._replace(chosen=True)
        taken.append(best.delays)
        yield best


def beside(cost: Cost, x: Real) -> list[Start]:
    """Return starts on either side of a minimum: all delays moved, gains solved."""
    delays, gains = Delays(cost), linear_parameters(cost.structure)
    steps = np.zeros(x.size)
    steps[delays.index] = _BESIDE * delays.apart
    sides = (-steps, steps) if delays.index.size else ()
    return [_solved(cost, np.clip(x + one, *cost.limits), gains, delays) for one in sides]


def _rational_starts(cost: Cost, form: Rational) -> list[Start]:
    frequency, structure = cost.points.frequency, cost.structure
    starts = {**structure.starts, **dict.fromkeys(cost.names, np.nan)}
    fixed = form.delay not in cost.names
    grid = np.array([starts[form.delay] if form.delay else 0.0])
    if form.delay and not fixed:
        grid = delay_grid(frequency, *structure.parameter(form.delay).limits)
    fits = rational_fits(
        frequency,
        cost.points.measured,
        cost.certainty,
        zeros=form.zeros,
        poles=form.poles,
        delays=grid,
        fixed=fixed,
        known=np.array([starts[name] for name in form.names]),
    )
    first: list[Start] = []
    again: list[Start] = []
    resolution = STEP / float(np.max(frequency))
    ends: list[tuple[float, float]] = []
    for k in np.argsort(fits.errors, kind="stable"):
        end = (float(fits.errors[k]), float(fits.delays[k]))
        if end[0] > _NEARLY * fits.errors.min():
            break
        found = (*fits.numerators[k].tolist(), *fits.denominators[k, :-1].tolist())
        values = {**dict(zip(form.names, found)), form.delay: end[1]}
        x = np.clip(np.array([values[name] for name in cost.names]), *cost.limits)
        begun = np.zeros(0) if fixed else grid[k : k + 1]
        known = any(
            np.isclose(end[0], error, rtol=1e-3) and abs(end[1] - delay) <= 0.1 * resolution
            for error, delay in ends
        )
        ends.append(end)
        (again if known else first).append(Start(x, begun, chosen=True))
    return [*first[:_VALLEYS], *again[:_VALLEYS]]


def scattered(structure: Structure, random: np.random.Generator, flipped: float) -> Real:
    """Return scattered free parameters, (n_free,), some unbounded ones of the other sign."""
    own = np.array([parameter.start for parameter in structure.free])
    size = np.array([parameter.magnitude for parameter in structure.free])
    factor = np.exp(_SPREAD * random.standard_normal(own.size))
    shift = size * random.standard_normal(own.size)
    free = np.array([parameter.bounds is None for parameter in structure.free])
    sign = np.where(free & (random.random(own.size) < flipped), -1.0, 1.0)
    return np.where(own != 0.0, own * factor * sign, shift)


def linear_parameters(structure: Structure) -> NDArray[np.intp]:
    """Return which free parameters act linearly, (n_gain,): those only in G and D."""
    upstream = _upstream(structure)
    elsewhere: set[str] = set()
    within: set[str] = set()
    for entry in structure.entries:
        between = (
            entry.matrix in ("F", "M") and entry.column in upstream and entry.row not in upstream
        )
        gain = entry.matrix == "D" or (entry.matrix == "G" and entry.row not in upstream)
        (within if gain or between else elsewhere).update(entry.expression.names)
    return np.flatnonzero([parameter.name in within - elsewhere for parameter in structure.free])


def _upstream(structure: Structure) -> set[int]:
    size = len(structure.states)
    reaches = np.eye(size, dtype=np.bool_)
    driven = np.zeros(size, dtype=np.bool_)
    free = {parameter.name for parameter in structure.free}
    for entry in structure.entries:
        if entry.matrix in ("F", "M"):
            reaches[entry.row, entry.column] = True
        elif entry.matrix == "G" and not entry.expression.names.isdisjoint(free):
            driven[entry.row] = True
    for k in range(size):
        reaches |= np.outer(reaches[:, k], reaches[k])
    # nothing free drives what moves these states, and they move that in turn
    apart = ~(reaches @ driven) & np.all(reaches <= reaches.T, axis=1)
    found = set(np.flatnonzero(np.any(reaches[apart], axis=0)).tolist())
    return found if len(found) < size else set()


def _solved(cost: Cost, x: Real, gains: NDArray[np.intp], delays: "Delays") -> Start:
    x = x.copy()
    if gains.size:
        residual, jacobian = cost.relative(x), cost.relative_jacobian(x)[:, gains]
        x[gains] -= np.linalg.lstsq(jacobian, residual, rcond=1e-9)[0]
    x = np.clip(x, *cost.limits)
    return Start(x, x[delays.index])


class Delays:
    """Free delays: (n_delay,) `index`, values to try of each, s, least difference of starts, s."""

    def __init__(self, cost: Cost) -> None:
        structure, points = cost.structure, cost.points
        program, everything = structure.program, slice(None)
        starts = program.ordered(structure.starts).tolist()
        slope = np.zeros((len(cost.names), len(structure.outputs), len(structure.inputs)))
        for one in program.dependences:
            name = program.names[one.place]
            if one.matrix in DELAYS and name in cost.names:
                late = one.matrix == "input_delays"
                place = (everything, one.column) if late else (one.row, everything)
                slope[cost.names.index(name), *place] += value_at(one.slope, starts)
        self._cost = cost
        self.index = np.flatnonzero(np.any(slope != 0.0, axis=(1, 2)))
        limits = cost.limits[:, self.index].T
        self.grids = [delay_grid(points.frequency, low, high) for low, high in limits]
        step = STEP / float(np.max(points.frequency))
        self.apart = np.array([min(step, 0.5 * np.ptp(grid)) for grid in self.grids])
        # phase of each point by a second of each delay, rad
        self._turn = points.frequency * slope[self.index][:, points.output, points.input]

    def differ(self, one: Real, other: Real) -> bool:
        """Return whether two vectors of delays, (n_delay,) s each, are a step apart."""
        return bool(np.any(np.abs(one - other) >= 0.99 * self.apart))

    def scan(self, x: Real, gains: NDArray[np.intp], taken: Sequence[Real] = ()) -> Real:
        """Return free parameters with the best delays for x, (n_free,): all alike, then one by one.

        `gains` (n_gain,) act linearly; `taken` are delays, (n_delay,) s, to stay a step away from.
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
            delays = delays[[all(self.differ(one, other) for other in taken) for one in delays]]
            # |turn (g s + rest) - 1| = |g s + rest - 1 / turn|: the gains' span is constant
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
