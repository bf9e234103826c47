"""What a fit found: parameters by name with their accuracy, costs, verdicts and the model."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.errors import UnknownNameError
from helisim.ident.evaluate import matrices, response, state_space
from helisim.ident.frf import FrequencyResponse
from helisim.ident.structure import Parameter, Structure

CRAMER_RAO_LIMIT = 20.0
"""Percent of the value above which a Cramér-Rao bound says "poorly identified"."""

INSENSITIVITY_LIMIT = 10.0
"""Percent of the value above which an insensitivity says "poorly identified"."""

CORRELATION_LIMIT = 0.9
"""Two parameters correlated more than this can stand in for each other."""

ACCEPTABLE_COST = 100.0
EXCELLENT_COST = 50.0
ACCEPTABLE_SINGLE_COST = 200.0
"""Limits of the average cost and of a single response's (Tischler and Remple)."""


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


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted model.

    Attributes:
        structure: what was fitted.
        parameters: every parameter by name.
        correlation: (n_free, n_free) between the free parameters, in their order.
        costs: J of each response that was used.
        bands: lowest and highest frequency used of each response, rad/s.
        dropped: responses without enough coherent points.
        converged: the search ended at a minimum, not at its limit of steps.
        searches_agreeing: how many starts ended in this minimum; 1 says to look closer.
        data: the frequency response that was fitted.
    """

    structure: Structure
    parameters: Mapping[str, FittedParameter]
    correlation: NDArray[np.float64]
    costs: Mapping[str, float]
    bands: Mapping[str, tuple[float, float]]
    dropped: tuple[str, ...]
    converged: bool
    searches_agreeing: int
    data: FrequencyResponse

    def __post_init__(self) -> None:
        correlation = np.array(self.correlation, dtype=np.float64)
        correlation.flags.writeable = False
        object.__setattr__(self, "correlation", correlation)
        for name in ("parameters", "costs", "bands"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __getitem__(self, name: str) -> FittedParameter:
        """Return a parameter. Raises UnknownNameError."""
        try:
            return self.parameters[name]
        except KeyError:
            raise UnknownNameError("parameter", name, self.parameters) from None

    def __repr__(self) -> str:
        return f"Fit({self.structure.name}, average cost {self.cost:.4g})"

    def __str__(self) -> str:
        return _report(self)

    @property
    def values(self) -> dict[str, float]:
        """Every parameter's value by name."""
        return {name: parameter.value for name, parameter in self.parameters.items()}

    @property
    def cost(self) -> float:
        """The average of J over the responses."""
        return float(np.mean(list(self.costs.values())))

    @property
    def band(self) -> tuple[float, float]:
        """The lowest and highest frequency used in any response, rad/s."""
        edges = list(self.bands.values())
        return min(low for low, _ in edges), max(high for _, high in edges)

    @property
    def acceptable(self) -> bool:
        """Whether the average cost is at most 100 and each response's at most 200."""
        return self.cost <= ACCEPTABLE_COST and max(self.costs.values()) <= ACCEPTABLE_SINGLE_COST

    @property
    def excellent(self) -> bool:
        """Whether the average cost is at most 50."""
        return self.acceptable and self.cost <= EXCELLENT_COST

    @property
    def poorly_identified(self) -> tuple[str, ...]:
        """Parameters whose accuracy is beyond the guidelines; drop or fix the worst first."""
        return tuple(name for name, one in self.parameters.items() if one.poorly_identified)

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Parameters that ended at a bound: widen it, or question the structure."""
        return tuple(name for name, one in self.parameters.items() if one.at_bound)

    @property
    def ok(self) -> bool:
        """Whether the fit converged off every bound with acceptable costs, none poor."""
        return (
            self.converged and self.acceptable and not self.at_bound and not self.poorly_identified
        )

    @property
    def correlated(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters whose correlation exceeds 0.9 in size, with it."""
        names = [parameter.name for parameter in self.structure.free]
        return tuple(
            (names[i], names[j], float(self.correlation[i, j]))
            for i in range(len(names))
            for j in range(i + 1, len(names))
            if abs(self.correlation[i, j]) > CORRELATION_LIMIT
        )

    @cached_property
    def model(self) -> control.StateSpace:
        """The identified state space, named; its delays are in `delays`."""
        return state_space(self.structure, self.values)

    @property
    def delays(self) -> dict[str, float]:
        """The delay of every input and output, s; negative where the channel leads."""
        return {**self.input_delays, **self.output_delays}

    @property
    def input_delays(self) -> dict[str, float]:
        """The delay of every input, s."""
        numbers = matrices(self.structure, self.values)
        return dict(zip(self.structure.inputs, numbers.input_delays.tolist()))

    @property
    def output_delays(self) -> dict[str, float]:
        """The delay of every output, s."""
        numbers = matrices(self.structure, self.values)
        return dict(zip(self.structure.outputs, numbers.output_delays.tolist()))

    def response(self, frequency: ArrayLike) -> FrequencyResponse:
        """Return the model's frequency response, delays included, at frequencies in rad/s."""
        grid = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
        return FrequencyResponse.exact(
            grid,
            response(self.structure, self.values, grid),
            inputs=self.structure.inputs,
            outputs=self.structure.outputs,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; what isn't finite becomes None."""
        return {
            "structure": self.structure.to_dict(),
            "parameters": [
                {
                    "name": one.name,
                    "unit": one.unit,
                    "value": one.value,
                    "cr_percent": _finite(one.cr_percent),
                    "insensitivity_percent": _finite(one.insensitivity_percent),
                    "standard_error": _finite(one.standard_error),
                    "fixed": one.fixed,
                    "at_bound": one.at_bound,
                    "poorly_identified": one.poorly_identified,
                }
                for one in self.parameters.values()
            ],
            "correlation": self.correlation.tolist(),
            "cost": self.cost,
            "costs": dict(self.costs),
            "band_rad_s": list(self.band),
            "bands_rad_s": {name: list(edges) for name, edges in self.bands.items()},
            "dropped": list(self.dropped),
            "converged": self.converged,
            "acceptable": self.acceptable,
            "searches_agreeing": self.searches_agreeing,
            "method": "joint input-output" if self.data.reference else "direct",
            "windows_s": list(self.data.windows),
            "flags": list(self.data.flags),
        }


def _percent(part: float, whole: float) -> float:
    if part == 0.0:
        return 0.0
    return 100.0 * part / abs(whole) if whole != 0.0 else math.inf


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _report(fit: Fit) -> str:
    """Return the fit as a table, with everything a reader should know below it."""
    lines = [f"{fit.structure.name}: {fit.structure.meaning}".rstrip(": "), ""]
    width = max(9, *(len(name) for name in fit.parameters))
    units = max(4, *(len(one.unit) for one in fit.parameters.values()))
    lines.append(
        f"{'parameter':<{width}}  {'unit':<{units}}  {'value':>12}  {'CR %':>7}  "
        f"{'insens. %':>9}  {'std. error':>10}  verdict"
    )
    for one in fit.parameters.values():
        numbers = (
            f"{'-':>7}  {'-':>9}  {'-':>10}"
            if one.fixed
            else f"{one.cr_percent:7.2f}  {one.insensitivity_percent:9.2f}  "
            f"{one.standard_error:10.3g}"
        )
        lines.append(
            f"{one.name:<{width}}  {one.unit:<{units}}  {one.value:12.6g}  {numbers}  {one.verdict}"
        )
    lines.append("")
    for name, cost in fit.costs.items():
        low, high = fit.bands[name]
        lines.append(f"J {name} = {cost:.4g} from {low:.3g} to {high:.3g} rad/s")
    quality = "excellent" if fit.excellent else "acceptable" if fit.acceptable else "too high"
    lines.append(f"average J = {fit.cost:.4g}: {quality}")
    return "\n".join(lines + _remarks(fit))


def _remarks(fit: Fit) -> list[str]:
    remarks = []
    if not fit.converged:
        remarks.append("the search did not converge: give better starts, or fix a parameter")
    if fit.searches_agreeing < 2:
        remarks.append("only one start ended in this minimum: try more searches")
    if fit.dropped:
        remarks.append(f"left out for lack of coherence: {', '.join(fit.dropped)}")
    remarks.extend(f"{a} and {b} are correlated by {r:.3f}" for a, b, r in fit.correlated)
    return remarks + list(fit.data.flags)
