"""The page of a design: charts with levels, loops, steps, what was foretold and what flew.

Nothing is designed or rated here; curves and ratings come with the result and its proof.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from helisim.base.files import atomic_write
from helisim.design.result import DesignResult, Judged
from helisim.handling.axis import BY_NAME
from helisim.handling.criteria import NicholsExclusion, Rating
from helisim.handling.curve import Curve
from helisim.handling.loop import Loop, NoResponse
from helisim.handling.measured.loop import MeasuredLoop
from helisim.handling.measured.measured_curve import MeasuredCurve
from helisim.handling.spec import specs_to_toml
from helisim.show import html
from helisim.show.before_after import draw_gust, draw_step
from helisim.show.chart_drawing import Shown, draw_chart
from helisim.show.design_rows import proof_table
from helisim.show.handling_shown import drawing_name, judged
from helisim.show.loop_drawing import Loops, draw_loops
from helisim.show.report import as_json
from helisim.show.svg import Drawing
from helisim.show.tradeoff_drawing import draw_trade_off

if TYPE_CHECKING:
    from helisim.study.proof.comparison import ComparedCriterion
    from helisim.study.proof.prove import Proof

REPORT = "report.html"
_OPEN = 1e-6
"""The gain of a loop below which no feedback is meant."""

_ASKED = {
    "hard": "Kept whatever it costs",
    "soft": "To be in Level 1",
    "objective": "As good as the others let it be",
    "check": "Looked at only",
}
"""Kind of a specification -> what it was in the design."""


def write_design_page(
    path: str | Path,
    result: DesignResult,
    *,
    proof: "Proof | None" = None,
    predicted: Loop | None = None,
    before: Loop | None = None,
) -> Path:
    """Write the page of a design and return its path.

    Args:
        path: of the HTML file.
        result: of the design.
        proof: of its law in flight; None if it wasn't flown.
        predicted: the identified model's loop with the law; the proof's by default.
        before: the identified model's loop with the law before.

    Raises:
        StorageError: it can't be written.
    """
    if predicted is None and proof is not None:
        predicted = proof.predicted
    loops: dict[str, Loop | None] = {"before": before, "predicted": predicted}
    if proof is not None:
        loops |= {"exact": proof.exact, "flown": proof.measured}
    known = {label: loop for label, loop in loops.items() if loop is not None}
    sections = [
        ("criteria", "Handling qualities", _criteria(result, proof)),
        ("numbers", "Asked, predicted, exact, flown", _numbers(result, proof)),
        ("loops", "Broken loops", _loops(known)),
        ("steps", "Before and after", _flights(proof)),
        ("trade", "What phase margin costs", _trade_offs(result)),
        ("law", "The law", html.preformatted(result.law.to_toml())),
        ("asked", "What was asked", html.folded("specs.toml", specs_to_toml(result.specs))),
        ("provenance", "Provenance", html.folded("the design", as_json(dict(result.provenance)))),
    ]
    text = html.page("A control law from identified models", sections, _summary(result, proof))
    path = Path(path)
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def _summary(result: DesignResult, proof: "Proof | None") -> str:
    asked = [one for one in result.judged if one.spec.kind in ("hard", "soft")]
    first = sum(one.nominal.level == 1 for one in asked)
    text = (
        f"{first} of {len(asked)} specifications are in Level 1 in the identified model, all of "
        f"them in {100.0 * result.share:.3g} % of {result.drawn} models that the records leave "
        "possible."
    )
    said = list(result.misses)
    if proof is not None:
        flown = [one for one in proof.table if one.spec.kind in ("hard", "soft") and one.flown]
        good = sum(one.flown.level == 1 for one in flown if one.flown)
        text += f" In flight {good} of {len(flown)} that were measured are in Level 1."
        said += [
            f"{one.spec.criterion.name} of {one.spec.criterion.word}: Level {one.flown.level} in "
            "flight"
            for one in flown
            if one.flown and one.flown.level > 1
        ]
        said += _stops(proof)
    return html.paragraph(text, "lead") + html.bullets(said)


def _stops(proof: "Proof") -> list[str]:
    share = proof.flights.stops.share
    return [
        f"{name} was at its stops {100.0 * one:.2g} % of the time in rough air"
        for name, one in share.items()
    ]


def _criteria(result: DesignResult, proof: "Proof | None") -> str:
    """Return the charts, an axis after the other; curves are in the section of loops."""
    compared = {} if proof is None else {drawing_name(r.spec.criterion): r for r in proof.table}
    found: dict[str, list[Drawing]] = {}
    for one in result.judged:
        criterion = one.nominal.criterion
        chart = criterion.chart()
        if chart.across.figure:
            flown = compared.get(drawing_name(criterion))
            shown = judged(one) + _proved(flown)
            caption = _verdict(one, flown)
            drawn = draw_chart(drawing_name(criterion), chart, shown, caption=caption)
            found.setdefault(criterion.axis, []).append(drawn)
    lead = (
        "Grey squares: the law before, in the identified model. Rings: the designed law, predicted "
        "by the identified model, in a cloud of the models that its records leave possible."
    )
    if proof is not None:
        lead += (
            " Crosses: exact, by linearising the model that flew. Dots: measured in flight, with "
            "95 % intervals."
        )
    blocks = [_of_one_axis(axis, found[axis]) for axis in BY_NAME if axis in found]
    sources = {one.nominal.criterion.name: one.nominal.criterion.source for one in result.judged}
    listed = [f"{name.replace('_', ' ')}: {source}" for name, source in sources.items()]
    return "\n".join(
        [html.paragraph(lead, "note"), html.folded_list("sources of the criteria", listed), *blocks]
    )


def _of_one_axis(axis: str, drawings: Sequence[Drawing]) -> str:
    """Return the charts of an axis, strips together."""
    strips = [one for one in drawings if one.panels[0].bare]
    others = [one for one in drawings if not one.panels[0].bare]
    word = BY_NAME[axis].word
    return html.heading(word.capitalize()) + html.figures(others) + html.figures(strips)


def _verdict(one: Judged, flown: "ComparedCriterion | None") -> str:
    """Return in a line how a law stands by one specification."""
    if one.spec.kind == "objective":
        return f"{_ASKED[one.spec.kind]}: its borders only weigh it against others"
    words = [f"{_ASKED[one.spec.kind]}. Predicted: Level {one.nominal.level}"]
    if one.cloud:
        words.append(f"Level 1 in {100.0 * one.share:.3g} % of the models drawn")
    if flown is not None and flown.flown is not None:
        words.append(f"flown: Level {flown.flown.level}")
    return ", ".join(words)


def _proved(one: "ComparedCriterion | None") -> list[Shown]:
    """Return what a proof adds to a chart."""
    if one is None:
        return []
    found = [Shown("exact", one.exact.figures)] if one.exact else []
    if one.flown:
        ends = {
            figure.name: (figure.flown.low, figure.flown.high)
            for figure in one.figures
            if figure.flown is not None
        }
        found.append(Shown("flown", one.flown.figures, intervals=ends))
    return found


def _numbers(result: DesignResult, proof: "Proof | None") -> str:
    if proof is None:
        return ""
    was = {drawing_name(one.nominal.criterion): one for one in result.judged}
    before = {
        k: _before(was, drawing_name(one.spec.criterion)) for k, one in enumerate(proof.table)
    }
    remarks = list(proof.remarks)
    for one in proof.table:
        name = f"{one.spec.criterion.name} of {one.spec.criterion.word}"
        remarks += [f"{name}, {who}: {why}" for who, why in one.unknown.items()]
    return html.table(proof_table(proof, before)) + html.folded_list("what is not known", remarks)


def _before(was: Mapping[str, Judged], name: str) -> Rating | None:
    return was[name].before if name in was else None


def _loops(loops: Mapping[str, Loop]) -> str:
    """Return the broken loop of each axis, over frequency and as gain over phase."""
    drawings = []
    for axis in BY_NAME:
        curves = {label: _broken(loop, axis) for label, loop in loops.items()}
        there = {label: one for label, one in curves.items() if one and _closed(one)}
        if "predicted" in there or "exact" in there:
            drawings += _of_axis(axis, there)
    if not drawings:
        return ""
    lead = (
        "Each loop is cut at its servo command, all others closed; a loop of negative feedback, "
        "with -1 the critical point. Bars: 95 % intervals of what was measured."
    )
    return html.paragraph(lead, "note") + html.figures(drawings)


def _closed(curve: Curve | MeasuredCurve) -> bool:
    """Return whether a loop is there at all: what rounding leaves of an open one is none."""
    return bool(np.max(np.abs(curve.response)) > _OPEN)


def _of_axis(axis: str, curves: Loops) -> list[Drawing]:
    word = BY_NAME[axis].word
    bode = draw_loops(f"loop_{axis}", f"Broken loop, {word}", curves)
    lines = {label: [_line(curve)] for label, curve in curves.items()}
    chart = NicholsExclusion(axis=axis).chart()
    caption = f"The loop of {word} as gain over phase, and the zone that it is to stay out of"
    return [bode, draw_chart(f"nichols_{axis}", chart, curves=lines, caption=caption)]


def _line(curve: Curve | MeasuredCurve) -> Curve:
    return curve.curve() if isinstance(curve, MeasuredCurve) else curve


def _broken(loop: Loop, axis: str) -> Curve | MeasuredCurve | None:
    """Return the loop of an axis, with its draws if it was measured; None where it isn't known."""
    try:
        if isinstance(loop, MeasuredLoop):
            return loop.curves.broken(axis)
        return loop.broken(axis)
    except NoResponse:
        return None


def _flights(proof: "Proof | None") -> str:
    if proof is None:
        return ""
    before = proof.before
    drawings = [
        draw_step(axis, before.get(f"step_{axis}"), record)
        for axis, record in proof.flights.steps.items()
    ]
    drawings.append(draw_gust(before.get("gust"), proof.flights.gust))
    lead = (
        "Flown on the nonlinear vehicle, the pilot's hands off. Steps are as large as the vehicle "
        "stays linear, so they may differ."
    )
    return html.paragraph(lead, "note") + html.figures(drawings)


def _trade_offs(result: DesignResult) -> str:
    drawings: Sequence[Drawing] = [draw_trade_off(one) for one in result.trade_offs]
    return html.figures(drawings)
