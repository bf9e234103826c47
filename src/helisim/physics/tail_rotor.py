"""What the tail rotor does in the air that passes it, edgewise and through its disc."""

import math
from typing import NamedTuple

from helisim.physics import rotor
from helisim.physics.body import Wrench
from helisim.physics.inflow import balance
from helisim.physics.kernel import kernel
from helisim.physics.main_rotor import turning
from helisim.physics.params import PARAM


class TailRotor(NamedTuple):
    """What the tail rotor does.

    Attributes:
        thrust: N.
        inflow: ratio of the air's velocity through the disc to the tip speed.
        torque: at its own shaft, N m.
        drag_x: force of the blades' drag in the disc's plane, N, forward.
        drag_z: likewise downward, N.
        heat: power that the air keeps, induced and of the blades' drag, W.
    """

    thrust: float
    inflow: float
    torque: float
    drag_x: float
    drag_z: float
    heat: float


@kernel()
def tail_rotor(par, motion, speed, pedal, wash=0.0):
    """Return what the tail rotor does, a `TailRotor`.

    Under blades that turn clockwise it pushes the tail to the left (nose right), and more so with
    the pedals; under others to the right, and less so: pedals forward is nose right for both.

    Args:
        par: parameters.
        motion: `Velocities` of the body through the air.
        speed: rotor speed over the nominal one.
        pedal: of the tail servo, unitised.
        wash: velocity of the main rotor's wake there, m/s downwards.
    """
    speed, share = turning(speed)
    radius = par[PARAM.tail_radius]
    tip_speed = par[PARAM.tail_speed] * speed * radius
    hand, x, z = par[PARAM.main_direction], par[PARAM.tail_x], par[PARAM.tail_z]
    pitch = par[PARAM.tail_pitch_trim] + hand * par[PARAM.tail_pitch_range] * pedal
    ahead, down = motion.u + motion.q * z, motion.w - motion.q * x - wash
    advance = math.sqrt(ahead**2 + down**2) / tip_speed
    climb = -hand * (motion.v + motion.r * x - motion.p * z) / tip_speed
    slope = 0.25 * par[PARAM.tail_lift_slope] * par[PARAM.tail_solidity]
    limit = par[PARAM.tail_stall] * par[PARAM.tail_solidity]
    free = rotor.unloaded_inflow(pitch, 0.0, climb, advance)
    induced, thrust = balance(free, slope, limit, climb, advance, 0.0)
    spent = rotor.losses(
        thrust,
        slope * (free - induced),
        induced,
        advance,
        par[PARAM.tail_solidity],
        slope,
        par[PARAM.tail_induced_factor],
        par[PARAM.tail_profile_drag],
    )
    force = share * par[PARAM.air_density] * math.pi * radius**2 * tip_speed**2
    torque = force * radius * (climb * thrust + spent.torque)
    drag = -force * spent.drag / tip_speed
    heat = force * tip_speed * (spent.torque + spent.drag * advance**2)
    return TailRotor(force * thrust, climb + induced, torque, drag * ahead, drag * down, heat)


@kernel()
def tail_wrench(par, tail):
    """Return the wrench of a tail rotor that does what `tail`, a `TailRotor`, says."""
    x, z = par[PARAM.tail_x], par[PARAM.tail_z]
    side = -par[PARAM.main_direction] * (1.0 - par[PARAM.tail_blockage]) * tail.thrust
    pitching = z * tail.drag_x - x * tail.drag_z - par[PARAM.tail_direction] * tail.torque
    return Wrench(tail.drag_x, side, tail.drag_z, -z * side, pitching, x * side)
