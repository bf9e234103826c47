"""What a reader should know of a fit beside its numbers."""

from typing import TYPE_CHECKING

from helisim.ident.fitting.doubts import doubts
from helisim.ident.fitting.points import enough
from helisim.ident.fitting.suspicion import shapes
from helisim.ident.model.paths import connected

if TYPE_CHECKING:
    from helisim.ident.fitting.result import Fit


def remarks(fit: "Fit") -> list[str]:
    """Return what a reader should know beside the numbers, the gravest first, a line each."""
    found = list(fit.degenerate)
    if not fit.converged:
        found.append(
            "the search did not converge: give better starts (--start NAME=VALUE), or fix a "
            "parameter (--fix NAME=VALUE)"
        )
    if fit.searches_agreeing < 2:
        found.append(
            "no two starts, at different delays where there are any, ended in this minimum: "
            "try more searches (--searches N), or say where to start (--start NAME=VALUE)"
        )
    found.extend(doubts(fit))
    if fit.at_bound:
        found.append(
            f"at a bound: {', '.join(fit.at_bound)}; widen it (--bounds NAME=LO:HI), or doubt the "
            "structure"
        )
    reached = connected(fit.structure)
    incoherent = [name for name in fit.dropped if name in reached]
    if incoherent:
        found.append(f"left out for lack of coherence: {', '.join(incoherent)}")
    found.extend(_unreached(fit))
    found.extend(f"{a} and {b} are correlated by {r:.3f}" for a, b, r in fit.correlated)
    found.extend(one.text for one in shapes(fit))
    return found + list(fit.data.flags)


def _unreached(fit: "Fit") -> list[str]:
    """Return a line on coherent responses for which the structure has no path, if there are any."""
    reached = connected(fit.structure)
    seen = [
        name
        for name in fit.dropped
        if name not in reached and enough(fit.data, *name.split("/", 1))
    ]
    if not seen:
        return []
    return [
        f"coherent, yet zero in the structure: {', '.join(seen)}; left out: chance, or a coupling "
        "that the structure lacks"
    ]
