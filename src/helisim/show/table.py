"""Tables for terminal and page, and numbers as text."""

import math
import re
import textwrap
from collections.abc import Iterable
from dataclasses import dataclass

WIDTH = 80  # columns of a terminal
PERCENT = "percent"  # format of an uncertainty in percent: two significant digits
NO_BREAK = "\u00a0"
_COLUMN = re.compile(r"(.*?)(<)?([*?])?(?: \[(.*?)\])?$")


@dataclass(frozen=True)
class Column:
    """One column of a table, which a terminal leaves out if it is "*", or "?" and has no room.

    `unit` is of the numbers, "" where each row has its own; `left` aligns texts to the left.
    """

    heading: str
    left: bool = False
    left_out: str = ""
    unit: str = ""


@dataclass(frozen=True)
class Table:
    """Rows of texts under headings.

    `lead` stands beside the title; notes are label, which may be "", and text.
    """

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    lead: str = ""
    notes: tuple[tuple[str, str], ...] = ()


def table(
    title: str,
    notation: str,
    rows: Iterable[Iterable[str]],
    lead: str = "",
    notes: Iterable[tuple[str, str]] = (),
) -> Table:
    """Return a table with columns in short notation, "parameter<|from [rad/s]|how<*".

    "<" aligns words to the left, "*" marks a column for pages only, "?" one for terminals that have
    room, too; a unit is in brackets.
    """
    parts = (_COLUMN.findall(one)[0] for one in notation.split("|"))
    columns = (Column(name, bool(left), out, unit) for name, left, out, unit in parts)
    return Table(title, tuple(columns), tuple(map(tuple, rows)), lead, tuple(notes))


def number(value: float | None, form: str = ".4g") -> str:
    """Return a number as text by a format or `PERCENT`, never as negative zero; "-" for None."""
    if value is None:
        return "-"
    if form == PERCENT and math.isfinite(value):
        sizes = ((1000.0, ".0e"), (10.0, ".0f"), (1.0, ".1f"), (0.0, ".2g"))
        form = next(form for least, form in sizes if abs(value) >= least)
    text = format(value, ".2g" if form == PERCENT else form)
    return text.lstrip("+-") if float(text) == 0.0 else text


def numbers(values: Iterable[float | None], form: str) -> tuple[str, ...]:
    """Return numbers as texts of one format; see `number`."""
    return tuple(number(value, form) for value in values)


def common_form(values: Iterable[float | None], digits: int = 4) -> str:
    """Return the format that gives the largest number its digits, and all the same decimals."""
    sizes = [abs(value) for value in values if value is not None and math.isfinite(value)]
    largest = max(sizes, default=0.0)
    exponent = 0 if largest == 0.0 else math.floor(math.log10(largest))
    return f".{max(digits - 1 - exponent, 0)}f" if -4 <= exponent < 7 else f".{digits - 1}e"


def interval_form(width: float, usual: str = ".3g") -> str:
    """Return the format that gives an interval's width two digits; `usual` for no width."""
    return (
        f".{min(max(1 - math.floor(math.log10(width)), 0), 6)}f"
        if math.isfinite(width) and width > 0.0
        else usual
    )


def as_text(table: Table, left_out: str = "*") -> str:
    """Return a table as lines of at most 80 columns, without a final line end.

    Columns with one of the marks `left_out` aren't shown.
    """
    kept = [k for k, one in enumerate(table.columns) if one.left_out not in [*left_out]]
    columns = [table.columns[k] for k in kept]
    units = [[one.unit for one in columns]] * any(one.unit for one in columns)
    heads = [[one.heading for one in columns], *units]
    lines = heads + [[row[k] for k in kept] for row in table.rows]
    widths = [max(map(len, column)) for column in zip(*lines)]
    gap = "  " if sum(widths) + 2 * (len(widths) - 1) <= WIDTH else " "
    texts = [
        gap.join(
            text.ljust(width) if column.left else text.rjust(width)
            for text, column, width in zip(line, columns, widths)
        ).rstrip()
        for line in lines
    ]
    if max(map(len, texts)) > WIDTH and left_out == "*":
        return as_text(table, "*?")
    texts.insert(len(heads), "-" * max(map(len, texts[: len(heads)])))
    title = f"{table.title}: {table.lead}" if table.lead else table.title
    notes = [filled(text, f"{label}: " if label else "") for label, text in table.notes]
    return "\n".join([*([title] if title else []), *texts, *notes])


def filled(text: str, label: str = "") -> str:
    """Return text wrapped behind a label, with numbers unbroken from percent signs."""
    return textwrap.fill(
        text.replace(" %", f"{NO_BREAK}%"),
        WIDTH,
        initial_indent=label,
        subsequent_indent=" " * len(label),
        break_on_hyphens=False,
    ).replace(NO_BREAK, " ")
