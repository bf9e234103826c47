"""ArduPilot flies the JR700 twice by the same script: what must hold of a flight, and of both.

Take-off to 5 m, a hover, a square, a sweep of each axis of SystemID at the mixer, landing,
disarmed, rotor stopped. Bars: the hover stays within 0.5 m of where it began; the autopilot stands
disarmed at the end and the rotor stands still; its log lacks no message; and two flights give the
same flight record byte for byte. Exit status 1 if one is missed.

    HELISIM_ARDUPILOT=.../arducopter-heli python scripts/proof/autopilot_flights.py --hover 300
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import common
import numpy as np

from helisim.records.storage import write_record
from helisim.sitl.aircraft import Aircraft
from helisim.sitl.parameters import parameters_for
from helisim.sitl.pilot import Pilot, Steps
from helisim.sitl.process import find_program
from helisim.sitl.session import Flight, fly_script
from helisim.sitl.systemid import fly_sweep, sweeps

CORNERS = ((5.0, 0.0), (5.0, 5.0), (0.0, 5.0), (0.0, 0.0))  # m north and east
WITHIN = 0.5  # m, of the hover.
STILL = 0.02  # Of the rotor's nominal speed: it creeps on below.


class Flown(NamedTuple):
    """A flight, and what is judged of it."""

    flight: Flight
    record: bytes
    rotor: float


def flown(
    script: Callable[[Pilot], Steps], program: Path, folder: Path, *, armed: bool = True
) -> Flown:
    aircraft = Aircraft("jr700", recorded=True)
    text, path = parameters_for("jr700").text, folder / "flight.parquet"
    log = folder / "flight.bin" if armed else None
    flight = fly_script(script, aircraft, program, text, log=log, say=lambda text: None)
    write_record(aircraft.record(), path)
    return Flown(flight, path.read_bytes(), aircraft.rotor_speed)


class Whole:
    """The script: a tour of all that is asked; it measures its hover."""

    def __init__(self, hover: float, seconds: float) -> None:
        self.hover, self.seconds, self.away = hover, seconds, np.nan
        self.disarmed = False

    def __call__(self, pilot: Pilot) -> Steps:
        yield from pilot.take_off(5.0)
        yield from pilot.wait(5.0)
        begun, end = pilot.sensed.position, pilot.time + self.hover
        self.away = 0.0
        while pilot.time < end:
            self.away = max(self.away, float(np.linalg.norm(pilot.sensed.position - begun)))
            yield
        for north, east in CORNERS:
            yield from pilot.go_to(north, east, 5.0)
        band = {"start_hz": 0.5, "stop_hz": 5.0, "seconds": self.seconds}
        for sweep in sweeps(["roll", "pitch", "yaw", "thrust"], **band):
            yield from pilot.go_to(0.0, 0.0, 30.0)
            yield from fly_sweep(pilot, sweep)
        yield from pilot.go_to(0.0, 0.0, 5.0)
        yield from pilot.land()
        self.disarmed = not pilot.telemetry.armed


def main(*, hover: float = 300.0, sweep: float = 20.0) -> int:
    """Fly twice, with a hover of so many seconds and sweeps of so many, each."""
    program, flights = find_program(), []
    for _ in range(2):
        script = Whole(hover, sweep)
        with tempfile.TemporaryDirectory() as folder:
            flights.append(flown(script, program, Path(folder)))
        print(f"flown: {flights[-1].flight.served}", flush=True)
    first, second = flights
    bars = {
        f"hover of {hover:g} s stays within {script.away:.3f} m": script.away <= WITHIN,
        "disarmed at the end": script.disarmed,
        f"rotor at {first.rotor:.3f} of its speed at the end": first.rotor < STILL,
        f"{first.flight.lost} messages lost in the log": first.flight.lost == 0,
        f"two records of {len(first.record)} bytes are the same": first.record == second.record,
    }
    for text, holds in bars.items():
        print(f"{'holds' if holds else 'MISSED'}: {text}")
    return int(not all(bars.values()))


if __name__ == "__main__":
    common.run(main)
