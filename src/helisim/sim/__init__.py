"""Fly a plan and record it: the simulated experiment, and the benches on the ground (`rigs`)."""

from helisim.sim import missions
from helisim.sim.excitation import Excitation
from helisim.sim.faults import (
    ClockDrift,
    Fault,
    GyroDropout,
    GyroRestart,
    RecordGap,
    SampleLoss,
    SensorDropout,
    SensorSpikes,
    ServoStuck,
    ServoWeak,
    parse_fault,
)
from helisim.sim.flight import Flight, fly, fly_all, fly_each, fly_to, simulate
from helisim.sim.ground import Deck, Ground, Swing
from helisim.sim.limits import FlightEnvelope
from helisim.sim.manoeuvres import (
    Chirp,
    Doublet,
    History,
    Manoeuvre,
    Pulse,
    Sequence,
    Step,
    Sweep,
    ThreeTwoOneOne,
    Together,
)
from helisim.sim.missions import Mission
from helisim.sim.multisine import Multisine
from helisim.sim.plan import FlightPlan, Pilot, read_plan, write_plan
from helisim.sim.recorder import End, Recorder, Trajectory
from helisim.sim.weather import Gust, Weather

__all__ = [
    "Chirp",
    "ClockDrift",
    "Deck",
    "Doublet",
    "End",
    "Excitation",
    "Fault",
    "Flight",
    "FlightEnvelope",
    "FlightPlan",
    "Ground",
    "Gust",
    "GyroDropout",
    "GyroRestart",
    "History",
    "Manoeuvre",
    "Mission",
    "Multisine",
    "Pilot",
    "Pulse",
    "RecordGap",
    "Recorder",
    "SampleLoss",
    "SensorDropout",
    "SensorSpikes",
    "Sequence",
    "ServoStuck",
    "ServoWeak",
    "Step",
    "Sweep",
    "Swing",
    "ThreeTwoOneOne",
    "Together",
    "Trajectory",
    "Weather",
    "fly",
    "fly_all",
    "fly_each",
    "fly_to",
    "missions",
    "parse_fault",
    "read_plan",
    "simulate",
    "write_plan",
]
