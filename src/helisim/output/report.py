"""Reports: one self-contained HTML page for a whole experiment, or for a model of anyone's log.

Made from files or value objects alone; nothing is computed here. Every number of a table
carries its place in `results.json`.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from helisim.comparison import ParameterRow
from helisim.errata import Erratum
from helisim.errors import StorageError
from helisim.ident import Fit, Verification
from helisim.output import html
from helisim.output.drawings import bode_drawings, run_drawings, verification_drawings
from helisim.output.evidence import Evidence
from helisim.output.html import Cell
from helisim.output.plots import Drawing, draw_flight
from helisim.output.run import Run, read_run
from helisim.output.tables import HEADINGS, LEFT, cells, percent
from helisim.record import FlightRecord
from helisim.reference import jr700
from helisim.storage import atomic_write

FIGURES = "figures"
REPORT = "report.html"

_IN_PAPER = {
    "yaw_base": ("Table 2, yaw, base helicopter", "Figure 4"),
    "yaw_gyro": ("Table 2, yaw, gyro", ""),
    "yaw_overall": ("Table 2 and eq. (8), yaw, helicopter with gyro", "Figure 3"),
    "rollpitch_in1": ("Table 3, roll and pitch, base helicopter", "Figure 6"),
    "rollpitch_in2": ("Table 3, roll and pitch, helicopter with gyro", "Figure 5"),
    "heave": ("Table 4, heave", ""),
}
"""Model -> its table and its figure in the paper."""

_FLOWN = {
    "R_mr": "main_rotor.radius",
    "R_tr": "tail_rotor.radius",
    "c_mr": "main_rotor.chord",
    "rho": "air.density",
    "Omega_mr": "main_rotor.speed",
    "Omega_tr": "tail_rotor.speed",
}
"""Table 1 -> the parameter of the vehicle that flew."""


def write_report(folder: str | Path, *, errata: Sequence[Erratum] = ()) -> Path:
    """Write FOLDER/report.html and FOLDER/figures from the other files in the folder.

    Each file appears complete or not at all.

    Args:
        folder: that `helisim reproduce` wrote.
        errata: the known errors of the paper.

    Returns:
        The path of the report.

    Raises:
        StorageError: a file can't be read or written.
        InputError: a file holds something else.
    """
    folder = Path(folder)
    run = read_run(folder)
    drawings = run_drawings(run)
    try:
        (folder / FIGURES).mkdir(exist_ok=True)
    except OSError as error:
        raise StorageError(f"can't make {folder / FIGURES}: {error.strerror}") from None
    for group in drawings.values():
        for drawing in group:
            drawing.write(folder / FIGURES)
    text = render_run(run, drawings, errata=errata)
    with atomic_write(folder / REPORT) as path:
        path.write_text(text, encoding="utf-8")
    return folder / REPORT


def write_fit_report(
    path: str | Path,
    fit: Fit,
    *,
    records: Mapping[str, FlightRecord] | None = None,
    verification: Verification | None = None,
) -> Path:
    """Write a report of one identified model, from anyone's records, and return its path.

    Args:
        path: of the HTML file.
        fit: the model.
        records: by name; their inputs and outputs are shown.
        verification: of flights that the fit has not seen.

    Raises StorageError.
    """
    item = Evidence(fit.structure.name, fit, verification=verification)
    signals = (*fit.structure.inputs, *fit.structure.outputs)
    flights = [
        draw_flight(f"flight_{k}", name, record, signals)
        for k, (name, record) in enumerate((records or {}).items())
    ]
    low, high = fit.band
    lead = (
        f"{'; '.join(item.fit.data.pairs)} from {len(fit.data.sources)} record(s), "
        f"{low:.3g} to {high:.3g} rad/s, {fit.method} method; average cost {fit.cost:.3g}."
    )
    sections = [
        ("parameters", "Parameters", _fit_table(fit)),
        ("bode", "Frequency responses", html.figures(bode_drawings(item))),
        ("time", "Verification in the time domain", _verified(item)),
        ("flights", "Records", html.figures(flights)),
        ("omitted", "What was left out, and warnings", html.bullets(_omitted(item))),
        ("provenance", "Provenance", html.folded("the fit", _json(fit.provenance))),
    ]
    text = html.page(f"Identified model: {fit.structure.name}", sections, html.paragraph(lead))
    path = Path(path)
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


# The page of a run


def render_run(
    run: Run, drawings: Mapping[str, Sequence[Drawing]], *, errata: Sequence[Erratum] = ()
) -> str:
    """Return the report of a run as HTML."""
    results = run.results
    sections = [
        ("experiment", "The experiment", _experiment(run)),
        ("airframe", "Table 1, the helicopter", _airframe(run)),
        ("tables", "Tables 2 to 4, the models", "\n".join(_results_tables(run))),
        ("bode", "Frequency responses", _bode_section(run, drawings)),
        ("time", "Verification in the time domain", _time_section(run, drawings)),
        ("sweeps", "The sweeps", _sweep_section(drawings.get("sweeps", ()))),
        ("omitted", "What was left out, and why", _omitted_section(run)),
        ("errata", "Errors in the paper", _errata(errata)),
        ("provenance", "Provenance", _provenance(results)),
    ]
    return html.page("The JR700 swept, identified and compared", sections, _summary(results))


def _summary(results: Mapping[str, Any]) -> str:
    rows = [row for table in results["tables"] for row in table["parameters"]]
    judged = [row for row in rows if row["verdict"] != "not judged"]
    good = sum(row["verdict"] == "ok" for row in judged)
    text = (
        f"{len(rows)} parameters of {len(results['tables'])} models, identified from flight "
        f"records alone. {good} of the {len(judged)} that are judged are within their tolerances."
    )
    return html.paragraph(text, "lead") + html.bullets(results.get("misses", []))


def _experiment(run: Run) -> str:
    given = run.results["configuration"]
    recorder = given["recorder"]
    flights = next(iter(run.sweeps.values()), None)
    flown = flights.provenance.get("excitation", {}) if flights is not None else {}
    length = f"of {flown['duration']:g} s " if "duration" in flown else ""
    changed = given["parameters"]
    text = (
        "A nonlinear JR700 of 8.01 kg with a three-axis gyro was flown in MuJoCo, with a time "
        f"step of {1e3 * given['timestep_s']:g} ms, by a pilot who holds the hover and sweeps one "
        f"stick at a time: {given['flown_each_axis']} flights {length}on each of the four axes, "
        f"of which the {given['flights_kept_each_axis']} most coherent were kept. A flight "
        f"computer recorded sticks (IN2), servo signals (from which IN1 is recomputed) and motion "
        f"(OUT) at {recorder['rate_hz']:g} Hz behind a {recorder['antialias_hz']:g} Hz "
        "anti-alias filter, with latency, noise and resolution by channel. From these records "
        "alone the frequency responses were estimated by the method of Tischler and Remple "
        "(CIFER), and the paper's models were fitted to them. The truth beside them is the exact "
        "linearisation of the nonlinear model that flew; the paper is Wu and Chen, System "
        "identifications of three-axis gyro model and base model of a RC helicopter without "
        "stabilizer bar."
    )
    other = (
        "Another truth than the paper's was flown, so the paper is printed and not judged by: "
        + ", ".join(f"{name} = {value:g}" for name, value in changed.items())
        + "."
    )
    return html.paragraph(text) + (html.paragraph(other) if changed else "")


def _airframe(run: Run) -> str:
    record = next(iter(run.sweeps.values()), None)
    flown = record.provenance.get("parameters", {}) if record is not None else {}
    rows = []
    for value in jr700.AIRFRAME:
        used = flown.get(_FLOWN.get(value.name, ""))
        rows.append(
            (
                Cell(value.name, "name"),
                Cell(value.unit),
                Cell(f"{value.value:.6g}", value=value.value, key=f"paper.airframe.{value.name}"),
                Cell("-" if used is None else f"{used:.6g}"),
                Cell(value.source, "long"),
            )
        )
    headings = ("parameter", "unit", "paper", "flown", "source")
    return html.table(headings, rows, ("parameter", "unit", "source"))


def _results_tables(run: Run) -> list[str]:
    order = [*_IN_PAPER, *(table.name for table in run.tables)]
    tables = sorted(run.tables, key=lambda table: order.index(table.name))
    parts = [
        html.paragraph(
            "CR is the Cramér-Rao bound and insens. the insensitivity, percent of the identified "
            "value, by the conventions of CIFER; the paper's own bounds stand beside. Below 20 % "
            "and 10 % a parameter counts as well identified.",
            "note",
        )
    ]
    for table in tables:
        low, high = table.band_rad_s
        name = _IN_PAPER.get(table.name, ("",))[0]
        parts += [
            html.heading(f"{name} ({table.name})" if name else table.name),
            html.paragraph(
                f"From {table.input}, {low:.3g} to {high:.3g} rad/s, average cost {table.cost:.3g}."
            ),
            html.table(
                (*HEADINGS[:-1], "paper CR %", "verdict"),
                [_row(table.name, row) for row in table.parameters],
                LEFT,
            ),
        ]
    return parts


def _row(table: str, row: ParameterRow) -> list[Cell]:
    *shown, verdict = cells(row)
    keys = ("", "", "paper", "truth", "identified", "cr_percent", "insensitivity_percent")
    values = (
        None,
        None,
        row.paper,
        row.truth,
        row.identified,
        row.cr_percent,
        row.insensitivity_percent,
    )
    made = [
        Cell(
            text,
            style="name" if k == 0 else "",
            key=f"tables.{table}.{row.name}.{key}" if key and value is not None else "",
            value=value,
        )
        for k, (text, key, value) in enumerate(zip(shown, keys, values))
    ]
    published = jr700.TABLES[table].get(row.name) if table in jr700.TABLES else None
    bound = None if published is None else published.cr_percent
    made.append(Cell(percent(bound), key=f"paper.{table}.{row.name}.cr_percent", value=bound))
    style = {"ok": "ok", "not judged": ""}.get(verdict, "off")
    made.append(Cell(verdict, style, key=f"tables.{table}.{row.name}.verdict"))
    return made


def _bode_section(run: Run, drawings: Mapping[str, Sequence[Drawing]]) -> str:
    blocks = []
    lead = html.paragraph(
        "Dots: estimated from the flights, hollow where the coherence is below 0.6, in a band "
        "of one random error. Solid: the identified model. Dashed: the truth. Grey ground: "
        "not used by the fit.",
        "note",
    )
    for item in run.evidence:
        table, figure = _IN_PAPER.get(item.name, ("", ""))
        meaning = table.split(", ", 1)[-1]
        title = item.name if meaning in ("", item.name) else f"{item.name}: {meaning}"
        shown = drawings.get(item.name, ())
        block = (
            html.heading(f"{title} (the paper's {figure})" if figure else title)
            + html.paragraph(item.note, "note")
            + html.figures(shown)
        )
        blocks.append((block, len(shown) > 1))
    return "\n".join([lead, html.side_by_side(blocks)]) if blocks else ""


def _time_section(run: Run, drawings: Mapping[str, Sequence[Drawing]]) -> str:
    parts = []
    for item in run.evidence:
        if item.verification is not None:
            parts.append(html.heading(item.name))
            parts.append(_verification_table(item))
            parts.append(html.figures(drawings.get(f"time {item.name}", ())))
    if not parts:
        return ""
    lead = (
        "The paper's Figures 7 and 8: flights that no fit has seen, predicted by the identified "
        "models; only bias, trim and initial state are estimated. Theil's coefficient (TIC) is 0 "
        "for a perfect and 1 for a useless prediction; up to 0.25 is good."
    )
    return "\n".join([html.paragraph(lead), *parts])


def _verified(item: Evidence) -> str:
    if item.verification is None:
        return ""
    return _verification_table(item) + html.figures(verification_drawings(item))


def _verification_table(item: Evidence) -> str:
    checked = item.verification
    if checked is None:
        return ""
    rows = [
        (
            Cell(name, "name"),
            Cell(unit),
            _number(f"verification.{item.name}.{name}.j_rms", checked.j_rms_by_output[name]),
            _number(f"verification.{item.name}.{name}.tic", checked.tic_by_output[name]),
        )
        for name, unit in zip(checked.outputs, checked.units)
    ]
    return html.table(("output", "unit", "J_rms", "TIC"), rows, ("output", "unit"))


def _number(key: str, value: float) -> Cell:
    return Cell(f"{value:.3g}", key=key, value=value)


def _sweep_section(drawings: Sequence[Drawing]) -> str:
    if not drawings:
        return ""
    lead = (
        "One kept sweep of each axis: the stick, what the swashplate or the tail rotor does, "
        "and the motion."
    )
    return html.paragraph(lead) + html.figures(drawings)


def _omitted_section(run: Run) -> str:
    sentences = list(run.results.get("excluded", []))
    for item in run.evidence:
        sentences += [f"{item.name}: {sentence}" for sentence in _omitted(item)]
    return html.bullets(sentences) or html.paragraph("Nothing was left out.")


def _omitted(item: Evidence) -> list[str]:
    fit = item.fit
    return [
        *(f"{name} has too few coherent points and is not in the fit" for name in fit.dropped),
        *fit.data.flags,
        *(f"{name} ended at a bound" for name in fit.at_bound),
        *([] if fit.converged else ["the search ended before it converged"]),
    ]


def _errata(errata: Sequence[Erratum]) -> str:
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


def _provenance(results: Mapping[str, Any]) -> str:
    rows = [(Cell(name, "name"), Cell(text)) for name, text in results["versions"].items()]
    further = {
        name: item
        for name, item in results.items()
        if name not in ("tables", "versions", "configuration", "excluded", "misses", "errata")
    }
    return (
        html.paragraph(f"Seed {results['seed']}. The same seed and versions give the same numbers.")
        + html.table(("program", "version"), rows, ("program", "version"))
        + html.folded("configuration", _json(results["configuration"]))
        + html.folded("further results", _json(further))
    )


# One fit


def _fit_table(fit: Fit) -> str:
    rows = [
        (
            Cell(one.name, "name"),
            Cell(one.unit),
            Cell(f"{one.value:.4g}", key=f"parameters.{one.name}.value", value=one.value),
            Cell("-" if one.fixed else percent(one.cr_percent)),
            Cell("-" if one.fixed else percent(one.insensitivity_percent)),
            Cell(fit.verdict(one.name), "long"),
        )
        for one in fit.parameters.values()
    ]
    headings = ("parameter", "unit", "value", "CR %", "insens. %", "verdict")
    return html.table(headings, rows, ("parameter", "unit", "verdict"))


def _json(data: Any) -> str:
    return json.dumps(data, indent=2, ensure_ascii=False, default=str)
