"""A rotor of untwisted blades whose inflow is in balance with its thrust."""

from helisim.physics.inflow import balance
from helisim.physics.rotor import unloaded_inflow


def inflow_and_thrust(pitch, climb, advance, solidity, lift_slope, stall, nearness=0.0):
    """Return total inflow and CT; climb: along thrust; lift_slope: 1/rad; stall: |CT| / sigma."""
    free = unloaded_inflow(pitch, 0.0, climb, advance)
    slope = 0.25 * lift_slope * solidity
    induced, thrust = balance(free, slope, stall * solidity, climb, advance, nearness)
    return climb + induced, thrust
