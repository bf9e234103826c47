"""What the tail rotor does in the air that passes it."""

import math
from typing import NamedTuple

from helisim.physics import rotor
from helisim.physics.inflow import balance
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM
from helisim.physics.main_rotor import turning


class TailRotor(NamedTuple):
    """What the tail rotor does.

    Attributes:
        thrust: N.
        inflow: ratio of the air's velocity through the disc to the tip speed.
        torque: at its own shaft, N m.
    """

    thrust: float
    inflow: float
    torque: float


@kernel()
def tail_rotor(par, motion, speed, pedal):
    """Return what the tail rotor does, a `TailRotor`.

    Under blades that turn clockwise it pushes the tail to the left (nose right), and more so with
    the pedals; under others to the right, and less so: pedals forward is nose right for both.

    Args:
        par: parameters.
        motion: `Velocities` of the body through the air.
        speed: rotor speed over the nominal one.
        pedal: of the tail servo, unitised.
    """
    speed, share = turning(speed)
    tip_speed = par[PARAM.tail_speed] * speed * par[PARAM.tail_radius]
    hand = par[PARAM.main_direction]
    pitch = par[PARAM.tail_pitch_trim] + hand * par[PARAM.tail_pitch_range] * pedal
    climb = -hand * tail_v(par, motion) / tip_speed
    slope = 0.25 * par[PARAM.tail_lift_slope] * par[PARAM.tail_solidity]
    limit = par[PARAM.tail_stall] * par[PARAM.tail_solidity]
    free = rotor.unloaded_inflow(pitch, 0.0, climb, 0.0)
    induced, thrust = balance(free, slope, limit, climb, 0.0, 0.0)
    spent = rotor.losses(
        thrust,
        slope * (free - induced),
        induced,
        0.0,
        par[PARAM.tail_solidity],
        slope,
        par[PARAM.main_induced_factor],
        par[PARAM.main_profile_drag],
    )
    radius = par[PARAM.tail_radius]
    force = share * par[PARAM.air_density] * math.pi * radius**2 * tip_speed**2
    torque = force * radius * (climb * thrust + spent.torque)
    return TailRotor(force * thrust, climb + induced, torque)


@kernel()
def tail_v(par, motion):
    """Return the velocity through the air of the tail rotor and fin to the right, m/s."""
    return motion.v + motion.r * par[PARAM.tail_x] - motion.p * par[PARAM.tail_z]
