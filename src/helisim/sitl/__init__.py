"""A vehicle flown by ArduPilot, over its JSON interface.

A script's flight of the autopilot's program::

    program, text = hs.sitl.find_program(), hs.autopilot_parameters("jr700").text
    script, aircraft = hs.sitl.fly_sweeps(hs.sitl.sweeps(["roll"])), hs.sitl.Aircraft("jr700")
    hs.sitl.fly_script(script, aircraft, program, text, log="flight.bin")
"""

from helisim.sitl.aircraft import Aircraft as Aircraft
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
