"""An outside autopilot in the loop: the vehicle as a backend for ArduPilot's JSON interface.

A frame of servo pulses comes in by `link`, moves the vehicle that `aircraft` steps by way of its
`outputs`, and what its IMU then senses goes back. `backend` ties the three together::

    aircraft = hs.sitl.Aircraft("jr700")
    with hs.sitl.Link() as link:
        print(hs.sitl.serve(aircraft, link))
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from helisim.sitl.aircraft import Aircraft
    from helisim.sitl.backend import Backend, serve
    from helisim.sitl.link import Link
    from helisim.sitl.outputs import Output, Outputs
    from helisim.sitl.packet import Frame, Sensed
    from helisim.sitl.served import Served

_HOMES = {
    "Aircraft": "aircraft",
    "Backend": "backend",
    "Frame": "packet",
    "Link": "link",
    "Output": "outputs",
    "Outputs": "outputs",
    "Sensed": "packet",
    "Served": "served",
    "serve": "backend",
}
"""Name -> module; loaded on first use, as a parameter file needs no simulator."""

__all__ = ["Aircraft", "Backend", "Frame", "Link", "Output", "Outputs", "Sensed", "Served", "serve"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'helisim.sitl' has no attribute {name!r}")
    return getattr(import_module(f"helisim.sitl.{_HOMES[name]}"), name)
