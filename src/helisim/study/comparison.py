"""Identified parameters beside truth and paper, with support by the data and agreement apart."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from helisim import ident
from helisim.base.errors import named
from helisim.base.settings import check, setting
from helisim.design.exact import Air
from helisim.ident.fitted import Support
from helisim.records.record import FlightRecord
from helisim.sim import Recorder
from helisim.sim.rigs import RigTest
from helisim.study.models import ModelSpec
from helisim.study.paper import published_of
from helisim.study.truth import true_values
from helisim.vehicle import Vehicle

Agreement = Literal["agrees", "differs", "not judged"]  # not judged without a tolerance

Truth = Literal["truth", "equivalent"]  # equivalent: fitted to the exact response

GroundTests = Mapping[str, RigTest]  # by rig

Flights = Mapping[str, Sequence[FlightRecord]]  # by axis


@dataclass(frozen=True, kw_only=True)
class ParameterRow:
    """One identified parameter beside its truth and the paper's value; None where there is none.

    All values and the standard error, of `identified` or else of the given value, are in `unit`.
    Bound (`cr_percent`) and insensitivity are in percent of `identified`. Tolerances are the
    largest accepted distances from `truth` and `paper`, in percent of those; without one of both
    nothing is judged.
    """

    derived: ClassVar = ("truth_agreement", "paper_agreement")
    name: str
    unit: str
    paper: float | None = None
    truth: float | None = None
    identified: float
    cr_percent: float | None = setting(None, finite=False)
    insensitivity_percent: float | None = setting(None, finite=False)
    standard_error: float | None = setting(None, finite=False)
    support: Support | None = None
    tolerance_percent: float | None = setting(None, above=0.0)
    tolerance_reason: str = ""
    paper_tolerance_percent: float | None = setting(None, above=0.0)
    paper_tolerance_reason: str = ""

    def __post_init__(self) -> None:
        check(self, self.name)

    @property
    def value(self) -> float:
        """`identified`, as of a ground test's finding."""
        return self.identified

    @property
    def error_percent(self) -> float | None:
        """`identified` less `truth`, percent of `truth`."""
        return _deviation_percent(self.identified, self.truth)

    @property
    def paper_error_percent(self) -> float | None:
        """`identified` less `paper`, percent of `paper`."""
        return _deviation_percent(self.identified, self.paper)

    @property
    def truth_agreement(self) -> Agreement:
        """Agreement with the truth."""
        return _agreement(self.error_percent, self.tolerance_percent)

    @property
    def paper_agreement(self) -> Agreement:
        """Agreement with the paper's value."""
        return _agreement(self.paper_error_percent, self.paper_tolerance_percent)

    @property
    def agreement(self) -> Agreement:
        """Agreement with each reference that it is judged by."""
        both = {self.truth_agreement, self.paper_agreement}
        if "differs" in both:
            return "differs"
        return "agrees" if "agrees" in both else "not judged"

    def misses(self, truth: Truth = "truth") -> tuple[str, ...]:
        """Return a sentence for each missed tolerance, with amount and reason."""
        judged = (
            (truth, self.truth, self.error_percent, "tolerance"),
            ("paper", self.paper, self.paper_error_percent, "paper_tolerance"),
        )
        return tuple(
            f"{self.name} is {self.identified:.5g} {self.unit}, {abs(error):.3g} % from the "
            f"{what}'s {target:.5g}; the tolerance is {tolerance:.3g} % "
            f"({getattr(self, f'{kind}_reason')})"
            for what, target, error, kind in judged
            if error is not None
            and (tolerance := getattr(self, f"{kind}_percent")) is not None
            and _agreement(error, tolerance) == "differs"
        )


@dataclass(frozen=True, kw_only=True)
class GivenValue:
    """A value that a fit was given, in SI, from a table or ground test."""

    name: str
    unit: str
    value: float
    source: str
    standard_error: float | None = setting(None, finite=False)


@dataclass(frozen=True, kw_only=True)
class ComparisonTable:
    """The parameters of one identified model from IN1 or IN2.

    `cost` is the average J of the fit in its band, lowest and highest frequency, rad/s.
    """

    name: str
    input: str
    cost: float = setting(low=0.0)
    band_rad_s: tuple[float, float] = setting(above=0.0)
    truth: Truth = "truth"
    parameters: tuple[ParameterRow, ...]
    given: tuple[GivenValue, ...] = ()

    def __post_init__(self) -> None:
        check(self, self.name)

    def __getitem__(self, name: str) -> ParameterRow:
        """Return the row of a parameter. Raises UnknownNameError."""
        return named(self.parameters, name, f"parameter of {self.name}")

    @property
    def misses(self) -> tuple[str, ...]:
        """A sentence for each missed tolerance."""
        return tuple(
            f"{self.name}: {miss}" for row in self.parameters for miss in row.misses(self.truth)
        )

    @property
    def identified(self) -> dict[str, float]:
        """Identified values by parameter, SI."""
        return {row.name: row.identified for row in self.parameters}


def _deviation_percent(value: float, target: float | None) -> float | None:
    if target is None:
        return None
    if target == 0.0:
        return 0.0 if value == 0.0 else math.copysign(math.inf, value)
    return 100.0 * (value - target) / abs(target)


def _agreement(error: float | None, tolerance: float | None) -> Agreement:
    if error is None or tolerance is None:
        return "not judged"
    return "differs" if abs(error) > tolerance else "agrees"


def frequency_response(model: ModelSpec, flights: Flights) -> ident.FrequencyResponse:
    """Return a model's frequency response from the pooled records of its sweeps.

    The band begins no lower than what few flights resolve (window <= T_F / 5).
    """
    records = [record for axis in model.sweeps for record in flights[axis]]
    longest_window = min(
        0.5 * min(record.duration for record in records),
        0.2 * sum(record.duration for record in records),
    )
    return ident.frequency_response(
        records,
        inputs=model.inputs,
        outputs=model.outputs,
        conditioning=model.conditioning or None,
        reference=model.reference or None,
        estimator=model.estimator,
        band=(max(model.band[0], 1.01 * 2.0 * np.pi / longest_window), model.band[1]),
    )


def identify_model(
    model: ModelSpec,
    flights: Flights,
    *,
    before: Mapping[str, ComparisonTable] | None = None,
    ground: GroundTests | None = None,
    estimated: ident.FrequencyResponse | None = None,
) -> ident.Fit:
    """Identify a model from records by axis, given values of tables by name and tests by rig."""
    sources: dict[str, RigTest | ComparisonTable] = {**(before or {}), **(ground or {})}
    given = {name: sources[one.source][one.name] for name, one in model.given.items()}
    known = model.structure.with_fixed(
        {name: one.value for name, one in given.items()},
        {name: one.standard_error or 0.0 for name, one in given.items()},  # none is stated
    )
    if estimated is None:
        estimated = frequency_response(model, flights)
    return ident.identify(estimated, known, weighting=model.weighting)


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
    """Return an identified model's parameters beside the truth and the paper.

    The truth is the mean over `air` if given; given values are listed apart.
    """
    truth = true_values(vehicle, model, recorder, like=fit.data, air=air)
    tests = ground or {}
    sources = {one.name: "assumed" for one in model.structure.parameters if one.fixed}
    sources |= {name: one.source for name, one in model.given.items()}
    given = [
        GivenValue(
            name=name,
            unit=fit[name].unit,
            value=fit[name].value,
            source=source,
            standard_error=fit[name].standard_error or None,
        )
        for name, source in sources.items()
    ]
    found = [(one, tests[one.source][one.name]) for one in model.behind if one.source in tests]
    behind = [
        GivenValue(
            name=one.name,
            unit=test.unit,
            value=test.value,
            source=f"{one.source}, {test.how}",
            standard_error=test.standard_error,
        )
        for one, test in found
    ]
    return ComparisonTable(
        name=model.name,
        input=model.input,
        cost=fit.cost,
        band_rad_s=fit.band,
        truth="equivalent" if model.truth_kind == "equivalent" else "truth",
        parameters=tuple(
            _row(vehicle, fit, name, truth.get(name), model, judge_paper)
            for name in fit.values
            if name in model.tolerances or not fit.structure.parameter(name).fixed
        ),
        given=(*given, *behind),
    )


def _row(
    vehicle: Vehicle,
    fit: ident.Fit,
    name: str,
    truth: float | None,
    model: ModelSpec,
    judge_paper: bool,
) -> ParameterRow:
    fitted, given = fit[name], name in model.given
    printed = published_of(vehicle).get(model.name).get(name)
    tolerance, bound = model.tolerances.get(name), None
    if tolerance is not None and judge_paper and printed is not None:
        bound = model.paper_tolerance(name, printed.cr_percent)
    return ParameterRow(
        name=name,
        unit=fitted.unit or (printed.unit if printed else ""),
        paper=None if printed is None else printed.value,
        truth=truth,
        identified=fitted.value,
        cr_percent=None if given else _stated(fitted.cr_percent),
        insensitivity_percent=None if given else _stated(fitted.insensitivity_percent),
        standard_error=_stated(fitted.standard_error),
        support=fitted.support,
        tolerance_percent=tolerance and tolerance.percent,
        tolerance_reason=tolerance.reason if tolerance else "",
        paper_tolerance_percent=bound and bound.percent,
        paper_tolerance_reason=bound.reason if bound else "",
    )


def _stated(size: float | None) -> float | None:
    return None if size is None or math.isnan(size) else size
