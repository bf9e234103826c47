"""Designs a control law on an identified model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from helisim.base.display import Displayed, shower
from helisim.base.errors import InputError
from helisim.base.files import write_json
from helisim.base.linear import Linear
from helisim.base.settings import FrozenMap, Value
from helisim.design.descent import Vector
from helisim.design.laws.law import Law
from helisim.design.plant import Plant
from helisim.design.problem import (
    Close,
    Problem,
    Ratings,
    Search,
    Step,
    free_parameters,
    growth,
    infeasible,
)
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criterion import Rating
from helisim.handling.loop import GRID, NoResponse
from helisim.handling.spec import Spec
from helisim.ident import Fit
from helisim.records.record import IN2, made_by, one_blas_thread

if TYPE_CHECKING:
    from helisim.base.display import Figure

FORMAT = "helisim design, version 1"
MARGIN = 0.1
"""Design margin: of the distance between Levels 1 and 2, that is kept from Level 1's border."""
MODELS = 20
"""Drawn by the fit's covariance and designed with."""
DRAWN = 200
"""Drawn anew, for the share that keeps Level 1."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Judged:
    """One specification, and how laws stand by it.

    Attributes:
        spec: what is asked.
        before: of the law before; None where that one's loop is unstable or lacks a response.
        nominal: of the designed law, in the model that was identified.
        worst: of the designed law, in the worst of the models that may as well be the aircraft.
        share: of those models in which it keeps Level 1.
        cloud: of the designed law, in each of those models.
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
                "figures": dict(one.figures),
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
    """A designed law with what it is worth.

    Attributes:
        before: the law that it is compared with: that of the start, if no other was given.
        law: the designed one.
        judged: each specification.
        margin: design margin that every specification keeps in the models designed with.
        share: of the models drawn in which every hard and soft specification keeps Level 1.
        drawn: how many models these are.
        history: laws on the way.
        provenance: of what, with which seed and versions.
    """

    before: Law
    law: Law
    judged: tuple[Judged, ...]
    margin: float
    share: float
    drawn: int
    history: tuple[Step, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("judged", "history"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        object.__setattr__(self, "provenance", FrozenMap(self.provenance))

    def __repr__(self) -> str:
        return (
            f"DesignResult({len(self.judged)} specifications, Level 1 in "
            f"{100.0 * self.share:.3g} % of {self.drawn} models drawn, margin {self.margin:.3g})"
        )

    @property
    def specs(self) -> tuple[Spec, ...]:
        """What was asked for."""
        return tuple(one.spec for one in self.judged)

    @property
    def misses(self) -> tuple[str, ...]:
        """One sentence for each level that is missed, in the nominal or a drawn model."""
        return tuple(
            f"{one.nominal.criterion.name} of {one.nominal.criterion.word}: Level 1 "
            f"in {100.0 * one.share:.3g} % of the models drawn"
            for one in self.judged
            if one.spec.kind in ("hard", "soft") and (one.share < 1.0 or one.nominal.level > 1)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data: what `design.json` holds."""
        return {
            "format": FORMAT,
            "law": self.law.parameters(),
            "before": self.before.parameters(),
            "specifications": [one.to_dict() for one in self.judged],
            "margin": self.margin,
            "share_level_1": self.share,
            "drawn": self.drawn,
            "history": [
                {name: None if value == np.inf else value for name, value in asdict(one).items()}
                for one in self.history
            ],
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
    drawn: int = DRAWN,
    seed: int = 1,
    period: float | None = None,
    close: Close = ClosedLoop,
    on_progress: Progress | None = None,
) -> DesignResult:
    """Find the parameters of a law with which a model meets specifications at the least cost.

    Hard constraints come first, then Level 1 of the soft specifications, then the design margin,
    then the summed objective while all of that holds; in the worst of the nominal model and of
    those that the fit's covariance draws.

    Args:
        plant: from commands to what is sensed, with `draws(count, seed=...)` if models are drawn;
            of fits alone, records are taken to be without latencies: see `Plant`.
        law: of the structure that is wanted; its parameters are where the search starts.
        specs: what is asked, each a criterion that is "hard", "soft", an "objective" or a "check".
        before: a law to compare with; by default that of the start.
        bounds: least and largest value of parameters, by name; see `free_parameters`.
        only: names of the parameters that are moved; by default all that have a value.
        margin: design margin, as a share of the distance between the borders of Levels 1 and 2.
        models: drawn to design with, beside the nominal one.
        drawn: drawn anew to judge by.
        seed: of the draws.
        period: s, between the law's ticks; by default the plant's own.
        close: closes a loop of a model and a law's linear form.
        on_progress: called with a word after each step.

    Raises:
        InputError: the law needs a signal that the plant doesn't give, a parameter is unknown, a
            number is out of range, or a specification can't be judged.
        UnstableError: no law of this structure makes every loop stable.
        InfeasibleError: a specification can't be met even in the nominal model.
    """
    if not 0.0 <= margin < 10.0:
        raise InputError(f"the design margin is 0 or more and below 10, got {margin!r}")
    for name, count in (("models", models), ("drawn", drawn)):
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

    def on_step(one: Step) -> None:
        tell(f"{one.phase}: worst {min(one.hard, one.soft):+.2f}")

    with one_blas_thread():
        _check_signals(plant, law.linear(ticks))
        free = free_parameters(law.parameters(), bounds or {}, only)
        sampled = _draws(plant, models, seed)
        problem = Problem(law, tuple(specs), (plant, *sampled), free, ticks, close)
        loop = problem.loops(problem.start)[0]
        for spec in specs:
            try:
                spec.criterion.rate(loop)
            except NoResponse as error:
                name = f"{spec.criterion.name} of {spec.criterion.axis}"
                raise InputError(f"{name} can't be judged: {error}") from None
        search = Search(problem, margin=margin, seed=seed, on_step=on_step)
        at, kept = search.run()
        if kept < 0.0 and search.models == (0,):
            raise infeasible(problem, at)
        others = _draws(plant, drawn, seed + 1)
        judged, share = _judged(problem, at, before or law, others, tell)
    return DesignResult(
        before=before or law,
        law=problem.law_at(at),
        judged=judged,
        margin=kept,
        share=share,
        drawn=drawn,
        history=tuple(search.history),
        provenance=made_by(
            "design",
            seed=seed,
            margin=margin,
            models=models,
            drawn=drawn,
            designed_with=len(search.models),
            period_s=ticks,
            free={one.name: [one.low, one.high] for one in free},
        ),
    )


def _judged(
    problem: Problem, at: Vector, before: Law, others: Sequence[Linear], tell: Progress
) -> tuple[tuple[Judged, ...], float]:
    """Return every specification as it stands, and the share of models in Level 1.

    The designed law and the one before are rated on the whole grid, in all models drawn.
    """
    own, first = problem.law_at(at).linear(problem.period), problem.models[0]
    nominal = problem.rate(problem.close(first, own, GRID))
    tell("nominal model")
    rated: list[Ratings] = []
    kept: list[list[bool]] = []
    for model in others or [first]:
        loop = problem.close(model, own, GRID)
        rated.append(problem.rate(loop))
        stable = growth(loop) <= 0.0
        kept.append([stable and one.distance >= 0.0 for one in rated[-1]])
    tell("models drawn")
    holds = np.array(kept, dtype=bool)
    loop = problem.close(first, before.linear(problem.period), GRID)
    steady = growth(loop) <= 0.0
    judged = []
    for k, (spec, here) in enumerate(zip(problem.specs, nominal)):
        cloud = tuple(one[k] for one in rated)
        worst = min((here, *cloud), key=lambda one: one.distance)
        try:
            old = spec.criterion.rate(loop) if steady else None
        except NoResponse:
            old = None
        judged.append(Judged(spec, old, here, worst, float(np.mean(holds[:, k])), cloud))
    asked = problem.of_kind("hard", "soft")
    return tuple(judged), float(np.mean(np.all(holds[:, asked], axis=1)))


def _check_signals(plant: Linear, law: Linear) -> None:
    """Raise InputError unless the plant gives what the law needs, and takes what it commands."""
    rows = [k for k, name in enumerate(law.outputs) if name in plant.inputs]
    if not rows:
        raise InputError(
            f"the law commands {', '.join(law.outputs)} and the model has none of them: it has "
            f"{', '.join(plant.inputs)}"
        )
    used = np.any(law.response(GRID[::40])[rows] != 0.0, axis=(0, 2))
    known = (*plant.outputs, *IN2)
    lacks = [name for name, needed in zip(law.inputs, used) if needed and name not in known]
    if lacks:
        raise InputError(
            f"the law senses {', '.join(lacks)}, which the model doesn't give: it has "
            f"{', '.join(plant.outputs)}; identify the axis that is missing, or give a law "
            "without it"
        )


def _draws(plant: Any, count: int, seed: int) -> tuple[Linear, ...]:
    if count and not hasattr(plant, "draws"):
        raise InputError(
            "the model has no draws, so none can be designed with: give models=0, drawn=0, or a "
            "plant of fits with covariances"
        )
    return tuple(plant.draws(count, seed=seed)) if count else ()
