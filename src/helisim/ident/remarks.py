"""What a reader should know of a fit beside its numbers."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from helisim.ident.result import Fit


def remarks(fit: "Fit") -> list[str]:
    """Return what a reader should know beside the numbers, the gravest first, a line each."""
    found = list(fit.degenerate)
    if not fit.converged:
        found.append("the search did not converge: give better starts, or fix a parameter")
    if fit.searches_agreeing < 2:
        found.append(
            "no two starts, at different delays where there are any, ended in this minimum: "
            "try more searches, or say where to start"
        )
    if fit.dropped:
        found.append(f"left out for lack of coherence: {', '.join(fit.dropped)}")
    found.extend(f"{a} and {b} are correlated by {r:.3f}" for a, b, r in fit.correlated)
    return found + list(fit.data.flags)
