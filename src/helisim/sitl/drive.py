"""What turns the rotor that an autopilot's speed channel asks for."""

import copy

from helisim.base.errors import ModelError
from helisim.physics.drive import IDEAL, MOTOR
from helisim.physics.params import PARAM
from helisim.vehicle import Vehicle
from helisim.vehicle.assembly import with_room
from helisim.vehicle.controller import law_room
from helisim.vehicle.force_laws import check_motor
from helisim.vehicle.motion import addresses
from helisim.vehicle.trim import find_trim

_SPOOL_UP = 12.0
"""s, to the nominal speed where no motor's numbers say it: usual for speed controllers."""


def powered(vehicle: Vehicle, timestep: float, *, motor: bool = True) -> Vehicle:
    """Return a vehicle whose rotor a motor turns, in time steps of so many seconds.

    Args:
        vehicle: one that has no motor's numbers gets an ideal governor.
        timestep: s.
        motor: False for an ideal governor in any case.
    """
    try:
        check_motor(vehicle.parameters, "a motor turns the rotor")
    except ModelError:
        motor = False
    governor = "motor" if motor else "ideal"
    parameters = vehicle.parameters.replace(
        {"drive.governor": governor}, "an autopilot spools it up"
    )
    model = copy.copy(vehicle.model)
    model.opt.timestep = timestep
    model.actuator_user[addresses(model).rotor, PARAM.drive_governor] = MOTOR if motor else IDEAL
    model = with_room(model, vehicle.folder, parameters, law_room(model))
    trim = find_trim(model, height=vehicle.trim.height, near=vehicle.trim)
    return Vehicle(vehicle.folder, parameters, model, trim, vehicle.controller)


class SlowRotor:
    """A rotor that follows the speed asked for as slowly as one that is spooled up.

    For a vehicle that has no motor's numbers: its ideal governor keeps any speed at once.

    Attributes:
        speed: over the nominal one.
    """

    def __init__(self, period: float) -> None:
        """Stand still; `towards` is called once in each period, s."""
        self.speed = 0.0
        self._most = period / _SPOOL_UP

    def towards(self, wanted: float) -> float:
        """Return the speed a period later, nearer to the one that is asked for."""
        self.speed += min(self._most, max(-self._most, wanted - self.speed))
        return self.speed
