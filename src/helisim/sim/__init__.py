"""Fly a plan and record it: the simulated experiment, and the benches on the ground (`rigs`)."""

from helisim.sim import missions
from helisim.sim.envelope import FlightEnvelope
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
from helisim.sim.fly import Flight, fly, fly_all, fly_each
from helisim.sim.folder import fly_to
from helisim.sim.ground import Deck, Ground, Swing
from helisim.sim.manoeuvres import (
    Chirp,
    Doublet,
    History,
    Manoeuvre,
    Multisine,
    Pulse,
    Sequence,
    Step,
    Sweep,
    ThreeTwoOneOne,
    Together,
)
from helisim.sim.missions import Mission
from helisim.sim.pilot import Pilot
from helisim.sim.plan import FlightPlan, read_plan, write_plan
from helisim.sim.recorder import Recorder
from helisim.sim.simulation import simulate
from helisim.sim.trajectory import End, Trajectory
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
