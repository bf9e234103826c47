"""The points of a campaign: every combination, a Latin hypercube, or independent draws."""

from collections.abc import Sequence
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from helisim.base.errors import InputError
from helisim.study.campaign.variation import Levels, Value, Variation

Design = Literal["grid", "latin hypercube", "monte carlo"]
"""How the points are chosen."""

Point = dict[str, Value]
"""Value by the key of its variation."""


def points(
    design: Design, variations: Sequence[Variation], count: int | None, seed: int
) -> list[Point]:
    """Return the points; without variations one, which is empty.

    Args:
        design: "grid" combines all levels; the others draw `count` points from the laws.
        variations: what varies.
        count: of points; None for a grid, which has its own.
        seed: of the draws.

    Raises:
        InputError: count and design don't agree, or a grid lacks levels.
    """
    keys = [variation.key for variation in variations]
    if design == "grid":
        return [dict(zip(keys, values)) for values in product(*_levels(variations, count))]
    if count is None or count < 1:
        raise InputError(f"the design {design!r} needs points = N, of 1 or more, got {count}")
    if not variations:
        raise InputError(f"the design {design!r} needs something that varies, see [vary]")
    shares = _shares(design, count, len(variations), seed)
    return [
        {one.key: one.law.at(float(share)) for one, share in zip(variations, row)} for row in shares
    ]


def _shares(design: Design, count: int, dimensions: int, seed: int) -> NDArray[np.float64]:
    """Return points of the unit cube, (count, dimensions), all strictly inside."""
    rng = np.random.default_rng(seed)
    if design == "latin hypercube":
        shares = qmc.LatinHypercube(dimensions, rng=rng).random(count)
    else:
        shares = rng.random((count, dimensions))
    return np.clip(shares, np.finfo(float).tiny, 1.0 - np.finfo(float).epsneg)


def _levels(variations: Sequence[Variation], count: int | None) -> list[tuple[Value, ...]]:
    if count is not None:
        raise InputError("a grid has as many points as combinations: leave out points")
    levels = []
    for variation in variations:
        if not isinstance(variation.law, Levels):
            raise InputError(
                f"a grid needs levels for {variation.key}: a list, or {{ low, high, count }}"
            )
        levels.append(variation.law.values)
    return levels
