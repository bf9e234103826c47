"""What the main rotor does in the air that passes it, shaft axes."""

import math
from typing import NamedTuple

from helisim.physics import rotor
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM

STOPPED = 0.05
"""Fraction of its speed below which a rotor's forces fade, to nothing where it stands."""


class MainRotor(NamedTuple):
    """What the main rotor does.

    Attributes:
        thrust: N.
        torque: N m.
        inflow: ratio of the air's velocity through the disc to the tip speed.
        tip_speed: m/s, at least that of a rotor that counts as stopped.
        pitch: collective pitch of the blades, rad.
    """

    thrust: float
    torque: float
    inflow: float
    tip_speed: float
    pitch: float


@kernel()
def turning(speed):
    """Return the speed at which a rotor is computed, and the share of its forces that it has.

    Both over nominal ones. A rotor that hardly turns has its forces in the ratio of an endless
    advance ratio; so they are found at `STOPPED`, and fade from there as a smooth cubic.

    Args:
        speed: of the rotor, over the nominal one.
    """
    if speed >= STOPPED:
        return speed, 1.0
    part = max(0.0, speed) / STOPPED
    return STOPPED, part * part * (3.0 - 2.0 * part)


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
    speed, share = turning(speed)
    tip_speed = par[PARAM.main_speed] * speed * par[PARAM.main_radius]
    pitch = par[PARAM.main_pitch_trim] + par[PARAM.main_pitch_range] * collective
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
    force = share * par[PARAM.air_density] * math.pi * radius**2 * tip_speed**2
    return MainRotor(force * ct, force * radius * cp, inflow, tip_speed, pitch)
