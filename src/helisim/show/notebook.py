"""Figures of `plot` and pages of values in notebooks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError, check_known
from helisim.ident import Fit, FrequencyResponse, Verification
from helisim.records.record import FlightRecord
from helisim.show import page, tables
from helisim.show.page import paragraph
from helisim.show.plots import draw_bode, draw_flight, draw_pair, draw_verifications

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from helisim.design.design import DesignResult
    from helisim.handling.criteria import Criterion
    from helisim.show.figure import Drawing
    from helisim.study.results import Results

Names = Sequence[str] | str | None

_FEW = 4  # figures of a notebook's page at most
_MEASURED = ("IN1", "IN2", "OUT")


def plot_record(record: FlightRecord, channels: Names) -> Figure:
    """Draw a record's channels, by default the measured ones, grouped by kind."""
    return _figure([_record(record, channels)])


def plot_response(found: FrequencyResponse, pairs: Names) -> Figure:
    """Draw magnitude, phase and coherence of each pair, with two random errors as bars."""
    shown = _chosen(found.outputs, found.inputs, pairs)
    return _figure([draw_bode("", o, i, found) for o, i in shown], len(found.inputs))


def plot_fit(fit: Fit, pairs: Names) -> Figure:
    """Draw data, model and their difference for each pair."""
    return _figure(_pairs(fit, pairs), len(fit.structure.inputs))


def plot_verification(verification: Verification) -> Figure:
    """Draw each record's inputs, and its measured and predicted outputs."""
    return _figure(draw_verifications("", verification))


def plot_ratings(criterion: Criterion, ratings: Any) -> Figure:
    """Draw ratings on their criterion's chart."""
    from helisim.show.charts import draw_ratings

    return _figure([draw_ratings(criterion, ratings)])


def plot_design(result: DesignResult) -> Figure:
    """Draw the charts of a design's specifications."""
    return _figure(_judged(result))


def to_html(value: Any) -> str:
    """Return a value as a piece of a page, or its text."""
    made = _PAGES.get(type(value).__name__)
    if made is None:
        return f"<pre>{escape(str(value))}</pre>"
    title, *parts = made(value)
    return (
        f'<div class="helisim">\n<style>\n{page.style("notebook.css")}</style>\n'
        f"<h4>{escape(title)}</h4>\n{''.join(parts)}\n</div>"
    )


def _record_page(record: FlightRecord) -> tuple[str, ...]:
    flown = record.provenance
    facts = [f"{len(record)} samples over {record.duration:.4g} s"]
    facts += [f"{name} {flown[name]}" for name in ("vehicle", "seed", "flight") if name in flown]
    return (
        "Flight record",
        paragraph("; ".join(facts) + "."),
        paragraph(f"Ended early: {record.ended}." if record.ended else "", "off"),
        page.figures([_record(record, None)]),
        page.folded("channels", page.table(tables.channels(record))),
    )


def _response_page(found: FrequencyResponse) -> tuple[str, ...]:
    shown = _chosen(found.outputs, found.inputs, None)[:_FEW]
    return (
        f"Frequency response: {', '.join(found.outputs)} over {', '.join(found.inputs)}",
        paragraph(
            f"{found.frequency.size} frequencies from {found.frequency[0]:.3g} to "
            f"{found.frequency[-1]:.3g} rad/s, {found.method} method, {len(found.sources)} "
            "record(s)."
        ),
        page.figures(draw_bode("", o, i, found) for o, i in shown),
        page.bullets(found.flags),
    )


def _fit_page(fit: Fit) -> tuple[str, ...]:
    low, high = fit.band
    return (
        f"Fit: {fit.structure.name}",
        paragraph(
            f"{', '.join(fit.costs)} from {low:.3g} to {high:.3g} rad/s, {fit.method} method; "
            f"average cost {fit.cost:.4g}: {fit.judged}, as costs go; {fit.verdict}."
        ),
        page.table(tables.fitted(fit)),
        page.folded("modes", page.table(tables.fit_modes(fit))),
        page.figures(_pairs(fit, None)[:_FEW]),
        page.bullets(fit.remarks),
    )


def _results_page(results: Results) -> tuple[str, ...]:
    missed = results.misses
    judged = f"{len(missed)} tolerance(s) missed" if missed else "all tolerances hold"
    return (
        "Results",
        paragraph(f"Seed {results.seed}; {judged}."),
        *(page.block(tables.comparison(one)) for one in results.tables),
        page.table(tables.verification(results.verification)),
        page.bullets(missed),
    )


_PAGES: dict[str, Callable[[Any], tuple[str, ...]]] = {
    "FlightRecord": _record_page,
    "FrequencyResponse": _response_page,
    "Fit": _fit_page,
    "Verification": lambda one: (
        "Verification",
        paragraph(
            f"Theil's coefficient {one.tic:.3f}: {'' if one.acceptable else 'not '}acceptable."
        ),
        page.table(tables.verification({"": one.figures})),
        page.figures(draw_verifications("", one)[:_FEW]),
    ),
    "Results": _results_page,
    "Run": lambda run: _results_page(run.results),
    "DesignResult": lambda result: (
        "Design of a control law",
        page.block(tables.design(result)),
        page.bullets(result.misses),
        page.figures(_judged(result)),
    ),
}
"""Pages by type name; types aren't imported here."""


def _record(record: FlightRecord, channels: Names) -> Drawing:
    measured = [one.name for one in record.channels if one.kind in _MEASURED]
    names = _listed(channels, "channels") or measured or list(record.names)
    record.select(names)  # raises for one that there is not
    flown = record.provenance.get("excitation")
    title = f"{flown['kind']}, {flown['axis']}" if isinstance(flown, dict) else "Flight record"
    return draw_flight("flight", title, record, names)


def _pairs(fit: Fit, pairs: Names) -> list[Drawing]:
    from helisim.study.results import IdentifiedModel  # behind which stands the simulator

    item = IdentifiedModel(fit.structure.name, fit)
    shown = _chosen(fit.structure.outputs, fit.structure.inputs, pairs)
    return [draw_pair(item, o, i) for o, i in shown]


def _judged(result: DesignResult) -> list[Drawing]:
    from helisim.show.charts import draw_judged  # which imports laws

    return [draw_judged(one) for one in result.judged]


def _figure(drawings: Sequence[Drawing], wide: int = 3) -> Figure:
    from helisim.show.canvas import to_figure  # matplotlib is slow to import

    return to_figure([drawings[k : k + wide] for k in range(0, len(drawings), wide)])


def _listed(names: Names, what: str) -> list[str]:
    if names is None:
        return []
    listed = [names] if isinstance(names, str) else list(names)
    if not listed:
        raise InputError(f"{what} is empty; leave it out for all")
    return listed


def _chosen(outputs: Sequence[str], inputs: Sequence[str], pairs: Names) -> list[tuple[str, str]]:
    known = {f"{output}/{input_}": (output, input_) for output in outputs for input_ in inputs}
    names = _listed(pairs, "pairs") or list(known)
    check_known("response", names, known)
    return [known[name] for name in names]
