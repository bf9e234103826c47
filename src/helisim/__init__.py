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

from lazy_loader import attach_stub

__version__ = "0.1.0"

# The public names are those of __init__.pyi. Each is loaded on its first use, so that identifying
# a log needs no simulator.
__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
