"""An identified model by its numbers: each parameter beside its truth and the paper's value.

Two verdicts stand beside a value, of which neither follows from the other. Support is what the
data say of it; agreement is how far it is from a named reference.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Literal

import numpy as np

from helisim import ident
from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import check, setting
from helisim.design.exact import Air
from helisim.ident.fitted import Support
from helisim.records.record import FlightRecord
from helisim.sim import Recorder
from helisim.sim.rigs import RigTest
from helisim.study.models import Given, ModelSpec
from helisim.study.paper import paper_table
from helisim.study.truth import true_values
from helisim.vehicle import Vehicle

Agreement = Literal["agrees", "differs", "not judged"]
"""Whether a value is within its tolerance of a reference; "not judged" where it has none."""

Truth = Literal["truth", "equivalent"]
"""Which truth a table's values are compared with, see `TRUTHS`."""

TRUTHS: Mapping[Truth, str] = MappingProxyType(
    {
        "truth": "the exact linearisation of the model that flew",
        "equivalent": "this structure fitted to the exact response of the model that flew, which "
        "has more states: what flights without noise would give",
    }
)

GroundTests = Mapping[str, RigTest]
"""By rig."""

Flights = Mapping[str, Sequence[FlightRecord]]
"""Records by axis."""


@dataclass(frozen=True, kw_only=True)
class ParameterRow:
    """One identified parameter beside its truth and the paper's number.

    Attributes:
        name: the parameter's name, as in the paper.
        unit: of `paper`, `truth` and `identified`.
        paper: the published value; None where there is none.
        truth: what the table's truth has; None where there is none.
        identified: estimated from the records alone.
        cr_percent: Cramér-Rao bound of `identified`; None where it was not estimated.
        insensitivity_percent: insensitivity of `identified`; None where it was not estimated.
        standard_error: of `identified`, or of what was given; None in results that have none.
        support: what the data say of it; None in results that did not say it.
        tolerance_percent: the largest accepted distance from `truth`, percent of `truth`;
            None reports the parameter without judging it.
        tolerance_reason: why that tolerance.
        paper_tolerance_percent: the same for `paper`; None reports without judging, as it
            must where the truth is not the paper's.
        paper_tolerance_reason: why that tolerance.
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
        for what, against in (("tolerance", "truth"), ("paper_tolerance", "paper")):
            if getattr(self, f"{what}_percent") is None:
                continue
            if getattr(self, against) is None:
                raise InputError(f"{self.name}: {what}_percent needs a value of {against}")
            if not getattr(self, f"{what}_reason"):
                raise InputError(f"{self.name}: {what}_percent needs its reason")

    @property
    def error_percent(self) -> float | None:
        """Distance of `identified` from `truth`, percent of `truth`, with sign."""
        return _deviation_percent(self.identified, self.truth)

    @property
    def paper_error_percent(self) -> float | None:
        """Distance of `identified` from `paper`, percent of `paper`, with sign."""
        return _deviation_percent(self.identified, self.paper)

    @property
    def truth_agreement(self) -> Agreement:
        """Whether it is within its tolerance of the truth."""
        return _agreement(self.error_percent, self.tolerance_percent)

    @property
    def paper_agreement(self) -> Agreement:
        """Whether it is within its tolerance of the paper's value."""
        return _agreement(self.paper_error_percent, self.paper_tolerance_percent)

    @property
    def agreement(self) -> Agreement:
        """Whether it agrees with each reference that it is judged by."""
        both = {self.truth_agreement, self.paper_agreement}
        if "differs" in both:
            return "differs"
        return "agrees" if "agrees" in both else "not judged"

    def misses(self, truth: Truth = "truth") -> tuple[str, ...]:
        """Return a sentence for each tolerance that is missed, with the amount and the reason."""
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
    """A value that a fit was given.

    Attributes:
        name: of the parameter.
        unit: SI.
        value: in `unit`.
        source: the table or the ground test that it comes from.
        standard_error: of `value`, in `unit`; None where none is known.
    """

    name: str
    unit: str
    value: float
    source: str
    standard_error: float | None = None


@dataclass(frozen=True, kw_only=True)
class ComparisonTable:
    """The parameters of one identified model.

    Attributes:
        name: of the model, as in the reference tables.
        input: the signals that drive it: "IN1" or "IN2".
        cost: average cost of the fit, J.
        band_rad_s: lowest and highest frequency of the fit, rad/s.
        truth: which truth the parameters' are.
        parameters: one row a parameter.
        given: what the fit was given.
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
        low, high = (float(edge) for edge in self.band_rad_s)
        if not low < high:
            raise InputError(f"{self.name}: the band must rise, got {low} to {high}")
        object.__setattr__(self, "band_rad_s", (low, high))

    def __getitem__(self, name: str) -> ParameterRow:
        """Return the row of a parameter. Raises UnknownNameError."""
        for row in self.parameters:
            if row.name == name:
                return row
        names = [row.name for row in self.parameters]
        raise UnknownNameError(f"parameter of {self.name}", name, names)

    @property
    def misses(self) -> tuple[str, ...]:
        """One sentence for each tolerance that is missed; empty when all hold."""
        return tuple(
            f"{self.name}: {miss}" for row in self.parameters for miss in row.misses(self.truth)
        )

    @property
    def truth_meaning(self) -> str:
        """What the truth of its parameters is."""
        return TRUTHS[self.truth]

    @property
    def identified(self) -> dict[str, float]:
        """Parameter -> identified value, SI."""
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
    """Return the frequency response of one model from the pooled records of its sweeps.

    The band's lower edge is raised to what few flights can resolve (window <= T_F / 5).
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
    """Identify one model from the records.

    Args:
        model: to identify.
        flights: records by axis.
        before: tables by name, whose identified values the model is given.
        ground: tests by rig, whose findings the model is given.
        estimated: the model's `frequency_response` of these flights; estimated here if None.
    """
    values, errors = {}, {}
    for name, source in model.given.items():
        if source.source in (ground or {}):
            found = (ground or {})[source.source][source.name]
            values[name] = found.value
        else:
            found = (before or {})[source.source][source.name]
            values[name] = found.identified
        errors[name] = found.standard_error or 0.0  # none is stated
    known = model.structure.with_fixed(values, errors)
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
    """Set an identified model beside the truth and the paper.

    What the fit was given is listed apart, with what is behind it in the ground tests, and judged
    where the model has a tolerance for it. The truth is the mean over `air`, if there is any.
    """
    truth = true_values(vehicle, model, recorder, like=fit.data, air=air)
    tests = ground or {}
    given = [
        GivenValue(
            name=name,
            unit=fit[name].unit,
            value=fit[name].value,
            source=one.source,
            standard_error=fit[name].standard_error or None,
        )
        for name, one in model.given.items()
    ]
    behind = [_behind(one, tests) for one in model.behind if one.source in tests]
    return ComparisonTable(
        name=model.name,
        input=model.input,
        cost=fit.cost,
        band_rad_s=fit.band,
        truth="equivalent" if model.truth_kind == "equivalent" else "truth",
        parameters=tuple(
            _row(vehicle, fit, name, truth.get(name), model, judge_paper)
            for name in fit.values
            if name not in model.given or name in model.tolerances
        ),
        given=(*given, *behind),
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
    vehicle: Vehicle,
    fit: ident.Fit,
    name: str,
    truth: float | None,
    model: ModelSpec,
    judge_paper: bool,
) -> ParameterRow:
    fitted, given = fit[name], name in model.given
    printed = paper_table(vehicle, model.name).get(name)
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
    """Return a size, None where it isn't a number."""
    return None if size is None or math.isnan(size) else size
