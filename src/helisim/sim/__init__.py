"""The simulated experiment: truth in flight, and what the flight computer records of it."""

from helisim.sim.excitation import Doublet, Excitation, Sweep
from helisim.sim.fly import fly, fly_each, simulate
from helisim.sim.folder import fly_to
from helisim.sim.instruments import Recorder
from helisim.sim.pilot import Pilot
from helisim.sim.truth import Truth, read_truth
from helisim.sim.weather import Gust, Weather

__all__ = [
    "Doublet",
    "Excitation",
    "Gust",
    "Pilot",
    "Recorder",
    "Sweep",
    "Truth",
    "Weather",
    "fly",
    "fly_each",
    "fly_to",
    "read_truth",
    "simulate",
]
