"""The tables that helisim shows, each made once: for terminal, page and recording."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import degrees
from typing import TYPE_CHECKING, Literal

from helisim.ident import Fit, FittedParameter
from helisim.ident.verifying.verification import VerificationFigures
from helisim.records.channels import IN1
from helisim.records.record import FlightRecord
from helisim.show.table import NO_BREAK, PERCENT, Cell, Column, Table, common_form, number, words
from helisim.study.paper import jr700

if TYPE_CHECKING:
    from helisim.sim.rigs import Finding, RigTest
    from helisim.study.comparison import ComparisonTable, GivenValue, ParameterRow
    from helisim.study.paper.eq8 import Coefficient, OverallCheck
    from helisim.study.paper.errata import Erratum
    from helisim.study.paper.gyro_effect import Change, GyroEffect, Statement
    from helisim.vehicle import Vehicle

_NAME = (Column("parameter", left=True), Column("unit", left=True))
_BOUNDS = (Column("CR %"), Column("insens. %"))
_UNCERTAINTY = ".2g"
"""Two digits of an uncertainty, as is usual."""

_FLOWN = {
    "R_mr": "main_rotor.radius",
    "R_tr": "tail_rotor.radius",
    "c_mr": "main_rotor.chord",
    "rho": "air.density",
    "Omega_mr": "main_rotor.speed",
    "Omega_tr": "tail_rotor.speed",
}
"""Table 1 -> the parameter of the vehicle that flew."""


def comparison(table: ComparisonTable) -> Table:
    """Return a model's parameters beside paper and truth, with support and agreement of each."""
    low, high = table.band_rad_s
    given = "; ".join(map(_given, table.given)) or "nothing"
    notes = {
        "given": given,
        "equivalent": table.truth_meaning if table.truth != "truth" else "",
    }
    return Table(
        table.name,
        (
            *_NAME,
            *(Column("paper"), Column(table.truth), Column("identified")),
            *(Column("CR %"), Column("insens. %", page_only=True)),
            Column("paper CR %", page_only=True),
            *(Column("support", left=True), Column("agreement", left=True)),
        ),
        tuple(_compared(table.name, row) for row in table.parameters),
        lead=f"from {table.input}, {low:.3g} to {high:.3g} rad/s, average cost {table.cost:.3g}",
        notes=tuple((label, text) for label, text in notes.items() if text),
    )


def _given(one: GivenValue) -> str:
    """Return a given value with its standard error and source, unbroken."""
    error = "" if one.standard_error is None else f" +- {one.standard_error:{_UNCERTAINTY}}"
    unit = "" if one.unit in ("", "1") else f" {one.unit}"
    value = f"{one.name} {one.value:.4g}{error}{unit}".replace(" ", NO_BREAK)
    return f"{value} ({one.source})"


def _compared(table: str, row: ParameterRow) -> tuple[Cell, ...]:
    place = f"tables.{table}.{row.name}"
    values = {"paper": row.paper, "truth": row.truth, "identified": row.identified}
    form = common_form(values.values())
    bounds = {
        "cr_percent": row.cr_percent,
        "insensitivity_percent": row.insensitivity_percent,
    }
    published = jr700.TABLES[table].get(row.name) if table in jr700.TABLES else None
    is_its = published is not None and published.value == row.paper  # of no other vehicle
    bound = published.cr_percent if published is not None and is_its else None
    style = {"agrees": " ok", "differs": " off"}.get(row.agreement, "")
    return (
        *_named(row.name, row.unit),
        *(number(x, form, unit=row.unit, key=f"{place}.{at}") for at, x in values.items()),
        *(number(x, PERCENT, unit="%", key=f"{place}.{at}") for at, x in bounds.items()),
        number(bound, PERCENT, unit="%", key=f"paper.{table}.{row.name}.cr_percent"),
        words(row.support or "-", key=f"{place}.support"),
        words(row.agreement, f"verdict{style}", key=f"{place}.agreement"),
    )


def _named(name: str, unit: str) -> tuple[Cell, Cell]:
    return words(name, "name"), words(unit, "unit")


def verification(found: Mapping[str, VerificationFigures]) -> Table:
    """Return how well each output of the models was predicted on flights that no fit has seen."""
    return Table(
        "Verified on flights that no fit has seen",
        (
            *(Column(name, left=True) for name in ("model", "output", "unit")),
            *(Column("J_rms"), Column("TIC")),
        ),
        tuple(
            (
                words(model, "name"),
                *_named(one.name, one.unit),
                number(
                    one.j_rms, ".3g", unit=one.unit, key=f"verification.{model}.{one.name}.j_rms"
                ),
                number(one.tic, ".3g", key=f"verification.{model}.{one.name}.tic"),
            )
            for model, figures in found.items()
            for one in figures.outputs
        ),
        notes=tuple(
            (model, str(figures.approach)) for model, figures in found.items() if figures.approach
        ),
    )


def gyro_changes(found: GyroEffect) -> Table:
    """Return the roll-pitch parameters before and after the gyro, the paper's and ours."""
    return Table(
        "Before and after the gyro: roll-pitch from IN1 and from IN2",
        (
            *_NAME,
            *(Column("paper IN1"), Column("IN2", label="paper IN2")),
            *(Column("ratio", label="paper ratio"), Column("found IN1")),
            *(Column("IN2", label="found IN2"), Column("ratio", label="found ratio")),
        ),
        tuple(_changed(one) for one in found.changes),
    )


def _changed(one: Change) -> tuple[Cell, ...]:
    columns = ("paper_before", "paper_after", "paper_ratio", "before", "after", "ratio")
    values = {column: getattr(one, column) for column in columns}
    forms = {
        "before": common_form((one.paper_before, one.before)),
        "after": common_form((one.paper_after, one.after)),
        "ratio": ".3f",
    }
    return (
        *_named(one.name, one.unit),
        *(
            number(
                value,
                forms[column.removeprefix("paper_")],
                unit="ratio" if "ratio" in column else one.unit,
                key=f"before_after.{one.name}.{column}",
            )
            for column, value in values.items()
        ),
    )


def gyro_statements(found: Sequence[Statement]) -> Table:
    """Return what the paper says of the gyro's effect, beside what is so."""
    return _sentences(
        [("said", "the paper says"), ("paper", "its table"), ("found", "identified")],
        [(f'"{one.said}"', one.paper, one.identified) for one in found],
        cards="-",
    )


def overall(found: OverallCheck) -> Table:
    """Return eq. (8) as printed, from the parts, and identified directly."""
    low, high = found.band_rad_s
    return Table(
        "Eq. (8) by eq. (5) from base, gyro and ground tests, beside the one identified",
        (
            *(Column("coefficient", left=True), Column("unit", left=True)),
            *(Column("paper"), Column("from parts"), Column("direct"), Column("difference %")),
        ),
        tuple(_coefficient(one) for one in found.coefficients),
        notes=(
            (
                "",
                f"Largest differences from {low:.3g} to {high:.3g} rad/s: {found.gain_db:+.2f} dB "
                f"at {found.gain_at_rad_s:.3g} rad/s, {found.phase_deg:+.1f} degrees at "
                f"{found.phase_at_rad_s:.3g} rad/s.",
            ),
        ),
    )


def _coefficient(one: Coefficient) -> tuple[Cell, ...]:
    place = f"eq_8.{one.name}"
    values = {"paper": one.paper, "parts": one.parts, "direct": one.direct}
    form = common_form(values.values(), digits=5)
    percent = f"{place}.difference_percent"
    return (
        *_named(one.name, one.unit),
        *(number(x, form, unit=one.unit, key=f"{place}.{at}") for at, x in values.items()),
        number(one.difference_percent, "+.2f", unit="%", key=percent),
    )


def rig(test: RigTest) -> Table:
    """Return what one ground test found, each value beside the truth."""
    return Table(
        test.rig,
        (
            *(Column("found", left=True), Column("unit", left=True)),
            *(Column("value"), Column("truth"), Column("error"), Column("std error")),
            *(Column("error %"), Column("how", left=True, page_only=True)),
        ),
        tuple(_found(test.rig, one) for one in test.findings),
        notes=tuple(("", f"{note[:1].upper()}{note[1:]}.") for note in test.notes),
    )


def _found(rig: str, one: Finding) -> tuple[Cell, ...]:
    place = f"ground.{rig}.{one.name}"
    unit = one.unit
    share = None
    if one.error is not None and one.truth is not None and abs(one.truth) > abs(one.error):
        share = 100.0 * one.error / one.truth  # an error beyond the truth is no percentage
    return (
        *_named(one.name, unit),
        number(one.value, ".5g", unit=unit, key=f"{place}.value"),
        number(one.truth, ".5g", unit=unit, key=f"{place}.truth"),
        number(one.error, _UNCERTAINTY, unit=unit, key=f"{place}.error"),
        number(one.standard_error, _UNCERTAINTY, unit=unit, key=f"{place}.standard_error"),
        number(share, ".2f", unit="%"),
        words(one.how, "long"),
    )


def airframe(record: FlightRecord | None) -> Table:
    """Return Table 1 with what the vehicle of a record had."""
    flown = record.provenance.get("parameters", {}) if record is not None else {}
    return Table(
        "Table 1",
        (*_NAME, Column("paper"), Column("flown"), Column("source", left=True)),
        tuple(
            (
                *_named(one.name, one.unit),
                number(one.value, ".6g", unit=one.unit, key=f"paper.airframe.{one.name}"),
                number(flown.get(_FLOWN.get(one.name, "")), ".6g", unit=one.unit),
                words(one.source, "long"),
            )
            for one in jr700.AIRFRAME
        ),
    )


def fitted(fit: Fit, parameters: Sequence[FittedParameter] | None = None) -> Table:
    """Return the parameters of a fit with their bounds and support, or the same in other units."""
    return Table(
        fit.structure.name,
        (*_NAME, Column("value"), *_BOUNDS, Column("support", left=True)),
        tuple(
            (
                *_named(one.name, one.unit),
                number(one.value, unit=one.unit, key=f"parameters.{one.name}.value"),
                number(None if one.fixed else one.cr_percent, PERCENT, unit="%"),
                number(None if one.fixed else one.insensitivity_percent, PERCENT, unit="%"),
                words(fit.support(one.name), "long"),
            )
            for one in parameters or fit.parameters.values()
        ),
    )


def responses(fit: Fit) -> Table:
    """Return each response of a fit: where it was used, its cost, and how well it is known."""
    return Table(
        "Responses",
        (
            Column("response", left=True),
            *(Column("from", unit="rad/s"), Column("to", unit="rad/s"), Column("J")),
            *(Column("coherence"), Column("error", unit="%", label="mean random error")),
            *(Column("left", unit="dB"), Column("left", unit="deg", label="left, phase")),
        ),
        tuple(_response(fit, name) for name in fit.costs),
        notes=(("left", "what the model leaves beyond noise, rms"),) if fit.misfit else (),
    )


def _response(fit: Fit, name: str) -> tuple[Cell, ...]:
    low, high = fit.bands[name]
    pair = fit.data.index(*name.split("/", 1))
    inside = (fit.data.frequency >= low) & (fit.data.frequency <= high)
    inside &= fit.data.usable()[pair]
    left = fit.misfit
    return (
        words(name, "name"),
        *(number(edge, ".3g", unit="rad/s") for edge in (low, high)),
        number(fit.costs[name], ".3g", key=f"costs.{name}"),
        number(float(fit.data.coherence[pair][inside].mean()), ".3f"),
        number(100.0 * float(fit.data.random_error[pair][inside].mean()), _UNCERTAINTY, unit="%"),
        number(left.magnitude[name] if left else None, _UNCERTAINTY, unit="dB"),
        number(left.phase[name] if left else None, _UNCERTAINTY, unit="deg"),
    )


def errata(found: Sequence[Erratum]) -> Table:
    """Return the known errors of the paper, each with its calculation."""
    return _sentences(
        [("", "error"), ("printed", ""), ("calculated", ""), ("so", "result"), ("", "conclusion")],
        [
            (
                f"{one.title} ({one.where})",
                one.printed,
                one.calculation,
                one.computed,
                one.conclusion,
            )
            for one in found
        ],
        cards="1.",
    )


def _sentences(
    columns: Sequence[tuple[str, str]],
    rows: Iterable[tuple[str, ...]],
    *,
    cards: Literal["-", "1."],
) -> Table:
    """Return a table of sentences: headings and labels of the columns, the first naming a row."""
    return Table(
        "",
        tuple(Column(heading, left=True, label=label) for heading, label in columns),
        tuple(
            (words(first, "name long"), *(words(one, "long") for one in rest))
            for first, *rest in rows
        ),
        cards=cards,
    )


def trims(flights: Sequence[Vehicle]) -> Table:
    """Return level flights, a row for each speed; with the throttle where there is one."""
    driven = any(flight.trim.throttle for flight in flights)
    return Table(
        "",
        (
            *(Column("speed", unit="m/s"), Column("power", unit="W")),
            *(Column(name) for name in IN1),
            *(Column(name, unit="deg") for name in ("theta", "phi", "a", "b")),
            *[Column("throttle")] * driven,
        ),
        tuple(
            (
                number(flight.trim.speed, "g", unit="m/s"),
                number(flight.power, ".1f", unit="W"),
                *(number(getattr(flight.trim, name), ".4f") for name in IN1),
                *(
                    number(degrees(getattr(flight.trim, name)), ".2f", unit="deg")
                    for name in ("theta", "phi", "a", "b")
                ),
                *[number(flight.trim.throttle, ".3f")] * driven,
            )
            for flight in flights
        ),
    )


def versions(found: Mapping[str, str]) -> Table:
    """Return what computed the numbers."""
    return Table(
        "Versions",
        (Column("program", left=True), Column("version", left=True)),
        tuple((words(name, "name"), words(text)) for name, text in found.items()),
    )
