"""What the main rotor does in the air that passes it.

Three planes meet at the hub. The shaft's carries the forces in the plane of the disc. In that of no
feathering, which the swashplate tilts, blades see no cyclic pitch: what passes through it gives
their lift. Thrust stands on the tips' plane: what passes along it is what momentum theory knows,
and what thrust works against, so that the shaft's power is the work of thrust and drag on the
vehicle and the heat that the air keeps.
"""

import math
from typing import NamedTuple

from helisim.physics import rotor
from helisim.physics.inflow import balance, carried
from helisim.physics.kernel import kernel
from helisim.physics.params import PARAM

STOPPED = 0.05
"""Fraction of its speed below which a rotor's forces fade, to nothing where it stands."""


class MainRotor(NamedTuple):
    """What the main rotor does.

    Attributes:
        thrust: N, along the normal of the tips' plane.
        torque: N m, which the shaft takes; negative where the air turns the rotor.
        drag_x: force of the blades in the plane of the hub, N, forward.
        drag_y: likewise to the right, N.
        heat: power that the air keeps, induced and of the blades' drag, W.
        inflow: ratio of the air's velocity through the plane of no feathering to the tip speed.
        induced: share of it that the rotor itself makes.
        climb: ratio of the hub's velocity along the thrust, through the air, to the tip speed.
        advance: likewise across the shaft.
        tip_speed: m/s, at least that of a rotor that counts as stopped.
        pitch: collective pitch of the blades, rad.
    """

    thrust: float
    torque: float
    drag_x: float
    drag_y: float
    heat: float
    inflow: float
    induced: float
    climb: float
    advance: float
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
def main_rotor(par, motion, speed, collective, tips, swashplate, nearness=0.0, mean=0.0):
    """Return what the main rotor does.

    Args:
        par: parameters.
        motion: `Velocities` of the body through the air.
        speed: rotor speed over the nominal one.
        collective: unitised.
        tips: tilt of the tips' plane, rearward and right, rad, (2,).
        swashplate: tilt of the plane of no feathering, likewise, (2,).
        nearness: (R / 4z)^2 of the ground, 0 far from it.
        mean: induced velocity, m/s, where inflow is dynamic; else it is what the thrust asks for.
    """
    speed, share = turning(speed)
    radius = par[PARAM.main_radius]
    tip_speed = par[PARAM.main_speed] * speed * radius
    pitch = par[PARAM.main_pitch_trim] + par[PARAM.main_pitch_range] * collective
    u = (motion.u + motion.q * par[PARAM.hub_z]) / tip_speed
    v = (motion.v - motion.p * par[PARAM.hub_z]) / tip_speed
    w = (motion.w - motion.q * par[PARAM.hub_x]) / tip_speed
    advance = math.sqrt(u**2 + v**2)
    x, y, z = normal(par, tips)
    climb = u * x + v * y + w * z
    through = -swashplate[0] * u + swashplate[1] * v - w
    slope = 0.25 * par[PARAM.main_lift_slope] * par[PARAM.main_solidity]
    limit = par[PARAM.main_stall] * par[PARAM.main_solidity]
    free = rotor.unloaded_inflow(pitch, par[PARAM.main_twist], through, advance)
    if par[PARAM.main_dynamic_inflow] != 0.0:
        induced = mean / tip_speed
        thrust = carried(free, slope, limit, induced)
    else:
        induced, thrust = balance(free, slope, limit, climb, advance, nearness)
    unstalled = slope * (free - induced)
    spent = rotor.losses(
        thrust,
        unstalled,
        induced,
        advance,
        par[PARAM.main_solidity],
        slope,
        par[PARAM.main_induced_factor],
        par[PARAM.main_profile_drag],
    )
    lean = rotor.leaning_lift(pitch, par[PARAM.main_twist], climb + induced, slope)
    if thrust != unstalled:
        lean *= thrust / unstalled
    drag = spent.drag + lean
    force = share * par[PARAM.air_density] * math.pi * radius**2 * tip_speed**2
    return MainRotor(
        force * thrust,
        force * radius * (climb * thrust + spent.torque - lean * advance**2),
        -force * drag * u,
        -force * drag * v,
        force * tip_speed * (spent.torque + spent.drag * advance**2),
        through + induced,
        induced,
        climb,
        advance,
        tip_speed,
        pitch,
    )


@kernel()
def normal(par, tips):
    """Return the direction of thrust, body axes, at a tilt of the tips' plane (2,), rad.

    Tilts are the slopes of that plane, as the first harmonic of small flapping angles is.
    """
    stop = par[PARAM.flap_stop]
    a, b = rotor.soft_limit(tips[0], stop, 0.7), rotor.soft_limit(tips[1], stop, 0.7)
    level = 1.0 / math.sqrt(1.0 + a * a + b * b)
    return -a * level, b * level, -level
