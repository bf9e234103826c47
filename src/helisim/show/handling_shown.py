"""What `plot` and a notebook show of ratings and of a design."""

from collections.abc import Mapping, Sequence
from typing import Any

from helisim.base.errors import InputError
from helisim.design.result import DesignResult, Judged
from helisim.handling.criteria import Criterion, Rating
from helisim.show import html
from helisim.show.chart_drawing import Shown, draw_chart
from helisim.show.svg import Drawing
from helisim.show.tradeoff_drawing import draw_trade_off

Ratings = Rating | Sequence[Rating]


def rating_drawing(
    criterion: Criterion, ratings: Ratings | Mapping[str, Ratings | None]
) -> Drawing:
    """Return the chart of a criterion with ratings.

    Args:
        criterion: whose chart it is.
        ratings: one, or several (a cloud of draws), or a mapping from a label to either, of
            several the first the nominal one; None where there is none.

    Raises:
        InputError: something is no rating, or not of that kind of criterion.
    """
    labelled = ratings if isinstance(ratings, Mapping) else {"": ratings}
    there = {label: some for label, some in labelled.items() if some is not None}
    shown = [_shown(criterion, label, some) for label, some in there.items()]
    return draw_chart(criterion.name, criterion.chart(), shown)


def design_drawings(result: DesignResult) -> list[Drawing]:
    """Return the chart of each criterion, laws before and after, and the trade-offs."""
    charts = [judged_drawing(one) for one in result.judged]
    return [*charts, *(draw_trade_off(one) for one in result.trade_offs)]


def design_parts(result: DesignResult) -> tuple[str, ...]:
    """Return a design as parts of a page, its title first."""
    lead = (
        f"{len(result.judged)} specifications; every hard and soft one keeps Level 1 in "
        f"{100.0 * result.share:.3g} % of {result.drawn} models drawn."
    )
    return (
        "Design of a control law",
        html.paragraph(lead),
        html.bullets(result.misses),
        html.figures(design_drawings(result), anchors=False),
    )


def judged_drawing(one: Judged) -> Drawing:
    """Return the chart of one specification with laws before and after, by the models alone."""
    return draw_chart(
        drawing_name(one.nominal.criterion), one.nominal.criterion.chart(), judged(one)
    )


def judged(one: Judged) -> list[Shown]:
    """Return what a design says of one specification, for its chart."""
    before = [Shown("before", one.before.figures)] if one.before else []
    return [*before, Shown("predicted", one.nominal.figures, [each.figures for each in one.cloud])]


def drawing_name(criterion: Criterion) -> str:
    """Return a name for the drawing of a criterion of one axis."""
    more = (getattr(criterion, name, None) for name in ("at", "by"))
    return "_".join(filter(None, (criterion.name, criterion.axis, *more)))


def _shown(criterion: Criterion, label: str, ratings: Any) -> Shown:
    some = [ratings] if isinstance(ratings, Rating) else list(ratings)
    for one in some:
        if not (isinstance(one, Rating) and isinstance(one.criterion, type(criterion))):
            raise InputError(f"expected ratings by {criterion.name}, got {one!r:.60}")
    if not some:
        raise InputError(f"no rating under {label!r}: leave the label out")
    return Shown(label, some[0].figures, [one.figures for one in some[1:]])
