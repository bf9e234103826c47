"""Chooses where the searches begin: what the data say first, then scattered starts.

A search finds a minimum only from a delay that turns the phase less than about half a turn too
far, so delays are scanned: of a transfer function with the rational fit of the data at each delay,
of any other structure with the gains solved from the data at each.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.ident.cost import Cost
from helisim.ident.factored import Factors, rational_form
from helisim.ident.rational import STEP, delay_grid, rational_fits
from helisim.ident.structure import Structure
from helisim.ident.transfer import Coefficients

_SPREAD = 0.7
"""Standard deviation of the starts' natural logarithm: a factor of 2 either way."""

_HANDFUL = 8
"""Scattered starts of which the best one is searched from: each costs as much as one step."""

_VALLEYS = 4
"""Different rational fits that are searched from."""

_NEARLY = 1.5
"""Rational fits whose error is so many times the best one's are searched from too."""


class Start(NamedTuple):
    """Where a search begins.

    Attributes:
        x: (n_free,) the free parameters.
        delays: (n_delay,) s, from which x was found.
    """

    x: NDArray[np.float64]
    delays: NDArray[np.float64]


class Waits:
    """The free delays of a structure, as a vector of free parameters has them.

    Attributes:
        index: (n_delay,) where they are among the free parameters.
        grids: the values to look at of each, s.
        apart: (n_delay,) s, by which two must differ to be different starts: what turns the top
            of the band by half a radian, or half of what the bounds leave.
    """

    def __init__(self, cost: Cost) -> None:
        structure, points = cost.structure, cost.points
        names = [parameter.name for parameter in structure.free]
        known = {**structure.constants, **structure.starts}
        slope = np.zeros((len(names), len(structure.outputs), len(structure.inputs)))
        for matrix, row, column, expression in structure.entries:
            if not matrix.endswith("delays"):
                continue
            place: tuple[object, object] = (row, column)
            if matrix == "input_delays":
                place = (slice(None), column)
            elif matrix == "output_delays":
                place = (row + column, slice(None))
            for name, derivative in expression.evaluate(known)[1].items():
                if name in names:
                    slope[names.index(name), *place] += derivative
        self.index = np.flatnonzero(np.any(slope != 0.0, axis=(1, 2)))
        self.grids = [delay_grid(points.frequency, *structure.free[k].limits) for k in self.index]
        step = STEP / float(np.max(points.frequency))
        self.apart = np.array([min(step, 0.5 * np.ptp(grid)) for grid in self.grids])
        # rad by which a second of each delay turns each point
        at = points.frequency[points.position]
        self._turn = at * slope[self.index][:, points.output, points.input]

    def differ(self, one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
        """Return whether two vectors of delays, each (n_delay,) s, are a step apart."""
        return bool(np.any(np.abs(one - other) >= 0.99 * self.apart))

    def turned(self, waits: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return by what longer delays, (n_some, n_delay) s, multiply points, (n_some, n_point)."""
        return np.exp(-1j * (waits @ self._turn))


def starting_points(cost: Cost, count: int, seed: int) -> Iterator[Start]:
    """Yield `count` starts, the most likely one first."""
    random = np.random.default_rng(seed)
    low, high = np.array([parameter.limits for parameter in cost.structure.free]).T
    gains = _gains(cost.structure)
    waits = Waits(cost)
    form = rational_form(cost.structure)
    direct = [] if form is None else _rational_starts(cost, form, waits)
    yield from direct[:count]
    taken: list[NDArray[np.float64]] = []
    for number in range(count - len(direct)):
        own = (np.array([parameter.start for parameter in cost.structure.free]),)
        scattered = (_scatter(cost.structure, random) for _ in range(_HANDFUL if number else 0))
        candidates = [
            _solve(cost, np.clip(x, low, high), gains, waits, taken)
            for x in (scattered if number else own)
        ]
        best = min(candidates, key=lambda x: float(np.sum(cost.relative(x) ** 2)))
        taken.append(best)
        yield Start(np.clip(best, low, high), best[waits.index])


def _rational_starts(cost: Cost, form: Coefficients | Factors, waits: Waits) -> list[Start]:
    """Return starts from the rational fits of the only response, the best first.

    First come the different fits that are nearly as good as the best, then those that ended there
    from another delay.
    """
    points, structure = cost.points, cost.structure
    parameter = None if form.delay is None else structure.parameter(form.delay)
    fixed = parameter is None or parameter.fixed
    frequency = points.frequency[points.position]
    fits = rational_fits(
        frequency,
        points.measured * (1j * frequency) ** form.power,
        cost.certainty,
        zeros=form.zeros,
        poles=form.poles,
        delays=np.array([0.0 if parameter is None else parameter.start])
        if parameter is None or parameter.fixed
        else delay_grid(points.frequency, *parameter.limits),
        fixed=fixed,
    )
    low, high = np.array([parameter.limits for parameter in structure.free]).T
    first: list[Start] = []
    again: list[Start] = []
    resolution = STEP / float(np.max(points.frequency))
    ends: list[tuple[float, float]] = []
    for k in np.argsort(fits.errors, kind="stable"):
        end = (float(fits.errors[k]), float(fits.delays[k]))
        if end[0] > _NEARLY * fits.errors.min():
            break
        values = form.values(fits.numerators[k], fits.denominators[k])
        if form.delay is not None:
            values[form.delay] = end[1]
        x = np.array([values[parameter.name] for parameter in structure.free])
        begun = np.zeros(0) if fixed else fits.begun[k : k + 1]
        known = any(
            np.isclose(end[0], error, rtol=1e-3) and abs(end[1] - delay) <= 0.1 * resolution
            for error, delay in ends
        )
        ends.append(end)
        (again if known else first).append(Start(np.clip(x, low, high), begun))
    return [*first[:_VALLEYS], *again[:_VALLEYS]]


def _solve(
    cost: Cost,
    x: NDArray[np.float64],
    gains: NDArray[np.intp],
    waits: Waits,
    taken: Sequence[NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return x with the delays and gains that fit the measured response best, all else given.

    Delays within a step of those of an earlier start are left out.
    """
    if waits.index.size:
        x = _scan(cost, x, gains, waits, taken)
    return _solve_gains(cost, x, gains)


def _scan(
    cost: Cost,
    x: NDArray[np.float64],
    gains: NDArray[np.intp],
    waits: Waits,
    taken: Sequence[NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return x with the best delays: all alike first, then one at a time.

    A delay turns the response that is known at x, so no other response is evaluated.
    """
    z, slope = cost.ratio(x)
    if not (np.all(np.isfinite(z)) and np.all(np.isfinite(slope))):
        return x
    root = np.sqrt(cost.certainty)
    table = np.concatenate([slope[gains], z[None, :], -np.ones((1, z.size))]) * root
    here = x[waits.index]

    def misfits(candidates: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the relative error at each vector of delays, gains solved, (n_candidate,)."""
        turn = waits.turned(candidates - here)[:, None, :]
        rows = np.concatenate(
            [
                table[None, :-1] * turn,
                np.broadcast_to(table[None, -1:], (len(candidates), 1, z.size)),
            ],
            axis=1,
        )
        # relative error g s + z - 1 where z - 1 is the right-hand side
        rows = np.concatenate([rows[:, :-2], rows[:, -2:-1] + rows[:, -1:]], axis=1)
        real = np.concatenate([rows.real, rows.imag], axis=2).transpose(0, 2, 1)
        return np.abs(np.asarray(np.linalg.qr(real, mode="r"))[:, -1, -1])

    def free(candidates: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.array(
            [all(waits.differ(c, earlier[waits.index]) for earlier in taken) for c in candidates]
        )

    grids = waits.grids
    longest = max(grids, key=len)
    limits = np.array([(grid[0], grid[-1]) for grid in grids])
    candidates = np.clip(np.repeat(longest[:, None], len(grids), axis=1), *limits.T)
    if (allowed := free(candidates)).any():
        candidates = candidates[allowed]
    best = candidates[np.argmin(misfits(candidates))]
    for k, grid in [*enumerate(grids)] * 2 if len(grids) > 1 else []:
        candidates = np.repeat(best[None, :], grid.size, axis=0)
        candidates[:, k] = grid
        if (allowed := free(candidates)).any():
            candidates = candidates[allowed]
            best = candidates[np.argmin(misfits(candidates))]
    found = x.copy()
    found[waits.index] = best
    return found


def _scatter(structure: Structure, random: np.random.Generator) -> NDArray[np.float64]:
    own = np.array([parameter.start for parameter in structure.free])
    size = np.array([parameter.magnitude for parameter in structure.free])
    factor = np.exp(_SPREAD * random.standard_normal(own.size))
    shift = size * random.standard_normal(own.size)
    return np.where(own != 0.0, own * factor, shift)


def _gains(structure: Structure) -> NDArray[np.intp]:
    """Return which free parameters act linearly: they stand in G, D and D1 only.

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
    found = [
        k
        for k, parameter in enumerate(structure.free)
        if parameter.name in within and parameter.name not in elsewhere
    ]
    return np.array(found, dtype=np.intp)


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


def _solve_gains(
    cost: Cost, x: NDArray[np.float64], gains: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return x with the gains that fit the measured response best, all else given."""
    if gains.size == 0:
        return x
    residual, jacobian = cost.relative(x), cost.relative_jacobian(x)[:, gains]
    if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(jacobian))):
        return x
    solved = x.copy()
    solved[gains] -= np.linalg.lstsq(jacobian, residual, rcond=1e-9)[0]
    return solved
