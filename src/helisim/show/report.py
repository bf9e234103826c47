"""Self-contained reports of a run and of a fit."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from helisim.base.files import make_folder
from helisim.handling.loop import NoResponse, axis_of
from helisim.handling.measured.margins import MeasuredMargins
from helisim.ident import USABLE_COHERENCE, Fit, Verification
from helisim.ident.fitted import meanings
from helisim.ident.result import CORRELATION_LIMIT
from helisim.records.record import FlightRecord
from helisim.show import page, tables
from helisim.show.charts import draw_loops
from helisim.show.figure import Drawing
from helisim.show.page import Section, paragraph
from helisim.show.plots import draw_flight, draw_over_time, draw_pair, draw_verifications, pairs_of
from helisim.show.table import numbers, table
from helisim.study.errata import errata
from helisim.study.results import IdentifiedModel, Results, Run, read_run

if TYPE_CHECKING:  # slow to import
    from helisim.study.log_tune import LogTuning

FIGURES = "figures"
REPORT = "report.html"

_TITLES = {  # model -> name and place in the paper
    "yaw_base": "yaw_base: Table 2 and Figure 4, yaw, base helicopter",
    "yaw_gyro": "yaw_gyro: Table 2, yaw, gyro",
    "yaw_overall": "yaw_overall: Table 2, eq. (8) and Figure 3, yaw, helicopter with gyro",
    "rollpitch_in1": "rollpitch_in1: Table 3 and Figure 6, roll and pitch, base helicopter",
    "rollpitch_in2": "rollpitch_in2: Table 3 and Figure 5, roll and pitch, helicopter with gyro",
    "heave": "heave: Table 4, heave",
}
_OF_SWEEP = {  # axis -> name and channels of its sweep
    "col": ("collective", "COL", "col", "w", "phi", "theta"),
    "lon": ("longitudinal", "LON", "lon", "q", "theta", "u"),
    "lat": ("lateral", "LAT", "lat", "p", "phi", "v"),
    "ped": ("pedal", "PED", "ped", "r", "psi", "v"),
}


def write_report(folder: str | Path, run: Run | None = None) -> Path:
    """Write FOLDER/report.html and figures of a run, None: that in the folder; return its path.

    Raises StorageError, InputError.
    """
    folder = Path(folder)
    run = run or read_run(folder)
    return page.write_page(
        folder / REPORT,
        "The JR700 swept, identified and compared",
        _sections(run, make_folder(folder / FIGURES)),
        _summary(run.results),
    )


def write_fit_report(
    path: str | Path,
    fit: Fit,
    *,
    records: Mapping[str, FlightRecord] | None = None,
    verification: Verification | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> Path:
    """Write a report of one identified model and return its path. Raises StorageError.

    `records` have the fit's inputs and outputs; `verification` is of unseen flights.
    """
    item = IdentifiedModel(fit.structure.name, fit, verification=verification)
    own, flights = fit.structure, []
    for k, (name, record) in enumerate((records or {}).items()):
        flights.append(draw_flight(f"flight_{k}", name, record, (*own.inputs, *own.outputs)))
        on_progress(name)
    low, high = fit.band
    lead = (
        f"{'; '.join(fit.data.pairs)} from {len(fit.data.sources)} record(s), "
        f"{low:.3g} to {high:.3g} rad/s, {fit.method} method; average cost {fit.cost:.3g}; "
        f"{fit.verdict}."
    )
    sections = [
        ("parameters", "Parameters", page.table(tables.fitted(fit)) + _meanings()),
        ("modes", "Modes", page.table(tables.fit_modes(fit))),
        ("responses", "Responses", _fit_quality(fit)),
        ("bode", "Frequency responses", _pairs(item)),
        ("time", "Verification in the time domain", _verified(item)),
        ("flights", "Records", page.figures(flights)),
        ("omitted", "What was left out, and warnings", page.bullets(fit.remarks)),
        ("provenance", "Provenance", page.folded("the fit", page.as_json(fit.provenance))),
    ]
    return page.write_page(
        Path(path), f"Identified model: {fit.structure.name}", sections, paragraph(lead)
    )


def write_margins_report(path: str | Path, found: MeasuredMargins) -> Path:
    """Write a report of measured loops and return its path. Raises StorageError."""
    loops = []
    for cut in found.loop.used:
        with suppress(NoResponse):
            title = f"Broken loop, {axis_of(cut.axis).word}, cut at the {cut.at}"
            curve = found.loop.broken(cut.axis, cut.at)
            loops.append(draw_loops(f"loop_{cut.axis}_{cut.at}", title, {"flown": curve}))
    sections = [
        ("figures", "Figures", page.table(tables.measured_margins(found))),
        ("loops", "Broken loops, with intervals of 95 %", page.figures(loops)),
        ("remarks", "What is to be known of them", page.bullets(found.remarks)),
    ]
    lead = "Measured in flight, without a model; the intervals hold what the records leave open."
    return page.write_page(
        Path(path), "Margins and disturbance rejection", sections, paragraph(lead)
    )


def write_flight_report(path: str | Path, found: "LogTuning") -> Path:
    """Write a page on an autopilot's flight, its models, loops and new gains; return its path.

    Raises StorageError.
    """
    flown = [(f"{since:.1f}", name) for since, name in found.modes]
    loops = [
        draw_loops(f"loop_{one.axis}", f"Broken loop, {axis_of(one.axis).word}", one.loops)
        for one in found.axes
        if one.loops
    ]
    over_time = (
        [draw_over_time("histories", "Over time", found.histories)] if found.histories else []
    )
    told = "".join(
        page.block(tables.tuning(one)) + paragraph(one.why and f"No new gains: {one.why}.", "off")
        for one in found.axes
    )
    models = "".join(
        page.block(tables.fitted(fit)) + paragraph(f"{fit.verdict}.") for fit in found.fits
    )
    gains = page.table(tables.changes(found.changes)) if found.changes else ""
    vibration = ""
    if found.vibration is not None:
        tones = tables.vibration(found.vibration, found.crossovers)
        vibration = page.table(tones) or page.bullets(text for _, text in tones.notes)
    sections = [
        ("gains", "New gains", gains),
        ("figures", "Margins, rejection and bandwidth, with 95 % intervals", told),
        ("loops", "Broken loops, as flown, and predicted with new gains", page.figures(loops)),
        ("vibration", "Vibration", vibration),
        ("remarks", "What is to be known of them", page.bullets(found.remarks)),
        ("models", "Models", models),
        (
            "modes",
            "Flight modes, and what the log has over time",
            page.table(table("", "from [s]|mode<", flown)) + page.figures(over_time),
        ),
        (
            "flown",
            "What was swept, and what of the log is taken",
            found.told and page.preformatted(found.told),
        ),
    ]
    lead = f"From {', '.join(Path(one).name for one in found.logs)}."
    return page.write_page(Path(path), "A flight, and better gains", sections, paragraph(lead))


def _sections(run: Run, folder: Path) -> list[Section]:
    results, effect = run.results, run.results.gyro_effect
    flown = next(iter(run.sweeps.values()), None)
    predicted = "".join(_verified(one, folder) for one in run.models)
    lead = (
        "The paper's Figures 7 and 8: flights that no fit has seen, predicted by the identified "
        "models; only bias, trim and initial state are estimated. Theil's coefficient (TIC) is 0 "
        "for a perfect and 1 for a useless prediction; up to 0.25 is good."
    )
    omitted = [one.message for one in results.excluded]
    omitted += [f"{item.name}: {said}" for item in run.models for said in item.fit.remarks]
    provenance = (
        paragraph(f"Seed {results.seed}. The same seed and versions give the same numbers.")
        + page.folded("versions", page.as_json(dict(results.versions)))
        + page.folded("configuration", page.as_json(dict(results.configuration)))
    )
    quality = "".join(page.heading(one.name) + _fit_quality(one.fit) for one in run.models)
    swept = (_sweep(axis, record) for axis, record in run.sweeps.items())
    return [
        ("experiment", "The experiment", _experiment(results)),
        ("tables", "Tables 2 to 4, the models", _results_tables(run)),
        (
            "gyro",
            "Before and after the gyro",
            page.table(tables.gyro_changes(effect)) if effect else "",
        ),
        ("overall", "Eq. (8)", page.block(tables.overall(results.eq_8)) if results.eq_8 else ""),
        ("bode", "Frequency responses", _bode(run, folder)),
        ("quality", "Costs and correlations", quality),
        ("time", "Verification in the time domain", predicted and paragraph(lead) + predicted),
        ("sweeps", "One kept sweep of each axis", page.figures(swept, folder)),
        ("airframe", "Table 1, the helicopter", page.table(tables.airframe(flown))),
        (
            "ground",
            "On the ground",
            "".join(map(page.block, map(tables.rig, results.ground.values()))),
        ),
        ("omitted", "What was left out, and why", page.bullets(omitted)),
        ("errata", "Errors in the paper", page.table(tables.errata(errata()))),
        ("provenance", "Provenance", provenance),
    ]


def _sweep(axis: str, record: FlightRecord) -> Drawing:
    word, *names = _OF_SWEEP[axis]
    return draw_flight(
        f"sweep_{axis}", f"{word} sweep", record, [name for name in names if name in record]
    )


def _pairs(item: IdentifiedModel, folder: Path | None = None) -> str:
    return page.figures((draw_pair(item, *pair) for pair in pairs_of(item.fit)), folder)


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


def _experiment(results: Results) -> str:
    given = results.configuration
    text = (
        "A nonlinear JR700 with a three-axis gyro was flown in MuJoCo by a pilot who holds the "
        f"hover and sweeps one stick at a time, {given.get('flown_each_axis', 'some')} flights on "
        f"each of the four axes; the {given.get('flights_kept_each_axis', 'most')} most coherent "
        "were kept. A flight computer recorded sticks (IN2), servo signals (from which IN1 is "
        "recomputed) and motion (OUT), with its filter, latency, noise and resolution. From these "
        "records alone the frequency responses were estimated by the method of Tischler and Remple "
        "(CIFER), and the paper's models were fitted to them. The truth beside them is the exact "
        "linearisation of the nonlinear model that flew; the paper is Wu and Chen, System "
        "identifications of three-axis gyro model and base model of a RC helicopter without "
        "stabilizer bar."
    )
    other = ", ".join(f"{name} = {one}" for name, one in given.get("parameters", {}).items())
    said = f"Another truth was flown, so the paper is printed and not judged by: {other}."
    return paragraph(text) + (paragraph(said) if other else "")


def _results_tables(run: Run) -> str:
    lead = (
        "s.e. is the standard error; CR, the Cramér-Rao bound, and insens., the insensitivity, are "
        "in percent of the identified value, by the conventions of CIFER; the paper's own bounds "
        "stand beside. Up to 20 % and 10 % the data's support of a parameter is good. Agreement "
        "says whether the value is within its tolerance of truth and paper: neither follows from "
        "the other."
    )
    parts = [paragraph(lead, "note"), _meanings()]
    for one in run.results.tables:
        parts += [
            page.block(replace(tables.comparison(one), title=_TITLES.get(one.name, one.name))),
            page.folded(
                "tolerances",
                page.bullets(
                    f"{row.name}: within {limit:.3g} % of the {source} ({reason})"
                    for row in one.parameters
                    for source, limit, reason in (
                        (one.truth, row.tolerance_percent, row.tolerance_reason),
                        ("paper", row.paper_tolerance_percent, row.paper_tolerance_reason),
                    )
                    if limit is not None
                ),
            ),
        ]
    return "\n".join(parts)


def _bode(run: Run, folder: Path) -> str:
    lead = (
        "Dots: estimated from the flights, hollow where the coherence is below "
        f"{USABLE_COHERENCE:g}, with bars of two random errors. Solid: the identified model. "
        "Dashed: the truth, exact of the model that flew. Grey ground: not used by the fit. "
        "Where the lines meet, what lies apart is below, on its own scale. The folder figures/ has "
        "each as a file."
    )
    blocks = (
        page.heading(_TITLES.get(item.name, item.name))
        + paragraph(item.note, "note")
        + _pairs(item, folder)
        for item in run.models
    )
    return "\n".join([paragraph(lead, "note"), *blocks]) if run.models else ""


def _verified(item: IdentifiedModel, folder: Path | None = None) -> str:
    if item.verification is None:
        return ""
    shown = tables.verification({item.name: item.verification.figures})
    drawn = draw_verifications(f"time_{item.name}", item.verification, item.verified_on)
    return page.table(shown) + page.figures(drawn, folder)


def _fit_quality(fit: Fit) -> str:
    lengths = ", ".join(f"{length:.3g}" for length in fit.data.windows)
    text = f"Windows of {lengths} s. " if lengths else ""
    if fit.residual is not None:
        text += f"{fit.residual.summary[0].upper()}{fit.residual.summary[1:]}."
    names = [parameter.name for parameter in fit.structure.free]
    note = (
        f"Two parameters whose errors' correlation is beyond {CORRELATION_LIMIT:g} can stand in "
        "for each other: fix one, or fly what tells them apart."
    )
    found = table(
        "Correlations",
        "|".join(["<", *names]),
        (
            (name, *numbers(fit.correlation[k, :k], ".2f"), *[""] * (len(names) - k))
            for k, name in enumerate(names)
        ),
        notes=[("", note)],
    )
    correlations = page.folded("correlations", page.table(found)) if len(names) > 1 else ""
    return "\n".join([paragraph(text), page.table(tables.responses(fit)), correlations])


def _meanings() -> str:
    return page.folded("what the words of support say", page.preformatted(meanings()))
