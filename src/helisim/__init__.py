"""helisim: fly, sweep, identify and verify a nonlinear helicopter in MuJoCo.

import helisim as hs

vehicle = hs.load("jr700")
flights = hs.fly(vehicle, hs.Sweep(axis="lat"), count=10, seed=1)

The house, from the ground up; each room imports only from those above it in this list, but
`ident` knows neither `physics`, `vehicle` nor `sim`: a flight record is all that it sees.

    errors, units   what can go wrong, and conversion factors
    records         flight records: channels, provenance, quality, files; `logs`: anyone's logs
    physics         the force laws, compiled to callbacks that MuJoCo calls at every step
    vehicle         a folder with an MJCF and parameters, as a model that is trimmed and linearised
    ident           from flight records to models with bounds, by the frequency-response method
    sim             what is flown and recorded: pilot, manoeuvre, weather, faults; `rigs`: benches
    paper           published values and the paper's errata: compared with, never fed to `ident`
    study           the experiment: models, truth, flights, results; `campaign`: many replicates
    output          results as tables, plots, a report, a Rerun recording; computes nothing
    cli             each command parses, calls the library once, prints, exits
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
    from helisim.physics.native import installed
    from helisim.records.logs import read_log, screen
    from helisim.records.record import FlightRecord
    from helisim.records.storage import read_record, write_record
    from helisim.sim import (
        ClockDrift,
        Doublet,
        FlightEnvelope,
        FlightPlan,
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
        Weather,
        fly,
        fly_each,
        fly_to,
        read_plan,
        write_plan,
    )
    from helisim.study.reproduce import reproduce
    from helisim.vehicle import GyroSettings, Vehicle, isa_density, load

__version__ = "0.1.0"

_HOMES = {
    "ClockDrift": "helisim.sim",
    "Doublet": "helisim.sim",
    "Fit": "helisim.ident",
    "FlightEnvelope": "helisim.sim",
    "FlightPlan": "helisim.sim",
    "FlightRecord": "helisim.records.record",
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
    "read_log": "helisim.records.logs",
    "read_plan": "helisim.sim",
    "read_record": "helisim.records.storage",
    "reduce": "helisim.ident",
    "reproduce": "helisim.study.reproduce",
    "screen": "helisim.records.logs",
    "structures": "helisim.ident",
    "verify": "helisim.ident",
    "write_plan": "helisim.sim",
    "write_record": "helisim.records.storage",
}
"""Public name -> module. Loaded on first use, so that identifying a log needs no simulator."""

__all__ = [
    "ClockDrift",
    "Doublet",
    "Fit",
    "FlightEnvelope",
    "FlightPlan",
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
    "read_plan",
    "read_record",
    "reduce",
    "reproduce",
    "screen",
    "structures",
    "verify",
    "write_plan",
    "write_record",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'helisim' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
