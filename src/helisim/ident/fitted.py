"""One fitted parameter: its value, its accuracy, and what supports it; tables of such.

Support is no agreement. A poorly supported value can agree with a reference by luck, and a well
supported one can differ from it because the structure lacks something; how a value agrees with a
reference is said by whoever has one, in words of its own.
"""

import json
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

from helisim.base.errors import InputError
from helisim.base.settings import Value, convert
from helisim.ident.structure import Parameter, Structure

CRAMER_RAO_LIMIT = 20.0
"""Percent of the value above which a Cramér-Rao bound says "poor" (Tischler and Remple).

It holds a factor of 2, so two standard errors are held to it as well: they can be the larger, of
an estimate whose noise is more than the cost supposes.
"""
INSENSITIVITY_LIMIT = 10.0
"""Percent of the value above which an insensitivity says "poor" (Tischler and Remple)."""
_UNSURE_DIGITS, _MOST_DIGITS = 4, 7
"""Significant digits of a value whose error is unknown, and whose error is negligible."""

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
)
"""Word -> what it says of a parameter."""


def meanings() -> str:
    """Return what each word of support says, a line each."""
    return "\n".join(f"{word}: {meaning}" for word, meaning in SUPPORT.items())


@dataclass(frozen=True, eq=False)
class FittedParameter(Value):
    """One parameter's value and accuracy, in its unit.

    Attributes:
        definition: name, unit, start, bounds and meaning.
        value: what the fit found, or the fixed value.
        cramer_rao: CR, the spread to expect, with Tischler and Remple's factor 2.
        insensitivity: I, how far the value can move with little effect on the cost.
        standard_error: standard deviation to expect of the value: what noise, estimator and the
            errors of known parameters make of it; the given error of a fixed parameter.
        at_bound: the fit ended at a bound, so the value is the bound's, not the data's.
        degenerate: the model around it collapsed, so its accuracy says nothing.
    """

    definition: Parameter
    value: float
    cramer_rao: float
    insensitivity: float
    standard_error: float
    at_bound: bool
    degenerate: bool = False

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
        half = 1.96 * self.standard_error
        return (self.value - half, self.value + half)

    @property
    def bound(self) -> float:
        """How far from the truth the value can be: CR, or 3 standard errors where they are more."""
        return max(self.cramer_rao, 3.0 * self.standard_error)

    @property
    def cr_percent(self) -> float:
        """The Cramér-Rao bound in percent of the value."""
        return self._percent(self.cramer_rao)

    @property
    def insensitivity_percent(self) -> float:
        """The insensitivity in percent of the value."""
        return self._percent(self.insensitivity)

    def _percent(self, part: float) -> float:
        if part == 0.0:
            return 0.0
        return 100.0 * part / abs(self.value) if self.value else math.inf

    @property
    def _spread(self) -> float:
        """What support is judged by: CR is twice a deviation too, of noise as J supposes it."""
        return max(self.cramer_rao, 2.0 * self.standard_error)

    @property
    def poorly_identified(self) -> bool:
        """Whether CR or 2 standard errors exceed 20 %, or the insensitivity 10 %, of the value."""
        return not self.fixed and (
            self.degenerate
            or self._percent(self._spread) > CRAMER_RAO_LIMIT
            or self.insensitivity_percent > INSENSITIVITY_LIMIT
        )

    @property
    def support(self) -> Support:
        """What the data say of it, in a word; `SUPPORT` has the meanings."""
        if self.fixed:
            return "fixed"
        if not math.isfinite(self.insensitivity):
            return "not seen"
        if self.degenerate or not math.isfinite(self._spread):
            return "degenerate"
        if self.at_bound:
            return "at bound"
        size = abs(self.value)
        good = 100.0 * self._spread <= CRAMER_RAO_LIMIT * size
        return (
            "good" if good and 100.0 * self.insensitivity <= INSENSITIVITY_LIMIT * size else "poor"
        )

    @classmethod
    def from_dict(cls, structure: Structure, data: Mapping[str, Any]) -> "FittedParameter":
        """Read what `to_dict` wrote. Raises InputError."""
        given = convert(Mapping[str, Any], data, "parameter")
        definition = structure.parameter(convert(str, given.get("name"), "parameter's name"))
        place = f"parameter {definition.name!r}"
        hints = {"value": float, "at_bound": bool, "degenerate": bool}
        hints |= dict.fromkeys(("cramer_rao", "insensitivity", "standard_error"), float | None)
        missing = [key for key in hints if key not in given]
        if missing:
            raise InputError(f"{place} lacks {' and '.join(missing)}")
        fields = {key: convert(hint, given[key], f"{place}.{key}") for key, hint in hints.items()}
        plain: dict[str, Any] = {k: math.inf if x is None else x for k, x in fields.items()}
        return cls(definition, **plain)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; what isn't finite becomes None."""
        numbers = ("cramer_rao", "insensitivity", "cr_percent", "insensitivity_percent")
        return {
            "name": self.name,
            "unit": self.unit,
            "value": self.value,
            **{key: finite(getattr(self, key)) for key in (*numbers, "standard_error")},
            "fixed": self.fixed,
            "at_bound": self.at_bound,
            "degenerate": self.degenerate,
            "poorly_identified": self.poorly_identified,
            "support": self.support,
        }


def finite(number: float) -> float | None:
    """Return a number for JSON: None where it isn't finite."""
    return float(number) if math.isfinite(number) else None


def text_table(parameters: Collection[FittedParameter], support: Callable[[str], str]) -> list[str]:
    """Return parameters with their accuracy as lines of text, headings first.

    Args:
        parameters: one a line.
        support: what the data say of a parameter, by its name.
    """
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


_LATEX_SPECIAL = {
    **{character: f"\\{character}" for character in "&%$#_{}"},
    **{"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"},
}
_GREEK = ("tau", "omega", "zeta", "alpha", "beta", "gamma", "delta", "theta", "phi", "psi")


def rounded(value: float, error: float) -> tuple[str, str]:
    """Return a value and its error as text, rounded by the Particle Data Group's rule.

    The error keeps two digits where its first three are 100 to 354, one from 355 to 949, and
    becomes 1.0 of the next decade above; the value ends at the same decimal. The error is empty
    where it is negligible.
    """
    if not math.isfinite(value):
        return str(value), ""
    if not math.isfinite(error):
        return f"{value:.{_UNSURE_DIGITS}g}", r"\infty"
    if error <= abs(value) * 10.0**-_MOST_DIGITS:
        return f"{value:.{_MOST_DIGITS}g}", ""
    decade = math.floor(math.log10(error))
    first = round(error / 10.0 ** (decade - 2))
    if first >= 1000:
        decade, first = decade + 1, 100
    if first >= 950:
        decade, digits, error = decade + 1, 2, 10.0 ** (decade + 1)
    else:
        digits = 2 if first < 355 else 1
    decimals = digits - 1 - decade
    if decimals >= 0:
        return f"{value:.{decimals}f}", f"{error:.{decimals}f}"
    return f"{round(value, decimals):.0f}", f"{round(error, decimals):.0f}"


def latex_table(
    parameters: Collection[FittedParameter],
    *,
    cost: float,
    provenance: Mapping[str, Any],
    caption: str = "",
    label: str = "",
) -> str:
    """Return parameters as a LaTeX `table`, values rounded by their standard errors.

    It needs the package booktabs. The errors are standard errors; CR and
    insensitivity are in percent of the value.

    Args:
        parameters: one a row.
        cost: average cost of the fit, the last row.
        provenance: plain data, a comment above the table.
        caption: of the table; none if empty.
        label: of the table; none if empty.
    """
    lines = [
        f"% {json.dumps(provenance)}",
        r"\begin{table}",
        r"\centering",
        *([rf"\caption{{{caption}}}"] if caption else []),
        *([rf"\label{{{label}}}"] if label else []),
        r"\begin{tabular}{llrrr}",
        r"\toprule",
        r"Parameter & Unit & Value & CR (\%) & $\bar{I}$ (\%) \\",
        r"\midrule",
        *map(_latex_row, parameters),
        r"\midrule",
        rf"\multicolumn{{5}}{{l}}{{Average cost $J_\mathrm{{ave}} = {cost:.1f}$}} \\",
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def _latex_row(one: FittedParameter) -> str:
    head, *tail = one.name.split("_")
    symbol = rf"\{head}" if head in _GREEK else head if len(head) == 1 else rf"\mathrm{{{head}}}"
    symbol += rf"_{{\mathrm{{{','.join(tail)}}}}}" if tail else ""
    unit = "".join(_LATEX_SPECIAL.get(character, character) for character in one.unit)
    for power in "23":
        unit = unit.replace(rf"\textasciicircum{{}}{power}", f"$^{power}$")
    if one.fixed:
        known = rf" \pm {one.standard_error:.2g}" if one.standard_error else ""
        return rf"${symbol}$ & {unit} & ${one.value:.6g}{known}$ & fixed & fixed \\"
    value, error = rounded(one.value, one.standard_error)
    number = rf"${value} \pm {error}$" if error else f"${value}$"
    mark = r"\,$^*$" if one.poorly_identified or one.at_bound else ""
    percent = " & ".join(
        f"{x:.1f}" if math.isfinite(x) else r"$\infty$"
        for x in (one.cr_percent, one.insensitivity_percent)
    )
    return rf"${symbol}${mark} & {unit} & {number} & {percent} \\"
