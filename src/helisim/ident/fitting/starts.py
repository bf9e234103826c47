"""Chooses where the searches begin: what the data say first, then scattered starts.

A search finds a minimum only from a delay that turns the phase less than about half a turn too
far, so delays are scanned: of a transfer function with the rational fit of the data at each delay,
of any other structure with the gains solved from the data at each.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.ident.fitting.approach import approach
from helisim.ident.fitting.cost import Cost
from helisim.ident.fitting.rational import STEP, delay_grid, rational_fits
from helisim.ident.fitting.waits import Waits
from helisim.ident.model.factored import Factors, rational_form
from helisim.ident.model.structure import Structure
from helisim.ident.model.transfer import Coefficients

_SPREAD = 0.7
"""Standard deviation of the starts' natural logarithm: a factor of 2 either way."""

_HANDFUL = 8
"""Scattered starts of which the best one is searched from: each costs as much as one step."""

_CROWD = 16
"""Scattered starts that race each other, from the third start on."""

_LAP = 6
"""Steps of a race after which the slower half drops out."""

_FLIPPED = 0.2
"""Share of the unbounded parameters that a race tries with the other sign."""

_BESIDE = 4
"""Steps of the delays by which a minimum is looked past: two radians at the top of the band."""

_VALLEYS = 4
"""Different rational fits that are searched from."""

_NEARLY = 1.5
"""Rational fits whose error is so many times the best one's are searched from too."""


class Start(NamedTuple):
    """Where a search begins.

    Attributes:
        x: (n_free,) the free parameters.
        delays: (n_delay,) s, from which x was found.
        chosen: from so many others that it needs no further one beside it: by a race, or from the
            rational fits of all delays.
    """

    x: NDArray[np.float64]
    delays: NDArray[np.float64]
    chosen: bool = False


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

    def solved(x: NDArray[np.float64]) -> Start:
        x = _solved(cost, np.clip(x, low, high), gains, waits, taken[-1:])
        return Start(np.clip(x, low, high), x[waits.index])

    own = np.array([parameter.start for parameter in cost.structure.free])
    for number in range(count - len(direct)):
        if number == 0:
            best = solved(own)
        elif number == 1:
            crowd = [solved(_scatter(cost.structure, random, 0.0)) for _ in range(_HANDFUL)]
            best = min(crowd, key=lambda start: _distance(cost, start))
        else:
            crowd = [solved(_scatter(cost.structure, random, _FLIPPED)) for _ in range(_CROWD)]
            best = _leader(cost, crowd)
        taken.append(best.delays)
        yield best


def beside(cost: Cost, x: NDArray[np.float64]) -> list[Start]:
    """Return starts on either side of a minimum x, (n_free,): all delays moved, gains solved.

    A wrong delay often has a wrong sign or a zero on the wrong side with it, which hold it there.
    """
    waits, gains = Waits(cost), _gains(cost.structure)
    low, high = np.array([parameter.limits for parameter in cost.structure.free]).T
    found = []
    for steps in (-_BESIDE, _BESIDE) if waits.index.size else ():
        moved = x.copy()
        moved[waits.index] += steps * waits.apart
        moved = _solve_gains(cost, np.clip(moved, low, high), gains)
        moved = np.clip(moved, low, high)
        found.append(Start(moved, moved[waits.index]))
    return found


def _leader(cost: Cost, crowd: list[Start]) -> Start:
    """Return the one that leads after a race in which the slower half drops out at each lap."""
    while len(crowd) > 1:
        crowd = [Start(approach(cost, one.x, _LAP), one.delays) for one in crowd]
        crowd = sorted(crowd, key=lambda start: _distance(cost, start))[: len(crowd) // 2]
    return crowd[0]._replace(chosen=True)


def _distance(cost: Cost, start: Start) -> float:
    return float(np.sum(cost.relative(start.x) ** 2))


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
        known=_known(structure, form),
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
        (again if known else first).append(Start(np.clip(x, low, high), begun, chosen=True))
    return [*first[:_VALLEYS], *again[:_VALLEYS]]


def _known(structure: Structure, form: Coefficients | Factors) -> NDArray[np.float64] | None:
    """Return the coefficients of a transfer function that are given, nan for the others."""
    if isinstance(form, Factors):
        return None
    sought = {parameter.name for parameter in structure.free}
    return np.array(
        [
            np.nan if name in sought else structure.parameter(name).start
            for name in (*form.numerator, *form.denominator)
        ]
    )


def _solved(
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
        x = waits.scan(cost, x, gains, taken)
    return _solve_gains(cost, x, gains)


def _scatter(
    structure: Structure, random: np.random.Generator, flipped: float
) -> NDArray[np.float64]:
    """Return scattered parameters, a share of them of the other sign."""
    own = np.array([parameter.start for parameter in structure.free])
    size = np.array([parameter.magnitude for parameter in structure.free])
    factor = np.exp(_SPREAD * random.standard_normal(own.size))
    shift = size * random.standard_normal(own.size)
    free = np.array([parameter.bounds is None for parameter in structure.free])
    sign = np.where(free & (random.random(own.size) < flipped), -1.0, 1.0)
    return np.where(own != 0.0, own * factor * sign, shift)


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
