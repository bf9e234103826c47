"""An identified model by its numbers: each parameter beside its truth and the paper's value.

Two verdicts stand beside a value, of which neither follows from the other. Support is what the
data say of it (`verdicts`); agreement is how far it is from a named reference.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any, Literal

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import INFINITE
from helisim.ident.fitted import Support

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
"""Which truth -> what it is."""


@dataclass(frozen=True, kw_only=True)
class ParameterRow:
    """One identified parameter beside its truth and the paper's number.

    Attributes:
        name: the parameter's name, as in the paper.
        unit: of `paper`, `truth` and `identified`.
        identified: estimated from the records alone.
        truth: what the table's truth has; None where there is none.
        paper: the published value; None where there is none.
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

    name: str
    unit: str
    identified: float
    truth: float | None = None
    paper: float | None = None
    cr_percent: float | None = None
    insensitivity_percent: float | None = None
    standard_error: float | None = None
    support: Support | None = None
    tolerance_percent: float | None = None
    tolerance_reason: str = ""
    paper_tolerance_percent: float | None = None
    paper_tolerance_reason: str = ""

    def __post_init__(self) -> None:
        for what in ("identified", "truth", "paper"):
            value = getattr(self, what)
            if value is not None and not math.isfinite(value):
                raise InputError(f"{self.name}: {what} must be finite, got {value}")
        for what, against in (("tolerance", "truth"), ("paper_tolerance", "paper")):
            tolerance = getattr(self, f"{what}_percent")
            if tolerance is None:
                continue
            if getattr(self, against) is None:
                raise InputError(f"{self.name}: {what}_percent needs a value of {against}")
            if not tolerance > 0.0:
                raise InputError(f"{self.name}: {what}_percent must be positive, got {tolerance}")
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
        """Return a sentence for each tolerance that is missed, with the amount and the reason.

        Args:
            truth: which truth `truth` is.
        """
        against_truth = self._miss(
            truth, self.truth, self.error_percent, self.tolerance_percent, self.tolerance_reason
        )
        against_paper = self._miss(
            "paper",
            self.paper,
            self.paper_error_percent,
            self.paper_tolerance_percent,
            self.paper_tolerance_reason,
        )
        return tuple(miss for miss in (against_truth, against_paper) if miss)

    def _miss(
        self,
        what: str,
        target: float | None,
        error: float | None,
        tolerance: float | None,
        reason: str,
    ) -> str:
        if error is None or _agreement(error, tolerance) != "differs":
            return ""
        return (
            f"{self.name} is {self.identified:.5g} {self.unit}, {abs(error):.3g} % from the "
            f"{what}'s {target:.5g}; the tolerance is {tolerance:.3g} % ({reason})"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data; an infinite bound is "inf", an absent one None."""
        return {
            "name": self.name,
            "unit": self.unit,
            "paper": self.paper,
            "truth": self.truth,
            "identified": self.identified,
            "cr_percent": _json_number(self.cr_percent),
            "insensitivity_percent": _json_number(self.insensitivity_percent),
            "standard_error": _json_number(self.standard_error),
            "support": self.support,
            "tolerance_percent": self.tolerance_percent,
            "tolerance_reason": self.tolerance_reason,
            "paper_tolerance_percent": self.paper_tolerance_percent,
            "paper_tolerance_reason": self.paper_tolerance_reason,
            "truth_agreement": self.truth_agreement,
            "paper_agreement": self.paper_agreement,
        }


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
        parameters: one row a parameter.
        given: what the fit was given.
        truth: which truth the parameters' are.
    """

    name: str
    input: str
    cost: float
    band_rad_s: tuple[float, float]
    parameters: tuple[ParameterRow, ...]
    given: tuple[GivenValue, ...] = ()
    truth: Truth = "truth"

    def __post_init__(self) -> None:
        low, high = (float(edge) for edge in self.band_rad_s)
        if not (math.isfinite(self.cost) and self.cost >= 0.0):
            raise InputError(f"{self.name}: cost must be finite and not negative, got {self.cost}")
        if not 0.0 < low < high < math.inf:
            raise InputError(f"{self.name}: the band must rise from above 0, got {low} to {high}")
        object.__setattr__(self, "band_rad_s", (low, high))
        object.__setattr__(self, "parameters", tuple(self.parameters))

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

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {
            "name": self.name,
            "input": self.input,
            "cost": self.cost,
            "band_rad_s": list(self.band_rad_s),
            "truth": self.truth,
            "parameters": [row.to_dict() for row in self.parameters],
            "given": [asdict(one) for one in self.given],
        }


def _json_number(value: float | None) -> float | str | None:
    """Return a size as JSON can hold it; one that is not a number becomes None."""
    if value is None or math.isnan(value):
        return None
    return value if math.isfinite(value) else INFINITE


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
