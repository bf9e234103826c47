"""Fits a structure to frequency responses, as NAVFIT and DERIVID do.

Trial fits report likely causes of a failing one: units, signs, columns, delays.
"""

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, islice
from typing import Any, Literal

import numpy as np

from helisim.base.arrays import Real
from helisim.base.errors import HelisimError
from helisim.base.note import Note, Option
from helisim.base.settings import Limits, convert
from helisim.ident.bounds import Accuracy, accuracy
from helisim.ident.cost import Band, Cost, select
from helisim.ident.diagnosis import DEGREES, degenerate, residual
from helisim.ident.fitted import FittedParameter
from helisim.ident.response import FrequencyResponse
from helisim.ident.result import Fit
from helisim.ident.search import Minimum, refine, search
from helisim.ident.structure import Structure
from helisim.records.record import one_blas_thread, plain

_AT_BOUND = 1e-6  # fraction of the interval within which a parameter is at its bound
_SHIFT = 0.02  # of a parameter that a lag may move it by without a word
_OF_LOWER_ORDER = 3  # starts of a transfer function of lower order
_MORE_DELAY = (0.025, 0.05, 0.1, 0.2)  # s, of trial delays that are fixed, at a bound, or missing
_BETTER = 0.3  # greatest share of the cost that a trial may leave
_TOLD, _CLOSE = 3, 3.0  # Trials reported: most, and largest cost over the best one's
_TRIALS, _LARGEST, _SEARCHES = 24, 12, 3
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


def suspicions(fit: Fit) -> tuple[Note, ...]:
    """Return the likely causes of a failing fit, the clearest first; takes some seconds."""
    if fit.acceptable:
        return ()
    data, better = replace(fit.data, scatter=None, direct=None), []
    if len(fit.structure.free) <= _LARGEST:
        base = _cost(fit, data)
        for note, changed in islice(_trials(fit, data), _TRIALS):
            cost = _cost(fit, changed)
            if cost < _BETTER * base:
                text = f"{note.text}: J would be {cost:.3g}, not {base:.3g}"
                better.append((cost, replace(note, text=text)))
    better.sort(key=lambda pair: pair[0])
    tried = [one for cost, one in better[:_TOLD] if cost < _CLOSE * better[0][0] + 1.0]
    # wrong units, columns and delays show at an edge of the band, too
    return (*tried, *(one for one in fit.shapes if not tried or one.kind == "coherence"))


def _cost(fit: Fit, data: FrequencyResponse) -> float:
    try:
        return identify(
            data,
            fit.structure,
            band=fit.band,
            searches=_SEARCHES,
            weighting="coherence",
            responses=fit.options.get("responses"),
            frequencies_per_response=fit.options.get("frequencies_per_response", 20),
        ).cost
    except HelisimError:
        return math.inf


def _trials(fit: Fit, data: FrequencyResponse) -> Iterator[tuple[Note, FrequencyResponse]]:
    structure = fit.structure
    outputs = [(name, k) for k, name in enumerate(data.outputs) if name in structure.outputs]
    inputs = [(name, k) for k, name in enumerate(data.inputs) if name in structure.inputs]

    def scaled(axis: int, number: int, factor: Any) -> FrequencyResponse:
        response = data.response.copy()
        np.moveaxis(response, axis, 0)[number] *= factor
        return replace(data, response=response)

    def note(kind: str, text: str, *columns: str) -> Note:
        return Note(kind, text, tuple(Option("channel", one) for one in columns))

    for name, number in inputs:
        known = fit.parameters.get(structure.input_delays.get(name, ""))
        if known is not None and not known.fixed and not known.at_bound:
            continue
        for delay in _MORE_DELAY:
            text = f"with a delay of {name} longer by about {delay:g} s"
            if known is None:
                said = Note("delay", f"{text}; the structure has none there: give it one")
            else:
                said = Note(
                    "delay", text, (Option("fix", f"{known.name}={known.value + delay:.3g}"),)
                )
            yield said, scaled(1, number, np.exp(1j * data.frequency * delay))
    for axis, signals in enumerate((outputs, inputs)):
        for (one, a), (other, b) in combinations(signals, 2):
            order = np.arange(data.response.shape[axis])
            order[[a, b]] = b, a
            taken = {
                field: np.take(getattr(data, field), order, axis=axis)
                for field in ("response", "coherence", "random_error")
            }
            text = f"with the columns of {one} and {other} swapped"
            columns = f"{one}=COLUMN_OF_{other}", f"{other}=COLUMN_OF_{one}"
            yield note("columns", text, *columns), replace(data, **taken)
        for name, number in signals:
            text = f"with {name}'s sign the other way"
            yield note("sign", text, f"{name}=COLUMN:UNIT:sign=-1"), scaled(axis, number, -1.0)
    for name, number in outputs:
        unit = data.output_units[number]
        units = (unit, unit.replace("rad", "deg"))
        for factor, (said, was) in ((DEGREES, units), (1.0 / DEGREES, units[::-1])):
            if unit in ("rad", "rad/s"):
                text = f"with {name}'s column in {said}, not {was}"
                yield note("unit", text, f"{name}=COLUMN:{said}"), scaled(0, number, factor)
