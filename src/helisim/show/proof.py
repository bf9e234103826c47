"""The tables of a proof: asked, predicted, exact and flown; and how far a gust turned what flew."""

from collections.abc import Sequence
from math import floor, isfinite, log10

from helisim.base.units import RAD_PER_DEG
from helisim.handling.axis import axis_of
from helisim.handling.criteria import Limit
from helisim.handling.measured.interval import Interval
from helisim.show.table import Cell, Column, Table, number, words
from helisim.study.proof.comparison import ComparedCriterion, ComparedFigure
from helisim.study.proof.prove import Proof

_SHORT = {"drb": "DRB", "drp": "DRP"}
_PLAIN = ".3g"
_LAW = {"before": "before", "law": "with the law"}


def proof_table(proof: Proof) -> Table:
    """Return every figure that was flown, or has a border; angles in degrees."""
    columns = (
        Column("axis", left=True),
        Column("criterion", left=True, page_only=True),
        Column("figure", left=True),
        Column("asked"),
        Column("predicted"),
        Column("exact"),
        Column("in that air"),
        Column("flown"),
        Column("95 % from"),
        Column("to"),
        Column("unit", left=True),
    )
    rows = [row for one in proof.table for row in _rows(one)]
    stops = proof.flights.stops
    at = ", ".join(f"{name} {100.0 * share:.2g} %" for name, share in stops.share.items())
    largest = ", ".join(f"{name} {one:.2f}" for name, one in stops.largest.items())
    notes = (
        ("at its stops in rough air", at or "nothing"),
        ("largest commands there, of 0.5", largest),
    )
    return Table("Proof in flight", columns, tuple(rows), notes=notes)


def gust_table(proof: Proof) -> Table:
    """Return how far the gust turned the vehicle, before and with the law."""
    rows = [
        (
            words(_LAW[name]),
            words(angle),
            number(one.peak / RAD_PER_DEG, _PLAIN),
            number(one.rms / RAD_PER_DEG, _PLAIN),
        )
        for name, angles in proof.gust_deviations.items()
        for angle, one in angles.items()
    ]
    columns = (
        Column("controller", left=True),
        Column("angle", left=True),
        Column("peak", unit="deg"),
        Column("rms", unit="deg"),
    )
    return Table("Gust", columns, tuple(rows))


def _rows(one: ComparedCriterion) -> list[tuple[Cell, ...]]:
    criterion = one.spec.criterion
    shown = [f for f in one.figures if f.name in criterion.limits or f.flown is not None]
    return [
        (
            words(axis_of(criterion.axis).word),
            words(criterion.name.replace("_", " ")),
            words(_SHORT.get(figure.name, figure.name.replace("_", " "))),
            *_numbers(figure),
            words("deg" if figure.unit == "rad" else figure.unit),
        )
        for figure in shown
    ]


def _numbers(figure: ComparedFigure) -> list[Cell]:
    limit, flown = figure.limit, figure.flown
    form = _PLAIN if flown is None else _form(flown, figure.unit)
    asked = limit.level1 if isinstance(limit, Limit) else None
    measured = (None, None, None) if flown is None else (flown.value, flown.low, flown.high)
    return [
        _cell(asked, figure.unit, _PLAIN),
        *(_cell(one, figure.unit, form) for one in _known(figure, measured)),
    ]


def _known(figure: ComparedFigure, measured: Sequence[float | None]) -> list[float | None]:
    return [figure.predicted, figure.exact, figure.met, *measured]


def _cell(value: float | None, unit: str, form: str) -> Cell:
    if value is None or not isfinite(value):
        return words("-")
    return number(value / RAD_PER_DEG if unit == "rad" else value, form)


def _form(one: Interval, unit: str) -> str:
    """Return the format that gives the interval's width two digits."""
    width = (one.high - one.low) / (RAD_PER_DEG if unit == "rad" else 1.0)
    if not (isfinite(width) and width > 0.0):
        return _PLAIN
    return f".{min(max(1 - floor(log10(width)), 0), 6)}f"
