"""The air's flow past the airframe and its loads: rotors, hub, fuselage and fin, body axes."""

import math
from typing import NamedTuple

from helisim.physics import air, rotor
from helisim.physics.body import Velocities, Wrench
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, STATE
from helisim.physics.memory import from_element, speed_ratio
from helisim.physics.servo import unmix
from helisim.physics.timing import position_ahead

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


class Flow(NamedTuple):
    """The flow past a vehicle, and what its main rotor does in it.

    Attributes:
        motion: velocities of the body through the air.
        speed: rotor speed over the nominal one.
        main: what the main rotor does.
        air: velocities of the air itself.
    """

    motion: Velocities
    speed: float
    main: MainRotor
    air: Velocities


@kernel()
def flow(view, ahead):
    """Return the `Flow` past a vehicle; the collective is that of a time `ahead` (s)."""
    moving = air.motion(view)
    motion = air.relative_motion(view, moving)
    speed = speed_ratio(view)
    collective, _, _ = unmix(
        from_element(view.par, PARAM.mix_front_col),
        position_ahead(view, STATE.front_position, ahead),
        position_ahead(view, STATE.left_position, ahead),
        position_ahead(view, STATE.right_position, ahead),
    )
    nearness = air.ground_nearness(view)
    return Flow(motion, speed, main_rotor(view.par, motion, speed, collective, nearness), moving)


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
        par[PARAM.main_inflow_floor],
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


@kernel()
def tail_rotor(par, motion, speed, pedal):
    """Return the tail rotor's thrust, N.

    Under blades that turn clockwise it pushes the tail to the left (nose right), and more so with
    the pedals; under others to the right, and less so: pedals forward is nose right for both.

    Args:
        par: parameters.
        motion: `Velocities` of the body through the air.
        speed: rotor speed over the nominal one.
        pedal: of the tail servo, unitised.
    """
    tip_speed = par[PARAM.tail_speed] * speed * par[PARAM.tail_radius]
    if speed < STOPPED:
        return 0.0
    hand = par[PARAM.main_direction]
    pitch = par[PARAM.tail_pitch_trim] + hand * par[PARAM.tail_pitch_range] * pedal
    climb = -hand * tail_v(par, motion) / tip_speed
    _, ct = rotor.inflow_and_thrust(
        pitch,
        climb,
        0.0,
        par[PARAM.tail_solidity],
        par[PARAM.tail_lift_slope],
        par[PARAM.tail_stall],
        par[PARAM.tail_inflow_floor],
        0.0,
    )
    return par[PARAM.air_density] * math.pi * par[PARAM.tail_radius] ** 2 * tip_speed**2 * ct


@kernel()
def tail_v(par, motion):
    """Return the velocity through the air of the tail rotor and fin to the right, m/s."""
    return motion.v + motion.r * par[PARAM.tail_x] - motion.p * par[PARAM.tail_z]


@kernel()
def wrench(par, pedal, a, b, motion, speed, main):
    """Return the aerodynamic force and moment at the body's origin, a `Wrench`.

    Args:
        par: parameters.
        pedal: of the tail servo, unitised.
        a: rearward tilt, rad.
        b: right tilt, rad.
        motion: `Velocities` of the body through the air.
        speed: rotor speed over the nominal one.
        main: what the main rotor does, a `MainRotor`.
    """
    u, v, w = motion.u, motion.v, motion.w
    tail = tail_rotor(par, motion, speed, pedal)
    stop = par[PARAM.flap_stop]
    a = rotor.soft_limit(a, stop, 0.7)
    b = rotor.soft_limit(b, stop, 0.7)
    stiffness = par[PARAM.hub_stiffness] if speed >= STOPPED else 0.0
    # hub: thrust along the tip-path plane's normal, springs, torque, against the blades' turning
    hub_x = -main.thrust * math.sin(a)
    hub_y = main.thrust * math.sin(b)
    hub_z = -main.thrust * math.cos(a) * math.cos(b)
    arm_x, arm_z = par[PARAM.hub_x], par[PARAM.hub_z]
    moment_l = stiffness * b - arm_z * hub_y
    moment_m = stiffness * a + arm_z * hub_x - arm_x * hub_z
    moment_n = arm_x * hub_y - par[PARAM.main_direction] * main.torque
    # drag of fuselage and fin
    density = par[PARAM.air_density]
    pressure = 0.5 * density * math.sqrt(u**2 + v**2 + w**2)
    side_speed = tail_v(par, motion)
    fin = -0.5 * density * par[PARAM.fin_area] * abs(side_speed) * side_speed
    side = fin - par[PARAM.main_direction] * tail
    return Wrench(
        hub_x - pressure * par[PARAM.drag_x] * u,
        hub_y - pressure * par[PARAM.drag_y] * v + side,
        hub_z - pressure * par[PARAM.drag_z] * w,
        moment_l - par[PARAM.tail_z] * side,
        moment_m,
        moment_n + par[PARAM.tail_x] * side,
    )
