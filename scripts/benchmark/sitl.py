"""How many times real time ArduPilot flies a vehicle, both processes on one core.

Needs an ArduCopter-heli, which HELISIM_ARDUPILOT names, and pymavlink. It takes off to 5 m, hovers
and lands, at several rates of frames. Beside the clock's, the factor by processor time is told,
which is the same on a machine that others use too: simulated seconds over those of the processor
in the flight, helisim's and ArduPilot's.

    HELISIM_ARDUPILOT=arducopter-heli python scripts/benchmark/sitl.py [SECONDS]
"""

import os
import resource
import sys
import time

import helisim as hs
from helisim.sitl.pilot import Pilot, Steps
from helisim.sitl.process import find_program
from helisim.sitl.session import fly_script

RATES = (800.0, 1000.0, 2000.0)  # Below 1.8 frames a loop of its 400 Hz it does not arm.
HOVER = 60.0  # s, by default.


def processor() -> tuple[float, float]:
    """Return seconds of the processor: of this process, and of those that it has seen end."""
    own, ended = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return own.ru_utime + own.ru_stime, ended.ru_utime + ended.ru_stime


def main(seconds: float) -> None:
    """Print the factors of a hover of so many seconds."""
    vehicle = hs.load("jr700")
    parameters = (vehicle.folder / "jr700.parm").read_text(encoding="utf-8")

    def flight(pilot: Pilot) -> Steps:
        yield from pilot.take_off(5.0)
        yield from pilot.wait(seconds)
        yield from pilot.land()

    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})  # ArduPilot's process inherits it
    program = find_program()
    print(f"{'frames/s':>8}{'flown':>8}{'x clock':>9}{'x processor':>13}   us a frame")
    for rate_hz in RATES:
        aircraft = hs.sitl.Aircraft(vehicle, rate_hz=rate_hz)
        own, theirs = processor()
        start = time.perf_counter()
        fly_script(flight, aircraft, program, parameters)
        clock = time.perf_counter() - start
        own, theirs = (after - before for after, before in zip(processor(), (own, theirs)))
        frames = aircraft.time * rate_hz
        print(
            f"{rate_hz:8.0f}{aircraft.time:6.0f} s{aircraft.time / clock:9.2f}"
            f"{aircraft.time / (own + theirs):13.2f}   helisim {1e6 * own / frames:.0f}, "
            f"ArduPilot {1e6 * theirs / frames:.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else HOVER)
