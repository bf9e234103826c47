"""The table of a design: what was asked, of the law before, of the designed one, in flight."""

from collections.abc import Mapping

from helisim.base.units import RAD_PER_DEG
from helisim.design.result import DesignResult, Judged
from helisim.handling.axis import axis_of
from helisim.handling.criteria import Criterion, Limit, LoadRejection, Rating
from helisim.show.table import Cell, Column, Table, number, words

_DIGITS = ".3g"
_SHORT = {"drb": "DRB", "drp": "DRP", "growth": "growth of poles"}

Flown = Mapping[tuple[Criterion, str], float]
"""(criterion, figure) -> as measured in flight."""


def design_table(result: DesignResult, flown: Flown | None = None) -> Table:
    """Return every figure that has a border, of all specifications but those to check.

    Args:
        result: of the design.
        flown: as measured in flight, if it flew.
    """
    columns = [
        Column("axis", left=True),
        Column("criterion", left=True, page_only=True),
        Column("figure", left=True),
        Column("asked"),
        Column("before"),
        Column("designed"),
        Column("worst"),
    ]
    columns += [Column("flown")] if flown is not None else []
    columns += [Column("unit", left=True), Column("Level 1 %", page_only=True)]
    asked = [one for one in result.judged if one.spec.kind in ("hard", "soft")]
    return Table(
        "Design",
        tuple(columns),
        tuple(row for one in asked for row in _rows(one, flown)),
        lead=f"Level 1 in {100.0 * result.share:.3g} % of {result.drawn} models drawn, design "
        f"margin {result.margin:.2g}",
    )


def _rows(one: Judged, flown: Flown | None) -> list[tuple[Cell, ...]]:
    criterion = one.spec.criterion
    rows = []
    for name, limit in criterion.limits.items():
        unit = criterion.units.get(name, "")
        asked = limit.level1 if isinstance(limit, Limit) else None
        figure = _called(criterion, name)
        cells = [words(criterion.word), words(criterion.name.replace("_", " ")), words(figure)]
        cells.append(_cell(asked, unit))
        cells += [_figure(rating, name, unit) for rating in (one.before, one.nominal, one.worst)]
        if flown is not None:
            cells.append(_cell(flown.get((criterion, name)), unit))
        cells.append(words("deg" if unit == "rad" else unit))
        cells.append(number(100.0 * one.share, _DIGITS))
        rows.append(tuple(cells))
    return rows


def _called(criterion: Criterion, name: str) -> str:
    if isinstance(criterion, LoadRejection):
        return f"turned by {axis_of(criterion.by).word} load"
    return _SHORT.get(name, name.replace("_", " "))


def _figure(rating: Rating | None, name: str, unit: str) -> Cell:
    return _cell(None if rating is None else rating.figures.get(name), unit)


def _cell(value: float | None, unit: str) -> Cell:
    if value is None:
        return words("-")
    return number(value / RAD_PER_DEG if unit == "rad" else value, _DIGITS)
