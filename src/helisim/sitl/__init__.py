"""An outside autopilot in the loop: the vehicle as a backend for ArduPilot's JSON interface.

A frame of servo pulses comes in by `link`, moves the vehicle that `aircraft` steps by way of its
`outputs`, and what its IMU then senses goes back. `backend` ties the three together::

    aircraft = hs.sitl.Aircraft("jr700")
    with hs.sitl.Link() as link:
        print(hs.sitl.serve(aircraft, link))

Or a script flies the autopilot, whose program `process` starts and `flights` speak to::

    program = hs.sitl.find_program()
    text = hs.autopilot_parameters("jr700").text
    hs.sitl.fly_script(hs.sitl.fly_sweeps(hs.sitl.sweeps(["roll"])), aircraft, program, text,
                       log="flight.bin")
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from helisim.sitl.aircraft import Aircraft
    from helisim.sitl.backend import Backend, serve
    from helisim.sitl.flights.pilot import Pilot, Sticks
    from helisim.sitl.flights.session import Flight, fly_script
    from helisim.sitl.flights.sweeps import Sweep, fly_sweep, fly_sweeps, sweeps
    from helisim.sitl.link import Link
    from helisim.sitl.outputs import Output, Outputs
    from helisim.sitl.packet import Frame, Sensed
    from helisim.sitl.process import find_program
    from helisim.sitl.served import Served

_HOMES = {
    "Aircraft": "aircraft",
    "Backend": "backend",
    "Flight": "flights.session",
    "Frame": "packet",
    "Link": "link",
    "Output": "outputs",
    "Outputs": "outputs",
    "Pilot": "flights.pilot",
    "Sensed": "packet",
    "Served": "served",
    "Sticks": "flights.pilot",
    "Sweep": "flights.sweeps",
    "find_program": "process",
    "fly_script": "flights.session",
    "fly_sweep": "flights.sweeps",
    "fly_sweeps": "flights.sweeps",
    "serve": "backend",
    "sweeps": "flights.sweeps",
}
"""Name -> module; loaded on first use, as a parameter file needs no simulator."""

__all__ = [
    "Aircraft",
    "Backend",
    "Flight",
    "Frame",
    "Link",
    "Output",
    "Outputs",
    "Pilot",
    "Sensed",
    "Served",
    "Sticks",
    "Sweep",
    "find_program",
    "fly_script",
    "fly_sweep",
    "fly_sweeps",
    "serve",
    "sweeps",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'helisim.sitl' has no attribute {name!r}")
    return getattr(import_module(f"helisim.sitl.{_HOMES[name]}"), name)
