"""helisim: fly, sweep, identify and verify a nonlinear helicopter in MuJoCo.

import helisim as hs

vehicle = hs.load("jr700")
flights = hs.fly(vehicle, hs.Sweep(axis="lat"), count=10, seed=1)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from helisim.ident import (
        Fit,
        FrequencyResponse,
        Structure,
        Verification,
        frequency_response,
        identify,
        load_fit,
        reduce,
        structures,
        verify,
    )
    from helisim.logs import read_log, screen
    from helisim.physics.native import installed
    from helisim.pipeline import reproduce
    from helisim.record import FlightRecord
    from helisim.sim import (
        ClockDrift,
        Doublet,
        Gust,
        GyroDropout,
        GyroRestart,
        Pilot,
        Recorder,
        RecordGap,
        SampleLoss,
        SensorDropout,
        SensorSpikes,
        ServoStuck,
        ServoWeak,
        Sweep,
        Watch,
        Weather,
        fly,
        fly_each,
        fly_to,
    )
    from helisim.storage import read_record, write_record
    from helisim.vehicle import GyroSettings, Vehicle, isa_density, load

__version__ = "0.1.0"

_HOMES = {
    "ClockDrift": "helisim.sim",
    "Doublet": "helisim.sim",
    "Fit": "helisim.ident",
    "FlightRecord": "helisim.record",
    "FrequencyResponse": "helisim.ident",
    "Gust": "helisim.sim",
    "GyroDropout": "helisim.sim",
    "GyroRestart": "helisim.sim",
    "GyroSettings": "helisim.vehicle",
    "Pilot": "helisim.sim",
    "RecordGap": "helisim.sim",
    "Recorder": "helisim.sim",
    "SampleLoss": "helisim.sim",
    "SensorDropout": "helisim.sim",
    "SensorSpikes": "helisim.sim",
    "ServoStuck": "helisim.sim",
    "ServoWeak": "helisim.sim",
    "Structure": "helisim.ident",
    "Sweep": "helisim.sim",
    "Vehicle": "helisim.vehicle",
    "Verification": "helisim.ident",
    "Watch": "helisim.sim",
    "Weather": "helisim.sim",
    "fly": "helisim.sim",
    "fly_each": "helisim.sim",
    "fly_to": "helisim.sim",
    "frequency_response": "helisim.ident",
    "identify": "helisim.ident",
    "installed": "helisim.physics.native",
    "isa_density": "helisim.vehicle",
    "load": "helisim.vehicle",
    "load_fit": "helisim.ident",
    "read_log": "helisim.logs",
    "read_record": "helisim.storage",
    "reduce": "helisim.ident",
    "reproduce": "helisim.pipeline",
    "screen": "helisim.logs",
    "structures": "helisim.ident",
    "verify": "helisim.ident",
    "write_record": "helisim.storage",
}
"""Public name -> module. Loaded on first use, so that identifying a log needs no simulator."""

__all__ = [
    "ClockDrift",
    "Doublet",
    "Fit",
    "FlightRecord",
    "FrequencyResponse",
    "Gust",
    "GyroDropout",
    "GyroRestart",
    "GyroSettings",
    "Pilot",
    "RecordGap",
    "Recorder",
    "SampleLoss",
    "SensorDropout",
    "SensorSpikes",
    "ServoStuck",
    "ServoWeak",
    "Structure",
    "Sweep",
    "Vehicle",
    "Verification",
    "Watch",
    "Weather",
    "fly",
    "fly_each",
    "fly_to",
    "frequency_response",
    "identify",
    "installed",
    "isa_density",
    "load",
    "load_fit",
    "read_log",
    "read_record",
    "reduce",
    "reproduce",
    "screen",
    "structures",
    "verify",
    "write_record",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'helisim' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
