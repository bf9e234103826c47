"""An outside autopilot in the loop: the vehicle as a backend for ArduPilot's JSON interface.

A frame of servo pulses comes in by `link` and moves the vehicle that `aircraft` steps by way of its
outputs; the readings of its IMU go back::

    aircraft = hs.sitl.Aircraft("jr700")
    with hs.sitl.Link() as link:
        print(hs.sitl.serve(aircraft, link))

Or a script flies the autopilot, whose program `process` starts and `pilot` speaks to::

    program = hs.sitl.find_program()
    text = hs.autopilot_parameters("jr700").text
    hs.sitl.fly_script(hs.sitl.fly_sweeps(hs.sitl.sweeps(["roll"])), aircraft, program, text,
                       log="flight.bin")
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from helisim.sitl.aircraft import Aircraft as Aircraft
    from helisim.sitl.link import Backend as Backend
    from helisim.sitl.link import Frame as Frame
    from helisim.sitl.link import Link as Link
    from helisim.sitl.link import Sensed as Sensed
    from helisim.sitl.link import Served as Served
    from helisim.sitl.link import serve as serve
    from helisim.sitl.mixing import Output as Output
    from helisim.sitl.mixing import Outputs as Outputs
    from helisim.sitl.pilot import Pilot as Pilot
    from helisim.sitl.pilot import Sticks as Sticks
    from helisim.sitl.process import find_program as find_program
    from helisim.sitl.session import Flight as Flight
    from helisim.sitl.session import fly_script as fly_script
    from helisim.sitl.systemid import Sweep as Sweep
    from helisim.sitl.systemid import fly_sweep as fly_sweep
    from helisim.sitl.systemid import fly_sweeps as fly_sweeps
    from helisim.sitl.systemid import sweeps as sweeps

_HOMES = {
    "aircraft": ("Aircraft",),
    "link": ("Backend", "Frame", "Link", "Sensed", "Served", "serve"),
    "mixing": ("Output", "Outputs"),
    "pilot": ("Pilot", "Sticks"),
    "process": ("find_program",),
    "session": ("Flight", "fly_script"),
    "systemid": ("Sweep", "fly_sweep", "fly_sweeps", "sweeps"),
}
"""Module -> its public names; loaded on first use, as a parameter file needs no simulator."""

__all__ = sorted(name for names in _HOMES.values() for name in names)  # pyright: ignore


def __getattr__(name: str) -> Any:
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"helisim.sitl.{module}"), name)
    raise AttributeError(f"module 'helisim.sitl' has no attribute {name!r}")
