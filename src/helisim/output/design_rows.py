"""The table of a proof: what was asked, predicted, exact and flown, figure by figure."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from helisim.handling.criteria import Limit, Rating
from helisim.output.table import Cell, Column, Table, number, words
from helisim.units import RAD_PER_DEG

if TYPE_CHECKING:
    from helisim.study.proof.comparison import ComparedCriterion, ComparedFigure
    from helisim.study.proof.prove import Proof

_FORM = ".3g"


def proof_table(proof: "Proof", before: Mapping[int, Rating | None]) -> Table:
    """Return every figure of every specification, four times over.

    Args:
        proof: of the law.
        before: ratings of the law before, by the number of the row of the proof's table.
    """
    rows = [
        _row(one, figure, before.get(k), first=number_ == 0)
        for k, one in enumerate(proof.table)
        for number_, figure in enumerate(one.figures)
    ]
    columns = (
        Column("criterion", left=True),
        Column("figure", left=True),
        Column("unit", left=True),
        Column("Level 1"),
        Column("before"),
        Column("predicted"),
        Column("exact"),
        Column("flown"),
        Column("95 %"),
        Column("level", label="level flown", left=True),
    )
    return Table("Asked, predicted, exact, flown", columns, tuple(rows))


def _row(
    one: "ComparedCriterion", figure: "ComparedFigure", before: Rating | None, *, first: bool
) -> tuple[Cell, ...]:
    criterion, unit, flown = one.spec.criterion, figure.unit, figure.flown
    at = getattr(criterion, "at", "")
    name = f"{criterion.word}: {criterion.name.replace('_', ' ')}" + (f", {at}" if at else "")
    limit = figure.limit.level1 if isinstance(figure.limit, Limit) else None
    was = None if before is None else before.figures.get(figure.name)
    half = None if flown is None else 0.5 * (flown.high - flown.low)
    rated = one.flown or one.exact
    level = "" if rated is None or not first else f"Level {rated.level}"
    return (
        words(name, "name"),
        words(figure.name.replace("_", " ")),
        words("deg" if unit == "rad" else unit, "unit"),
        _value(limit, unit),
        _value(was, unit),
        _value(figure.predicted, unit),
        _value(figure.exact, unit),
        _value(None if flown is None else flown.value, unit),
        words("-") if half is None else words(f"\u00b1 {_people(half, unit):.2g}"),
        words(level, "verdict ok" if level == "Level 1" else "verdict off" if level else ""),
    )


def _value(value: float | None, unit: str) -> Cell:
    return number(None if value is None else _people(value, unit), _FORM)


def _people(value: float, unit: str) -> float:
    return value / RAD_PER_DEG if unit == "rad" else value
