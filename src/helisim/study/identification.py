"""Identify the models of the experiment from its flights, and set them beside truth and paper."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from helisim import ident
from helisim.records.record import FlightRecord
from helisim.sim import Recorder
from helisim.sim.rigs import RigTest
from helisim.study.comparison import ComparisonTable, GivenValue, ParameterRow
from helisim.study.identified import IdentifiedModel
from helisim.study.models import Given, ModelSpec
from helisim.study.paper import ReferenceTable
from helisim.study.published import paper_table
from helisim.study.truth import Air, exact_response, true_values
from helisim.vehicle import Vehicle

GroundTests = Mapping[str, RigTest]
"""By rig."""

Flights = Mapping[str, Sequence[FlightRecord]]
"""Records by axis."""


def frequency_response(model: ModelSpec, flights: Flights) -> ident.FrequencyResponse:
    """Return the frequency response of one model from the pooled records of its sweeps."""
    records = [record for axis in model.sweeps for record in flights[axis]]
    return ident.frequency_response(
        records,
        inputs=model.inputs,
        outputs=model.outputs,
        conditioning=model.conditioning or None,
        reference=model.reference or None,
        estimator=model.estimator,
        band=_usable_band(model.band, records),
    )


def _usable_band(band: tuple[float, float], records: list[FlightRecord]) -> tuple[float, float]:
    """Raise the lower edge to what few flights can resolve (window <= T_F / 5)."""
    longest_window = min(
        0.5 * min(record.duration for record in records),
        0.2 * sum(record.duration for record in records),
    )
    return max(band[0], 1.01 * 2.0 * np.pi / longest_window), band[1]


def identify_model(
    model: ModelSpec,
    flights: Flights,
    *,
    before: Mapping[str, ComparisonTable] | None = None,
    ground: GroundTests | None = None,
    estimated: ident.FrequencyResponse | None = None,
) -> ident.Fit:
    """Identify one model from the records.

    Args:
        model: to identify.
        flights: records by axis.
        before: tables by name, whose identified values the model is given.
        ground: tests by rig, whose findings the model is given.
        estimated: the model's `frequency_response` of these flights; estimated here if None.
    """
    given = {
        name: _given(source, before or {}, ground or {}) for name, source in model.given.items()
    }
    known = model.structure.with_fixed(
        {name: value for name, (value, _) in given.items()},
        {name: error for name, (_, error) in given.items()},
    )
    if estimated is None:
        estimated = frequency_response(model, flights)
    return ident.identify(estimated, known, weighting=model.weighting)


def _given(
    source: Given, before: Mapping[str, ComparisonTable], ground: GroundTests
) -> tuple[float, float]:
    """Return a value and its standard error, 0 where none is stated."""
    if source.source in ground:
        finding = ground[source.source][source.name]
        return finding.value, finding.standard_error or 0.0
    row = before[source.source][source.name]
    return row.identified, row.standard_error or 0.0


def comparison_table(
    vehicle: Vehicle,
    model: ModelSpec,
    fit: ident.Fit,
    recorder: Recorder,
    *,
    judge_paper: bool = True,
    air: Air | None = None,
    ground: GroundTests | None = None,
) -> ComparisonTable:
    """Set an identified model beside the truth and the paper.

    What the fit was given is listed apart, with what is behind it in the ground tests, and judged
    where the model has a tolerance for it. The truth is the mean over `air`, if there is any.
    """
    truth = true_values(vehicle, model, recorder, like=fit.data, air=air)
    paper = paper_table(vehicle, model.name)
    found = [name for name in fit.values if name not in model.given or name in model.tolerances]
    return ComparisonTable(
        name=model.name,
        input=model.input,
        cost=fit.cost,
        band_rad_s=fit.band,
        truth="equivalent" if model.truth_kind == "equivalent" else "truth",
        parameters=tuple(_row(fit, name, truth, paper, model, judge_paper) for name in found),
        given=(
            *(_given_value(fit[name], one.source) for name, one in model.given.items()),
            *(_behind(one, ground or {}) for one in model.behind if one.source in (ground or {})),
        ),
    )


def _given_value(fitted: ident.FittedParameter, source: str) -> GivenValue:
    return GivenValue(
        name=fitted.name,
        unit=fitted.unit,
        value=fitted.value,
        source=source,
        standard_error=fitted.standard_error or None,
    )


def _behind(one: Given, ground: GroundTests) -> GivenValue:
    found = ground[one.source][one.name]
    return GivenValue(
        name=one.name,
        unit=found.unit,
        value=found.value,
        source=f"{one.source}, {found.how}",
        standard_error=found.standard_error,
    )


def _row(
    fit: ident.Fit,
    name: str,
    truth: Mapping[str, float],
    paper: ReferenceTable,
    model: ModelSpec,
    judge_paper: bool,
) -> ParameterRow:
    fitted = fit[name]
    printed = paper.get(name)
    tolerance = model.tolerances.get(name)
    limits: dict[str, Any] = {}
    if tolerance is not None:
        limits |= {
            "tolerance_percent": tolerance.percent,
            "tolerance_reason": tolerance.reason,
        }
        if judge_paper and printed is not None:
            bound = model.paper_tolerance(name, printed.cr_percent)
            limits |= {
                "paper_tolerance_percent": bound.percent,
                "paper_tolerance_reason": bound.reason,
            }
    given = name in model.given
    return ParameterRow(
        name=name,
        unit=fitted.unit or (printed.unit if printed else ""),
        identified=fitted.value,
        truth=truth.get(name),
        paper=None if printed is None else printed.value,
        cr_percent=None if given else fitted.cr_percent,
        insensitivity_percent=None if given else fitted.insensitivity_percent,
        standard_error=fitted.standard_error,
        support=fitted.support,
        **limits,
    )


def identified_model(
    vehicle: Vehicle,
    model: ModelSpec,
    fit: ident.Fit,
    recorder: Recorder,
    doublets: Mapping[str, FlightRecord],
) -> IdentifiedModel:
    """Return a model with the exact response and the verification that it is judged by."""
    unseen = {axis: doublets[axis] for axis in model.verified_by}
    return IdentifiedModel(
        model.name,
        fit,
        exact=exact_response(vehicle, model, recorder, np.geomspace(*model.band, 200)),
        note=model.note,
        verification=ident.verify(fit, list(unseen.values())) if unseen else None,
        verified_on=tuple(f"{axis}_doublet" for axis in unseen),
    )
