"""Fits a structure to frequency responses: NAVFIT and DERIVID in one."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, get_args

import numpy as np

from helisim.base.errors import InputError
from helisim.ident.fitting.bounds import Accuracy, accuracy
from helisim.ident.fitting.cost import Cost
from helisim.ident.fitting.degenerate import Degenerate, degenerate
from helisim.ident.fitting.fitted import FittedParameter
from helisim.ident.fitting.misfit import misfit
from helisim.ident.fitting.points import Band, select
from helisim.ident.fitting.result import Fit
from helisim.ident.fitting.search import Minimum, refine, search
from helisim.ident.model.structure import Structure
from helisim.ident.response import FrequencyResponse
from helisim.records.provenance import one_blas_thread, plain

_AT_BOUND = 1e-6
"""A parameter is at a bound when it is this fraction of the interval away from it."""

_OF_LOWER_ORDER = 3
"""Starts of a transfer function of lower order: those that its rational fits give."""

Weighting = Literal["error", "coherence"]
"""How the points of a fit are weighed."""


@one_blas_thread()
def identify(
    frf: FrequencyResponse,
    structure: Structure,
    *,
    band: Band | Mapping[str, Band] | None = None,
    responses: Sequence[str] | None = None,
    frequencies_per_response: int = 20,
    searches: int = 12,
    seed: int = 0,
    weighting: Weighting = "error",
    on_progress: Callable[[str], None] | None = None,
) -> Fit:
    """Fit a structure's free parameters to frequency responses.

    Args:
        frf: responses, best one estimate pooled from all records.
        structure: the model's structure.
        band: lowest and highest frequency, rad/s, for all responses or by response ("p/lat").
            Each response is used where its coherence is at least 0.6.
        responses: those to fit, such as ("p/lat", "q/lon"); all by default.
        frequencies_per_response: log-spaced points; the cost's scale does not depend on it.
        searches: how many starts are tried at most; fewer when two find the same minimum.
        seed: of the scattered starts. The same call gives the same numbers.
        weighting: "error" weighs each point by its own random error, known from the records:
            the parameters scatter less, by half or more where a gust blurs some frequencies.
            "coherence" is CIFER's: minimise J, whose weights are nearly equal at a coherence of
            0.9 and 0.999. A response without records, such as an exact one, is fitted by J.
            J, Cramér-Rao bounds and insensitivities are CIFER's either way.
        on_progress: called with the structure's name after each search.

    Raises:
        UnknownNameError: a signal or response does not exist.
        IdentificationError: no response is coherent enough.
    """
    if frequencies_per_response < 5 or searches < 1:
        raise InputError(
            f"{frequencies_per_response} frequencies a response and {searches} searches; "
            "expected at least 5 and 1"
        )
    if weighting not in get_args(Weighting):
        raise InputError(
            f"weighting is {weighting!r}, expected {' or '.join(map(repr, get_args(Weighting)))}"
        )
    points = select(frf, structure, band=band, responses=responses, count=frequencies_per_response)
    cost = Cost(structure, points)
    deviation = points.deviation
    standardised = weighting == "error" and deviation is not None and bool(np.any(deviation > 0.0))

    def fitted(of: Cost, starts: int) -> tuple[Minimum, int]:
        best, agreeing = search(of, starts, seed, on_progress or (lambda _: None))
        return (refine(of, best) if standardised and of.structure.free else best), agreeing

    best, agreeing = fitted(cost, searches)
    quality = accuracy(cost, best.x, standardised=standardised)
    collapsed = degenerate(
        cost,
        best,
        quality.cramer_rao,
        lambda of, end: float(np.sum(of.standardised(end.x) ** 2)) if standardised else end.cost,
        lambda of: fitted(of, min(searches, _OF_LOWER_ORDER))[0],
    )
    options = plain(
        {
            "band_rad_s": dict(band) if isinstance(band, Mapping) else band,
            "responses": responses,
            "frequencies_per_response": frequencies_per_response,
            "searches": searches,
            "seed": seed,
            "weighting": weighting,
        }
    )
    return _result(frf, cost, best, agreeing, quality, collapsed, options)


def _result(
    frf: FrequencyResponse,
    cost: Cost,
    best: Minimum,
    agreeing: int,
    quality: Accuracy,
    collapsed: Degenerate,
    options: Mapping[str, Any],
) -> Fit:
    structure, points = cost.structure, cost.points
    values = cost.values(best.x)
    free = [parameter.name for parameter in structure.free]
    fitted = []
    for parameter in structure.parameters:
        value = values[parameter.name]
        if parameter.fixed:
            fitted.append(FittedParameter(parameter, value, 0.0, 0.0, parameter.error, False))
            continue
        k = free.index(parameter.name)
        low, high = parameter.limits
        edge = _AT_BOUND * (high - low) if math.isfinite(high - low) else 1e-12
        fitted.append(
            FittedParameter(
                parameter,
                value,
                float(quality.cramer_rao[k]),
                float(quality.insensitivity[k]),
                float(quality.standard_error[k]),
                min(value - low, high - value) <= edge,
                parameter.name in collapsed.names,
            )
        )
    costs = cost.per_response(best.x)
    return Fit(
        structure=structure,
        parameters={one.name: one for one in fitted},
        correlation=quality.correlation,
        covariance=quality.covariance,
        carried=quality.carried,
        misfit=misfit(cost, best.x, quality.noise, quality.ratio),
        costs=dict(zip(points.pairs, costs.tolist())),
        bands=dict(zip(points.pairs, points.bands)),
        dropped=points.dropped,
        converged=best.converged,
        searches_agreeing=agreeing,
        degenerate=collapsed.advice,
        data=frf,
        options=options,
    )
