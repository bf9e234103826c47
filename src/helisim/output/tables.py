"""Comparison tables as text of 80 columns, in colour on a terminal."""

import math
import os
import textwrap
from collections.abc import Mapping, Sequence
from typing import TextIO

from helisim.output.findings import render_further
from helisim.records.channels import IN1
from helisim.study.results import ComparisonTable, ParameterRow, Results, Verdict
from helisim.vehicle import Linearization, Vehicle

WIDTH = 80
HEADINGS = (
    "parameter",
    "unit",
    "paper",
    "truth",
    "identified",
    "CR %",
    "insens. %",
    "verdict",
)
LEFT = frozenset({"parameter", "unit", "verdict"})
_DIGITS = 4
"""Significant digits: bounds are of the order of a percent, so a fifth would say nothing."""
_ZERO_POLE = 1e-6
"""rad/s: smaller eigenvalues are position and heading, which nothing holds."""

_NO_BREAK = "\u00a0"
_RESET = "\x1b[0m"
_BOLD = "\x1b[1m"
_COLOURS: dict[Verdict, str] = {
    "ok": "\x1b[32m",
    "off truth": "\x1b[31m",
    "off paper": "\x1b[31m",
    "off both": "\x1b[31m",
    "not judged": "\x1b[2m",
}


def wants_color(stream: TextIO, environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether to colour text for a stream: on a terminal, unless NO_COLOR is set."""
    if environment.get("NO_COLOR") or environment.get("TERM") == "dumb":
        return False
    return stream.isatty()


def render_table(table: ComparisonTable, *, color: bool = False) -> str:
    """Return a table as lines of at most 80 columns, without a final line end."""
    rows = [cells(row) for row in table.parameters]
    widths = [max(map(len, column)) for column in zip(HEADINGS, *rows)]
    low, high = table.band_rad_s
    title = (
        f"{table.name}: from {table.input}, {low:.3g} to {high:.3g} rad/s, "
        f"average cost {table.cost:.3g}"
    )
    lines = [_paint(title, _BOLD, color), _line(HEADINGS, widths)]
    lines.append("-" * len(lines[-1]))
    for row, row_cells in zip(table.parameters, rows):
        text = _line(row_cells, widths)
        verdict = row_cells[-1]
        start = text.removesuffix(verdict)
        lines.append(start + _paint(verdict, _COLOURS[row.verdict], color))
    if table.given:
        lines.append(_given(table))
    return "\n".join(lines)


def _given(table: ComparisonTable) -> str:
    values = [
        f"{one.name} {one.value:.{_DIGITS}g} {one.unit} ({one.source})" for one in table.given
    ]
    text = textwrap.fill(
        "; ".join(value.replace(" ", _NO_BREAK) for value in values),
        WIDTH,
        initial_indent="given: ",
        subsequent_indent="       ",
    )
    return text.replace(_NO_BREAK, " ")


def render_results(results: Results, *, color: bool = False) -> str:
    """Return all tables, what else was found, what was left out, and what missed its tolerance."""
    blocks = [render_table(table, color=color) for table in results.tables]
    blocks += render_further(results.further)
    if results.excluded:
        blocks.append(_list("Left out:", results.excluded))
    if results.misses:
        heading = f"{len(results.misses)} missed:"
        blocks.append(_list(_paint(heading, _COLOURS["off truth"], color), results.misses))
    elif results.tables:
        blocks.append(_paint("All tolerances hold.", _COLOURS["ok"], color))
    return "\n\n".join(blocks)


def cells(row: ParameterRow) -> tuple[str, ...]:
    """Return a row as text, one cell a heading."""
    decimals = _decimals(row.paper, row.truth, row.identified)
    return (
        row.name,
        row.unit,
        _number(row.paper, decimals),
        _number(row.truth, decimals),
        _number(row.identified, decimals),
        percent(row.cr_percent),
        percent(row.insensitivity_percent),
        row.verdict,
    )


def _decimals(*values: float | None) -> int | None:
    """Return the decimals that give the largest value its digits; None asks for an exponent."""
    largest = max((abs(value) for value in values if value is not None), default=0.0)
    if largest == 0.0:
        return _DIGITS - 1
    exponent = math.floor(math.log10(largest))
    if not -4 <= exponent < 7:
        return None
    return max(_DIGITS - 1 - exponent, 0)


def _number(value: float | None, decimals: int | None) -> str:
    if value is None:
        return "-"
    if decimals is None:
        return f"{value:.{_DIGITS - 1}e}"
    return f"{value:.{decimals}f}"


def percent(value: float | None) -> str:
    """Return two significant digits, as is usual for an uncertainty."""
    if value is None:
        return "-"
    if not math.isfinite(value):
        return "inf"
    if value >= 1000.0:
        return f"{value:.0e}"
    if value < 1.0:
        return f"{value:.2g}"
    return f"{value:.0f}" if value >= 10.0 else f"{value:.1f}"


def _line(cells: tuple[str, ...], widths: list[int]) -> str:
    gap = "  " if sum(widths) + 2 * (len(widths) - 1) <= WIDTH else " "
    return gap.join(
        cell.ljust(width) if heading in LEFT else cell.rjust(width)
        for heading, cell, width in zip(HEADINGS, cells, widths)
    ).rstrip()


def _list(heading: str, sentences: tuple[str, ...]) -> str:
    items = [
        textwrap.fill(_keep_percent(item), WIDTH, initial_indent="- ", subsequent_indent="  ")
        for item in sentences
    ]
    return "\n".join([heading, *items]).replace(_NO_BREAK, " ")


def _keep_percent(text: str) -> str:
    """Return the text with each number tied to its percent sign."""
    return text.replace(" %", f"{_NO_BREAK}%")


def _paint(text: str, code: str, color: bool) -> str:
    return f"{code}{text}{_RESET}" if color else text


def render_derivatives(linear: Linearization, derivatives: Mapping[str, float]) -> str:
    """Return a hover, its derivatives and its eigenvalues as lines of at most 80 columns."""
    trim = linear.trim
    controls = {name: getattr(trim, name) for name in IN1}
    lines = [
        f"Hover: phi {_tidy(trim.phi, 5)} rad, theta {_tidy(trim.theta, 5)} rad",
        "  controls " + ", ".join(f"{name} {_tidy(x, 4)}" for name, x in controls.items()),
        "",
        "Derivatives of the base helicopter (SI, per unit of servo position)",
    ]
    lines += [f"  {name:<6} {value:12.6g}" for name, value in derivatives.items()]
    lines += ["", f"Eigenvalues of {linear.system.name}, rad/s"]
    for pole in sorted(linear.system.poles(), key=lambda pole: (abs(pole), pole.imag)):
        if abs(pole) > _ZERO_POLE and pole.imag >= 0.0:
            pair = f" +- {pole.imag:.5g}j" if pole.imag > _ZERO_POLE else ""
            lines.append(f"  {pole.real:.5g}{pair}")
    if linear.delays:
        waits = ", ".join(f"{name} {delay:.4g} s" for name, delay in linear.delays.items())
        lines += ["", "Delays before the inputs act, not in the matrices", f"  {waits}"]
    return "\n".join(lines)


def render_trims(flights: Sequence[Vehicle]) -> str:
    """Return level flights, a line for each speed, as lines of at most 80 columns."""
    headings = ("speed", "power", *IN1, "theta", "phi", "a", "b")
    units = ("m/s", "W", *("" for _ in IN1), *("deg" for _ in range(4)))
    lines = ["".join(f"{text:>8}" for text in row) for row in (headings, units)]
    lines.append("-" * len(lines[0]))
    for flight in flights:
        trim = flight.trim
        controls = [_tidy(getattr(trim, name), 4) for name in IN1]
        angles = [_tidy(math.degrees(x), 2) for x in (trim.theta, trim.phi, trim.a, trim.b)]
        row = (f"{trim.speed:g}", _tidy(flight.power, 1), *controls, *angles)
        lines.append("".join(f"{text:>8}" for text in row))
    least = min(flights, key=lambda flight: flight.power)
    lines += [
        "",
        f"Least power: {least.power:.1f} W at {least.trim.speed:g} m/s. Controls are those of "
        "swashplate and",
        "tail, unitised; a and b are the disc's tilt back and to the right of the mast.",
    ]
    return "\n".join(lines)


def _tidy(value: float, decimals: int) -> str:
    """Return a number without the sign of a zero."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"
