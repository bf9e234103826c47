"""Control laws as data: a file that can be read, compared, tuned, linearised and flown."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from helisim.design.laws.attitude_command import (
        AttitudeAxis,
        AttitudeCommand,
        HeaveAxis,
        YawAxis,
    )
    from helisim.design.laws.filters import Filter, Lead, Lowpass, Notch
    from helisim.design.laws.law import Law, law_of, read_law, register
    from helisim.design.laws.probe import probed
    from helisim.design.laws.rate_command import CollectiveAxis, RateAxis, RateCommand, YawRateAxis
    from helisim.design.laws.state_space import StateSpaceLaw
    from helisim.design.laws.tables import TabledLaw
    from helisim.handling.sampled_law import LinearLaw, SampledLaw

_HOMES = {
    "attitude_command": ("AttitudeAxis", "AttitudeCommand", "HeaveAxis", "YawAxis"),
    "filters": ("Filter", "Lead", "Lowpass", "Notch"),
    "law": ("Law", "law_of", "read_law", "register"),
    "probe": ("probed",),
    "rate_command": ("CollectiveAxis", "RateAxis", "RateCommand", "YawRateAxis"),
    "helisim.handling.sampled_law": ("LinearLaw", "SampledLaw"),
    "state_space": ("StateSpaceLaw",),
    "tables": ("TabledLaw",),
}
"""Module -> what it has; loaded on first use, as reading a file needs no simulator."""
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "AttitudeAxis",
    "AttitudeCommand",
    "CollectiveAxis",
    "Filter",
    "HeaveAxis",
    "Law",
    "Lead",
    "LinearLaw",
    "Lowpass",
    "Notch",
    "RateAxis",
    "RateCommand",
    "SampledLaw",
    "StateSpaceLaw",
    "TabledLaw",
    "YawAxis",
    "YawRateAxis",
    "law_of",
    "probed",
    "read_law",
    "register",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'helisim.design.laws' has no attribute {name!r}")
    home = _HOME_OF[name]
    return getattr(import_module(home if "." in home else f"{__name__}.{home}"), name)
