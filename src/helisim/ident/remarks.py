"""What a reader should know of a fit beside its numbers."""

from typing import TYPE_CHECKING

from helisim.ident.doubts import doubts
from helisim.ident.suspicion import shapes

if TYPE_CHECKING:
    from helisim.ident.result import Fit


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
    if fit.dropped:
        found.append(f"left out for lack of coherence: {', '.join(fit.dropped)}")
    found.extend(f"{a} and {b} are correlated by {r:.3f}" for a, b, r in fit.correlated)
    found.extend(one.text for one in shapes(fit))
    return found + list(fit.data.flags)
