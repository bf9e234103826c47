"""helisim: fly, sweep, identify and verify a nonlinear helicopter in MuJoCo.

import helisim as hs

vehicle = hs.load("jr700")
flights = hs.fly(vehicle, hs.Sweep(axis="lat"), count=10, seed=1)

The house, from the ground up; each room imports only from those above it in this list, but
`ident` knows neither `physics`, `vehicle` nor `sim`: a flight record is all that it sees.

    errors, units   what can go wrong, and conversion factors; `registration`: gymnasium's names
    records         flight records: channels, provenance, quality, files; `logs`: anyone's logs
    physics         the force laws, compiled to callbacks that MuJoCo calls at every step
    vehicle         a folder with an MJCF and parameters, as a model that is trimmed and linearised
    ident           from flight records to models with bounds, by the frequency-response method:
                    `responses` | `model`, `fitting`, `verifying`
    laws            control laws as data: a file that is read, linearised and flown
    handling        what a closed loop is judged by: margins, disturbance rejection, ADS-33
    look            a first look at logs of which nothing is known: what to identify, and how;
                    `systemid`: what autopilots' logs of it say themselves, their loops too
    sim             what is flown and recorded: pilot, manoeuvre, weather, faults; `rigs`: benches
    design          from an identified model to a control law that meets specifications
    sitl            an outside autopilot in the loop: ArduPilot flies the vehicle, lock step
    paper           published values and the paper's errata: compared with, never fed to `ident`
    study           the experiment: models, truth, flights, results; `campaign`: many replicates
    output          results as tables, plots, a report, a Rerun recording; computes nothing
    cli             each command parses, calls the library once, prints, exits
    gym             beside it: Gymnasium environments, in which an agent flies
"""

import ast
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

from helisim.base import register as _register

__version__ = "0.1.0"

_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_HOMES = {
    alias.name: str(node.module)
    for node in ast.parse(_STUB).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}
"""Public name -> module. Loaded on first use, so that identifying a log needs no simulator."""

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]  (it reads the stub)


SHOWN_BY = "helisim.show.notebook"
"""The module that shows a value, by `plot` or in a notebook; see `helisim.base.display`."""


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'helisim' has no attribute {name!r}")
    if _HOMES[name] == __name__:  # a room of the house
        return import_module(f"{__name__}.{name}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])


class _House(ModuleType):
    """Keeps a public name what it is where a room has the same, as `look` does."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (isinstance(value, ModuleType) and name in _HOMES):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _House
_register()
