"""Designs a control law on an identified model."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from helisim.base.errors import InputError
from helisim.base.linear import Linear
from helisim.design.descent import Vector
from helisim.design.free import free_parameters
from helisim.design.laws.law import Law
from helisim.design.nearest import infeasible
from helisim.design.phases import Phases, Step
from helisim.design.plant import Plant
from helisim.design.problem import Close, Problem, closed, slowest
from helisim.design.result import DesignResult, Judged
from helisim.design.tradeoff import TradeOff, trade_off
from helisim.handling.loop import GRID, Loop, NoResponse
from helisim.handling.spec import Spec
from helisim.ident.fitting.result import Fit
from helisim.records.channels import IN2
from helisim.records.provenance import made_by, one_blas_thread

MARGIN = 0.1
"""Design margin: of the distance between Levels 1 and 2, that is kept from Level 1's border."""
MODELS = 20
"""Drawn by the fit's covariance and designed with."""
DRAWN = 200
"""Drawn anew, for the share that keeps Level 1."""

Progress = Callable[[str], None]


def design(
    plant: Linear | Fit | Sequence[Fit],
    law: Law,
    specs: Sequence[Spec],
    *,
    before: Law | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    only: Sequence[str] | None = None,
    trade_offs: Sequence[str] = (),
    margin: float = MARGIN,
    models: int = MODELS,
    drawn: int = DRAWN,
    seed: int = 1,
    period: float | None = None,
    close: Close = closed,
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
        trade_offs: axes of which disturbance rejection over phase margin is computed too.
        margin: design margin, as a share of the distance between the borders of Levels 1 and 2.
        models: drawn to design with, beside the nominal one.
        drawn: drawn anew to judge by.
        seed: of the draws.
        period: s, between the law's ticks; by default the plant's own.
        close: closes a loop of a model and a law's linear form.
        on_progress: called with a word after each step.

    Raises:
        InputError: the law needs a signal that the plant doesn't give, an axis or parameter is
            unknown, a number is out of range, or a specification can't be judged.
        UnstableError: no law of this structure makes every loop stable.
        InfeasibleError: a specification can't be met even in the nominal model.
    """
    _check_numbers(margin, models, drawn)
    plant = _plant_of(plant)
    ticks = _period_of(plant, period)
    tell = on_progress or (lambda _: None)
    with one_blas_thread():
        _check_signals(plant, law.linear(ticks))
        free = free_parameters(law.parameters(), bounds or {}, only)
        sampled = _draws(plant, models, seed)
        problem = Problem(law, tuple(specs), (plant, *sampled), free, ticks, close)
        _check_specs(problem)
        found = Phases(
            problem, margin=margin, seed=seed, on_step=lambda one: tell(_word(one))
        ).run()
        if found.margin < 0.0 and found.models == (0,):
            raise infeasible(problem, found.at)
        curves = tuple(_trade_off(problem, found.at, axis, tell) for axis in trade_offs)
        judge = _Judge(problem, found.at, before or law, _draws(plant, drawn, seed + 1))
        judged, share = judge.judged(tell)
    return DesignResult(
        before=before or law,
        law=problem.law_at(found.at),
        judged=judged,
        margin=found.margin,
        share=share,
        drawn=judge.count,
        trade_offs=curves,
        history=found.history,
        provenance=made_by(
            "design",
            seed=seed,
            margin=margin,
            models=models,
            drawn=drawn,
            designed_with=len(found.models),
            period_s=ticks,
            free={one.name: [one.low, one.high] for one in free},
        ),
    )


class _Judge:
    """Rates the designed law and the one before, on the whole grid, in all models drawn."""

    def __init__(
        self, problem: Problem, at: Vector, before: Law, drawn: tuple[Linear, ...]
    ) -> None:
        self._problem, self._at, self._before = problem, at, before
        self._models = drawn
        self.count = len(drawn)

    def judged(self, tell: Progress) -> tuple[tuple[Judged, ...], float]:
        """Return every specification as it stands, and the share of models in Level 1."""
        problem = self._problem
        law = problem.law_at(self._at).linear(problem.period)
        nominal = problem.rate(problem.close(problem.models[0], law, GRID))
        tell("nominal model")
        rated, kept = [], []
        for model in self._models or problem.models[:1]:
            loop = problem.close(model, law, GRID)
            rated.append(problem.rate(loop))
            stable = slowest(loop) <= 0.0
            kept.append([stable and one.distance >= 0.0 for one in rated[-1]])
        tell("models drawn")
        holds = np.array(kept, dtype=bool)
        judged = tuple(
            Judged(
                spec,
                before,
                nominal[k],
                min((nominal[k], *(one[k] for one in rated)), key=lambda one: one.distance),
                float(np.mean(holds[:, k])),
                tuple(one[k] for one in rated),
            )
            for k, (spec, before) in enumerate(zip(problem.specs, self._of_before()))
        )
        asked = problem.of_kind("hard", "soft")
        return judged, float(np.mean(np.all(holds[:, asked], axis=1)))

    def _of_before(self) -> list[Any]:
        problem = self._problem
        loop = problem.close(problem.models[0], self._before.linear(problem.period), GRID)
        if slowest(loop) > 0.0:
            return [None] * len(problem.specs)
        return [_rating_or_none(spec, loop) for spec in problem.specs]


def _rating_or_none(spec: Spec, loop: Loop) -> Any:
    try:
        return spec.criterion.rate(loop)
    except NoResponse:
        return None


def _check_numbers(margin: float, models: int, drawn: int) -> None:
    if not 0.0 <= margin < 10.0:
        raise InputError(f"the design margin is 0 or more and below 10, got {margin!r}")
    for name, count in (("models", models), ("drawn", drawn)):
        if count < 0:
            raise InputError(f"{name} must be 0 or more, got {count}")


def _plant_of(given: Linear | Fit | Sequence[Fit]) -> Linear:
    if isinstance(given, Fit):
        return Plant((given,))
    return Plant(tuple(given)) if isinstance(given, Sequence) else given


def _period_of(plant: Any, period: float | None) -> float:
    found = getattr(plant, "period", None) if period is None else period
    if found is None or not found > 0.0:
        raise InputError("the plant doesn't say the law's period: give period, s, above 0")
    return float(found)


def _check_signals(plant: Linear, law: Linear) -> None:
    """Raise InputError unless the plant gives what the law needs, and takes what it commands."""
    if not set(law.outputs) & set(plant.inputs):
        raise InputError(
            f"the law commands {', '.join(law.outputs)} and the model has none of them: it has "
            f"{', '.join(plant.inputs)}"
        )
    rows = [law.outputs.index(name) for name in law.outputs if name in plant.inputs]
    used = np.any(law.response(GRID[::40])[rows] != 0.0, axis=(0, 2))
    lacks = [
        name
        for name, used_here in zip(law.inputs, used)
        if used_here and name not in plant.outputs and name not in IN2
    ]
    if lacks:
        raise InputError(
            f"the law senses {', '.join(lacks)}, which the model doesn't give: it has "
            f"{', '.join(plant.outputs)}; identify the axis that is missing, or give a law "
            "without it"
        )


def _check_specs(problem: Problem) -> None:
    """Raise InputError for a specification that can't be judged on the nominal model."""
    if not problem.specs:
        raise InputError("a design needs a specification; none was given")
    loop = problem.loops(problem.start)[0]
    for spec in problem.specs:
        try:
            spec.criterion.rate(loop)
        except NoResponse as error:
            raise InputError(
                f"{spec.criterion.name} of {spec.criterion.axis} can't be judged: {error}"
            ) from None


def _draws(plant: Any, count: int, seed: int) -> tuple[Linear, ...]:
    if count == 0:
        return ()
    if not hasattr(plant, "draws"):
        raise InputError(
            "the model has no draws, so none can be designed with: give models=0, drawn=0, or a "
            "plant of fits with covariances"
        )
    return tuple(plant.draws(count, seed=seed))


def _trade_off(problem: Problem, at: Vector, axis: str, tell: Progress) -> TradeOff:
    return trade_off(problem, at, axis, on_point=tell)


def _word(step: Step) -> str:
    return f"{step.phase}: worst {min(step.hard, step.soft):+.2f}"
