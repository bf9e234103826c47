"""The pictures of `plot` and the pages of a notebook: the reports' own figures and tables.

Values find this module by `helisim.base.display`; nobody below imports it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident import Fit, FrequencyResponse, Modes, Verification
from helisim.records.record import CHANNELS, IN1, IN2, RATES, FlightRecord
from helisim.show import page, tables
from helisim.show.figure import DARK, LIGHT, Drawing, colour_variables, drawing_style
from helisim.show.page import paragraph
from helisim.show.plots import (
    draw_bode,
    draw_excitation,
    draw_flight,
    draw_groups,
    draw_pair,
    draw_verification,
)
from helisim.show.table import Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from helisim.design.design import DesignResult
    from helisim.handling.criteria import Criterion
    from helisim.sim import FlightPlan
    from helisim.study.results import IdentifiedModel, Results, Run
    from helisim.vehicle import Linearization, Vehicle

Names = Sequence[str] | str | None
GivenAxes = Sequence["Axes"] | None

_FEW = 4
"""Figures of pairs that a notebook shows unasked."""
_MEASURED = ("IN1", "IN2", "OUT")
_OWN_AXES = ("w/col", "q/lon", "p/lat", "r/ped")
"""The response that each control is for; with sticks the same."""
_GRID = (0.1, 100.0)
"""rad/s, of an exact model: from the slow modes to beyond the rotor's and the servos'."""

# Jupyter, VS Code, Sphinx and Colab say on an element around which theme they have.
_LIGHT_PAGES = ('[data-jp-theme-light="true"]', ".vscode-light", '[data-theme="light"]')
_DARK_PAGES = ('[data-jp-theme-light="false"]', ".vscode-dark", '[data-theme="dark"]')
_VERDICTS = {
    "light": {"ok": "#1f6b33", "bad": "#a32014"},
    "dark": {"ok": "#6fcf87", "bad": "#ff8f80"},
}


def plot_record(record: FlightRecord, channels: Names, axes: GivenAxes) -> Figure:
    """Draw a record's channels, one panel each; by default all, grouped by kind."""
    if channels is None:
        measured = [one.name for one in record.channels if one.kind in _MEASURED]
        names = measured or list(record.names)
        return _figure([[draw_groups("flight", _title(record), record, names)]], axes)
    names = [channels] if isinstance(channels, str) else list(channels)
    record.select(names)  # raises for one that there is not
    if not names:
        raise InputError("channels is empty; leave it out for all channels")
    return _figure([[draw_flight("flight", _title(record), record, names)]], axes)


def plot_response(found: FrequencyResponse, pairs: Names, axes: GivenAxes) -> Figure:
    """Draw magnitude, phase and coherence of each pair, with two random errors as bars."""
    shown = _chosen(found.outputs, found.inputs, pairs)
    return _figure(_in_grid(shown, lambda o, i: draw_bode("", o, i, data=found)), axes)


def plot_fit(fit: Fit, pairs: Names, axes: GivenAxes) -> Figure:
    """Draw data, model, and their difference, for each pair."""
    item = _alone(fit)
    shown = _chosen(fit.structure.outputs, fit.structure.inputs, pairs)
    return _figure(_in_grid(shown, lambda o, i: draw_pair(item, o, i)), axes)


def plot_verification(
    verification: Verification, records: Sequence[int] | int | None, axes: GivenAxes
) -> Figure:
    """Draw each record's inputs, and its outputs measured and predicted, side by side."""
    count = len(verification.traces)
    chosen = range(count) if records is None else np.ravel(records).tolist()
    for number in chosen:
        if not (isinstance(number, int) and 0 <= number < count):
            raise InputError(f"there are records 0 to {count - 1}, got {number!r}")
    if not chosen:
        raise InputError("records is empty; leave it out for all records")
    return _figure(_in_rows(_predicted(verification, chosen)), axes)


def plot_linearization(model: Linearization, pairs: Names, axes: GivenAxes) -> Figure:
    """Draw magnitude and phase of an exact model, delays included."""
    found = _exact(model)
    shown = _chosen(found.outputs, found.inputs, _own_axes(found) if pairs is None else pairs)
    return _figure(_in_grid(shown, lambda o, i: draw_bode("", o, i, identified=found)), axes)


def plot_ratings(criterion: Criterion, ratings: Any, axes: Axes | None) -> Figure:
    """Draw ratings on the standard chart of their criterion."""
    from helisim.show.charts import draw_ratings

    return _figure([[draw_ratings(criterion, ratings)]], None if axes is None else [axes])


def plot_design(result: DesignResult) -> Figure:
    """Draw the charts of a design's specifications."""
    return _figure(_in_rows(_design_drawings(result)), None)


def to_html(value: Any) -> str:
    """Return a value as a piece of a page; of one that has none, its `repr`."""
    for kind in type(value).__mro__:
        if kind.__name__ in _PAGES:
            title, *parts = _PAGES[kind.__name__](value)
            inner = "\n".join(part for part in parts if part)
            return (
                f'<div class="helisim">\n<style>\n{_style()}</style>\n<h4>{escape(title)}</h4>\n'
                f"{inner}\n</div>"
            )
    return f"<pre>{escape(repr(value))}</pre>"


def _record_page(record: FlightRecord) -> tuple[str, ...]:
    flown = record.provenance
    steps = np.diff(record.time)
    rate = f"steps of {np.min(steps):.3g} to {np.max(steps):.3g} s"
    if np.ptp(steps) <= 1e-3 * np.median(steps):
        rate = f"{1.0 / float(np.median(steps)):.4g} Hz"
    facts = [f"{len(record)} samples over {record.duration:.4g} s", rate]
    facts += [f"{name} {flown[name]}" for name in ("vehicle", "seed", "flight") if name in flown]
    facts += [str(flown["made_by"])] if flown.get("made_by") else []
    names = [name for name in (*IN2, *RATES) if name in record]
    names = names or [name for name in (*IN1, *record.names) if name in record][:_FEW]
    drawn = [draw_groups("flight", _title(record), record, names)] if names else []
    return (
        "Flight record",
        paragraph("; ".join(facts) + "."),
        paragraph(f"Ended early: {record.ended}." if record.ended else "", "off"),
        _figures(drawn),
        _folded("channels", tables.channels(record)),
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
        _titled(tables.pairs(found)),
        _figures(draw_bode("", o, i, data=found) for o, i in shown),
        page.bullets(found.flags),
    )


def _fit_page(fit: Fit) -> tuple[str, ...]:
    low, high = fit.band
    item = _alone(fit)
    shown = _chosen(fit.structure.outputs, fit.structure.inputs, None)[:_FEW]
    return (
        f"Fit: {fit.structure.name}",
        paragraph(
            f"{', '.join(fit.costs)} from {low:.3g} to {high:.3g} rad/s, {fit.method} method; "
            f"average cost {fit.cost:.4g}: {fit.judged}."
        ),
        page.table(tables.fitted(fit)),
        _folded("modes", tables.fit_modes(fit)),
        _figures(draw_pair(item, o, i) for o, i in shown),
        page.bullets(fit.remarks),
    )


def _modes_page(found: Modes) -> tuple[str, ...]:
    stable = "stable" if found.stable else "not stable"
    lead = f"{len(found.poles)} poles, {stable}; zeros of {', '.join(found.zeros)}."
    return ("Modes", paragraph(lead), page.table(tables.modes(found)))


def _verification_page(verification: Verification) -> tuple[str, ...]:
    good = "acceptable" if verification.acceptable else "not acceptable"
    count = len(verification.traces)
    shown = tables.verification({"": verification.figures})
    # without the first column, the names of models: there is one here
    alone = replace(shown, columns=shown.columns[1:], rows=tuple(row[1:] for row in shown.rows))
    return (
        "Verification",
        paragraph(f"{count} record(s), Theil's coefficient {verification.tic:.3f}: {good}."),
        paragraph(f"{verification.approach}.") if verification.approach else "",
        page.table(alone),
        _figures(_predicted(verification, range(min(count, _FEW)))),
    )


def _vehicle_page(shown: Vehicle) -> tuple[str, ...]:
    return (
        f"Vehicle: {shown.name}",
        paragraph(f"{len(shown.parameters)} parameters, model digest {shown.digest[:8]}."),
        page.table(tables.vehicle(shown)),
        _exact_figures(shown.linearize()),
        _folded("parameters", tables.parameters(shown)),
    )


def _linearization_page(model: Linearization) -> tuple[str, ...]:
    kind = "sampled" if model.system.dt else "continuous"
    return (
        f"Linearization: from {', '.join(model.system.input_labels)}",
        paragraph(f"{kind}, {model.system.nstates} states; delays are beside it."),
        _exact_figures(model),
        _folded("modes", tables.linear_modes(model)),
    )


def _plan_page(plan: FlightPlan) -> tuple[str, ...]:
    drawn = None if plan.excitation is None else draw_excitation("", plan.excitation)
    return (
        f"Flight plan {plan.digest[:8]}" if plan.written else "Flight plan",
        page.table(tables.plan(plan)),
        _figures([drawn] if drawn is not None and drawn.panels else []),
    )


def _results_page(results: Results) -> tuple[str, ...]:
    missed = results.misses
    judged = f"{len(missed)} tolerance(s) missed" if missed else "all tolerances hold"
    return (
        "Results",
        paragraph(f"Seed {results.seed}; {judged}."),
        *(_titled(tables.comparison(table)) for table in results.tables),
        _titled(tables.verification(results.verification)) if results.verification else "",
        page.bullets(missed),
    )


def _run_page(run: Run) -> tuple[str, ...]:
    return _results_page(run.results)


def _design_page(result: DesignResult) -> tuple[str, ...]:
    lead = (
        f"{len(result.judged)} specifications; every hard and soft one keeps Level 1 in "
        f"{100.0 * result.share:.3g} % of {result.drawn} models drawn."
    )
    drawings = _figures(_design_drawings(result))
    return ("Design of a control law", paragraph(lead), page.bullets(result.misses), drawings)


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


def _style() -> str:
    light, dark = (
        f"color-scheme: {name}; {colour_variables(colours | _VERDICTS[name])}"
        for name, colours in (("light", LIGHT), ("dark", DARK))
    )
    own = "\n".join(f".helisim {rule}" for rule in drawing_style().splitlines())
    light_pages, dark_pages = (
        ", ".join(f"{one} .helisim" for one in some) for some in (_LIGHT_PAGES, _DARK_PAGES)
    )
    return (
        f".helisim {{ {light} }}\n"
        f"@media (prefers-color-scheme: dark) {{ .helisim {{ {dark} }} }}\n"
        f"{light_pages} {{ {light} }}\n{dark_pages} {{ {dark} }}\n"
        f"{page.asset('notebook.css')}{own}\n"
    )


def _figures(drawings: Iterable[Drawing]) -> str:
    return page.figures(drawings, anchors=False)


def _folded(summary: str, table: Table) -> str:
    return f"<details><summary>{escape(summary)}</summary>{page.table(table)}</details>"


def _titled(table: Table) -> str:
    lead = f": {table.lead}" if table.lead else ""
    notes = "".join(paragraph(f"{label}: {text}") for label, text in table.notes)
    return paragraph(f"{table.title}{lead}") + page.table(table) + notes


def _alone(fit: Fit) -> IdentifiedModel:
    from helisim.study.results import IdentifiedModel  # behind which stands the simulator

    return IdentifiedModel(fit.structure.name, fit)


def _predicted(verification: Verification, records: Iterable[int]) -> list[Drawing]:
    return [draw_verification("", verification, k, f"record {k}") for k in records]


def _design_drawings(result: DesignResult) -> list[Drawing]:
    """Return the chart of each criterion, laws before and after."""
    from helisim.show.charts import draw_judged  # which imports laws

    return [draw_judged(one) for one in result.judged]


def _exact_figures(model: Linearization) -> str:
    found = _exact(model)
    shown = _chosen(found.outputs, found.inputs, _own_axes(found))
    return _figures(draw_bode("", o, i, identified=found) for o, i in shown)


def _figure(rows: Sequence[Sequence[Drawing]], axes: GivenAxes) -> Figure:
    from helisim.show.canvas import draw_on, to_figure  # matplotlib is slow to import

    if axes is None:
        return to_figure(rows)
    return draw_on(axes, [drawing for row in rows for drawing in row])


def _chosen(outputs: Sequence[str], inputs: Sequence[str], pairs: Names) -> list[tuple[str, str]]:
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


def _in_rows(drawings: Sequence[Drawing]) -> list[Sequence[Drawing]]:
    """Return drawings in rows of two or three: a screen is no wider."""
    wide = 2 if len(drawings) in (2, 4) else 3
    return [drawings[k : k + wide] for k in range(0, len(drawings), wide)]


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


def _title(record: FlightRecord) -> str:
    flown = record.provenance.get("excitation")
    if isinstance(flown, dict) and {"kind", "axis"} <= set(flown):
        return f"{flown['kind']}, {flown['axis']}"
    mission = record.provenance.get("mission")
    if isinstance(mission, dict) and "kind" in mission:
        return f"mission {mission['kind']}"
    return "Flight record"
