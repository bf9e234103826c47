"""The simulated experiment: truth in flight, and what the flight computer records of it."""

from helisim.sim.envelope import Watch
from helisim.sim.excitation import Doublet, Excitation, Sweep
from helisim.sim.fault_notation import Fault, parse_fault
from helisim.sim.faults import GyroDropout, GyroRestart, ServoStuck, ServoWeak
from helisim.sim.fly import fly, fly_each
from helisim.sim.folder import fly_to
from helisim.sim.pilot import Pilot
from helisim.sim.recorder import Recorder
from helisim.sim.recorder_faults import (
    ClockDrift,
    RecordGap,
    SampleLoss,
    SensorDropout,
    SensorSpikes,
)
from helisim.sim.simulation import simulate
from helisim.sim.trajectory import End, Truth, read_truth
from helisim.sim.weather import Gust, Weather

__all__ = [
    "ClockDrift",
    "Doublet",
    "End",
    "Excitation",
    "Fault",
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
    "Truth",
    "Watch",
    "Weather",
    "fly",
    "fly_each",
    "fly_to",
    "parse_fault",
    "read_truth",
    "simulate",
]
