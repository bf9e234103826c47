"""What is asked, predicted by the identified model, exact, and flown, figure by figure."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from helisim.handling.criteria import (
    AttitudeBandwidth,
    Border,
    Criterion,
    DisturbanceRejection,
    Limit,
    Rating,
    StabilityMargins,
)
from helisim.handling.loop import Loop, NoResponse, axis_of
from helisim.handling.measured.interval import Interval, interval
from helisim.handling.measured.margins import MeasuredLoop
from helisim.handling.spec import Spec

_DISTANCE = "distance"


@dataclass(frozen=True)
class ComparedFigure:
    """One figure of one criterion, four times over.

    Attributes:
        name: of the figure.
        unit: SI, or dB.
        limit: where its levels end; None if the criterion has no border of it alone.
        predicted: by the identified model; None where that doesn't know it.
        exact: of the sampled linearisation.
        flown: measured in flight, with its 95 % interval.
        met: exact, but over the air that was flown in, whose slow gusts move the point that is
            linearised about: what the flown figure tends to. None in calm air.
    """

    name: str
    unit: str
    limit: Limit | Border | None
    predicted: float | None
    exact: float | None
    flown: Interval | None
    met: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; what is not finite is None."""
        flown = self.flown
        ends = {} if flown is None else {"value": flown.value, "low": flown.low, "high": flown.high}
        return {
            "name": self.name,
            "unit": self.unit,
            "level1": self.limit.level1 if isinstance(self.limit, Limit) else None,
            "level2": self.limit.level2 if isinstance(self.limit, Limit) else None,
            "predicted": _finite(self.predicted),
            "exact": _finite(self.exact),
            "exact_over_air": _finite(self.met),
            "flown": {name: _finite(one) for name, one in ends.items()} or None,
        }


@dataclass(frozen=True, eq=False)
class ComparedCriterion:
    """One criterion: its figures, and the ratings of who knows what it asks for.

    Attributes:
        spec: what is asked, and what it is in a design.
        figures: each of them.
        predicted: rating of the identified model's loop; None where that doesn't know it.
        exact: rating of the sampled linearisation.
        flown: rating of the loop as measured.
        distance: flown, from the border of Level 1, with its 95 % interval.
        unknown: why, of "predicted", "exact" and "flown", there is no rating.
    """

    spec: Spec
    figures: tuple[ComparedFigure, ...]
    predicted: Rating | None
    exact: Rating | None
    flown: Rating | None
    distance: Interval | None
    unknown: Mapping[str, str]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        ratings = {"predicted": self.predicted, "exact": self.exact, "flown": self.flown}
        return {
            "criterion": self.spec.criterion.name,
            "axis": self.spec.criterion.axis,
            "at": getattr(self.spec.criterion, "at", None),
            "kind": self.spec.kind,
            "level": {name: one.level if one else None for name, one in ratings.items()},
            "distance": {name: one.distance if one else None for name, one in ratings.items()},
            "figures": [one.to_dict() for one in self.figures],
            "unknown": dict(self.unknown),
        }


def with_usual(specs: Iterable[Spec | Criterion], axes: Sequence[str]) -> tuple[Spec, ...]:
    """Return specifications, and margins, rejection and bandwidth of axes that have none, to check.

    Args:
        specs: those of a design; a bare criterion is checked only.
        axes: of control.
    """
    found = [one if isinstance(one, Spec) else Spec(one, "check") for one in specs]
    there = {(type(one.criterion), one.criterion.axis) for one in found}
    for kind in (StabilityMargins, DisturbanceRejection, AttitudeBandwidth):
        for axis in axes:
            if (kind, axis_of(axis).name) not in there:
                found.append(Spec(kind(axis=axis), "check"))
    return tuple(found)


def compare(
    specs: Iterable[Spec],
    *,
    predicted: Loop | None,
    exact: Loop | None,
    flown: MeasuredLoop | None,
    met: Loop | None = None,
) -> tuple[ComparedCriterion, ...]:
    """Return each specification's figures and ratings, of the loops that there are.

    Args:
        specs: what is asked.
        predicted: loop of the identified model.
        exact: the sampled linearisation's.
        flown: measured.
        met: exact, over the air that was flown in.
    """
    return tuple(_compared(spec, predicted, exact, flown, met) for spec in specs)


def _compared(
    spec: Spec,
    predicted: Loop | None,
    exact: Loop | None,
    flown: MeasuredLoop | None,
    met: Loop | None,
) -> ComparedCriterion:
    criterion, unknown = spec.criterion, {}
    ratings: dict[str, Rating | None] = {}
    for name, loop in (
        ("predicted", predicted),
        ("exact", exact),
        ("flown", flown),
        ("met", met),
    ):
        ratings[name] = None
        if loop is None:
            continue
        try:
            ratings[name] = criterion.rate(loop)
        except NoResponse as error:
            if name != "met":  # a mean has neither poles nor steps
                unknown[name] = str(error)
    measured = ratings["flown"]
    drawn = {} if flown is None or measured is None else _intervals(criterion, flown, measured)
    names = dict.fromkeys(name for one in ratings.values() if one for name in one.figures)
    figures = tuple(
        ComparedFigure(
            name,
            criterion.units[name],
            criterion.limits.get(name),
            _figure(ratings["predicted"], name),
            _figure(ratings["exact"], name),
            drawn.get(name),
            _figure(ratings["met"], name),
        )
        for name in names
    )
    return ComparedCriterion(
        spec,
        figures,
        ratings["predicted"],
        ratings["exact"],
        measured,
        drawn.get(_DISTANCE),
        unknown,
    )


def _figure(rating: Rating | None, name: str) -> float | None:
    return None if rating is None else rating.figures.get(name)


def _intervals(criterion: Criterion, loop: MeasuredLoop, measured: Rating) -> dict[str, Interval]:
    """Return the figures that were measured, and the distance, with their intervals."""
    nominal = {**measured.figures, _DISTANCE: measured.distance}
    drawn: dict[str, list[float]] = {name: [] for name in nominal}
    for one in loop.draws:
        try:
            rating = criterion.rate(one)
        except NoResponse:
            continue
        for name, values in drawn.items():
            value = rating.distance if name == _DISTANCE else rating.figures.get(name, np.nan)
            values.append(float(value))
    return {
        name: interval(float(value), np.array(drawn[name]))
        for name, value in nominal.items()
        if drawn[name]
    }


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)
