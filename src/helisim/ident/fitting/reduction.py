"""Reduces a structure to what the data support, one parameter at a time, and keeps the log.

The order is Tischler and Remple's: first the parameters to which the cost is insensitive, worst
first; then those whose Cramér-Rao bound is large, which other parameters can stand in for.
Each is set to zero and the rest fitted again. Where the cost then rises too much the parameter
is needed after all, however poorly it is known, and comes back.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from helisim.base.errors import InputError
from helisim.base.value import Value
from helisim.ident.fitting.fit import Weighting, identify
from helisim.ident.fitting.fitted import FittedParameter
from helisim.ident.fitting.points import Band
from helisim.ident.fitting.result import Fit
from helisim.ident.fitting.verdicts import CRAMER_RAO_LIMIT, INSENSITIVITY_LIMIT
from helisim.ident.model.evaluate import response
from helisim.ident.model.structure import Structure
from helisim.ident.model.structure_toml import DELAYS
from helisim.ident.response import FrequencyResponse

ACCEPTED_RISE = 1.0
"""Rise of the average cost up to which a reduced model counts as good as the full one: an
error of 0.2 dB everywhere costs as much."""

Reason = Literal["insensitivity", "Cramér-Rao bound"]


@dataclass(frozen=True)
class Step:
    """One attempt to do without a parameter.

    Attributes:
        parameter: its name.
        reason: which figure was beyond its guideline.
        percent: that figure, percent of the value.
        value: what the parameter was before.
        cost_before: average cost before.
        cost_after: average cost of the rest fitted without it.
        dropped: False where the cost rose too much, so that it was kept.
    """

    parameter: str
    reason: Reason
    percent: float
    value: float
    cost_before: float
    cost_after: float
    dropped: bool

    def __str__(self) -> str:
        verb = "dropped" if self.dropped else "kept"
        return (
            f"{verb} {self.parameter}: {self.reason} {self.percent:.3g} %, "
            f"J {self.cost_before:.4g} to {self.cost_after:.4g} without it"
        )


@dataclass(frozen=True, eq=False)
class Reduction(Value):
    """A structure reduced to what the data support.

    Attributes:
        full: the fit of the whole structure.
        fit: the fit of the reduced one; parameters that were dropped are fixed at zero in it.
        steps: every attempt in order.
        protected: parameters that were poor but not tried, such as delays.
        rise: of the average cost that was allowed.
    """

    full: Fit
    fit: Fit
    steps: tuple[Step, ...]
    protected: tuple[str, ...]
    rise: float

    @property
    def structure(self) -> Structure:
        """The reduced structure, starting at the fitted values."""
        return self.fit.structure

    @property
    def dropped(self) -> tuple[str, ...]:
        """The parameters that the data do not support, in the order they were dropped."""
        return tuple(step.parameter for step in self.steps if step.dropped)

    @property
    def kept(self) -> tuple[str, ...]:
        """Parameters that are poorly known and yet needed."""
        return tuple(step.parameter for step in self.steps if not step.dropped)

    def __repr__(self) -> str:
        lost = f"dropped {', '.join(self.dropped)}" if self.dropped else "nothing dropped"
        return f"Reduction({self.full.structure.name}: {lost}, average cost {self.fit.cost:.4g})"

    def __str__(self) -> str:
        count = len(self.full.structure.free)
        lines = [
            f"{self.full.structure.name}: {count} parameters to {count - len(self.dropped)}, "
            f"average J {self.full.cost:.4g} to {self.fit.cost:.4g}"
        ]
        lines += [f"{number}. {step}" for number, step in enumerate(self.steps, start=1)]
        if self.protected:
            lines.append(f"poor but not tried: {', '.join(self.protected)}")
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; a figure that isn't finite becomes None."""
        return {"full": self.full.to_dict(), "fit": self.fit.to_dict(), **self.log()}

    def log(self) -> dict[str, Any]:
        """Return what was tried, without the fits, as plain data."""
        return {
            "rise": self.rise,
            "full_cost": self.full.cost,
            "steps": [
                {
                    "parameter": step.parameter,
                    "reason": step.reason,
                    "percent": step.percent if math.isfinite(step.percent) else None,
                    "value": step.value,
                    "cost_before": step.cost_before,
                    "cost_after": step.cost_after,
                    "dropped": step.dropped,
                }
                for step in self.steps
            ],
            "dropped": list(self.dropped),
            "kept": list(self.kept),
            "protected": list(self.protected),
        }


def reduce(
    frf: FrequencyResponse,
    structure: Structure,
    *,
    keep: Sequence[str] = (),
    delays: bool = False,
    rise: float = ACCEPTED_RISE,
    band: Band | Mapping[str, Band] | None = None,
    responses: Sequence[str] | None = None,
    frequencies_per_response: int = 20,
    searches: int = 12,
    seed: int = 0,
    weighting: Weighting = "error",
    on_progress: Callable[[str], None] | None = None,
) -> Reduction:
    """Drop the parameters that the data do not support, one at a time.

    A parameter is never dropped where zero is outside its bounds or leaves the model
    undefined, such as a time constant in M.

    Args:
        frf: responses, as for `identify`.
        structure: the structure to reduce.
        keep: parameters that must stay.
        delays: whether delays may be dropped too.
        rise: by how much the average cost of the reduced model may exceed the full one's.
        band: as for `identify`.
        responses: as for `identify`.
        frequencies_per_response: as for `identify`.
        searches: as for `identify`, of the full and of the final structure.
        seed: as for `identify`.
        weighting: as for `identify`.
        on_progress: as for `identify`.

    Raises:
        UnknownNameError: a parameter, signal or response does not exist.
        InputError: `rise` is negative.
        IdentificationError: no response is coherent enough.
    """
    if isinstance(keep, str):
        keep = (keep,)
    for name in keep:
        structure.parameter(name)
    if not rise >= 0.0:
        raise InputError(f"rise is {rise}, expected at least 0")

    def fitted(of: Structure, count: int) -> Fit:
        return identify(
            frf,
            of,
            band=band,
            responses=responses,
            frequencies_per_response=frequencies_per_response,
            searches=count,
            seed=seed,
            weighting=weighting,
            on_progress=on_progress,
        )

    full = fitted(structure, searches)
    forbidden = set(keep) | _undroppable(full)
    if not delays:
        forbidden |= _delays(structure)
    now, steps, tried = full, [], set(forbidden)
    while (worst := _worst(now, tried)) is not None:
        one, reason, percent = worst
        tried.add(one.name)
        # The rest starts where it is, so one search finds its new minimum.
        without = fitted(_without(now, one.name), 1)
        dropped = without.cost <= full.cost + rise
        steps.append(Step(one.name, reason, percent, one.value, now.cost, without.cost, dropped))
        now = without if dropped else now
    poor = [one for one in now.poorly_identified if one in forbidden]
    if now is not full:
        now = min(fitted(now.structure, searches), now, key=lambda fit: fit.cost)
    return Reduction(full=full, fit=now, steps=tuple(steps), protected=tuple(poor), rise=rise)


def _worst(fit: Fit, tried: set[str]) -> tuple[FittedParameter, Reason, float] | None:
    """Return the parameter to try next, with the figure that says so."""
    open_ones = [one for one in fit.parameters.values() if not one.fixed and one.name not in tried]
    figures: tuple[tuple[Reason, float, Any], ...] = (
        ("insensitivity", INSENSITIVITY_LIMIT, lambda one: one.insensitivity_percent),
        ("Cramér-Rao bound", CRAMER_RAO_LIMIT, lambda one: one.cr_percent),
    )
    for reason, limit, percent in figures:
        poor = [one for one in open_ones if percent(one) > limit]
        if poor:
            worst = max(poor, key=percent)
            return worst, reason, percent(worst)
    return None


def _without(fit: Fit, name: str) -> Structure:
    """Return the structure with one parameter at zero and the others starting as fitted."""
    parameters = []
    for one in fit.structure.parameters:
        if one.name == name:
            parameters.append(replace(one, start=0.0, scale=one.magnitude, fixed=True))
        elif one.fixed:
            parameters.append(one)
        else:
            value = fit[one.name].value
            parameters.append(replace(one, start=value, scale=one.magnitude))
    return replace(fit.structure, parameters=tuple(parameters))


def _undroppable(fit: Fit) -> set[str]:
    """Return parameters that can't be zero: outside their bounds, or the model breaks."""
    grid = np.array(fit.band)
    found = {
        name
        for entry in fit.structure.entries
        if entry.matrix == "M" and entry.row == entry.column
        for name in entry.expression.names
    }
    for one in fit.structure.free:
        low, high = one.limits
        defined = np.isfinite(response(fit.structure, {**fit.values, one.name: 0.0}, grid))
        if not (low <= 0.0 <= high and np.all(defined)):
            found.add(one.name)
    return found


def _delays(structure: Structure) -> set[str]:
    return {
        name
        for entry in structure.entries
        if entry.matrix in DELAYS
        for name in entry.expression.names
    }
