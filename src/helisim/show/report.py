"""The reports of a run and of one fit: self-contained pages, from their files alone.

Nothing is computed here. Every number of a table carries its place in `results.json`.
"""

from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path

from helisim.base.files import make_folder
from helisim.ident import USABLE_COHERENCE, Fit, FittedParameter, Verification
from helisim.ident.fitted import meanings
from helisim.ident.result import CORRELATION_LIMIT
from helisim.records.record import FlightRecord
from helisim.show import page, tables
from helisim.show.figure import Drawing, text_at, variable
from helisim.show.page import Section, paragraph
from helisim.show.plots import draw_flight, draw_pair, draw_verifications, pairs_of
from helisim.study.comparison import ComparisonTable
from helisim.study.errata import errata
from helisim.study.results import IdentifiedModel, Results, Run, read_run
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
_OF_SWEEP = {
    "col": ("collective", "COL", "col", "w", "phi", "theta"),
    "lon": ("longitudinal", "LON", "lon", "q", "theta", "u"),
    "lat": ("lateral", "LAT", "lat", "p", "phi", "v"),
    "ped": ("pedal", "PED", "ped", "r", "psi", "v"),
}
"""Axis -> its name, and the channels of its sweep: stick, swashplate or tail, motion."""
_CELL, _LETTER, _NARROWEST, _SHOWN = 27.0, 6.3, 320.0, 0.5
"""Of a map of correlations: units of a cell's side, of an average letter of a name, and of the
least width, a phone's; correlations from which a cell has its number."""

Drawings = Mapping[str, Sequence[Drawing]]


def write_report(folder: str | Path, run: Run | None = None) -> Path:
    """Write FOLDER/report.html and FOLDER/figures from the other files in the folder.

    Each file appears complete or not at all.

    Args:
        folder: that `helisim reproduce` wrote.
        run: as read from the folder; read if None.

    Returns:
        The path of the report.

    Raises:
        StorageError: a file can't be read or written.
        InputError: a file holds something else.
    """
    folder = Path(folder)
    run = run or read_run(folder)
    drawings: dict[str, Sequence[Drawing]] = {
        "sweeps": [
            draw_flight(
                f"sweep_{axis}",
                f"{_OF_SWEEP[axis][0]} sweep",
                record,
                [name for name in _OF_SWEEP[axis][1:] if name in record],
            )
            for axis, record in run.sweeps.items()
        ]
    }
    for item in run.models:
        drawings[item.name] = [draw_pair(item, *pair) for pair in pairs_of(item.fit)]
        drawings[f"time {item.name}"] = draw_verifications(item)
    make_folder(folder / FIGURES)
    for group in drawings.values():
        for drawing in group:
            drawing.write(folder / FIGURES)
    title = "The JR700 swept, identified and compared"
    return page.write_page(folder / REPORT, title, _sections(run, drawings), _summary(run.results))


def write_fit_report(
    path: str | Path,
    fit: Fit,
    *,
    records: Mapping[str, FlightRecord] | None = None,
    verification: Verification | None = None,
    parameters: Sequence[FittedParameter] | None = None,
    on_progress: Callable[[str], None] | None = None,
) -> Path:
    """Write a report of one identified model, from anyone's records, and return its path.

    Args:
        path: of the HTML file.
        fit: the model.
        records: by name; their inputs and outputs are shown.
        verification: of flights that the fit has not seen.
        parameters: the fit's in other units; SI by default.
        on_progress: called with a record's name when it is drawn.

    Raises StorageError.
    """
    item = IdentifiedModel(fit.structure.name, fit, verification=verification)
    signals = (*fit.structure.inputs, *fit.structure.outputs)
    flights = []
    for k, (name, record) in enumerate((records or {}).items()):
        flights.append(draw_flight(f"flight_{k}", name, record, signals))
        if on_progress is not None:
            on_progress(name)
    verified = ""
    if verification is not None:
        shown = tables.verification({item.name: verification.figures})
        said = "".join(paragraph(f"Verified: {text}.", "note") for _, text in shown.notes)
        verified = page.table(shown) + said + page.figures(draw_verifications(item))
    low, high = fit.band
    lead = (
        f"{'; '.join(fit.data.pairs)} from {len(fit.data.sources)} record(s), "
        f"{low:.3g} to {high:.3g} rad/s, {fit.method} method; average cost {fit.cost:.3g}."
    )
    bode = page.figures(draw_pair(item, *pair) for pair in pairs_of(fit))
    sections = [
        ("parameters", "Parameters", page.table(tables.fitted(fit, parameters)) + _meanings()),
        ("modes", "Modes", page.table(tables.fit_modes(fit))),
        ("responses", "Responses", _fit_quality(fit)),
        ("bode", "Frequency responses", bode),
        ("time", "Verification in the time domain", verified),
        ("flights", "Records", page.figures(flights)),
        ("omitted", "What was left out, and warnings", page.bullets(_left_out(fit))),
        ("provenance", "Provenance", _folded_text("the fit", page.as_json(fit.provenance))),
    ]
    title = f"Identified model: {fit.structure.name}"
    return page.write_page(Path(path), title, sections, paragraph(lead))


def _sections(run: Run, drawings: Drawings) -> list[Section]:
    results, effect = run.results, run.results.gyro_effect
    gyro = (
        ""
        if effect is None
        else paragraph(
            "The same structure from the servos (IN1: the base helicopter) and from the sticks "
            "(IN2: the helicopter with its gyro).",
            "note",
        )
        + "\n".join(
            map(
                page.table, (tables.gyro_changes(effect), tables.gyro_statements(effect.statements))
            )
        )
    )
    quality = page.side_by_side(
        (page.heading(item.name) + _fit_quality(item.fit), 2) for item in run.models
    )
    sweeps = page.figures(drawings.get("sweeps", ()))
    if sweeps:
        sweeps = (
            paragraph(
                "One kept sweep of each axis: the stick, what the swashplate or the tail rotor "
                "does, and the motion."
            )
            + sweeps
        )
    omitted = [one.message for one in results.excluded]
    omitted += [f"{item.name}: {said}" for item in run.models for said in _left_out(item.fit)]
    provenance = (
        paragraph(f"Seed {results.seed}. The same seed and versions give the same numbers.")
        + page.table(tables.versions(results.versions))
        + _folded_text("configuration", page.as_json(dict(results.configuration)))
    )
    equation = "" if results.eq_8 is None else page.block(tables.overall(results.eq_8))
    ground = "\n".join(page.block(tables.rig(test)) for test in results.ground.values())
    left_out = page.bullets(omitted) or paragraph("Nothing was left out.")
    return [
        ("experiment", "The experiment", _experiment(run)),
        ("airframe", "Table 1, the helicopter", _airframe(run)),
        ("ground", "On the ground", ground),
        ("tables", "Tables 2 to 4, the models", _results_tables(run)),
        ("gyro", "Before and after the gyro", gyro),
        ("overall", "Eq. (8), the parts against the whole", equation),
        ("bode", "Frequency responses", _bode(run, drawings)),
        ("quality", "Costs and correlations", quality),
        ("time", "Verification in the time domain", _verified(run, drawings)),
        ("sweeps", "The sweeps", sweeps),
        ("omitted", "What was left out, and why", left_out),
        ("errata", "Errors in the paper", page.table(tables.errata(errata()))),
        ("provenance", "Provenance", provenance),
    ]


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
    return paragraph(text, "lead") + page.bullets(results.misses)


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
    return paragraph(text) + (paragraph(other) if given.parameters else "")


def _airframe(run: Run) -> str:
    record = next(iter(run.sweeps.values()), None)
    vehicle = record.provenance.get("vehicle", "") if record is not None else ""
    if vehicle not in vehicle_names():
        return page.table(tables.airframe(record))
    picture, shown = model_folder(vehicle) / f"{vehicle}.png", ""
    if picture.is_file():
        caption = "The model, rendered by MuJoCo."
        shown = page.photograph(picture.read_bytes(), f"The {vehicle} model", caption)
    return page.side_by_side([(shown, 2), (page.table(tables.airframe(record)), 2)])


def _results_tables(run: Run) -> str:
    known = run.results.tables
    order = [*_IN_PAPER, *(table.name for table in known)]
    lead = paragraph(
        "CR is the Cramér-Rao bound and insens. the insensitivity, percent of the identified "
        "value, by the conventions of CIFER; the paper's own bounds stand beside. Up to 20 % "
        "and 10 % the data's support of a parameter is good. Agreement says whether the value is "
        "within its tolerance of truth and paper: neither follows from the other.",
        "note",
    )
    blocks = []
    for one in sorted(known, key=lambda table: order.index(table.name)):
        name = _IN_PAPER.get(one.name, ("",))[0]
        table = tables.comparison(one)
        block = [
            page.heading(f"{name} ({table.title})" if name else table.title),
            paragraph(f"{table.lead[0].upper()}{table.lead[1:]}."),
            page.table(table),
            _tolerances(one),
            *page.notes(table),
        ]
        blocks.append(("\n".join(block), 2))
    return lead + _meanings() + page.side_by_side(blocks)


def _tolerances(table: ComparisonTable) -> str:
    lines = [
        f"{row.name}: within {limit:.3g} % of the {source} ({reason})"
        for row in table.parameters
        for source, limit, reason in (
            (table.truth, row.tolerance_percent, row.tolerance_reason),
            ("paper", row.paper_tolerance_percent, row.paper_tolerance_reason),
        )
        if limit is not None
    ]
    return _folded_text("tolerances", "\n".join(lines)) if lines else ""


def _bode(run: Run, drawings: Drawings) -> str:
    blocks = []
    # models of one pair first: they share rows
    for item in sorted(run.models, key=lambda item: len(drawings.get(item.name, ())) > 1):
        table, figure = _IN_PAPER.get(item.name, ("", ""))
        meaning = table.split(", ", 1)[-1]
        title = item.name if meaning in ("", item.name) else f"{item.name}: {meaning}"
        shown = drawings.get(item.name, ())
        block = (
            page.heading(f"{title} (the paper's {figure})" if figure else title)
            + paragraph(item.note, "note")
            + page.figures(shown)
        )
        blocks.append((block, 4 if len(shown) > 1 else 1))
    lead = (
        "Dots: estimated from the flights, hollow where the coherence is below "
        f"{USABLE_COHERENCE:g}, with bars of two random errors. Solid: the identified model. "
        "Dashed: the exact response of the model that flew. Grey ground: not used by the fit. "
        "Where the lines meet, what lies apart is below, on its own scale; between the grey dashes "
        "pilots do not notice a mismatch (MUAD, found with fighters: a small helicopter is flown "
        "faster). The folder figures/ has each as a file."
    )
    return f"{paragraph(lead, 'note')}\n{page.side_by_side(blocks)}" if blocks else ""


def _verified(run: Run, drawings: Drawings) -> str:
    blocks = []
    for item in run.models:
        if item.verification is not None:
            shown = tables.verification({item.name: item.verification.figures})
            drawn = page.figures(drawings.get(f"time {item.name}", ()))
            block = [page.heading(item.name), page.table(shown), *page.notes(shown), drawn]
            blocks.append(("\n".join(block), 2))
    lead = (
        "The paper's Figures 7 and 8: flights that no fit has seen, predicted by the identified "
        "models; only bias, trim and initial state are estimated. Theil's coefficient (TIC) is 0 "
        "for a perfect and 1 for a useless prediction; up to 0.25 is good."
    )
    return paragraph(lead) + page.side_by_side(blocks) if blocks else ""


def _fit_quality(fit: Fit) -> str:
    """Return how well each response is known and followed, the windows, and the correlations."""
    lengths = ", ".join(f"{length:.3g}" for length in fit.data.windows)
    text = f"Windows of {lengths} s. " if lengths else ""
    if fit.misfit is not None:
        text += f"{fit.misfit.summary[0].upper()}{fit.misfit.summary[1:]}."
    shown = tables.responses(fit)
    return "\n".join([paragraph(text), page.table(shown), *page.notes(shown), correlation_map(fit)])


def _left_out(fit: Fit) -> list[str]:
    """Return what a fit leaves out, and its diagnostics, in sentences."""
    why = {True: "has too few coherent points", False: "is zero in the structure"}
    used = fit.structure.connected
    return [
        *(f"{name} {why[name in used]} and is not in the fit" for name in fit.dropped),
        *fit.data.flags,
        *(f"{name} ended at a bound" for name in fit.at_bound),
        *([] if fit.converged else ["the search ended before it converged"]),
    ]


def _meanings() -> str:
    return _folded_text("what the words of support say", meanings())


def _folded_text(summary: str, text: str) -> str:
    return page.folded(summary, page.preformatted(text))


def correlation_map(fit: Fit) -> str:
    """Return the correlations of a fit's parameters as a triangle of cells; "" for fewer than two.

    Blue parameters rise together, orange ones one against the other; the stronger, the deeper.
    """
    names = [parameter.name for parameter in fit.structure.free]
    if len(names) < 2:
        return ""
    left = _LETTER * max(map(len, names)) + 10.0
    parts = []
    for row in range(1, len(names)):
        y = (row - 1) * _CELL
        parts.append(text_at(left - 6.0, y + 17.5, names[row], "end"))
        for column in range(row):
            x, found = left + column * _CELL, float(fit.correlation[row, column])
            ink = "identified" if found > 0.0 else "data"
            number = f"{found:.2f}".replace("0.", ".").replace("-", "\u2212")
            middle = text_at(x + 0.5 * _CELL, y + 17.5, number, "middle ink")
            parts.append(
                f"<g><title>{escape(f'{names[row]}, {names[column]}')}: {found:.3f}</title>"
                f'<rect class="frame" x="{x:.1f}" y="{y:.1f}" width="{_CELL:g}" '
                f'height="{_CELL:g}" style="fill: {variable(ink)}; fill-opacity: '
                f'{0.75 * abs(found):.2f}; stroke: {variable("grid")}"/>'
                f"{'' if abs(found) < _SHOWN else middle}</g>"
            )
    foot = (len(names) - 1) * _CELL
    for column, name in enumerate(names[:-1]):
        x, y = left + (column + 0.5) * _CELL + 4.0, foot + 6.0
        parts.append(
            f'<text x="{x:.1f}" y="{y:.1f}" transform="rotate(-90 {x:.1f} {y:.1f})" class="end">'
            f"{escape(name)}</text>"
        )
    width, height = max(left + foot + 2.0, _NARROWEST), foot + left
    caption = (
        "Correlations of the parameters' errors, numbers from 0.5. Two beyond "
        f"{CORRELATION_LIMIT:g} can stand in for each other: fix one, or fly what tells them apart."
    )
    return (
        f'<figure id="correlation_{escape(fit.structure.name)}"><svg class="drawing" role="img" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" style="max-width: {width:.0f}px">'
        f"<title>{escape(caption)}</title>{''.join(parts)}</svg>"
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )
