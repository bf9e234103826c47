"""A vehicle whose pilot leaves the sticks alone, so that only the law closes its loops."""

import copy

from helisim.physics.layout import PARAM
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import addresses

_GAINS = {"pilot.k_attitude": PARAM.pilot_k_attitude, "pilot.k_heading": PARAM.pilot_k_heading}


def hands_off(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with a pilot who moves only the collective, to keep the height.

    Cyclic stick and pedals stay where they are trimmed: what he answers there would be part of
    the loops that are measured.

    Args:
        vehicle: with its controller.
    """
    model = copy.copy(vehicle.model)
    block = model.actuator_user[addresses(model).rotor].copy()
    block[list(_GAINS.values())] = 0.0
    model.actuator_user[addresses(model).rotor] = block
    parameters = vehicle.parameters.replace(dict.fromkeys(_GAINS, 0.0), "hands off")
    return Vehicle(vehicle.folder, parameters, model, vehicle.trim, vehicle.controller)
