"""Fly a plan and record it: the simulated experiment, and the benches on the ground (`rigs`)."""

from helisim.sim import missions
from helisim.sim.excitation import Excitation
from helisim.sim.flight import fly, fly_each, fly_to, simulate
from helisim.sim.ground import Deck, Ground, Swing
from helisim.sim.limits import FlightEnvelope
from helisim.sim.manoeuvres import (
    Chirp,
    Doublet,
    History,
    Pulse,
    Sequence,
    Step,
    Sweep,
    ThreeTwoOneOne,
    Together,
)
from helisim.sim.missions import Mission
from helisim.sim.multisine import Multisine
from helisim.sim.plan import (
    FAULTS,
    Fault,
    FlightPlan,
    Pilot,
    RecordGap,
    SampleLoss,
    ServoStuck,
    read_plan,
    write_plan,
)
from helisim.sim.recorder import End, Recorder, Trajectory
from helisim.sim.weather import Gust, Weather

__all__ = [
    "FAULTS",
    "Chirp",
    "Deck",
    "Doublet",
    "End",
    "Excitation",
    "Fault",
    "FlightEnvelope",
    "FlightPlan",
    "Ground",
    "Gust",
    "History",
    "Mission",
    "Multisine",
    "Pilot",
    "Pulse",
    "RecordGap",
    "Recorder",
    "SampleLoss",
    "Sequence",
    "ServoStuck",
    "Step",
    "Sweep",
    "Swing",
    "ThreeTwoOneOne",
    "Together",
    "Trajectory",
    "Weather",
    "fly",
    "fly_each",
    "fly_to",
    "missions",
    "read_plan",
    "simulate",
    "write_plan",
]
