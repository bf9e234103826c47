"""What `plot` and a notebook show of a value: the reports' own figures and tables, one at a time.

Values find this module by `helisim.base.display`; nobody below imports it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident import Fit, FrequencyResponse, Modes, Verification
from helisim.records.channels import CHANNELS, IN1, IN2, RATES
from helisim.records.record import FlightRecord
from helisim.show import html, modes, summaries, tables
from helisim.show.bode_drawing import draw_bode
from helisim.show.drawings import pair_drawing
from helisim.show.plots import (
    draw_excitation,
    draw_flight,
    draw_groups,
    draw_verification,
)
from helisim.show.svg import DARK, LIGHT, Drawing, colour_variables, drawing_style
from helisim.show.table import Table
from helisim.study.identified import IdentifiedModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from helisim.design.result import DesignResult
    from helisim.handling.criteria import Criterion
    from helisim.sim import FlightPlan
    from helisim.study.results import Results
    from helisim.study.run import Run
    from helisim.vehicle import Linearization, Vehicle

_FEW = 4
"""Figures of pairs that a notebook shows unasked."""
_MEASURED = ("IN1", "IN2", "OUT")
_OWN_AXES = ("w/col", "q/lon", "p/lat", "r/ped")
"""The answers that each control is for; with sticks the same."""
_GRID = (0.1, 100.0)
"""rad/s, of an exact model: from the slow modes to beyond the rotor's and the servos'."""

# Jupyter, VS Code, Sphinx and Colab say on an element around which theme they have.
_LIGHT_PAGES = ('[data-jp-theme-light="true"]', ".vscode-light", '[data-theme="light"]')
_DARK_PAGES = ('[data-jp-theme-light="false"]', ".vscode-dark", '[data-theme="dark"]')
_VERDICTS = {"light": "--ok: #1f6b33; --bad: #a32014;", "dark": "--ok: #6fcf87; --bad: #ff8f80;"}


def plot_record(
    record: FlightRecord, channels: Sequence[str] | str | None, axes: Sequence[Axes] | None
) -> Figure:
    """Draw a record's channels, one panel each; by default all, grouped by kind."""
    if channels is None:
        return _drawn([[_groups(record, _all_measured(record))]], axes)
    names = [channels] if isinstance(channels, str) else list(channels)
    record.select(names)  # raises for one that there is not
    if not names:
        raise InputError("channels is empty; leave it out for all channels")
    return _drawn([[draw_flight("flight", _title(record), record, names)]], axes)


def plot_response(
    found: FrequencyResponse, pairs: Sequence[str] | str | None, axes: Sequence[Axes] | None
) -> Figure:
    """Draw magnitude, phase and coherence of each pair, with two random errors as bars."""
    shown = _chosen(found.outputs, found.inputs, pairs)
    return _drawn(_in_grid(shown, lambda o, i: draw_bode("", o, i, data=found)), axes)


def plot_fit(fit: Fit, pairs: Sequence[str] | str | None, axes: Sequence[Axes] | None) -> Figure:
    """Draw data, model, and what they differ by, for each pair."""
    item = IdentifiedModel(fit.structure.name, fit)
    shown = _chosen(fit.structure.outputs, fit.structure.inputs, pairs)
    return _drawn(_in_grid(shown, lambda o, i: pair_drawing(item, o, i)), axes)


def plot_verification(
    verification: Verification, records: Sequence[int] | int | None, axes: Sequence[Axes] | None
) -> Figure:
    """Draw each record's inputs, and its outputs measured and predicted, side by side."""
    count = len(verification.traces)
    chosen = range(count) if records is None else np.ravel(records).tolist()
    for number in chosen:
        if not (isinstance(number, int) and 0 <= number < count):
            raise InputError(f"there are records 0 to {count - 1}, got {number!r}")
    drawings = [draw_verification("", verification, k, f"record {k}") for k in chosen]
    if not drawings:
        raise InputError("records is empty; leave it out for all records")
    return _drawn(_in_rows(drawings), axes)


def plot_linearization(
    model: Linearization, pairs: Sequence[str] | str | None, axes: Sequence[Axes] | None
) -> Figure:
    """Draw magnitude and phase of an exact model, delays included."""
    found = _exact(model)
    shown = _chosen(found.outputs, found.inputs, _own_axes(found) if pairs is None else pairs)
    return _drawn(_in_grid(shown, lambda o, i: draw_bode("", o, i, identified=found)), axes)


def plot_ratings(criterion: Criterion, ratings: Any, axes: Axes | None) -> Figure:
    """Draw ratings on the standard chart of their criterion."""
    from helisim.show import handling_shown  # which imports laws

    drawing = handling_shown.rating_drawing(criterion, ratings)
    return _drawn([[drawing]], None if axes is None else [axes])


def plot_design(result: DesignResult) -> Figure:
    """Draw the charts of a design's specifications, and its trade-offs."""
    from helisim.show import handling_shown

    return _drawn(_in_rows(handling_shown.design_drawings(result)), None)


def to_html(value: Any) -> str:
    """Return a value as a piece of a page; of one that has none, its `repr`."""
    for kind in type(value).__mro__:
        if kind.__name__ in _PAGES:
            return _page(*_PAGES[kind.__name__](value))
    return f"<pre>{escape(repr(value))}</pre>"


def _record_page(record: FlightRecord) -> tuple[str, ...]:
    flown = record.provenance
    facts = [f"{len(record)} samples over {record.duration:.4g} s", _sampling(record)]
    facts += [f"{name} {flown[name]}" for name in ("vehicle", "seed", "flight") if name in flown]
    names = [name for name in (*IN2, *RATES) if name in record]
    names = names or [name for name in (*IN1, *record.names) if name in record][:_FEW]
    made = str(flown.get("made_by", ""))
    return (
        "Flight record",
        html.paragraph("; ".join(filter(None, (*facts, made))) + "."),
        html.paragraph(f"Ended early: {record.ended}." if record.ended else "", "off"),
        _figures([_groups(record, names)] if names else []),
        _folded("channels", summaries.channels(record)),
    )


def _response_page(found: FrequencyResponse) -> tuple[str, ...]:
    shown = _chosen(found.outputs, found.inputs, None)[:_FEW]
    return (
        f"Frequency response: {', '.join(found.outputs)} over {', '.join(found.inputs)}",
        html.paragraph(
            f"{found.frequency.size} frequencies from {found.frequency[0]:.3g} to "
            f"{found.frequency[-1]:.3g} rad/s, {found.method} method, {len(found.sources)} "
            "record(s)."
        ),
        _titled(summaries.pairs(found)),
        _figures(draw_bode("", o, i, data=found) for o, i in shown),
        html.bullets(found.flags),
    )


def _fit_page(fit: Fit) -> tuple[str, ...]:
    low, high = fit.band
    item = IdentifiedModel(fit.structure.name, fit)
    shown = _chosen(fit.structure.outputs, fit.structure.inputs, None)[:_FEW]
    return (
        f"Fit: {fit.structure.name}",
        html.paragraph(
            f"{', '.join(fit.costs)} from {low:.3g} to {high:.3g} rad/s, {fit.method} method; "
            f"average cost {fit.cost:.4g}: {fit.judged}."
        ),
        html.table(tables.fitted(fit)),
        _folded("modes", modes.of_fit(fit)),
        _figures(pair_drawing(item, o, i) for o, i in shown),
        html.bullets(fit.remarks),
    )


def _modes_page(found: Modes) -> tuple[str, ...]:
    stable = "stable" if found.stable else "not stable"
    lead = f"{len(found.poles)} poles, {stable}; zeros of {', '.join(found.zeros)}."
    return ("Modes", html.paragraph(lead), html.table(modes.table(found)))


def _verification_page(verification: Verification) -> tuple[str, ...]:
    good = "acceptable" if verification.acceptable else "not acceptable"
    count = len(verification.traces)
    return (
        "Verification",
        html.paragraph(f"{count} record(s), Theil's coefficient {verification.tic:.3f}: {good}."),
        html.paragraph(f"{verification.approach}.") if verification.approach else "",
        html.table(_unnamed(tables.verification({"": verification.figures}))),
        _figures(
            draw_verification("", verification, k, f"record {k}") for k in range(min(count, _FEW))
        ),
    )


def _vehicle_page(shown: Vehicle) -> tuple[str, ...]:
    return (
        f"Vehicle: {shown.name}",
        html.paragraph(f"{len(shown.parameters)} parameters, model digest {shown.digest[:8]}."),
        html.table(summaries.vehicle(shown)),
        _exact_figures(shown.linearize()),
        _folded("parameters", summaries.parameters(shown)),
    )


def _linearization_page(model: Linearization) -> tuple[str, ...]:
    labels = model.system.input_labels
    kind = "sampled" if model.system.dt else "continuous"
    return (
        f"Linearization: from {', '.join(labels)}",
        html.paragraph(f"{kind}, {model.system.nstates} states; delays are beside it."),
        _exact_figures(model),
        _folded("modes", summaries.modes(model)),
    )


def _plan_page(plan: FlightPlan) -> tuple[str, ...]:
    drawn = None if plan.excitation is None else draw_excitation("", plan.excitation)
    return (
        f"Flight plan {plan.digest[:8]}" if plan.written else "Flight plan",
        html.table(summaries.plan(plan)),
        _figures([drawn] if drawn is not None and drawn.panels else []),
    )


def _results_page(results: Results) -> tuple[str, ...]:
    missed = results.misses
    judged = f"{len(missed)} tolerance(s) missed" if missed else "all tolerances hold"
    return (
        "Results",
        html.paragraph(f"Seed {results.seed}; {judged}."),
        *(_titled(tables.comparison(table)) for table in results.tables),
        _titled(tables.verification(results.verification)) if results.verification else "",
        html.bullets(missed),
    )


def _design_page(result: DesignResult) -> tuple[str, ...]:
    from helisim.show import handling_shown

    return handling_shown.design_parts(result)


def _run_page(run: Run) -> tuple[str, ...]:
    return _results_page(run.results)


_PAGES: dict[str, Callable[[Any], tuple[str, ...]]] = {
    "FlightRecord": _record_page,
    "FrequencyResponse": _response_page,
    "Fit": _fit_page,
    "Modes": _modes_page,
    "Verification": _verification_page,
    "Vehicle": _vehicle_page,
    "Linearization": _linearization_page,
    "FlightPlan": _plan_page,
    "Results": _results_page,
    "Run": _run_page,
    "DesignResult": _design_page,
}
"""By name, so that showing a record of one's own imports no simulator."""


def _page(title: str, *parts: str) -> str:
    inner = "\n".join(part for part in parts if part)
    return (
        f'<div class="helisim">\n<style>\n{_style()}</style>\n<h4>{escape(title)}</h4>\n'
        f"{inner}\n</div>"
    )


def _style() -> str:
    light = f"color-scheme: light; {colour_variables(LIGHT)} {_VERDICTS['light']}"
    dark = f"color-scheme: dark; {colour_variables(DARK)} {_VERDICTS['dark']}"
    own = files("helisim.show").joinpath("notebook.css").read_text(encoding="utf-8")
    drawn = "\n".join(f".helisim {rule}" for rule in drawing_style().splitlines())
    return (
        f".helisim {{ {light} }}\n"
        f"@media (prefers-color-scheme: dark) {{ .helisim {{ {dark} }} }}\n"
        f"{_within(_LIGHT_PAGES)} {{ {light} }}\n{_within(_DARK_PAGES)} {{ {dark} }}\n"
        f"{own}{drawn}\n"
    )


def _within(pages: Iterable[str]) -> str:
    return ", ".join(f"{page} .helisim" for page in pages)


def _figures(drawings: Iterable[Drawing]) -> str:
    return html.figures(drawings, anchors=False)


def _titled(table: Table) -> str:
    lead = f": {table.lead}" if table.lead else ""
    notes = "".join(html.paragraph(f"{label}: {text}") for label, text in table.notes)
    return html.paragraph(f"{table.title}{lead}") + html.table(table) + notes


def _in_rows(drawings: Sequence[Drawing]) -> list[Sequence[Drawing]]:
    """Return drawings in rows of two or three: a screen has no room for more."""
    wide = 2 if len(drawings) in (2, 4) else 3
    return [drawings[k : k + wide] for k in range(0, len(drawings), wide)]


def _exact_figures(model: Linearization) -> str:
    found = _exact(model)
    shown = _chosen(found.outputs, found.inputs, _own_axes(found))
    return _figures(draw_bode("", o, i, identified=found) for o, i in shown)


def _unnamed(table: Table) -> Table:
    """Return a table without its first column, the names of what is alone here."""
    return replace(table, columns=table.columns[1:], rows=tuple(row[1:] for row in table.rows))


def _folded(summary: str, table: Table) -> str:
    return f"<details><summary>{escape(summary)}</summary>{html.table(table)}</details>"


def _drawn(rows: Sequence[Sequence[Drawing]], axes: Sequence[Axes] | None) -> Figure:
    from helisim.show.canvas import draw_on, to_figure  # matplotlib is slow to import

    if axes is None:
        return to_figure(rows)
    return draw_on(axes, [drawing for row in rows for drawing in row])


def _chosen(
    outputs: Sequence[str], inputs: Sequence[str], pairs: Sequence[str] | str | None
) -> list[tuple[str, str]]:
    """Return pairs such as "p/lat" as output and input. Raises UnknownNameError."""
    known = {f"{output}/{input_}": (output, input_) for output in outputs for input_ in inputs}
    if pairs is None:
        return list(known.values())
    names = [pairs] if isinstance(pairs, str) else list(pairs)
    for name in names:
        if name not in known:
            raise UnknownNameError("response", name, known)
    if not names:
        raise InputError("pairs is empty; leave it out for all responses")
    return [known[name] for name in names]


def _in_grid(
    pairs: Sequence[tuple[str, str]], draw: Callable[[str, str], Drawing]
) -> Sequence[Sequence[Drawing]]:
    """Return drawings in rows: one an output where all pairs are shown, else of two or three."""
    outputs, inputs = ({pair[k] for pair in pairs} for k in (0, 1))
    if len(pairs) != len(outputs) * len(inputs):
        return _in_rows([draw(*pair) for pair in pairs])
    rows: dict[str, list[Drawing]] = {}
    for output, input_ in pairs:
        rows.setdefault(output, []).append(draw(output, input_))
    return list(rows.values())


def _own_axes(found: FrequencyResponse) -> list[str]:
    own = {pair.lower(): pair for pair in found.pairs}
    return [own[pair] for pair in _OWN_AXES if pair in own]


def _exact(model: Linearization) -> FrequencyResponse:
    highest = 0.9 * np.pi / model.system.dt if model.system.dt else np.inf
    omega = np.geomspace(_GRID[0], min(_GRID[1], highest), 300)
    names = model.system.input_labels, model.system.output_labels
    units = [[CHANNELS[name].unit for name in some] for some in names]
    return FrequencyResponse.exact(
        omega,
        model.response(omega),
        inputs=names[0],
        outputs=names[1],
        input_units=units[0],
        output_units=units[1],
    )


def _all_measured(record: FlightRecord) -> list[str]:
    measured = [one.name for one in record.channels if one.kind in _MEASURED]
    return measured or list(record.names)


def _groups(record: FlightRecord, names: Sequence[str]) -> Drawing:
    return draw_groups("flight", _title(record), record, names)


def _title(record: FlightRecord) -> str:
    flown = record.provenance.get("excitation")
    if isinstance(flown, dict) and {"kind", "axis"} <= set(flown):
        return f"{flown['kind']}, {flown['axis']}"
    mission = record.provenance.get("mission")
    if isinstance(mission, dict) and "kind" in mission:
        return f"mission {mission['kind']}"
    return "Flight record"


def _sampling(record: FlightRecord) -> str:
    steps = np.diff(record.time)
    if np.ptp(steps) <= 1e-3 * np.median(steps):
        return f"{1.0 / float(np.median(steps)):.4g} Hz"
    return f"steps of {np.min(steps):.3g} to {np.max(steps):.3g} s"
