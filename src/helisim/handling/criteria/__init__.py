"""Criteria of handling qualities and of stability: what is asked of a loop, by which source.

A criterion asks a `Loop` for the responses that it needs, computes its `figures` and says which
level they are and how far from the border of Level 1. An own one derives from `Criterion`.
"""

from helisim.handling.criteria.actuators import ActuatorOnset, ActuatorUse
from helisim.handling.criteria.bandwidth import AttitudeBandwidth
from helisim.handling.criteria.coupling import Coupling
from helisim.handling.criteria.criterion import Criterion, Rating
from helisim.handling.criteria.crossover import Crossover, CrossoverOrder
from helisim.handling.criteria.hold import AttitudeHold
from helisim.handling.criteria.limit import Border, Limit
from helisim.handling.criteria.load_rejection import LoadRejection
from helisim.handling.criteria.nichols import DiskMargin, NicholsExclusion
from helisim.handling.criteria.poles import Damping, PoleLimits
from helisim.handling.criteria.quickness import AttitudeQuickness
from helisim.handling.criteria.rejection import DisturbanceRejection
from helisim.handling.criteria.stability import StabilityMargins

__all__ = [
    "ActuatorOnset",
    "ActuatorUse",
    "AttitudeBandwidth",
    "AttitudeHold",
    "AttitudeQuickness",
    "Border",
    "Coupling",
    "Criterion",
    "Crossover",
    "CrossoverOrder",
    "Damping",
    "DiskMargin",
    "DisturbanceRejection",
    "Limit",
    "LoadRejection",
    "NicholsExclusion",
    "PoleLimits",
    "Rating",
    "StabilityMargins",
]
