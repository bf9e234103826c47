"""The vehicle: MJCF and parameters to a model that is trimmed and can be linearised."""

from helisim.vehicle.calibrate import calibrate
from helisim.vehicle.controller import Controller, ControllerLike, set_controller
from helisim.vehicle.linearize import Linearization, linearize
from helisim.vehicle.parameters import (
    Parameters,
    PhysicalParameter,
    read_parameters,
)
from helisim.vehicle.swashplate import Flapping, flapping_from_blade
from helisim.vehicle.trim import Trim, find_trim
from helisim.vehicle.vehicle import Vehicle, load, standard_parameters

__all__ = [
    "Controller",
    "ControllerLike",
    "Flapping",
    "Linearization",
    "Parameters",
    "PhysicalParameter",
    "Trim",
    "Vehicle",
    "calibrate",
    "find_trim",
    "flapping_from_blade",
    "linearize",
    "load",
    "read_parameters",
    "set_controller",
    "standard_parameters",
]
