"""helisim: fly, sweep, identify and verify a nonlinear helicopter in MuJoCo.

import helisim as hs

vehicle = hs.load("jr700")
flights = hs.fly(vehicle, hs.Sweep(axis="lat"), count=10, seed=1)

The packages, each importing only from those above it in this list; `ident` knows no simulator, a
flight record is all that it sees (docs/architecture.md):

    base        errors, notes, units, files, settings, linear systems
    records     flight records: channels, provenance, quality, files
    logs        anyone's logs as records
    physics     force laws, compiled to callbacks that MuJoCo calls at every step
    vehicle     a folder with an MJCF and parameters, as a model that is trimmed and linearised
    ident       from flight records to models with bounds, by the frequency-response method
    sim         flights and their records: plan, pilot, manoeuvre, weather, faults, missions
    handling    criteria and margins of closed loops, predicted or measured
    design      from an identified model to a control law that meets specifications
    sitl        ArduPilot in the loop, in lock step
    look        a first look at logs: what to identify, and how
    study       the experiment, campaigns, published numbers and the paper's errata
    show        tables, plots, pages, Rerun recordings; computes nothing
    gym, hand   an agent, or a hand, that flies
    cli         each command parses, calls the library, prints, exits
"""

import ast
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

from helisim.base import register as _register

__version__ = "0.2.0"

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
    if _HOMES[name] == __name__:  # a package
        return import_module(f"{__name__}.{name}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])


class _Package(ModuleType):
    """Keep a public name where a package has the same, as `look` does."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (isinstance(value, ModuleType) and name in _HOMES):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
_register()
