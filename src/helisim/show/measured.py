"""The table of what was measured of a closed loop."""

from helisim.handling.measured.interval import Interval
from helisim.handling.measured.margins import MeasuredFigure, MeasuredMargins
from helisim.show.table import Cell, Column, Table, number, words

_WORDS = {
    "crossover": "crossover",
    "phase_margin": "phase margin",
    "gain_margin": "gain margin",
    "DRB": "DRB",
    "DRP": "DRP",
    "bandwidth": "bandwidth",
    "phase_delay": "phase delay",
}


def measured_table(found: MeasuredMargins) -> Table:
    """Return the figures of a measured loop with their intervals, in degrees, dB and SI."""
    return Table(
        "Measured",
        (
            Column("axis", left=True),
            Column("cut at", left=True),
            Column("figure", left=True),
            Column("value"),
            Column("95 % from"),
            Column("to"),
            Column("unit", left=True),
        ),
        tuple(_row(one) for one in found.figures),
    )


def _row(one: MeasuredFigure) -> tuple[Cell, ...]:
    digits = _form(one.interval)
    return (
        words(one.axis),
        words(one.at),
        words(_WORDS[one.name]),
        number(one.interval.value, digits),
        number(one.interval.low, digits),
        number(one.interval.high, digits),
        words(one.unit),
    )


def _form(one: Interval) -> str:
    """Return the format that gives the interval's width two digits."""
    from math import floor, isfinite, log10

    width = one.high - one.low
    if not (isfinite(width) and width > 0.0):
        return ".4g"
    return f".{min(max(1 - floor(log10(width)), 0), 6)}f"
