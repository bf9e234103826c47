"""Fits a structure to frequency responses, as NAVFIT and DERIVID do."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Literal

import numpy as np

from helisim.base.arrays import Real
from helisim.base.note import Note
from helisim.base.settings import Limits, convert
from helisim.ident.bounds import Accuracy, accuracy
from helisim.ident.cost import Band, Cost, select
from helisim.ident.diagnosis import degenerate, residual
from helisim.ident.fitted import FittedParameter
from helisim.ident.response import FrequencyResponse
from helisim.ident.result import Fit
from helisim.ident.search import Minimum, refine, search
from helisim.ident.structure import Structure
from helisim.records.record import one_blas_thread, plain

_AT_BOUND = 1e-6  # fraction of the interval within which a parameter is at its bound
_SHIFT = 0.02  # of a parameter that a lag may move it by without a word
_OF_LOWER_ORDER = 3  # starts of a transfer function of lower order
Weighting = Literal["error", "coherence"]


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
        frf: best pooled from all records; used where the coherence is at least 0.6.
        structure: of the model.
        band: lowest and highest frequency, rad/s, for all responses or by response ("p/lat").
        responses: such as ("p/lat", "q/lon"); default all.
        frequencies_per_response: log-spaced points.
        searches: most starts; fewer when two find the same minimum.
        seed: of the scattered starts.
        weighting: "error" weighs points by their random errors; "coherence" minimises J as CIFER
            does. J, Cramér-Rao bounds and insensitivities are CIFER's either way.
        on_progress: called with the structure's name after each search.

    Raises UnknownNameError; IdentificationError if no response is coherent enough.
    """
    for name, count, low in (
        ("frequencies_per_response", frequencies_per_response, 5),
        ("searches", searches, 1),
        ("seed", seed, 0),
    ):
        convert(int, count, name, Limits(low=low))
    convert(Weighting, weighting, "weighting")
    points = select(frf, structure, band=band, responses=responses, count=frequencies_per_response)
    cost = Cost(structure, points)
    standardised = weighting == "error" and cost.noisy

    def fitted(of: Cost, starts: int) -> tuple[Minimum, int]:
        best, agreeing = search(of, starts, seed, on_progress or (lambda _: None))
        return (refine(of, best) if standardised and of.structure.free else best), agreeing

    best, agreeing = fitted(cost, searches)
    quality = accuracy(cost, best.x, standardised=standardised)
    advice, collapsed, lower = degenerate(
        cost,
        best,
        quality.cramer_rao,
        lambda of, end: float(np.sum(of.standardised(end.x) ** 2)) if standardised else end.cost,
        lambda of: fitted(of, min(searches, _OF_LOWER_ORDER))[0],
    )
    options = {
        "band_rad_s": dict(band) if isinstance(band, Mapping) else band,
        "responses": responses,
        "frequencies_per_response": frequencies_per_response,
        "searches": searches,
        "seed": seed,
        "weighting": weighting,
    }
    return Fit(
        structure=structure,
        parameters=fitted_parameters(structure, best.x, quality, collapsed),
        correlation=quality.correlation,
        covariance=quality.covariance,
        carried=quality.carried,
        residual=residual(cost, best.x, quality.noise, quality.ratio),
        costs=dict(zip(points.pairs, cost.per_response(best.x).tolist())),
        bands=dict(zip(points.pairs, points.bands)),
        dropped=points.dropped,
        converged=best.converged,
        searches_agreeing=agreeing,
        degenerate=advice,
        lower=lower,
        omitted=tuple(
            Note(
                "lag",
                f"a lag of {1e3 * lag:.2g} ms on {name}, which the structure lacks, explains the "
                f"data better, by {errors:.2g} of its errors, and moves parameters by up to "
                f"{100.0 * shift:.2g} %: a servo or a filter; put it in series, or give it as "
                "known",
            )
            for name, lag, errors, shift in quality.omitted
            if shift > _SHIFT
        ),
        data=frf,
        options=plain(options),
    )


def fitted_parameters(
    structure: Structure, x: Real, quality: Accuracy, collapsed: Collection[str] = ()
) -> dict[str, FittedParameter]:
    """Return all parameters by name for the free ones x, (n_free,); `collapsed` are degenerate."""
    parameters = {
        one.name: FittedParameter(one, one.start, 0.0, 0.0, one.error, at_bound=False)
        for one in structure.parameters
    }
    for k, one in enumerate(structure.free):
        value, (low, high) = float(x[k]), one.limits
        edge = _AT_BOUND * (high - low) if math.isfinite(high - low) else 1e-12
        parameters[one.name] = FittedParameter(
            one,
            value,
            float(quality.cramer_rao[k]),
            float(quality.insensitivity[k]),
            float(quality.standard_error[k]),
            min(value - low, high - value) <= edge,
            one.name in collapsed,
            float(quality.structural[k]),
        )
    return parameters
