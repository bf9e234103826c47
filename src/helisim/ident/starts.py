"""Chooses where the searches begin: scattered starts, with the input gains solved from the data."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from helisim.ident.cost import Cost
from helisim.ident.structure import Structure

_SPREAD = 0.7
"""Standard deviation of the starts' natural logarithm: a factor of 2 either way."""

_HANDFUL = 8
"""Scattered starts of which the best one is searched from: each costs as much as one step."""


def starting_points(cost: Cost, count: int, seed: int) -> Iterator[NDArray[np.float64]]:
    """Yield `count` vectors of free parameters, (n_free,), the structure's own start first.

    Each further one is the best of a handful of scattered ones.
    """
    random = np.random.default_rng(seed)
    low, high = np.array([parameter.limits for parameter in cost.structure.free]).T
    gains = _gains(cost.structure)
    for number in range(count):
        scattered = (_scatter(cost.structure, random) for _ in range(_HANDFUL if number else 0))
        own = (np.array([parameter.start for parameter in cost.structure.free]),)
        candidates = [
            np.clip(_solve_gains(cost, np.clip(x, low, high), gains), low, high)
            for x in (scattered if number else own)
        ]
        yield min(candidates, key=lambda x: float(np.sum(cost.relative(x) ** 2)))


def _scatter(structure: Structure, random: np.random.Generator) -> NDArray[np.float64]:
    own = np.array([parameter.start for parameter in structure.free])
    size = np.array([parameter.magnitude for parameter in structure.free])
    factor = np.exp(_SPREAD * random.standard_normal(own.size))
    shift = size * random.standard_normal(own.size)
    return np.where(own != 0.0, own * factor, shift)


def _gains(structure: Structure) -> NDArray[np.intp]:
    """Return which free parameters stand in G, D and D1 only, where they act linearly."""
    elsewhere: set[str] = set()
    within: set[str] = set()
    for entry in structure.entries:
        names = entry.expression.names
        (within if entry.matrix in ("G", "D", "D1") else elsewhere).update(names)
    found = [
        k
        for k, parameter in enumerate(structure.free)
        if parameter.name in within and parameter.name not in elsewhere
    ]
    return np.array(found, dtype=np.intp)


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
