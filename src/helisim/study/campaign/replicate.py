"""One replicate: fly its sweeps, identify the models, set every parameter beside the truth."""

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

from helisim.errors import DivergedError, HelisimError
from helisim.ident import ClosedLoopWarning, CrossControlWarning, Fit
from helisim.records.channels import AXES, IN1
from helisim.records.record import FlightRecord
from helisim.sim import FlightPlan, Recorder, fly
from helisim.sim.rigs import RigTest, run_rigs
from helisim.study.campaign.plan import MODEL_NAMES, Campaign, Method, Replicate
from helisim.study.flights import Flights
from helisim.study.identification import GroundTests, comparison_table, identify_model
from helisim.study.models import ModelSpec
from helisim.study.results import ComparisonTable
from helisim.vehicle import Vehicle

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """One parameter of one model, identified once: a row of the dataset.

    Attributes:
        flights: on each axis that were used.
        flight_time: s, of all records that the model was identified from.
        model, method, parameter, unit: what was identified, and how.
        truth: of the vehicle that flew; None if it has none, or the flights failed.
        estimate, cramer_rao, insensitivity, standard_error: in `unit`; None if it failed.
        cost: average J of the fit.
        converged: the fit ended at a minimum.
        at_bound: this parameter ended at a bound.
        flags: what the identification warns of, such as coherent inputs; None if nothing.
        failure: why there is no estimate; None if there is one.
    """

    flights: int
    flight_time: float | None
    model: str
    method: str
    parameter: str
    unit: str
    truth: float | None = None
    estimate: float | None = None
    cramer_rao: float | None = None
    insensitivity: float | None = None
    standard_error: float | None = None
    cost: float | None = None
    converged: bool | None = None
    at_bound: bool | None = None
    flags: str | None = None
    failure: str | None = None


def fly_and_identify(campaign: Campaign, one: Replicate) -> list[Estimate]:
    """Return every estimate of a replicate, those that failed with the reason."""
    try:
        vehicle = one.settings.load()
        plans = {axis: one.settings.plan(axis, vehicle) for axis in campaign.axes}
        recorder = one.settings.recorder(vehicle)
        # the truth is of the hover in the steady wind
        steady = one.settings.weather().trimmed(vehicle)
    except HelisimError as error:
        return [row for item in _tasks(campaign) for row in _failed(*item, str(error))]
    flown = {axis: _flights(campaign, one, vehicle, plan) for axis, plan in plans.items()}
    ground = _ground_tests(campaign, one, vehicle, recorder)
    rows: list[Estimate] = []
    found: dict[tuple[int, Method], dict[str, ComparisonTable]] = {}
    for count, method, model in _tasks(campaign):
        before = found.setdefault((count, method), {})
        try:
            flights = {axis: _done(flown[axis])[:count] for axis in model.sweeps}
            estimated = by_method(model, method)
            tested = _done(ground) if _needs_ground(model) else {}
            fit = _identified(estimated, flights, before, tested)
            table = comparison_table(steady, estimated, fit, recorder)
        except HelisimError as error:
            rows += _failed(count, method, model, str(error))
            continue
        before[model.name] = table
        time = sum(record.duration for records in flights.values() for record in records)
        rows += _estimates(count, time, method, fit, table)
    return rows


def by_method(model: ModelSpec, method: Method) -> ModelSpec:
    """Return a model as it is identified by a method.

    The joint method takes the sticks as reference for what servo signals drive; where sticks
    are the inputs they are outside the loop already, and the model stays as it is.
    """
    if method == "direct":
        return replace(model, reference=())
    if method == "joint" and not model.reference and model.input == "IN1":
        signals = (*model.inputs, *model.conditioning)
        return replace(model, reference=tuple(name.upper() for name in signals if name in IN1))
    return model


def _identified(
    model: ModelSpec,
    flights: Flights,
    before: Mapping[str, ComparisonTable],
    ground: GroundTests,
) -> Fit:
    with warnings.catch_warnings():  # the fit keeps them as flags
        for kind in (ClosedLoopWarning, CrossControlWarning):
            warnings.simplefilter("ignore", kind)
        return identify_model(model, flights, before=before, ground=ground)


def _tasks(campaign: Campaign) -> Iterator[tuple[int, Method, ModelSpec]]:
    for count in campaign.identified_after:
        for method in campaign.methods:
            for model in campaign.chosen:
                yield count, method, model


def _flights(
    campaign: Campaign, one: Replicate, vehicle: Vehicle, plan: FlightPlan
) -> list[FlightRecord] | HelisimError:
    axis = plan.excitation.axis
    seed = one.seed * len(AXES) + AXES.index(axis)
    try:
        return fly(vehicle, plan, count=campaign.flights, seed=seed, jobs=1)
    except DivergedError as error:
        number = "" if error.record is None else f" {error.record.provenance['flight'] + 1}"
        return DivergedError(f"flight{number} of {axis}: {error}")
    except HelisimError as error:
        return error


def _ground_tests(
    campaign: Campaign, one: Replicate, vehicle: Vehicle, recorder: Recorder
) -> dict[str, RigTest] | HelisimError:
    """Return the tests by rig, none where no model is given what they find."""
    if not any(map(_needs_ground, campaign.chosen)):
        return {}
    try:
        return {test.rig: test for test in run_rigs(vehicle, seed=one.seed, recorder=recorder)}
    except HelisimError as error:
        return error


def _needs_ground(model: ModelSpec) -> bool:
    return any(given.source not in MODEL_NAMES for given in model.given.values())


def _done(work: T | HelisimError) -> T:
    """Return what work gave, or raise why it failed."""
    if isinstance(work, HelisimError):
        raise work
    return work


def _estimates(
    count: int, time: float, method: Method, fit: Fit, table: ComparisonTable
) -> list[Estimate]:
    return [
        Estimate(
            flights=count,
            flight_time=time,
            model=table.name,
            method=method,
            parameter=row.name,
            unit=row.unit,
            truth=row.truth,
            estimate=row.identified,
            cramer_rao=fit[row.name].cramer_rao,
            insensitivity=fit[row.name].insensitivity,
            standard_error=fit[row.name].standard_error,
            cost=fit.cost,
            converged=fit.converged,
            at_bound=fit[row.name].at_bound,
            flags="; ".join(fit.data.flags) or None,
        )
        for row in table.parameters
        if not fit[row.name].fixed
    ]


def _failed(count: int, method: Method, model: ModelSpec, reason: str) -> list[Estimate]:
    return [
        Estimate(
            flights=count,
            flight_time=None,
            model=model.name,
            method=method,
            parameter=parameter.name,
            unit=parameter.unit,
            failure=reason,
        )
        for parameter in model.structure.free
        if parameter.name not in model.given
    ]
