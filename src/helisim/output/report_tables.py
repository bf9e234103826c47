"""The tables of the reports; a number carries its place in `results.json`, and itself in full."""

from collections.abc import Mapping, Sequence
from typing import Any

from helisim.ident import Fit, Verification
from helisim.output import html
from helisim.output.html import Cell
from helisim.output.tables import HEADINGS, LEFT, cells, percent
from helisim.paper import jr700
from helisim.paper.errata import Erratum
from helisim.records.record import FlightRecord
from helisim.study.results import ComparisonTable, ParameterRow

_FLOWN = {
    "R_mr": "main_rotor.radius",
    "R_tr": "tail_rotor.radius",
    "c_mr": "main_rotor.chord",
    "rho": "air.density",
    "Omega_mr": "main_rotor.speed",
    "Omega_tr": "tail_rotor.speed",
}
"""Table 1 -> the parameter of the vehicle that flew."""


def airframe_table(record: FlightRecord | None) -> str:
    """Return Table 1 with what the vehicle of a record had."""
    flown = record.provenance.get("parameters", {}) if record is not None else {}
    rows = []
    for value in jr700.AIRFRAME:
        used = flown.get(_FLOWN.get(value.name, ""))
        rows.append(
            (
                Cell(value.name, "name"),
                Cell(value.unit, "unit"),
                Cell(f"{value.value:.6g}", value=value.value, key=f"paper.airframe.{value.name}"),
                Cell("-" if used is None else f"{used:.6g}"),
                Cell(value.source, "long"),
            )
        )
    headings = ("parameter", "unit", "paper", "flown", "source")
    return html.table(headings, rows, ("parameter", "unit", "source"))


def comparison_table(table: ComparisonTable) -> str:
    """Return a model's parameters beside truth and paper, and by what they are judged."""
    judged = "\n".join(line for row in table.parameters for line in _tolerances(row))
    return html.table(
        (*HEADINGS[:-1], "paper CR %", "verdict"),
        [_compared(table.name, row) for row in table.parameters],
        LEFT,
    ) + (html.folded("tolerances", judged) if judged else "")


def _compared(table: str, row: ParameterRow) -> list[Cell]:
    place = f"tables.{table}.{row.name}"
    name, unit, *texts, verdict = cells(row)
    columns = ("paper", "truth", "identified", "cr_percent", "insensitivity_percent")
    numbers = [
        Cell(text, key="" if value is None else f"{place}.{column}", value=value)
        for column, text in zip(columns, texts)
        for value in [getattr(row, column)]
    ]
    published = jr700.TABLES[table].get(row.name) if table in jr700.TABLES else None
    bound = None if published is None else published.cr_percent
    style = {"ok": "ok", "not judged": ""}.get(verdict, "off")
    return [
        Cell(name, "name"),
        Cell(unit, "unit"),
        *numbers,
        Cell(percent(bound), key=f"paper.{table}.{row.name}.cr_percent", value=bound),
        Cell(verdict, f"verdict {style}".strip(), key=f"{place}.verdict"),
    ]


def _tolerances(row: ParameterRow) -> list[str]:
    limits = (
        ("truth", row.tolerance_percent, row.tolerance_reason),
        ("paper", row.paper_tolerance_percent, row.paper_tolerance_reason),
    )
    return [
        f"{row.name}: within {limit:.3g} % of the {what} ({reason})"
        for what, limit, reason in limits
        if limit is not None
    ]


def verification_table(model: str, checked: Verification) -> str:
    """Return how well each output of a model was predicted."""
    rows = [
        (
            Cell(name, "name"),
            Cell(unit, "unit"),
            number(f"verification.{model}.{name}.j_rms", checked.j_rms_by_output[name]),
            number(f"verification.{model}.{name}.tic", checked.tic_by_output[name]),
        )
        for name, unit in zip(checked.outputs, checked.units)
    ]
    return html.table(("output", "unit", "J_rms", "TIC"), rows, ("output", "unit"))


def fit_table(fit: Fit) -> str:
    """Return the parameters of a fit with their bounds."""
    rows = [
        (
            Cell(one.name, "name"),
            Cell(one.unit, "unit"),
            Cell(f"{one.value:.4g}", key=f"parameters.{one.name}.value", value=one.value),
            Cell("-" if one.fixed else percent(one.cr_percent)),
            Cell("-" if one.fixed else percent(one.insensitivity_percent)),
            Cell(fit.verdict(one.name), "long"),
        )
        for one in fit.parameters.values()
    ]
    headings = ("parameter", "unit", "value", "CR %", "insens. %", "verdict")
    return html.table(headings, rows, ("parameter", "unit", "verdict"))


def errata_table(errata: Sequence[Erratum]) -> str:
    """Return the known errors of the paper, or nothing for none."""
    rows = [
        (
            Cell(item.title, "name long"),
            Cell(item.where, "long"),
            Cell(item.printed, "long"),
            Cell(f"{item.calculation}: {item.computed}", "long"),
            Cell(item.conclusion, "long"),
        )
        for item in errata
    ]
    headings = ("error", "where", "printed", "calculation", "conclusion")
    return html.table(headings, rows, headings) if rows else ""


def versions_table(versions: Mapping[str, Any]) -> str:
    """Return what computed the numbers."""
    rows = [(Cell(name, "name"), Cell(str(text))) for name, text in versions.items()]
    return html.table(("program", "version"), rows, ("program", "version"))


def number(key: str, value: float, *, digits: int = 3) -> Cell:
    """Return a cell of some significant digits."""
    return Cell(f"{value:.{digits}g}", key=key, value=value)
