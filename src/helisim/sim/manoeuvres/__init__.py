"""The shipped manoeuvres: steps, sweeps, multisines, recorded histories, and what joins them."""

from helisim.sim.manoeuvres.composite import Sequence, Together
from helisim.sim.manoeuvres.history import History, Manoeuvre
from helisim.sim.manoeuvres.multisine import Multisine
from helisim.sim.manoeuvres.multistep import Doublet, Pulse, Step, ThreeTwoOneOne
from helisim.sim.manoeuvres.sweep import Chirp, Sweep

__all__ = [
    "Chirp",
    "Doublet",
    "History",
    "Manoeuvre",
    "Multisine",
    "Pulse",
    "Sequence",
    "Step",
    "Sweep",
    "ThreeTwoOneOne",
    "Together",
]
