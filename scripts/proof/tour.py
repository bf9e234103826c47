"""A tour for ArduPilot: a hover, a square, a sweep of each axis of SystemID, landing.

It fails if the hover leaves 0.5 m, or at the end the autopilot is armed or the rotor turns. Flown
twice it gives the same flight record, byte for byte, and logs that lack no message:

    helisim sitl --script scripts/proof/tour.py --log a.bin --record a.parquet
    helisim sitl --script scripts/proof/tour.py --log b.bin --record b.parquet
    cmp a.parquet b.parquet
"""

import numpy as np

from helisim.base.errors import AutopilotError
from helisim.sitl.pilot import Pilot, Steps
from helisim.sitl.systemid import fly_sweep, sweeps

HOVER, WITHIN = 300.0, 0.5  # s, m
CORNERS = ((5.0, 0.0), (5.0, 5.0), (0.0, 5.0), (0.0, 0.0))  # m north and east
SWEEPS = sweeps(["roll", "pitch", "yaw", "thrust"], start_hz=0.5, stop_hz=5.0, seconds=20.0)


def fly(pilot: Pilot) -> Steps:
    yield from pilot.take_off(5.0)
    yield from pilot.wait(5.0)
    begun, end, away = pilot.sensed.position, pilot.time + HOVER, 0.0
    while pilot.time < end:
        away = max(away, float(np.linalg.norm(pilot.sensed.position - begun)))
        if away > WITHIN:
            raise AutopilotError(f"the hover is {away:.3f} m from where it began")
        yield
    pilot.say(f"the hover stayed within {away:.3f} m")
    for north, east in CORNERS:
        yield from pilot.go_to(north, east, 5.0)
    for sweep in SWEEPS:
        yield from pilot.go_to(0.0, 0.0, 30.0)
        yield from fly_sweep(pilot, sweep)
    yield from pilot.go_to(0.0, 0.0, 5.0)
    yield from pilot.land()
