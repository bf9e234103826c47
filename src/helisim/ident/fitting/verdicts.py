"""Words for what the data say of a parameter: its support.

Support is no agreement. A poorly supported value can agree with a reference by luck, and a well
supported one can differ from it because the structure lacks something; how a value agrees with a
reference is said by whoever has one, in words of its own.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

CRAMER_RAO_LIMIT = 20.0
"""Percent of the value above which a Cramér-Rao bound says "poor" (Tischler and Remple).

It holds a factor of 2, so two standard errors are held to it as well: they can be the larger, of
an estimate whose noise is more than the cost supposes.
"""

INSENSITIVITY_LIMIT = 10.0
"""Percent of the value above which an insensitivity says "poor" (Tischler and Remple)."""

Support = Literal["good", "poor", "not seen", "at bound", "degenerate", "fixed"]

SUPPORT: Mapping[Support, str] = MappingProxyType(
    {
        "good": (
            "the data fix it: its Cramér-Rao bound and two standard errors are at most "
            f"{CRAMER_RAO_LIMIT:g} % of the value, its insensitivity at most "
            f"{INSENSITIVITY_LIMIT:g} %"
        ),
        "poor": "the data see it, but not that well",
        "not seen": "the data do not change with it at all",
        "at bound": "the search ended at a limit that it was given: the value is the limit's",
        "degenerate": "the data see only a combination of it with others: it means nothing alone",
        "fixed": "it was given, not estimated",
    }
)
"""Word -> what it says of a parameter."""


def meanings() -> str:
    """Return what each word says, a line each."""
    return "\n".join(f"{word}: {meaning}" for word, meaning in SUPPORT.items())


def support(
    value: float,
    bound: float,
    insensitivity: float,
    *,
    fixed: bool = False,
    at_bound: bool = False,
    degenerate: bool = False,
) -> Support:
    """Return in a word what the data say of a parameter; `SUPPORT` has the meanings.

    Args:
        value: what was found.
        bound: by how much it can be wrong, in its unit; infinite where nothing limits it.
        insensitivity: how far it alone can move with little effect on the cost, in its unit.
        fixed: it was given.
        at_bound: the search ended at a limit of it.
        degenerate: the model around it has collapsed.
    """
    if fixed:
        return "fixed"
    if not math.isfinite(insensitivity):
        return "not seen"
    if degenerate or not math.isfinite(bound):
        return "degenerate"
    if at_bound:
        return "at bound"
    size = abs(value)
    good = 100.0 * bound <= CRAMER_RAO_LIMIT * size
    return "good" if good and 100.0 * insensitivity <= INSENSITIVITY_LIMIT * size else "poor"
