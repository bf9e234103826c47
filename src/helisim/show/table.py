"""One table for terminal, page and recording: numbers with their formats, not yet text.

`Table.texts` formats every number once; `as_text`, `as_markdown` and `page.table` lay it out.
"""

import math
import re
import textwrap
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

WIDTH = 80
"""Columns of a terminal."""

PERCENT = "percent"
"""The format of an uncertainty in percent: two significant digits."""

_ROUNDING = 1e-9
"""A number below this share of the largest of its unit in the table prints as 0: nothing measured
or identified here is known to a billionth, and the rounding error of a zero is smaller."""

NO_BREAK = "\u00a0"
RESET = "\x1b[0m"
BOLD, RED, GREEN, FAINT = "\x1b[1m", "\x1b[31m", "\x1b[32m", "\x1b[2m"
_COLUMN = re.compile(r"(.*?)(<)?(\*)?(?: \[(.*?)\])?(?:=(.*))?")
_COLOURS = {"verdict": FAINT, "ok": GREEN, "off": RED}
"""Style of a cell -> its colour on a terminal."""


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes:
        heading: on a terminal; "" for none.
        left: True aligns words to the left; numbers stand on the right.
        unit: of the numbers; "" where each row has its own.
        label: heading on a page, where there is room for more words; `heading` if "".
        page_only: True leaves the column out on a terminal, which has no room for it.
    """

    heading: str
    left: bool = False
    unit: str = ""
    label: str = ""
    page_only: bool = False

    @property
    def page_heading(self) -> str:
        """The heading on a page, with the unit."""
        return (self.label or self.heading) + (f", {self.unit}" if self.unit else "")


@dataclass(frozen=True)
class Cell:
    """One cell: words, or a number and how it is written.

    Attributes:
        text: of words; what stands for a number that there is not.
        value: the number in full; None for words.
        form: of the number: a format specification such as ".4g", or `PERCENT`.
        unit: of the number; those of one unit in a table have one scale.
        style: words such as "name", "long", "verdict", "ok", "off".
        key: where the number stands in the results, such as "tables.heave.Z_w.truth".
    """

    text: str = ""
    value: float | None = None
    form: str = ".4g"
    unit: str = ""
    style: str = ""
    key: str = ""


def columns(notation: str) -> tuple[Column, ...]:
    """Return columns as they are written in short, "parameter<|value|from [rad/s]=lowest|how<*".

    A heading, then "<" for words on the left, "*" for a page only, a unit in brackets, and after
    "=" the heading of a page.
    """
    found = []
    for one in notation.split("|"):
        heading, left, page, unit, label = _COLUMN.fullmatch(one).groups()  # type: ignore[union-attr]
        found.append(Column(heading, bool(left), unit or "", label or "", bool(page)))
    return tuple(found)


def words(text: str, style: str = "", *, key: str = "") -> Cell:
    """Return a cell of words."""
    return Cell(text, style=style, key=key)


def number(value: float | None, form: str = ".4g", *, unit: str = "", key: str = "") -> Cell:
    """Return a cell of a number, "-" where there is none."""
    return Cell("-") if value is None else Cell("", float(value), form, unit, key=key)


@dataclass(frozen=True)
class Table:
    """Rows of numbers and words under headings.

    Attributes:
        title: what it shows.
        columns: from left to right.
        rows: of as many cells as there are columns.
        lead: a few words beside the title.
        notes: below the table: a label, which may be "", and a text each.
        cards: of rows whose words are too long for columns of a terminal: what its lines are
            listed by there, dashes or numbers; "" for columns.
    """

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    lead: str = ""
    notes: tuple[tuple[str, str], ...] = ()
    cards: Literal["", "-", "1."] = ""

    @property
    def texts(self) -> tuple[tuple[str, ...], ...]:
        """Every cell as it is shown, (rows, columns)."""
        scales: dict[str, float] = {}
        for row in self.rows:
            for cell in row:
                if cell.value is not None and math.isfinite(cell.value):
                    scales[cell.unit] = max(scales.get(cell.unit, 0.0), abs(cell.value))
        return tuple(
            tuple(
                cell.text
                if cell.value is None
                else formatted(cell.value, cell.form, scale=scales.get(cell.unit, 0.0))
                for cell in row
            )
            for row in self.rows
        )


def formatted(value: float, form: str, *, scale: float = 0.0) -> str:
    """Return a number as text: never a negative zero, nor what rounding left of a zero.

    Args:
        value: the number.
        form: a format specification, or `PERCENT`.
        scale: the largest number that it stands beside.
    """
    if not math.isfinite(value):
        return str(value)
    if abs(value) <= _ROUNDING * scale:
        value = 0.0
    if form == PERCENT:
        size = abs(value)
        sizes = ((1000.0, ".0e"), (10.0, ".0f"), (1.0, ".1f"), (0.0, ".2g"))
        form = next(form for least, form in sizes if size >= least)
    text = format(value, form)
    return text.lstrip("+-") if float(text) == 0.0 else text


def common_form(values: Iterable[float | None], digits: int = 4) -> str:
    """Return the format that gives the largest of some numbers its digits, and all its decimals."""
    largest = max(
        (abs(value) for value in values if value is not None and math.isfinite(value)), default=0.0
    )
    exponent = 0 if largest == 0.0 else math.floor(math.log10(largest))
    if not -4 <= exponent < 7:
        return f".{digits - 1}e"
    return f".{max(digits - 1 - exponent, 0)}f"


def interval_form(width: float, usual: str = ".3g") -> str:
    """Return the format that gives an interval's width two digits; the usual one of no width."""
    if not (math.isfinite(width) and width > 0.0):
        return usual
    return f".{min(max(1 - math.floor(math.log10(width)), 0), 6)}f"


def as_text(table: Table, *, color: bool = False) -> str:
    """Return a table as lines of a terminal, of at most 80 columns, without a final line end."""
    title = f"{table.title}: {table.lead}" if table.lead else table.title
    lines = [paint(title, BOLD, color)] if title else []
    lines += _cards(table) if table.cards else _columns(table, color)
    lines += [filled(text, f"{label}: " if label else "") for label, text in table.notes]
    return "\n".join(lines)


def as_markdown(table: Table) -> str:
    """Return the rows of a table in Markdown."""
    shown = [k for k, column in enumerate(table.columns) if not column.page_only]
    columns = [table.columns[k] for k in shown]
    lines = [
        [column.page_heading for column in columns],
        ["---" if column.left else "---:" for column in columns],
        *([texts[k] for k in shown] for texts in table.texts),
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def filled(text: str, label: str = "") -> str:
    """Return a text wrapped to a terminal behind a label, no number cut from its percent sign."""
    wrapped = textwrap.fill(
        text.replace(" %", f"{NO_BREAK}%"),
        WIDTH,
        initial_indent=label,
        subsequent_indent=" " * len(label),
        break_on_hyphens=False,
    )
    return wrapped.replace(NO_BREAK, " ")


def paint(text: str, code: str, color: bool) -> str:
    """Return a text in a colour of the terminal, if there shall be one."""
    return f"{code}{text}{RESET}" if color else text


def _columns(table: Table, color: bool) -> list[str]:
    shown = [k for k, column in enumerate(table.columns) if not column.page_only]
    columns = [table.columns[k] for k in shown]
    heads = [[column.heading for column in columns]]
    if any(column.unit for column in columns):
        heads.append([column.unit for column in columns])
    rows = [[texts[k] for k in shown] for texts in table.texts]
    widths = [max(map(len, column)) for column in zip(*heads, *rows)]
    gap = "  " if sum(widths) + 2 * (len(widths) - 1) <= WIDTH else " "

    def line(texts: list[str], codes: list[str]) -> str:
        cells = [
            text.ljust(width) if column.left else text.rjust(width)
            for text, column, width in zip(texts, columns, widths)
        ]
        cells[-1] = cells[-1].rstrip()
        return gap.join(
            cell.replace(text, paint(text, code, color)) if code and text else cell
            for cell, text, code in zip(cells, texts, codes)
        ).rstrip()

    plain = [""] * len(columns)
    lines = [line(head, plain) for head in heads]
    lines.append("-" * max(map(len, lines)))
    for row, texts in zip(table.rows, rows):
        styles = ((_COLOURS.get(word, "") for word in row[k].style.split()) for k in shown)
        lines.append(line(texts, [next(filter(None, reversed([*one])), "") for one in styles]))
    return lines


def _cards(table: Table) -> list[str]:
    width = max(len(column.heading) for column in table.columns) + 2
    lines = []
    for count, texts in enumerate(table.texts, 1):
        mark = f"{count}. " if table.cards == "1." else "- "
        indent = " " * (3 if table.cards == "1." else 2)
        if count > 1 and table.cards == "1.":
            lines.append("")
        for k, (column, text) in enumerate(zip(table.columns, texts)):
            label = f"{column.heading}:".ljust(width) if column.heading else ""
            lines.append(filled(text, (indent if k else mark) + label))
    return lines
