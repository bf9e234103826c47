"""One replicate: fly its sweeps, identify the models, set every parameter beside the truth."""

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

from helisim.base.errors import DivergedError, HelisimError
from helisim.design.exact import air_met
from helisim.ident import ClosedLoopWarning, CrossControlWarning, Fit
from helisim.records.channels import AXES, IN1
from helisim.records.record import FlightRecord
from helisim.sim import FlightPlan, Recorder, fly
from helisim.sim.rigs import RigTest, run_rigs
from helisim.study.campaign.plan import MODEL_NAMES, Campaign, Method, Replicate
from helisim.study.comparison import ComparisonTable, GroundTests, comparison_table, identify_model
from helisim.study.experiment import Flights, servo_test
from helisim.study.models import SERVOS, ModelSpec
from helisim.vehicle import Vehicle

T = TypeVar("T")


class _Task(NamedTuple):
    """What is identified: a model, by a method, from the first flights of each axis."""

    flights: int
    method: Method
    model: ModelSpec


@dataclass(frozen=True, kw_only=True)
class ReplicateRow:
    """One parameter of one model as one replicate found it: a row of the dataset.

    Attributes:
        flights: on each axis that were used.
        flight_time: s, of all records that the model was identified from.
        model, method, parameter, unit: what was identified, and how.
        truth: of the vehicle that flew, in the air that it met; None if it has none, or the
            flights failed.
        estimate, cramer_rao, insensitivity, standard_error: in `unit`; None if it failed.
        cost: average J of the fit.
        converged: the fit ended at a minimum.
        at_bound: this parameter ended at a bound.
        flags: what the identification warns of, such as coherent inputs; None if nothing.
        failure: why there is no estimate; None if there is one.
    """

    flights: int
    flight_time: float | None = None
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


def fly_and_identify(campaign: Campaign, one: Replicate) -> list[ReplicateRow]:
    """Fly a replicate, identify its models, and return a row for each parameter.

    What failed has rows too, with the reason.
    """
    try:
        vehicle = one.settings.load()
        plans = {axis: one.settings.plan(axis, vehicle) for axis in campaign.axes}
        recorder = one.settings.recorder(vehicle)
        air = air_met(vehicle, one.settings.weather())  # the truth is of the hover in it
    except HelisimError as error:
        return [row for task in _tasks(campaign) for row in _failed(task, str(error))]
    flown = {axis: _flights(campaign, one, vehicle, plan) for axis, plan in plans.items()}
    ground = _ground_tests(campaign, one, vehicle, recorder)
    rows: list[ReplicateRow] = []
    found: dict[tuple[int, Method], dict[str, ComparisonTable]] = {}
    for task in _tasks(campaign):
        model = task.model
        before = found.setdefault((task.flights, task.method), {})
        try:
            flights = {axis: _done(flown[axis])[: task.flights] for axis in model.sweeps}
            estimated = by_method(model, task.method)
            tested = _done(ground) if _needs_ground(model) else {}
            fit = _identified(estimated, flights, before, tested)
            table = comparison_table(vehicle, estimated, fit, recorder, air=air, ground=tested)
        except HelisimError as error:
            rows += _failed(task, str(error))
            continue
        before[model.name] = table
        time = sum(record.duration for records in flights.values() for record in records)
        rows += _identified_rows(task, time, fit, table)
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


def _tasks(campaign: Campaign) -> Iterator[_Task]:
    for count in campaign.identified_after:
        for method in campaign.methods:
            for model in campaign.chosen:
                yield _Task(count, method, model)


def _flights(
    campaign: Campaign, one: Replicate, vehicle: Vehicle, plan: FlightPlan
) -> list[FlightRecord] | HelisimError:
    axis = plan.name
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
    sources = {given.source for model in campaign.chosen for given in model.given.values()}
    needed = sources.difference(MODEL_NAMES)
    tests: list[RigTest] = []
    try:
        if SERVOS in needed:
            tests.append(servo_test(vehicle, seed=one.seed, recorder=recorder))
        if needed.difference({SERVOS}):
            tests += run_rigs(vehicle, seed=one.seed, recorder=recorder)
        return {test.rig: test for test in tests}
    except HelisimError as error:
        return error


def _needs_ground(model: ModelSpec) -> bool:
    return any(given.source not in MODEL_NAMES for given in model.given.values())


def _done(work: T | HelisimError) -> T:
    """Return what work gave, or raise why it failed."""
    if isinstance(work, HelisimError):
        raise work
    return work


def _identified_rows(
    task: _Task, time: float, fit: Fit, table: ComparisonTable
) -> list[ReplicateRow]:
    return [
        replace(
            _row(task, row.name, row.unit),
            flight_time=time,
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


def _failed(task: _Task, reason: str) -> list[ReplicateRow]:
    return [
        replace(_row(task, parameter.name, parameter.unit), failure=reason)
        for parameter in task.model.structure.free
        if parameter.name not in task.model.given
    ]


def _row(task: _Task, parameter: str, unit: str) -> ReplicateRow:
    """Return the row of a parameter, of which nothing is found yet."""
    return ReplicateRow(
        flights=task.flights,
        model=task.model.name,
        method=task.method,
        parameter=parameter,
        unit=unit,
    )
