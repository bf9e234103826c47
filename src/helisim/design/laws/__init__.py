"""Control laws as data: a file that can be read, compared, tuned, linearised and flown."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from helisim.base.linear import Linear as LinearLaw
    from helisim.base.linear import LinearSystem as SampledLaw
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

_HOMES = {
    "attitude_command": ("AttitudeAxis", "AttitudeCommand", "HeaveAxis", "YawAxis"),
    "filters": ("Filter", "Lead", "Lowpass", "Notch"),
    "law": ("Law", "law_of", "read_law", "register"),
    "probe": ("probed",),
    "rate_command": ("CollectiveAxis", "RateAxis", "RateCommand", "YawRateAxis"),
    "state_space": ("StateSpaceLaw",),
    "tables": ("TabledLaw",),
}
"""Module -> what it has; loaded on first use, as reading a file needs no simulator."""
_LINEAR = {"LinearLaw": "Linear", "SampledLaw": "LinearSystem"}
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
    if name in _LINEAR:
        return getattr(import_module("helisim.base.linear"), _LINEAR[name])
    if name not in _HOME_OF:
        raise AttributeError(f"module 'helisim.design.laws' has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
