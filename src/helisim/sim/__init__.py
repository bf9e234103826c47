"""Fly a plan and record it: the simulated experiment, and the benches on the ground (`rigs`)."""

from helisim.sim.envelope import FlightEnvelope
from helisim.sim.excitation import Doublet, Excitation, Sweep, ThreeTwoOneOne
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
from helisim.sim.pilot import Pilot
from helisim.sim.plan import FlightPlan, read_plan, write_plan
from helisim.sim.recorder import Recorder
from helisim.sim.simulation import simulate
from helisim.sim.trajectory import End, Trajectory
from helisim.sim.weather import Gust, Weather

__all__ = [
    "ClockDrift",
    "Doublet",
    "End",
    "Excitation",
    "Fault",
    "Flight",
    "FlightEnvelope",
    "FlightPlan",
    "Gust",
    "GyroDropout",
    "GyroRestart",
    "Pilot",
    "RecordGap",
    "Recorder",
    "SampleLoss",
    "SensorDropout",
    "SensorSpikes",
    "ServoStuck",
    "ServoWeak",
    "Sweep",
    "ThreeTwoOneOne",
    "Trajectory",
    "Weather",
    "fly",
    "fly_all",
    "fly_each",
    "fly_to",
    "parse_fault",
    "read_plan",
    "simulate",
    "write_plan",
]
