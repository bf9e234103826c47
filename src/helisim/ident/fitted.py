"""One fitted parameter: its value, its accuracy, and a verdict."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from helisim.ident.archive import number_in, number_out
from helisim.ident.structure import Parameter, Structure

CRAMER_RAO_LIMIT = 20.0
"""Percent of the value above which a Cramér-Rao bound says "poorly identified"."""

INSENSITIVITY_LIMIT = 10.0
"""Percent of the value above which an insensitivity says "poorly identified"."""


@dataclass(frozen=True, eq=False)
class FittedParameter:
    """One parameter's value and accuracy, in its unit.

    Attributes:
        definition: name, unit, start, bounds and meaning.
        value: what the fit found, or the fixed value.
        cramer_rao: CR, the spread to expect, with Tischler and Remple's factor 2.
        insensitivity: I, how far the value can move with little effect on the cost.
        standard_error: standard deviation estimated from the residuals.
        at_bound: the fit ended at a bound, so the value is the bound's, not the data's.
    """

    definition: Parameter
    value: float
    cramer_rao: float
    insensitivity: float
    standard_error: float
    at_bound: bool

    @property
    def name(self) -> str:
        """The parameter's name."""
        return self.definition.name

    @property
    def unit(self) -> str:
        """The parameter's unit."""
        return self.definition.unit

    @property
    def fixed(self) -> bool:
        """Whether the parameter was kept at a given value."""
        return self.definition.fixed

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval, 1.96 standard errors either way."""
        return (
            self.value - 1.96 * self.standard_error,
            self.value + 1.96 * self.standard_error,
        )

    @property
    def cr_percent(self) -> float:
        """The Cramér-Rao bound in percent of the value."""
        return _percent(self.cramer_rao, self.value)

    @property
    def insensitivity_percent(self) -> float:
        """The insensitivity in percent of the value."""
        return _percent(self.insensitivity, self.value)

    @property
    def poorly_identified(self) -> bool:
        """Whether CR exceeds 20 % or the insensitivity 10 % of the value."""
        return not self.fixed and (
            self.cr_percent > CRAMER_RAO_LIMIT or self.insensitivity_percent > INSENSITIVITY_LIMIT
        )

    @property
    def verdict(self) -> str:
        """One or two words about this parameter."""
        if self.fixed:
            return "fixed"
        if self.at_bound:
            return "at bound"
        return "poor" if self.poorly_identified else "good"


def parameter_to_dict(one: FittedParameter) -> dict[str, Any]:
    """Return a parameter as plain data for JSON; what isn't finite becomes None."""
    return {
        "name": one.name,
        "unit": one.unit,
        "value": one.value,
        "cramer_rao": number_out(one.cramer_rao),
        "insensitivity": number_out(one.insensitivity),
        "cr_percent": number_out(one.cr_percent),
        "insensitivity_percent": number_out(one.insensitivity_percent),
        "standard_error": number_out(one.standard_error),
        "fixed": one.fixed,
        "at_bound": one.at_bound,
        "poorly_identified": one.poorly_identified,
    }


def parameter_from_dict(structure: Structure, one: Mapping[str, Any]) -> FittedParameter:
    """Read what `parameter_to_dict` wrote. Raises KeyError, TypeError or InputError."""
    return FittedParameter(
        definition=structure.parameter(one["name"]),
        value=float(one["value"]),
        cramer_rao=number_in(one["cramer_rao"]),
        insensitivity=number_in(one["insensitivity"]),
        standard_error=number_in(one["standard_error"]),
        at_bound=bool(one["at_bound"]),
    )


def _percent(part: float, whole: float) -> float:
    if part == 0.0:
        return 0.0
    return 100.0 * part / abs(whole) if whole != 0.0 else math.inf
