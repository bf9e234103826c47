"""What a campaign says of the identification: bias, scatter, and what its bounds are worth."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from helisim.base.errors import UnknownNameError

_Z = 1.96
"""Standard errors to either side of a 95 % interval."""


@dataclass(frozen=True, kw_only=True)
class Summary:
    """How one parameter was found over the replicates of a group; errors relative to truth.

    Attributes:
        group: value by column.
        model, parameter: names.
        count: estimates.
        failed: replicates without one.
        bias: mean error.
        scatter: standard deviation of the error.
        stated: root mean square of the stated standard errors.
        cramer_rao: root mean square of the bounds.
        covered: share of the 95 % intervals, 1.96 stated standard errors, that hold the truth.
        covered_by_cr: share of the intervals of one bound to either side that do.
    """

    group: dict[str, Any]
    model: str
    parameter: str
    count: int
    failed: int
    bias: float
    scatter: float
    stated: float
    cramer_rao: float
    covered: float
    covered_by_cr: float


def summarise(table: pa.Table, *, by: Sequence[str] = ()) -> list[Summary]:
    """Summarise a campaign's dataset, a row for each parameter of each model in each group.

    Args:
        table: of `read_dataset`.
        by: columns whose values make the groups; all replicates together by default. Methods
            and numbers of flights are never mixed.

    Raises:
        UnknownNameError: no such column.
    """
    for name in by:
        if name not in table.column_names:
            raise UnknownNameError("column", name, table.column_names)
    grouped = list(dict.fromkeys([*by, "flights", "method"]))
    groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in table.to_pylist():
        key = tuple(_hashable(row[name]) for name in (*grouped, "model", "parameter"))
        groups.setdefault(key, []).append(row)
    return [
        _summary(dict(zip(grouped, key)), key[-2], key[-1], rows) for key, rows in groups.items()
    ]


def errors(rows: Sequence[dict[str, Any]]) -> NDArray[np.float64]:
    """Return the relative errors of the rows that have an estimate, (n_estimate,)."""
    return np.array(
        [(row["estimate"] - row["truth"]) / abs(row["truth"]) for row in rows if _judged(row)]
    )


def _judged(row: dict[str, Any]) -> bool:
    return row["estimate"] is not None and row["truth"] is not None


def _summary(
    group: dict[str, Any], model: str, parameter: str, rows: Sequence[dict[str, Any]]
) -> Summary:
    judged = [row for row in rows if _judged(row)]
    error = errors(judged)
    size = np.array([abs(row["truth"]) for row in judged])
    stated = np.array([row["standard_error"] for row in judged]) / size
    bound = np.array([row["cramer_rao"] for row in judged]) / size
    few = len(judged) == 0
    return Summary(
        group=group,
        model=model,
        parameter=parameter,
        count=len(judged),
        failed=sum(row["failure"] is not None for row in rows),
        bias=math.nan if few else float(error.mean()),
        scatter=float(error.std(ddof=1)) if len(judged) > 1 else math.nan,
        stated=math.nan if few else _rms(stated),
        cramer_rao=math.nan if few else _rms(bound),
        covered=math.nan if few else float(np.mean(np.abs(error) <= _Z * stated)),
        covered_by_cr=math.nan if few else float(np.mean(np.abs(error) <= bound)),
    )


def _rms(values: NDArray[np.float64]) -> float:
    return math.sqrt(float(np.mean(values**2)))


def _hashable(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


_HEADINGS = ("parameter", "n", "failed", "bias %", "scat. %", "SE %", "CR %", "in 95 %", "in CR")


def render(summaries: Sequence[Summary]) -> str:
    """Return the summaries as lines of at most 80 columns, a block for each group and model."""
    blocks: dict[str, list[str]] = {}
    for one in summaries:
        where = ", ".join(f"{name} {_text(value)}" for name, value in one.group.items())
        lines = blocks.setdefault(f"{one.model} ({where})", [])
        lines.append(_line(one))
    heading = f"  {_HEADINGS[0]:<12}" + "".join(f"{text:>8}" for text in _HEADINGS[1:])
    return "\n\n".join("\n".join([title, heading, *lines]) for title, lines in blocks.items())


def _line(one: Summary) -> str:
    percents = (one.bias, one.scatter, one.stated, one.cramer_rao)
    shares = (one.covered, one.covered_by_cr)
    return (
        f"  {one.parameter:<12}{one.count:8d}{one.failed:8d}"
        + "".join(f"{100.0 * value:8.2f}" for value in percents)
        + "".join(f"{100.0 * value:7.1f}%" for value in shares)
    )


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
