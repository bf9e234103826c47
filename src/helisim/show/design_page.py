"""The page of a design: charts with levels, loops, steps and figures."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from helisim.base.settings import grouped
from helisim.design.design import DesignResult, Judged
from helisim.handling.loop import BY_NAME, Curve, Loop, NoResponse
from helisim.handling.spec import specs_to_toml
from helisim.show import page, tables
from helisim.show.charts import Shown, chart_name, draw_judged, draw_loops
from helisim.show.figure import Drawing
from helisim.show.page import paragraph
from helisim.show.plots import draw_compared

if TYPE_CHECKING:
    from helisim.design.proof import ComparedCriterion, Proof

REPORT = "report.html"
_OPEN = 1e-6  # gain of a loop below which it counts as open
_ASKED = {  # kind of a specification -> its part in the design
    "hard": "Kept whatever it costs",
    "soft": "To be in Level 1",
    "objective": "As good as the others let it be",
    "check": "Looked at only",
}


def write_design_page(
    path: str | Path,
    result: DesignResult,
    *,
    proof: "Proof | None" = None,
    predicted: Loop | None = None,
    before: Loop | None = None,
) -> Path:
    """Write the page of a design and return its path. Raises StorageError.

    `predicted` (by default the proof's) and `before` are the model's loops with each law.
    """
    loops = {"before": before, "predicted": predicted or (proof and proof.predicted)}
    if proof is not None:
        loops |= {"exact": proof.exact, "flown": proof.measured}
    known = {label: loop for label, loop in loops.items() if loop is not None}
    specs, source = specs_to_toml(result.specs), page.as_json(dict(result.provenance))
    sections = [
        ("criteria", "Handling qualities", _criteria(result, proof)),
        ("numbers", "Asked, predicted, exact, flown", _numbers(result, proof) if proof else ""),
        ("loops", "Broken loops", _loops(known)),
        ("steps", "Before and after", page.figures(_flights(proof)) if proof else ""),
        ("law", "The law", page.preformatted(result.law.to_toml())),
        ("asked", "What was asked", page.folded("specs.toml", page.preformatted(specs))),
        ("provenance", "Provenance", page.folded("the design", source)),
    ]
    return page.write_page(
        Path(path), "A control law from identified models", sections, _summary(result, proof)
    )


def verdict(result: DesignResult, proof: "Proof | None") -> str:
    """Return how many specifications are in Level 1, and first what is worse than before."""
    flown = {} if proof is None else {chart_name(one.spec.criterion): one for one in proof.table}
    worse = []
    for one in result.judged:
        criterion, proved = one.nominal.criterion, flown.get(chart_name(one.nominal.criterion))
        now = (proved and (proved.flown or proved.exact)) or one.nominal
        if one.before is not None and now.level > one.before.level:
            name = criterion.name.replace("_", " ")
            worse.append(f"{criterion.word} {name} Level {now.level} (was {one.before.level})")
    start = f"Worse than with the law before: {', '.join(worse)}. " if worse else ""
    asked = [one for one in result.judged if one.spec.kind in ("hard", "soft")]
    first = sum(one.nominal.level == 1 for one in asked)
    text = (
        f"{start}{first} of {len(asked)} specifications are in Level 1 in the identified model, "
        f"all of them in {100.0 * result.share:.3g} % of {result.samples} models that the records "
        "leave possible."
    )
    if proof is not None:
        rated = [one for one in proof.table if one.spec.kind in ("hard", "soft") and one.flown]
        good = sum(one.flown.level == 1 for one in rated if one.flown)
        text += f" In flight {good} of {len(rated)} that were measured are in Level 1."
    return text


def _summary(result: DesignResult, proof: "Proof | None") -> str:
    said = [
        f"{k} was at its stops {100.0 * x:.2g} % of the time in rough air"
        for k, x in ({} if proof is None else proof.stops).items()
    ]
    return paragraph(verdict(result, proof), "lead") + page.bullets([*result.misses, *said])


def _criteria(result: DesignResult, proof: "Proof | None") -> str:
    compared = {} if proof is None else {chart_name(r.spec.criterion): r for r in proof.table}
    found = grouped(result.judged, lambda one: one.nominal.criterion.axis)

    def drawn(one: Judged) -> Drawing:
        criterion = one.nominal.criterion
        words = f"{_ASKED[one.spec.kind]}. Level 1 in {100.0 * one.share:.3g} % of the models"
        return draw_judged(
            one,
            _proved(compared.get(chart_name(criterion))),
            f"{words} drawn. {criterion.source}",
        )

    lead = (
        "Grey squares: the law before, in the identified model. Rings: the designed law, predicted "
        "by the identified model, in a cloud of the models that its records leave possible. "
        "Crosses: exact, by linearising the model that flew. Dots: measured in flight, with 95 % "
        "intervals."
    )
    blocks = (
        page.heading(BY_NAME[axis].word.capitalize()) + page.figures(map(drawn, found[axis]))
        for axis in BY_NAME
        if axis in found
    )
    return "\n".join([paragraph(lead, "note"), *blocks])


def _proved(one: "ComparedCriterion | None") -> list[Shown]:
    found = [Shown("exact", one.exact.figures)] if one and one.exact else []
    if one and one.flown:
        ends = {name: (each.low, each.high) for name, each in one.intervals.items()}
        found.append(Shown("flown", one.flown.figures, intervals=ends))
    return found


def _numbers(result: DesignResult, proof: "Proof") -> str:
    was = {chart_name(one.nominal.criterion): one.before for one in result.judged}
    before = {k: was.get(chart_name(one.spec.criterion)) for k, one in enumerate(proof.table)}
    unknown = [
        f"{one.spec.criterion.name} of {one.spec.criterion.word}, {who}: {why}"
        for one in proof.table
        for who, why in one.unknown.items()
    ]
    said = page.folded("what is not known", page.bullets([*proof.remarks, *unknown]))
    return page.table(tables.proof(proof, before)) + said


def _loops(loops: Mapping[str, Loop]) -> str:
    drawings = []
    for axis, one in BY_NAME.items():
        curves = dict(_closed(loops, axis))
        if "predicted" in curves or "exact" in curves:
            drawings.append(draw_loops(f"loop_{axis}", f"Broken loop, {one.word}", curves))
    lead = (
        "Each loop is cut at its servo command, all others closed; a loop of negative feedback, "
        "with -1 the critical point. Bars: 95 % intervals of what was measured."
    )
    return paragraph(lead, "note") + page.figures(drawings) if drawings else ""


def _closed(loops: Mapping[str, Loop], axis: str) -> Iterator[tuple[str, Curve]]:
    for label, loop in loops.items():
        try:
            curve = loop.broken(axis)
        except NoResponse:
            continue
        if np.max(np.abs(curve.response)) > _OPEN:
            yield label, curve


def _flights(proof: "Proof") -> Iterator[Drawing]:
    for name, record in proof.events.items():
        flights = {"before": proof.before.get(name), "designed": record}
        if name == "gust":
            axes = [one for one in BY_NAME.values() if one.rate is not None]
            names = [one.angle for one in axes] + [one.name for one in axes]
            title = "Through a gust, sticks left alone"
        else:
            one = BY_NAME[name.removeprefix("step_")]
            names = [each for each in (one.stick, one.angle, one.rate, one.name) if each]
            title = f"Step of the {one.word} stick"
        yield draw_compared(name, title, names, flights)
