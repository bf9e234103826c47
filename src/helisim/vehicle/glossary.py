"""What every parameter of a vehicle is: its unit, its plausible range, what it does, where from."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from types import MappingProxyType

from helisim.base.files import read_toml

OPTIONAL = (
    "fin",
    "tailplane",
    "drive",
    "swashplate",
    "outputs",
    "recorder_latency",
    "tuning",
    "targets",
    "geometry",
    "band",
)
"""Sections that a vehicle may leave out, whole or in part."""

_OPTIONAL = (
    "airframe.drag_centre_x",
    "airframe.drag_centre_z",
    "airframe.pitch_volume",
    "airframe.tail_wash",
    "airframe.pitch_zero",
    "airframe.yaw_volume",
    "airframe.download",
    "airframe.fin_area",
    "airframe.ixz",
    "main_rotor.direction",
    "main_rotor.shaft_tilt",
    "main_rotor.hub_cross",
    "main_rotor.twist",
    "main_rotor.inflow",
    "main_rotor.blade_inertia",
    "flapping.lock_reduction",
    "tail_rotor.induced_factor",
    "tail_rotor.profile_drag",
    "tail_rotor.direction",
    "tail_rotor.blockage",
)
_ANY = "*"


@dataclass(frozen=True)
class Term:
    """One parameter of a vehicle, as the glossary has it.

    Attributes:
        name: dotted; of the recorder's latencies "recorder_latency.*".
        unit: that its value is in.
        low: least plausible value.
        high: greatest plausible value.
        meaning: what it is and does.
        origin: where to get it.
    """

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    origin: str

    @property
    def needed(self) -> bool:
        """Whether every vehicle has it."""
        return self.name.split(".")[0] not in OPTIONAL and self.name not in _OPTIONAL


@cache
def glossary() -> Mapping[str, Term]:
    """Return every parameter that a vehicle can have, by name, in the order of its files."""
    terms: dict[str, Term] = {}
    path = files("helisim.vehicle").joinpath("glossary.toml")
    for section, entries in read_toml(str(path)).items():
        for names, (unit, (low, high), meaning, origin) in entries.items():
            for key in names.split():
                name = f"{section}.{key}"
                terms[name] = Term(name, unit, low, high, meaning, origin)
    return MappingProxyType(terms)


def sections() -> tuple[str, ...]:
    """Return the sections of the glossary."""
    return tuple(dict.fromkeys(name.split(".")[0] for name in glossary()))


def term(name: str) -> Term | None:
    """Return what a parameter is, None if no vehicle has one of that name."""
    section = name.split(".")[0]
    return glossary().get(name) or glossary().get(f"{section}.{_ANY}")
