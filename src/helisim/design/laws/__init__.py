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
    from helisim.design.laws.law import (
        Filter,
        Law,
        Lead,
        Lowpass,
        Notch,
        TabledLaw,
        law_of,
        probed,
        read_law,
        register,
    )
    from helisim.design.laws.rate_command import CollectiveAxis, RateAxis, RateCommand, YawRateAxis
    from helisim.design.laws.state_space import StateSpaceLaw

_LINEAR = {"LinearLaw": "Linear", "SampledLaw": "LinearSystem"}
_ATTITUDE = ("AttitudeAxis", "AttitudeCommand", "HeaveAxis", "YawAxis")
_RATE = ("CollectiveAxis", "RateAxis", "RateCommand", "YawRateAxis")
_HOME_OF = {
    **dict.fromkeys(_ATTITUDE, "attitude_command"),
    **dict.fromkeys(_RATE, "rate_command"),
    "StateSpaceLaw": "state_space",
}
"""Name -> module that has it; loaded on first use, as reading a file needs no simulator."""

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
    if name not in __all__:
        raise AttributeError(f"module 'helisim.design.laws' has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME_OF.get(name, 'law')}"), name)
