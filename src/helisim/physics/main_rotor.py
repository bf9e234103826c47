"""What the main rotor does in the air that passes it, shaft axes."""

import math
from typing import NamedTuple

from helisim.physics import rotor
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM

STOPPED = 0.05
"""Below this fraction of its speed the rotor counts as stopped."""


class MainRotor(NamedTuple):
    """What the main rotor does.

    Attributes:
        thrust: N.
        torque: N m.
        inflow: ratio of the air's velocity through the disc to the tip speed.
        tip_speed: m/s.
        pitch: collective pitch of the blades, rad.
    """

    thrust: float
    torque: float
    inflow: float
    tip_speed: float
    pitch: float


@kernel()
def main_rotor(par, motion, speed, collective, nearness=0.0):
    """Return what the main rotor does.

    Args:
        par: parameters.
        motion: `Velocities` of the body through the air.
        speed: rotor speed over the nominal one.
        collective: unitised.
        nearness: (R / 4z)^2 of the ground, 0 far from it.
    """
    tip_speed = par[PARAM.main_speed] * speed * par[PARAM.main_radius]
    pitch = par[PARAM.main_pitch_trim] + par[PARAM.main_pitch_range] * collective
    if speed < STOPPED:
        return MainRotor(0.0, 0.0, 0.0, tip_speed, pitch)
    hub_u = motion.u + motion.q * par[PARAM.hub_z]
    hub_v = motion.v - motion.p * par[PARAM.hub_z]
    climb = -(motion.w - motion.q * par[PARAM.hub_x]) / tip_speed
    advance = math.sqrt(hub_u**2 + hub_v**2) / tip_speed
    inflow, ct = rotor.inflow_and_thrust(
        pitch,
        climb,
        advance,
        par[PARAM.main_solidity],
        par[PARAM.main_lift_slope],
        par[PARAM.main_stall],
        nearness,
    )
    cp = rotor.power(
        ct,
        inflow,
        climb,
        advance,
        par[PARAM.main_solidity],
        par[PARAM.main_induced_factor],
        par[PARAM.main_profile_drag],
    )
    radius = par[PARAM.main_radius]
    force = par[PARAM.air_density] * math.pi * radius**2 * tip_speed**2
    return MainRotor(force * ct, force * radius * cp, inflow, tip_speed, pitch)
