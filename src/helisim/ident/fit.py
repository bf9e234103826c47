"""Fits a structure to frequency responses, NAVFIT and DERIVID in one, and reduces it.

The order of a reduction is Tischler and Remple's: first the parameters to which the cost is
insensitive, worst first; then those whose Cramér-Rao bound is large, which other parameters can
stand in for. Each is set to zero and the rest fitted again. Where the cost then rises too much the
parameter is needed after all, however poorly it is known, and comes back.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from helisim.base.errors import InputError
from helisim.base.settings import Value
from helisim.ident.bounds import accuracy
from helisim.ident.cost import Band, Cost, select
from helisim.ident.diagnosis import degenerate, delay_names, misfit
from helisim.ident.evaluate import response
from helisim.ident.fitted import CRAMER_RAO_LIMIT, INSENSITIVITY_LIMIT, FittedParameter, finite
from helisim.ident.response import FrequencyResponse
from helisim.ident.result import Fit
from helisim.ident.search import Minimum, refine, search
from helisim.ident.structure import Structure
from helisim.records.record import one_blas_thread, plain

ACCEPTED_RISE = 1.0
"""Rise of the average cost up to which a reduced model counts as good as the full one: an
error of 0.2 dB everywhere costs as much."""
_AT_BOUND = 1e-6
"""A parameter is at a bound when it is this fraction of the interval away from it."""
_OF_LOWER_ORDER = 3
"""Starts of a transfer function of lower order: those that its rational fits give."""

Weighting = Literal["error", "coherence"]
"""How the points of a fit are weighed."""
Reason = Literal["insensitivity", "Cramér-Rao bound"]


@one_blas_thread()
def identify(
    frf: FrequencyResponse,
    structure: Structure,
    *,
    band: Band | Mapping[str, Band] | None = None,
    responses: Sequence[str] | None = None,
    frequencies_per_response: int = 20,
    searches: int = 12,
    seed: int = 0,
    weighting: Weighting = "error",
    on_progress: Callable[[str], None] | None = None,
) -> Fit:
    """Fit a structure's free parameters to frequency responses.

    Args:
        frf: responses, best one estimate pooled from all records.
        structure: the model's structure.
        band: lowest and highest frequency, rad/s, for all responses or by response ("p/lat").
            Each response is used where its coherence is at least 0.6.
        responses: those to fit, such as ("p/lat", "q/lon"); all by default.
        frequencies_per_response: log-spaced points; the cost's scale does not depend on it.
        searches: how many starts are tried at most; fewer when two find the same minimum.
        seed: of the scattered starts. The same call gives the same numbers.
        weighting: "error" weighs each point by its own random error, known from the records:
            the parameters scatter less, by half or more where a gust blurs some frequencies.
            "coherence" is CIFER's: minimise J, whose weights are nearly equal at a coherence of
            0.9 and 0.999. A response without records, such as an exact one, is fitted by J.
            J, Cramér-Rao bounds and insensitivities are CIFER's either way.
        on_progress: called with the structure's name after each search.

    Raises:
        UnknownNameError: a signal or response does not exist.
        IdentificationError: no response is coherent enough.
    """
    if frequencies_per_response < 5 or searches < 1:
        raise InputError(
            f"{frequencies_per_response} frequencies a response and {searches} searches; "
            "expected at least 5 and 1"
        )
    if weighting not in get_args(Weighting):
        raise InputError(
            f"weighting is {weighting!r}, expected {' or '.join(map(repr, get_args(Weighting)))}"
        )
    points = select(frf, structure, band=band, responses=responses, count=frequencies_per_response)
    cost = Cost(structure, points)
    standardised = weighting == "error" and cost.noisy

    def fitted(of: Cost, starts: int) -> tuple[Minimum, int]:
        best, agreeing = search(of, starts, seed, on_progress or (lambda _: None))
        return (refine(of, best) if standardised and of.structure.free else best), agreeing

    best, agreeing = fitted(cost, searches)
    quality = accuracy(cost, best.x, standardised=standardised)
    advice, collapsed = degenerate(
        cost,
        best,
        quality.cramer_rao,
        lambda of, end: float(np.sum(of.standardised(end.x) ** 2)) if standardised else end.cost,
        lambda of: fitted(of, min(searches, _OF_LOWER_ORDER))[0],
    )
    parameters = {
        one.name: FittedParameter(one, one.start, 0.0, 0.0, one.error, at_bound=False)
        for one in structure.parameters
    }
    for k, one in enumerate(structure.free):
        value, (low, high) = float(best.x[k]), one.limits
        edge = _AT_BOUND * (high - low) if math.isfinite(high - low) else 1e-12
        parameters[one.name] = FittedParameter(
            one,
            value,
            float(quality.cramer_rao[k]),
            float(quality.insensitivity[k]),
            float(quality.standard_error[k]),
            min(value - low, high - value) <= edge,
            one.name in collapsed,
        )
    options = {
        "band_rad_s": dict(band) if isinstance(band, Mapping) else band,
        "responses": responses,
        "frequencies_per_response": frequencies_per_response,
        "searches": searches,
        "seed": seed,
        "weighting": weighting,
    }
    return Fit(
        structure=structure,
        parameters=parameters,
        correlation=quality.correlation,
        covariance=quality.covariance,
        carried=quality.carried,
        misfit=misfit(cost, best.x, quality.noise, quality.ratio),
        costs=dict(zip(points.pairs, cost.per_response(best.x).tolist())),
        bands=dict(zip(points.pairs, points.bands)),
        dropped=points.dropped,
        converged=best.converged,
        searches_agreeing=agreeing,
        degenerate=advice,
        data=frf,
        options=plain(options),
    )


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
            "steps": [{**asdict(step), "percent": finite(step.percent)} for step in self.steps],
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
    keep = (keep,) if isinstance(keep, str) else keep
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
    forbidden = set(keep) | _undroppable(full) | (set() if delays else delay_names(structure))
    now, steps, tried = full, [], set(forbidden)
    while (worst := _worst(now, tried)) is not None:
        one, reason, percent = worst
        tried.add(one.name)
        # The rest starts where it is, so one search finds its new minimum.
        parameters = tuple(
            known
            if known.fixed
            else replace(
                known,
                start=0.0 if known.name == one.name else now[known.name].value,
                scale=known.magnitude,
                fixed=known.name == one.name,
            )
            for known in now.structure.parameters
        )
        without = fitted(replace(now.structure, parameters=parameters), 1)
        dropped = without.cost <= full.cost + rise
        steps.append(Step(one.name, reason, percent, one.value, now.cost, without.cost, dropped))
        now = without if dropped else now
    poor = [name for name in now.poorly_identified if name in forbidden]
    if now is not full:
        now = min(fitted(now.structure, searches), now, key=lambda fit: fit.cost)
    return Reduction(full=full, fit=now, steps=tuple(steps), protected=tuple(poor), rise=rise)


def _worst(fit: Fit, tried: set[str]) -> tuple[FittedParameter, Reason, float] | None:
    """Return the parameter to try next, with the figure that says so."""
    waiting = [one for one in fit.parameters.values() if not one.fixed and one.name not in tried]
    figures: tuple[tuple[Reason, float, dict[str, float]], ...] = (
        (
            "insensitivity",
            INSENSITIVITY_LIMIT,
            {one.name: one.insensitivity_percent for one in waiting},
        ),
        ("Cramér-Rao bound", CRAMER_RAO_LIMIT, {one.name: one.cr_percent for one in waiting}),
    )
    for reason, limit, percent in figures:
        name = max(percent, key=lambda name: percent[name], default=None)
        if name is not None and percent[name] > limit:
            return fit[name], reason, percent[name]
    return None


def _undroppable(fit: Fit) -> set[str]:
    """Return parameters that can't be zero: outside their bounds, or the model breaks."""
    grid = np.array(fit.band)
    diagonal = (one for one in fit.structure.entries if one.matrix == "M" and one.row == one.column)
    found = {name for entry in diagonal for name in entry.expression.names}
    for one in fit.structure.free:
        low, high = one.limits
        defined = np.isfinite(response(fit.structure, {**fit.values, one.name: 0.0}, grid))
        if not (low <= 0.0 <= high and np.all(defined)):
            found.add(one.name)
    return found
