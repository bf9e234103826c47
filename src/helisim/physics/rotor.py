"""Thrust and power of a rotor: blade elements in uniform inflow.

Coefficients are those of the field: CT = T / (rho A (Omega R)^2), CP likewise with the
third power; inflow and climb ratios are over Omega R, positive when air passes the disc
against the thrust, as in a climb.
"""

from helisim.physics.inflow import balance, soft_limit
from helisim.physics.kernel import kernel

__all__ = ["soft_limit"]


@kernel()
def blade_element_thrust(pitch, inflow, advance, solidity, lift_slope):
    """Return CT of untwisted, unstalled blades (Padfield, Helicopter Flight Dynamics, ch. 3).

    Args:
        pitch: collective pitch, rad.
        inflow: total inflow ratio lambda.
        advance: advance ratio mu.
        solidity: sigma = blades x chord / (pi R).
        lift_slope: effective lift slope, 1/rad.
    """
    return 0.5 * lift_slope * solidity * (pitch / 3.0 * (1.0 + 1.5 * advance**2) - 0.5 * inflow)


@kernel()
def inflow_and_thrust(pitch, climb, advance, solidity, lift_slope, stall, nearness=0.0):
    """Return the total inflow ratio lambda and CT where blade elements and momentum meet.

    Args:
        pitch: collective pitch, rad.
        climb: climb ratio along the thrust.
        advance: advance ratio mu.
        solidity: sigma.
        lift_slope: 1/rad.
        stall: greatest |CT| / sigma that the blades carry.
        nearness: (R / 4z)^2 of the ground, 0 far from it.
    """
    slope = 0.25 * lift_slope * solidity
    free = pitch * (2.0 / 3.0 + advance**2) - climb
    induced, thrust = balance(free, slope, stall * solidity, climb, advance, nearness)
    return climb + induced, thrust


@kernel()
def power(thrust, inflow, climb, advance, solidity, induced_factor, profile_drag):
    """Return CP: induced, climb and profile power.

    Leishman, Principles of Helicopter Aerodynamics, chapter 5.

    Args:
        thrust: CT.
        inflow: total inflow ratio.
        climb: climb ratio.
        advance: advance ratio.
        solidity: sigma.
        induced_factor: kappa, ratio of induced power to that of uniform inflow.
        profile_drag: c_d0 of the blades.
    """
    induced = induced_factor * (inflow - climb) * thrust
    profile = 0.125 * solidity * profile_drag * (1.0 + 4.65 * advance**2)
    return induced + climb * thrust + profile
