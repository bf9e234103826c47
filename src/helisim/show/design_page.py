"""The page of a design: charts with levels, loops, steps; asked, predicted, exact and flown.

Nothing is designed or rated here; curves and ratings come with the result and its proof.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from helisim.design.design import DesignResult, Judged
from helisim.handling.criteria import NicholsExclusion
from helisim.handling.loop import BY_NAME, Curve, Loop, NoResponse, axis_of
from helisim.handling.measured.margins import MeasuredCurve, MeasuredLoop
from helisim.handling.spec import specs_to_toml
from helisim.records.record import FlightRecord
from helisim.show import page, tables
from helisim.show.charts import (
    Shown,
    chart_name,
    draw_chart,
    draw_judged,
    draw_loops,
)
from helisim.show.figure import Drawing
from helisim.show.page import paragraph
from helisim.show.plots import draw_compared

if TYPE_CHECKING:
    from helisim.design.proof import ComparedCriterion, Proof

REPORT = "report.html"
_OPEN = 1e-6
"""The gain of a loop below which there is no feedback."""
_ASKED = {
    "hard": "Kept whatever it costs",
    "soft": "To be in Level 1",
    "objective": "As good as the others let it be",
    "check": "Looked at only",
}
"""Kind of a specification -> its part in the design."""


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
    specs = page.preformatted(specs_to_toml(result.specs))
    source = page.preformatted(page.as_json(dict(result.provenance)))
    sections = [
        ("criteria", "Handling qualities", _criteria(result, proof)),
        ("numbers", "Asked, predicted, exact, flown", _numbers(result, proof)),
        ("loops", "Broken loops", _loops(known)),
        ("steps", "Before and after", _flights(proof)),
        ("law", "The law", page.preformatted(result.law.to_toml())),
        ("asked", "What was asked", page.folded("specs.toml", specs)),
        ("provenance", "Provenance", page.folded("the design", source)),
    ]
    title = "A control law from identified models"
    return page.write_page(Path(path), title, sections, _summary(result, proof))


def draw_step(axis: str, before: FlightRecord | None, after: FlightRecord) -> Drawing:
    """Draw the answer to a step of a stick: stick, angle or velocity, rate, command."""
    one = axis_of(axis)
    names = [one.stick, one.angle, *([one.rate] if one.rate else []), one.name]
    title = f"Step of the {one.word} stick"
    return draw_compared(f"step_{one.name}", title, names, before, after)


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
        flown = [
            (one.spec.criterion, one.flown.level)
            for one in proof.table
            if one.spec.kind in ("hard", "soft") and one.flown
        ]
        good = sum(level == 1 for _, level in flown)
        text += f" In flight {good} of {len(flown)} that were measured are in Level 1."
        said += [
            f"{criterion.name} of {criterion.word}: Level {level} in flight"
            for criterion, level in flown
            if level > 1
        ]
        said += [
            f"{name} was at its stops {100.0 * one:.2g} % of the time in rough air"
            for name, one in proof.flights.stops.share.items()
        ]
    return paragraph(text, "lead") + page.bullets(said)


def _criteria(result: DesignResult, proof: "Proof | None") -> str:
    """Return the charts, an axis after the other, strips together; curves stand with the loops."""
    compared = {} if proof is None else {chart_name(r.spec.criterion): r for r in proof.table}
    found: dict[str, list[Drawing]] = {}
    sources: dict[str, str] = {}
    for one in result.judged:
        criterion = one.nominal.criterion
        sources[criterion.name] = criterion.source
        if criterion.chart().across.figure:
            flown = compared.get(chart_name(criterion))
            drawn = draw_judged(one, _proved(flown), _verdict(one, flown))
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
    listed = [f"{name.replace('_', ' ')}: {source}" for name, source in sources.items()]
    blocks = [
        page.heading(BY_NAME[axis].word.capitalize())
        + "".join(
            page.figures(one for one in found[axis] if one.panels[0].bare is strip)
            for strip in (False, True)
        )
        for axis in BY_NAME
        if axis in found
    ]
    folded = page.folded("sources of the criteria", page.bullets(listed))
    return "\n".join([paragraph(lead, "note"), folded, *blocks])


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
    """Return the ratings that a proof adds to a chart."""
    if one is None:
        return []
    found = [Shown("exact", one.exact.figures)] if one.exact else []
    if one.flown:
        ends = {f.name: (f.flown.low, f.flown.high) for f in one.figures if f.flown is not None}
        found.append(Shown("flown", one.flown.figures, intervals=ends))
    return found


def _numbers(result: DesignResult, proof: "Proof | None") -> str:
    if proof is None:
        return ""
    was = {chart_name(one.nominal.criterion): one.before for one in result.judged}
    before = {k: was.get(chart_name(one.spec.criterion)) for k, one in enumerate(proof.table)}
    unknown = [
        f"{one.spec.criterion.name} of {one.spec.criterion.word}, {who}: {why}"
        for one in proof.table
        for who, why in one.unknown.items()
    ]
    said = page.folded("what is not known", page.bullets([*proof.remarks, *unknown]))
    return page.table(tables.proof_levels(proof, before)) + said


def _loops(loops: Mapping[str, Loop]) -> str:
    """Return the broken loop of each axis, over frequency and as gain over phase."""
    drawings: list[Drawing] = []
    for axis, one in BY_NAME.items():
        curves = dict(_closed(loops, axis))
        if "predicted" in curves or "exact" in curves:
            lines = {
                label: [curve.curve() if isinstance(curve, MeasuredCurve) else curve]
                for label, curve in curves.items()
            }
            chart = NicholsExclusion(axis=axis).chart()
            caption = (
                f"The loop of {one.word} as gain over phase, and the zone that it is to stay out of"
            )
            drawings += [
                draw_loops(f"loop_{axis}", f"Broken loop, {one.word}", curves),
                draw_chart(f"nichols_{axis}", chart, curves=lines, caption=caption),
            ]
    lead = (
        "Each loop is cut at its servo command, all others closed; a loop of negative feedback, "
        "with -1 the critical point. Bars: 95 % intervals of what was measured."
    )
    return paragraph(lead, "note") + page.figures(drawings) if drawings else ""


def _closed(loops: Mapping[str, Loop], axis: str) -> Iterator[tuple[str, Curve | MeasuredCurve]]:
    """Yield the known loops of an axis; the rounding error of an open one is none."""
    for label, loop in loops.items():
        try:
            measured = isinstance(loop, MeasuredLoop)
            curve = loop.measured("broken", axis) if measured else loop.broken(axis)
        except NoResponse:
            continue
        if np.max(np.abs(curve.response)) > _OPEN:
            yield label, curve


def _flights(proof: "Proof | None") -> str:
    if proof is None:
        return ""
    before = proof.before
    steps = proof.flights.steps.items()
    drawings = [draw_step(axis, before.get(f"step_{axis}"), record) for axis, record in steps]
    axes = [one for one in BY_NAME.values() if one.rate is not None]
    names: Sequence[str] = [one.angle for one in axes] + [one.name for one in axes]
    title = "Through a gust, sticks left alone"
    drawings.append(draw_compared("gust", title, names, before.get("gust"), proof.flights.gust))
    lead = (
        "Flown on the nonlinear vehicle, the pilot's hands off. Steps are as large as the vehicle "
        "stays linear, so they may differ."
    )
    return paragraph(lead, "note") + page.figures(drawings)
