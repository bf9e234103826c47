"""Fitted parameters: value, accuracy, and support by the data (not agreement with a truth)."""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

from helisim.base.settings import Value, convert, from_plain, setting
from helisim.ident.structure import Parameter, Structure

CRAMER_RAO_LIMIT = 20.0
"""Percent of the value above which a Cramér-Rao bound is poor (Tischler and Remple)."""
INSENSITIVITY_LIMIT = 10.0
"""Percent of the value above which an insensitivity is poor (Tischler and Remple)."""

Support = Literal["good", "poor", "not seen", "at bound", "degenerate", "fixed"]

SUPPORT: Mapping[Support, str] = MappingProxyType(
    {
        "good": (
            "the data fix it: its Cramér-Rao bound and two standard errors are at most "
            f"{CRAMER_RAO_LIMIT:g} % of the value, its insensitivity at most "
            f"{INSENSITIVITY_LIMIT:g} %"
        ),
        "poor": "the data see it, but not that well",
        "not seen": "the data do not change with it at all",
        "at bound": "the search ended at a limit that it was given: the value is the limit's",
        "degenerate": "the data see only a combination of it with others: it means nothing alone",
        "fixed": "it was given, not estimated",
    }
)  # Meaning of each word of support


def meanings() -> str:
    """Return the meanings of the words of support, a line each."""
    return "\n".join(f"{word}: {meaning}" for word, meaning in SUPPORT.items())


@dataclass(frozen=True, eq=False)
class FittedParameter(Value):
    """One parameter's value and accuracy, in its unit.

    `cramer_rao` has Tischler and Remple's factor 2; `insensitivity` is the change of the value with
    little effect on the cost; `standard_error` is from noise, estimator and known parameters'
    errors, and from what the structure leaves (`structural_error`). `at_bound`: the value is the
    bound's; `degenerate`: its accuracy is meaningless.
    """

    definition: Parameter
    value: float
    cramer_rao: float = setting(finite=False)
    insensitivity: float = setting(finite=False)
    standard_error: float = setting(finite=False)
    at_bound: bool = setting()
    degenerate: bool = False
    structural_error: float = 0.0

    @property
    def name(self) -> str:
        """Name."""
        return self.definition.name

    @property
    def unit(self) -> str:
        """Unit."""
        return self.definition.unit

    @property
    def fixed(self) -> bool:
        """Whether the parameter was fixed."""
        return self.definition.fixed

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval, 1.96 standard errors either way."""
        half = 1.96 * self.standard_error
        return (self.value - half, self.value + half)

    @property
    def cr_percent(self) -> float:
        """Cramér-Rao bound in percent of the value."""
        return self._percent(self.cramer_rao)

    @property
    def insensitivity_percent(self) -> float:
        """Insensitivity in percent of the value."""
        return self._percent(self.insensitivity)

    def _percent(self, part: float) -> float:
        if part == 0.0:
            return 0.0
        return 100.0 * part / abs(self.value) if self.value else math.inf

    @property
    def poorly_identified(self) -> bool:
        """Whether CR or 2 standard errors exceed 20 %, or the insensitivity 10 %, of the value."""
        return not self.fixed and (
            self.degenerate
            or self._percent(max(self.cramer_rao, 2.0 * self.standard_error)) > CRAMER_RAO_LIMIT
            or self.insensitivity_percent > INSENSITIVITY_LIMIT
        )

    @property
    def support(self) -> Support:
        """Support by the data, a word of `SUPPORT`."""
        if self.fixed:
            return "fixed"
        if not math.isfinite(self.insensitivity):
            return "not seen"
        if self.degenerate or not math.isfinite(self.cramer_rao + self.standard_error):
            return "degenerate"
        if self.at_bound:
            return "at bound"
        return "poor" if self.poorly_identified else "good"

    @classmethod
    def from_dict(cls, structure: Structure, data: Mapping[str, Any]) -> "FittedParameter":
        """Read what `to_dict` wrote. Raises InputError."""
        given = convert(Mapping[str, Any], data, "parameter")
        definition = structure.parameter(convert(str, given.get("name"), "parameter's name"))
        endless = ("cramer_rao", "insensitivity", "standard_error")
        numbers = {k: math.inf if x is None and k in endless else x for k, x in given.items()}
        place = f"parameter {definition.name!r}"
        return from_plain(cls, {**numbers, "definition": definition}, place, lenient=True)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; None for what isn't finite."""
        numbers = ("cramer_rao", "insensitivity", "cr_percent", "insensitivity_percent")
        return {
            "name": self.name,
            "unit": self.unit,
            "value": self.value,
            **{key: finite(getattr(self, key)) for key in (*numbers, "standard_error")},
            "structural_error": finite(self.structural_error),
            "fixed": self.fixed,
            "at_bound": self.at_bound,
            "degenerate": self.degenerate,
            "poorly_identified": self.poorly_identified,
            "support": self.support,
        }


def finite(number: float) -> float | None:
    """Return a number for JSON: None if it isn't finite."""
    return float(number) if math.isfinite(number) else None


def text_table(parameters: Collection[FittedParameter], support: Callable[[str], str]) -> list[str]:
    """Return parameters as lines of a table; `support` words each one's, by name."""
    width = max(9, *(len(one.name) for one in parameters), 0)
    units = max(4, *(len(one.unit) for one in parameters), 0)
    lines = [
        f"{'parameter':<{width}}  {'unit':<{units}}  {'value':>12}  {'CR %':>7}  "
        f"{'insens. %':>9}  {'std. error':>10}  support"
    ]
    for one in parameters:
        known = f"{one.standard_error:.3g}" if one.standard_error else "-"
        accuracy = f"{'-':>7}  {'-':>9}  {known:>10}"
        if not one.fixed:
            accuracy = f"{one.cr_percent:7.2f}  {one.insensitivity_percent:9.2f}  "
            accuracy += f"{one.standard_error:10.3g}"
        lines.append(
            f"{one.name:<{width}}  {one.unit:<{units}}  {one.value:12.6g}  {accuracy}  "
            f"{support(one.name)}"
        )
    return lines
