"""Criteria of handling qualities and of stability: what is asked of a loop, by which source.

A criterion asks a `Loop` for the responses that it needs, computes its `figures` and says which
level they are and how far from the border of Level 1. An own one derives from `Criterion`.
"""

from helisim.handling.criteria.criterion import Criterion, Limit, Rating
from helisim.handling.criteria.stability import StabilityMargins

__all__ = ["Criterion", "Limit", "Rating", "StabilityMargins"]
