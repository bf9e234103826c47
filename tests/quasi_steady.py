"""A rotor of untwisted blades whose inflow is in balance with its thrust, and their drag."""

import math

import numpy as np

from helisim.physics.inflow import balance
from helisim.physics.rotor import unloaded_inflow


def inflow_and_thrust(pitch, climb, advance, solidity, lift_slope, stall, nearness=0.0):
    """Return total inflow and CT; climb: along thrust; lift_slope: 1/rad; stall: |CT| / sigma."""
    free = unloaded_inflow(pitch, 0.0, climb, advance)
    slope = 0.25 * lift_slope * solidity
    induced, thrust = balance(free, slope, stall * solidity, climb, advance, nearness)
    return climb + induced, thrust


def drag_torque(own, name, thrust, inflow):
    """Return CQ of the blades' drag in axial flow, summed over them (Gauss, exact for the powers).

    own: a vehicle's parameters; name: of the rotor; thrust: CT; inflow: over the tip speed.
    """
    places, weights = np.polynomial.legendre.leggauss(5)
    r = 0.5 + 0.5 * places
    radius, slope = own[f"{name}.radius"], own[f"{name}.lift_slope"]
    solidity = own[f"{name}.blades"] * own[f"{name}.chord"] / (math.pi * radius)
    pitch = 3.0 * (2.0 * thrust / (slope * solidity) + 0.5 * inflow)
    lift = slope * (pitch - inflow / r)
    section = own[f"{name}.profile_drag"] + own[f"{name}.lift_drag"] * lift**2
    return 0.25 * solidity * float(weights @ (r**3 * section))
