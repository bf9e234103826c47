"""The table of a proof: what was asked, predicted, exact and flown, figure by figure."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from helisim.base.units import RAD_PER_DEG
from helisim.handling.criteria import Limit, Rating
from helisim.show.table import Cell, Column, Table, number, words

if TYPE_CHECKING:
    from helisim.study.proof.comparison import ComparedCriterion, ComparedFigure
    from helisim.study.proof.prove import Proof

_FORM = ".3g"
_STYLES = {"Level 1": "verdict ok", "": "verdict"}
_ALSO = "crossover"
"""A figure that is looked at without a border."""


def proof_table(proof: "Proof", before: Mapping[int, Rating | None]) -> Table:
    """Return every figure with a border of every specification, four times over, and crossovers.

    Args:
        proof: of the law.
        before: ratings of the law before, by the number of the row of the proof's table.
    """
    rows = [
        _row(one, figure, before.get(k), first=place == 0)
        for k, one in enumerate(proof.table)
        for place, figure in enumerate(_listed(one))
    ]
    columns = (
        Column("criterion", left=True),
        Column("unit", left=True),
        Column("Level 1"),
        Column("before"),
        Column("predicted"),
        Column("exact"),
        Column("flown"),
        Column("95 %"),
        Column("level", label="level flown, or exact", left=True),
    )
    return Table("Asked, predicted, exact, flown", columns, tuple(rows))


def _listed(one: "ComparedCriterion") -> "list[ComparedFigure]":
    return [each for each in one.figures if each.limit is not None or each.name == _ALSO]


def _row(
    one: "ComparedCriterion", figure: "ComparedFigure", before: Rating | None, *, first: bool
) -> tuple[Cell, ...]:
    criterion, unit, flown = one.spec.criterion, figure.unit, figure.flown
    called = (criterion.name, figure.name)
    name = f"{criterion.word}: {', '.join(one.replace('_', ' ') for one in called)}"
    limit = figure.limit.level1 if isinstance(figure.limit, Limit) else None
    was = None if before is None else before.figures.get(figure.name)
    half = None if flown is None else 0.5 * (flown.high - flown.low)
    rated = one.flown or one.exact
    told = first and one.spec.kind != "objective"  # borders that only weigh it against others
    level = "" if rated is None or not told else f"Level {rated.level}"
    return (
        words(name, "name"),
        words("deg" if unit == "rad" else unit, "unit"),
        _value(limit, unit),
        _value(was, unit),
        _value(figure.predicted, unit),
        _value(figure.exact, unit),
        _value(None if flown is None else flown.value, unit),
        words("-") if half is None else words(f"\u00b1 {_people(half, unit):.2g}"),
        words(level, _STYLES.get(level, "verdict off")),
    )


def _value(value: float | None, unit: str) -> Cell:
    return number(None if value is None else _people(value, unit), _FORM)


def _people(value: float, unit: str) -> float:
    return value / RAD_PER_DEG if unit == "rad" else value
