"""Designs a control law on an identified model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from helisim.base.arrays import Real
from helisim.base.display import Displayed, shower
from helisim.base.errors import InputError
from helisim.base.files import write_json
from helisim.base.linear import Linear
from helisim.base.settings import FrozenMap, Value
from helisim.design.laws.law import Law
from helisim.design.plant import Plant
from helisim.design.problem import (
    Problem,
    Search,
    free_parameters,
    growth,
    infeasible,
)
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criterion import Rating
from helisim.handling.loop import GRID, NoResponse
from helisim.handling.spec import Spec
from helisim.ident import Fit
from helisim.records.record import made_by, one_blas_thread

if TYPE_CHECKING:
    from helisim.base.display import Figure

FORMAT = "helisim design, version 1"
MARGIN = 0.1  # design margin kept from Level 1's border, a share of the distance to Level 2's
MODELS = 20  # models sampled by the fit's covariance that are designed with
SAMPLES = 200  # models sampled anew, for the share that keeps Level 1

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Judged:
    """One specification's ratings before (None: unstable or no response), and designed.

    `worst` is of nominal and sampled models, `cloud` of each sampled one, `share` of those in
    Level 1.
    """

    spec: Spec
    before: Rating | None
    nominal: Rating
    worst: Rating
    share: float
    cloud: tuple[Rating, ...] = field(default=(), repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""

        def plain(one: Rating | None) -> dict[str, Any] | None:
            return one and {
                "figures": {n: x if np.isfinite(x) else None for n, x in one.figures.items()},
                "level": one.level,
                "distance": one.distance,
                "remark": one.remark,
            }

        return {
            "criterion": self.nominal.criterion.name,
            "axis": self.nominal.criterion.axis,
            "kind": self.spec.kind,
            "before": plain(self.before),
            "nominal": plain(self.nominal),
            "worst": plain(self.worst),
            "share": self.share,
        }


@dataclass(frozen=True, eq=False)
class DesignResult(Value, Displayed):
    """A designed law with ratings; each specification keeps `margin` in the models designed with.

    `share` is of the `samples` models in which every hard and soft specification keeps Level 1.
    """

    before: Law
    law: Law
    judged: tuple[Judged, ...]
    margin: float
    share: float
    samples: int
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "judged", tuple(self.judged))
        object.__setattr__(self, "provenance", FrozenMap(self.provenance))

    def __repr__(self) -> str:
        return (
            f"DesignResult({len(self.judged)} specifications, Level 1 in "
            f"{100.0 * self.share:.3g} % of {self.samples} samples, margin {self.margin:.3g})"
        )

    @property
    def specs(self) -> tuple[Spec, ...]:
        """Specifications of the design."""
        return tuple(one.spec for one in self.judged)

    @property
    def misses(self) -> tuple[str, ...]:
        """One sentence for each missed level, in the nominal or a sampled model."""
        return tuple(
            f"{one.nominal.criterion.name} of {one.nominal.criterion.word}: Level 1 "
            f"in {100.0 * one.share:.3g} % of the sampled models"
            for one in self.judged
            if one.spec.kind in ("hard", "soft") and (one.share < 1.0 or one.nominal.level > 1)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data, the content of `design.json`."""
        return {
            "format": FORMAT,
            "law": self.law.parameters(),
            "before": self.before.parameters(),
            "specifications": [one.to_dict() for one in self.judged],
            "margin": self.margin,
            "share_level_1": self.share,
            "samples": self.samples,
            "provenance": dict(self.provenance),
        }

    def write(self, path: str | Path) -> None:
        """Write it as JSON. Raises StorageError."""
        write_json(self.to_dict(), path, indent=1)

    def plot(self) -> "Figure":
        """Draw the charts of all criteria with their levels, before and after."""
        return shower().plot_design(self)


def design(
    plant: Linear | Fit | Sequence[Fit],
    law: Law,
    specs: Sequence[Spec],
    *,
    before: Law | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    only: Sequence[str] | None = None,
    margin: float = MARGIN,
    models: int = MODELS,
    samples: int = SAMPLES,
    seed: int = 1,
    period: float | None = None,
    on_progress: Progress | None = None,
) -> DesignResult:
    """Find the parameters of a law with which a model meets specifications at the least cost.

    Hard constraints come first, then Level 1 of the soft specifications, then the design margin,
    then the summed objective; in the worst of the nominal model and of `models` sampled ones.

    The start is `law`'s own parameters, `before` by default too; `bounds` and `only` are as in
    `free_parameters`. `margin` is a share of the distance between the borders of Levels 1 and 2;
    `samples` models are sampled anew to judge by. `period`, s, of ticks is the plant's own if None.
    Fits are taken as a `Plant` without latencies; another plant needs `draws(count, seed=...)`.

    Raises InputError of arguments, UnstableError if no law of this structure is stable,
    InfeasibleError if a specification can't be met even in the nominal model.
    """
    if not 0.0 <= margin < 10.0:
        raise InputError(f"the design margin is 0 or more and below 10, got {margin!r}")
    for name, count in (("models", models), ("samples", samples)):
        if count < 0:
            raise InputError(f"{name} must be 0 or more, got {count}")
    if not specs:
        raise InputError("a design needs a specification; none was given")
    if isinstance(plant, Fit | Sequence):
        plant = Plant((plant,) if isinstance(plant, Fit) else tuple(plant))
    ticks = getattr(plant, "period", None) if period is None else period
    if ticks is None or not ticks > 0.0:
        raise InputError("the plant doesn't say the law's period: give period, s, above 0")
    ticks, tell = float(ticks), on_progress or (lambda _: None)
    with one_blas_thread():
        free = free_parameters(law.parameters(), bounds or {}, only)
        problem = Problem(law, tuple(specs), (plant, *_draws(plant, models, seed)), free, ticks)
        loop = problem.loops(problem.start)[0]
        for spec in specs:
            try:
                spec.criterion.rate(loop)
            except NoResponse as error:
                name = f"{spec.criterion.name} of {spec.criterion.axis}"
                raise InputError(f"{name} can't be judged: {error}") from None
        search = Search(problem, margin=margin, seed=seed, tell=tell)
        at, kept = search.run()
        if kept < 0.0 and search.models == (0,):
            raise infeasible(problem, at)
        judged, share = _judged(problem, at, before or law, _draws(plant, samples, seed + 1), tell)
    return DesignResult(
        before=before or law,
        law=problem.law_at(at),
        judged=judged,
        margin=kept,
        share=share,
        samples=samples,
        provenance=made_by(
            "design",
            seed=seed,
            margin=margin,
            models=models,
            samples=samples,
            designed_with=len(search.models),
            period_s=ticks,
            free={one.name: [one.low, one.high] for one in free},
        ),
    )


def _judged(
    problem: Problem, at: Real, before: Law, others: Sequence[Linear], tell: Progress
) -> tuple[tuple[Judged, ...], float]:
    own, first = problem.law_at(at).linear(problem.period), problem.models[0]
    nominal = problem.rate(ClosedLoop(first, own, GRID))
    tell("nominal model")
    loops = [ClosedLoop(model, own, GRID) for model in others or [first]]
    rated = [problem.rate(loop) for loop in loops]
    stable = np.array([growth(loop) <= 0.0 for loop in loops])
    holds = np.array([[one.distance >= 0.0 for one in ratings] for ratings in rated])
    holds &= stable[:, None]
    tell("sampled models")
    loop = ClosedLoop(first, before.linear(problem.period), GRID)
    judged = []
    for k, (spec, here) in enumerate(zip(problem.specs, nominal)):
        cloud = tuple(one[k] for one in rated)
        worst = min((here, *cloud), key=lambda one: one.distance)
        try:
            old = spec.criterion.rate(loop) if growth(loop) <= 0.0 else None
        except NoResponse:
            old = None
        judged.append(Judged(spec, old, here, worst, float(np.mean(holds[:, k])), cloud))
    return tuple(judged), float(np.mean(np.all(holds[:, problem.of_kind("hard", "soft")], axis=1)))


def _draws(plant: Any, count: int, seed: int) -> tuple[Linear, ...]:
    if count and not hasattr(plant, "draws"):
        raise InputError(
            "the model has no draws, so none can be designed with: give models=0, samples=0, or a "
            "plant of fits with covariances"
        )
    return tuple(plant.draws(count, seed=seed)) if count else ()
