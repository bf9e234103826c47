"""The report of one identified model, from anyone's records."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from helisim.base.files import atomic_write
from helisim.ident import Fit, FittedParameter, Verification
from helisim.ident.fitting.verdicts import meanings
from helisim.records.record import FlightRecord
from helisim.show import html, modes, tables
from helisim.show.drawings import bode_drawings, verification_drawings
from helisim.show.plots import draw_flight
from helisim.show.report import as_json, fit_quality, left_out
from helisim.study.identified import IdentifiedModel


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
    low, high = fit.band
    lead = (
        f"{'; '.join(item.fit.data.pairs)} from {len(fit.data.sources)} record(s), "
        f"{low:.3g} to {high:.3g} rad/s, {fit.method} method; average cost {fit.cost:.3g}."
    )
    sections = [
        (
            "parameters",
            "Parameters",
            html.table(tables.fitted(fit, parameters))
            + html.folded("what the words of support say", meanings()),
        ),
        ("modes", "Modes", html.table(modes.of_fit(fit))),
        ("responses", "Responses", fit_quality(fit)),
        ("bode", "Frequency responses", html.figures(bode_drawings(item))),
        ("time", "Verification in the time domain", _verified(item)),
        ("flights", "Records", html.figures(flights)),
        ("omitted", "What was left out, and warnings", html.bullets(left_out(fit))),
        ("provenance", "Provenance", html.folded("the fit", as_json(fit.provenance))),
    ]
    text = html.page(f"Identified model: {fit.structure.name}", sections, html.paragraph(lead))
    path = Path(path)
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def _verified(item: IdentifiedModel) -> str:
    if item.verification is None:
        return ""
    shown = tables.verification({item.name: item.verification.figures})
    notes = "".join(html.paragraph(f"Verified: {text}.", "note") for _, text in shown.notes)
    return html.table(shown) + notes + html.figures(verification_drawings(item))
