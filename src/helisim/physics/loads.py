"""The air's loads on the airframe: rotors, hub, fuselage and fin, body axes."""

import math

from helisim.physics import rotor
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM

STOPPED = 0.05
"""Below this fraction of its speed the rotor counts as stopped."""


@kernel()
def main_rotor(par, u, v, w, p, q, speed_ratio, collective, nearness=0.0):
    """Return thrust (N), torque (N m), inflow ratio, tip speed (m/s) and pitch (rad).

    Args:
        par: parameters.
        u: and the next four, motion through the air, m/s and rad/s, body axes.
        v: m/s.
        w: m/s.
        p: rad/s.
        q: rad/s.
        speed_ratio: rotor speed over the nominal one.
        collective: unitised.
        nearness: (R / 4z)^2 of the ground, 0 far from it.
    """
    tip_speed = par[PARAM.main_speed] * speed_ratio * par[PARAM.main_radius]
    pitch = par[PARAM.main_pitch_trim] + par[PARAM.main_pitch_range] * collective
    if speed_ratio < STOPPED:
        return 0.0, 0.0, 0.0, tip_speed, pitch
    hub_u = u + q * par[PARAM.hub_z]
    hub_v = v - p * par[PARAM.hub_z]
    climb = -(w - q * par[PARAM.hub_x]) / tip_speed
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
    return force * ct, force * radius * cp, inflow, tip_speed, pitch


@kernel()
def tail_rotor(par, v, p, r, speed_ratio, pedal):
    """Return the tail rotor's thrust, N; it pushes the tail to the left (nose right)."""
    tip_speed = par[PARAM.tail_speed] * speed_ratio * par[PARAM.tail_radius]
    if speed_ratio < STOPPED:
        return 0.0
    pitch = par[PARAM.tail_pitch_trim] + par[PARAM.tail_pitch_range] * pedal
    climb = -(v + r * par[PARAM.tail_x] - p * par[PARAM.tail_z]) / tip_speed
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
def wrench(par, pedal, a, b, u, v, w, p, q, r, speed_ratio, thrust, torque):
    """Return the aerodynamic force (N) and moment (N m) at the body's origin, body axes.

    Args:
        par: parameters.
        pedal: of the tail servo, unitised.
        a: rearward tilt, rad.
        b: right tilt, rad.
        u: and the next five, motion through the air, m/s and rad/s, body axes.
        v: m/s.
        w: m/s.
        p: rad/s.
        q: rad/s.
        r: rad/s.
        speed_ratio: rotor speed over the nominal one.
        thrust: of the main rotor, N.
        torque: of the main rotor, N m.
    """
    tail = tail_rotor(par, v, p, r, speed_ratio, pedal)
    stop = par[PARAM.flap_stop]
    a = rotor.soft_limit(a, stop, 0.7)
    b = rotor.soft_limit(b, stop, 0.7)
    stiffness = par[PARAM.hub_stiffness] if speed_ratio >= STOPPED else 0.0
    # hub: thrust along the tip-path plane's normal, springs, torque (blades turn clockwise)
    hub_x = -thrust * math.sin(a)
    hub_y = thrust * math.sin(b)
    hub_z = -thrust * math.cos(a) * math.cos(b)
    arm_x, arm_z = par[PARAM.hub_x], par[PARAM.hub_z]
    moment_l = stiffness * b - arm_z * hub_y
    moment_m = stiffness * a + arm_z * hub_x - arm_x * hub_z
    moment_n = arm_x * hub_y - torque
    # drag of fuselage and fin
    density = par[PARAM.air_density]
    pressure = 0.5 * density * math.sqrt(u**2 + v**2 + w**2)
    tail_v = v + r * par[PARAM.tail_x] - p * par[PARAM.tail_z]
    fin = -0.5 * density * par[PARAM.fin_area] * abs(tail_v) * tail_v
    side = fin - tail
    return (
        hub_x - pressure * par[PARAM.drag_x] * u,
        hub_y - pressure * par[PARAM.drag_y] * v + side,
        hub_z - pressure * par[PARAM.drag_z] * w,
        moment_l - par[PARAM.tail_z] * side,
        moment_m,
        moment_n + par[PARAM.tail_x] * side,
    )
