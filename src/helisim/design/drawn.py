"""Parameters drawn as a fit's covariance says that they err."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.ident.fitting.result import Fit


def draw(fits: Sequence[Fit], rng: np.random.Generator) -> tuple[Mapping[str, float], ...]:
    """Return every parameter of each fit, drawn once.

    A known parameter errs by its stated error, the same in all fits that were given the same
    value of it, and takes the free ones with it as each fit says.

    Args:
        fits: with covariances.
        rng: of the random numbers.

    Raises:
        InputError: a fit doesn't state its covariance, or the data don't see a parameter.
    """
    shared: dict[tuple[str, float], float] = {}
    return tuple(_drawn(fit, shared, rng) for fit in fits)


def _drawn(
    fit: Fit, shared: dict[tuple[str, float], float], rng: np.random.Generator
) -> dict[str, float]:
    free = [one.name for one in fit.structure.free]
    known = [one for one in fit.structure.parameters if one.error > 0.0]
    if fit.covariance is None or fit.carried is None:
        raise InputError(
            f"the fit {fit.structure.name!r} doesn't state its covariance: identify it again"
        )
    blind = [name for name, own in zip(free, np.diagonal(fit.covariance)) if not np.isfinite(own)]
    if blind:
        raise InputError(
            f"the data don't see {', '.join(blind)} of the fit {fit.structure.name!r}: fix it"
        )
    off = np.array(
        [shared.setdefault((one.name, one.start), rng.standard_normal()) for one in known]
    )
    own = fit.covariance - fit.carried @ fit.carried.T
    moved = fit.carried @ off + _root(own) @ rng.standard_normal(len(free))
    values = dict(fit.values)
    values |= {name: values[name] + float(by) for name, by in zip(free, moved)}
    return values | {one.name: one.start + one.error * x for one, x in zip(known, off)}


def _root(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return R with R R^T the covariance, rounding errors below zero apart."""
    scale = np.sqrt(np.maximum(np.diagonal(covariance), np.finfo(float).tiny))
    size, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    return scale[:, None] * axes * np.sqrt(np.maximum(size, 0.0))
