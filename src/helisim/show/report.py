"""The report of a run: one self-contained HTML page, from the run's files alone.

Nothing is computed here. Every number of a table carries its place in `results.json`.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from helisim.base.files import atomic_write, make_folder
from helisim.ident import USABLE_COHERENCE, Fit
from helisim.ident.fitting.verdicts import meanings
from helisim.ident.model.paths import connected
from helisim.show import html, tables
from helisim.show.correlation import correlation_map
from helisim.show.drawings import run_drawings
from helisim.show.svg import Drawing
from helisim.show.table import Table
from helisim.sim.rigs import RigTest
from helisim.study.comparison import ComparisonTable, ParameterRow
from helisim.study.paper.eq8 import OverallCheck
from helisim.study.paper.errata import Erratum, errata
from helisim.study.paper.gyro_effect import GyroEffect
from helisim.study.results import Results
from helisim.study.run import Run, read_run
from helisim.vehicle.folder import model_folder, vehicle_names

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


def write_report(folder: str | Path, run: Run | None = None) -> Path:
    """Write FOLDER/report.html and FOLDER/figures from the other files in the folder.

    Each file appears complete or not at all.

    Args:
        folder: that `helisim reproduce` wrote.
        run: what is in the folder; read if None.

    Returns:
        The path of the report.

    Raises:
        StorageError: a file can't be read or written.
        InputError: a file holds something else.
    """
    folder = Path(folder)
    run = run or read_run(folder)
    drawings = run_drawings(run)
    make_folder(folder / FIGURES)
    for group in drawings.values():
        for drawing in group:
            drawing.write(folder / FIGURES)
    text = render_run(run, drawings, errata=errata())
    with atomic_write(folder / REPORT) as path:
        path.write_text(text, encoding="utf-8")
    return folder / REPORT


def render_run(
    run: Run, drawings: Mapping[str, Sequence[Drawing]], *, errata: Sequence[Erratum] = ()
) -> str:
    """Return the report of a run as HTML."""
    results = run.results
    sections = [
        ("experiment", "The experiment", _experiment(run)),
        ("airframe", "Table 1, the helicopter", _airframe(run)),
        ("ground", "On the ground", _ground(results.ground)),
        ("tables", "Tables 2 to 4, the models", _results_tables(run)),
        ("gyro", "Before and after the gyro", _gyro(results.gyro_effect)),
        ("overall", "Eq. (8), the parts against the whole", _overall(results.eq_8)),
        ("bode", "Frequency responses", _bode_section(run, drawings)),
        ("quality", "Costs and correlations", _quality_section(run)),
        ("time", "Verification in the time domain", _time_section(run, drawings)),
        ("sweeps", "The sweeps", _sweep_section(drawings.get("sweeps", ()))),
        ("omitted", "What was left out, and why", _omitted_section(run)),
        ("errata", "Errors in the paper", html.table(tables.errata(errata))),
        ("provenance", "Provenance", _provenance(results)),
    ]
    return html.page("The JR700 swept, identified and compared", sections, _summary(results))


def _summary(results: Results) -> str:
    rows = [row for table in results.tables for row in table.parameters]
    judged = [row for row in rows if row.agreement != "not judged"]
    good = sum(row.agreement == "agrees" for row in judged)
    known = sum(row.support == "good" for row in rows)
    text = (
        f"{len(rows)} parameters of {len(results.tables)} models, identified from flight "
        f"records alone. {good} of the {len(judged)} that are judged agree with truth and paper "
        f"within their tolerances; the data support {known} of all well."
    )
    return html.paragraph(text, "lead") + html.bullets(results.misses)


def _experiment(run: Run) -> str:
    given = run.configuration
    flights = next(iter(run.sweeps.values()), None)
    flown = flights.provenance.get("excitation", {}) if flights is not None else {}
    length = f"of {flown['duration']:g} s " if "duration" in flown else ""
    text = (
        "A nonlinear JR700 of 8.01 kg with a three-axis gyro was flown in MuJoCo, with a time "
        f"step of {1e3 * given.timestep_s:g} ms, by a pilot who holds the hover and sweeps one "
        f"stick at a time: {given.flown_each_axis} flights {length}on each of the four axes, "
        f"of which the {given.flights_kept_each_axis} most coherent were kept. A flight "
        f"computer recorded sticks (IN2), servo signals (from which IN1 is recomputed) and motion "
        f"(OUT) at {given.recorder.rate_hz:g} Hz behind a {given.recorder.antialias_hz:g} Hz "
        "anti-alias filter, with latency, noise and resolution by channel. From these records "
        "alone the frequency responses were estimated by the method of Tischler and Remple "
        "(CIFER), and the paper's models were fitted to them. The truth beside them is the exact "
        "linearisation of the nonlinear model that flew; the paper is Wu and Chen, System "
        "identifications of three-axis gyro model and base model of a RC helicopter without "
        "stabilizer bar."
    )
    other = (
        "Another truth than the paper's was flown, so the paper is printed and not judged by: "
        + ", ".join(f"{name} = {value:g}" for name, value in given.parameters.items())
        + "."
    )
    return html.paragraph(text) + (html.paragraph(other) if given.parameters else "")


def _airframe(run: Run) -> str:
    record = next(iter(run.sweeps.values()), None)
    vehicle = record.provenance.get("vehicle", "") if record is not None else ""
    if vehicle not in vehicle_names():
        return html.table(tables.airframe(record))
    picture = model_folder(vehicle) / f"{vehicle}.png"
    shown = (
        ""
        if not picture.is_file()
        else html.photograph(
            picture.read_bytes(), f"The {vehicle} model", "The model, rendered by MuJoCo."
        )
    )
    return html.side_by_side([(shown, 2), (html.table(tables.airframe(record)), 2)])


def _ground(tests: Mapping[str, RigTest]) -> str:
    return "\n".join(_block(tables.rig(test)) for test in tests.values())


def _block(table: Table) -> str:
    """Return a table under its title, with its notes."""
    return "\n".join([html.heading(table.title), html.table(table), *_notes(table)])


def _notes(table: Table) -> list[str]:
    return [
        html.paragraph(f"{label[:1].upper()}{label[1:]}: {text}." if label else text, "note")
        for label, text in table.notes
    ]


def _gyro(found: GyroEffect | None) -> str:
    if found is None:
        return ""
    lead = (
        "The same structure from the servos (IN1: the base helicopter) and from the sticks "
        "(IN2: the helicopter with its gyro)."
    )
    shown = (tables.gyro_changes(found), tables.gyro_statements(found.statements))
    return html.paragraph(lead, "note") + "\n".join(map(html.table, shown))


def _overall(found: OverallCheck | None) -> str:
    return "" if found is None else _block(tables.overall(found))


def _results_tables(run: Run) -> str:
    known = run.results.tables
    order = [*_IN_PAPER, *(table.name for table in known)]
    lead = html.paragraph(
        "CR is the Cramér-Rao bound and insens. the insensitivity, percent of the identified "
        "value, by the conventions of CIFER; the paper's own bounds stand beside. Up to 20 % "
        "and 10 % the data's support of a parameter is good. Agreement says whether the value is "
        "within its tolerance of truth and paper: neither follows from the other.",
        "note",
    ) + html.folded("what the words of support say", meanings())
    blocks = []
    for one in sorted(known, key=lambda table: order.index(table.name)):
        name = _IN_PAPER.get(one.name, ("",))[0]
        table = tables.comparison(one)
        block = [
            html.heading(f"{name} ({table.title})" if name else table.title),
            html.paragraph(f"{table.lead[0].upper()}{table.lead[1:]}."),
            html.table(table),
            _tolerances(one),
            *_notes(table),
        ]
        blocks.append(("\n".join(block), 2))
    return lead + html.side_by_side(blocks)


def _tolerances(table: ComparisonTable) -> str:
    lines = [line for row in table.parameters for line in _limits(row, table.truth)]
    return html.folded("tolerances", "\n".join(lines)) if lines else ""


def _limits(row: ParameterRow, truth: str) -> list[str]:
    limits = (
        (truth, row.tolerance_percent, row.tolerance_reason),
        ("paper", row.paper_tolerance_percent, row.paper_tolerance_reason),
    )
    return [
        f"{row.name}: within {limit:.3g} % of the {what} ({reason})"
        for what, limit, reason in limits
        if limit is not None
    ]


def _bode_section(run: Run, drawings: Mapping[str, Sequence[Drawing]]) -> str:
    blocks = []
    lead = html.paragraph(
        "Dots: estimated from the flights, hollow where the coherence is below "
        f"{USABLE_COHERENCE:g}, with bars of two random errors. Solid: the identified model. "
        "Dashed: the exact response of the model that flew. Grey ground: not used by the fit. "
        "Where the lines meet, what lies apart is below, on its own scale; between the grey dashes "
        "pilots do not notice a mismatch (MUAD, found with fighters: a small helicopter is flown "
        "faster). The folder "
        "figures/ has each as a file.",
        "note",
    )
    # models of one pair first: they share rows
    for item in sorted(run.models, key=lambda item: len(drawings.get(item.name, ())) > 1):
        table, figure = _IN_PAPER.get(item.name, ("", ""))
        meaning = table.split(", ", 1)[-1]
        title = item.name if meaning in ("", item.name) else f"{item.name}: {meaning}"
        shown = drawings.get(item.name, ())
        block = (
            html.heading(f"{title} (the paper's {figure})" if figure else title)
            + html.paragraph(item.note, "note")
            + html.figures(shown)
        )
        blocks.append((block, 4 if len(shown) > 1 else 1))
    return "\n".join([lead, html.side_by_side(blocks)]) if blocks else ""


def _quality_section(run: Run) -> str:
    return html.side_by_side(
        (html.heading(item.name) + fit_quality(item.fit), 2) for item in run.models
    )


def _time_section(run: Run, drawings: Mapping[str, Sequence[Drawing]]) -> str:
    blocks = []
    for item in run.models:
        if item.verification is not None:
            shown = tables.verification({item.name: item.verification.figures})
            block = [
                html.heading(item.name),
                html.table(shown),
                *_notes(shown),
                html.figures(drawings.get(f"time {item.name}", ())),
            ]
            blocks.append(("\n".join(block), 2))
    if not blocks:
        return ""
    lead = (
        "The paper's Figures 7 and 8: flights that no fit has seen, predicted by the identified "
        "models; only bias, trim and initial state are estimated. Theil's coefficient (TIC) is 0 "
        "for a perfect and 1 for a useless prediction; up to 0.25 is good."
    )
    return html.paragraph(lead) + html.side_by_side(blocks)


def _sweep_section(drawings: Sequence[Drawing]) -> str:
    if not drawings:
        return ""
    lead = (
        "One kept sweep of each axis: the stick, what the swashplate or the tail rotor does, "
        "and the motion."
    )
    return html.paragraph(lead) + html.figures(drawings)


def _omitted_section(run: Run) -> str:
    sentences = [one.message for one in run.results.excluded]
    for item in run.models:
        sentences += [f"{item.name}: {sentence}" for sentence in left_out(item.fit)]
    return html.bullets(sentences) or html.paragraph("Nothing was left out.")


def fit_quality(fit: Fit) -> str:
    """Return how well each response is known and followed, the windows, and the correlations."""
    data = fit.data
    lengths = ", ".join(f"{length:.3g}" for length in data.windows)
    text = f"Windows of {lengths} s. " if lengths else ""
    if fit.misfit is not None:
        text += f"{fit.misfit.summary[0].upper()}{fit.misfit.summary[1:]}."
    shown = tables.responses(fit)
    words = [html.paragraph(text), html.table(shown), *_notes(shown)]
    return "\n".join([*words, correlation_map(fit)])


def left_out(fit: Fit) -> list[str]:
    """Return what a fit leaves out, and what is wrong with it, in sentences."""
    return [
        *(f"{name} {_why_left_out(fit, name)} and is not in the fit" for name in fit.dropped),
        *fit.data.flags,
        *(f"{name} ended at a bound" for name in fit.at_bound),
        *([] if fit.converged else ["the search ended before it converged"]),
    ]


def _why_left_out(fit: Fit, name: str) -> str:
    reached = name in connected(fit.structure)
    return "has too few coherent points" if reached else "is zero in the structure"


def _provenance(results: Results) -> str:
    return (
        html.paragraph(f"Seed {results.seed}. The same seed and versions give the same numbers.")
        + html.table(tables.versions(results.versions))
        + html.folded("configuration", as_json(dict(results.configuration)))
    )


def as_json(data: Any) -> str:
    """Return data as a person reads it."""
    return json.dumps(data, indent=2, ensure_ascii=False, default=str)
