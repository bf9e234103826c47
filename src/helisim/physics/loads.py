"""The air's loads on a vehicle: rotors, hub, fuselage and fin, body axes."""

import math

from helisim.physics import rotor
from helisim.physics.body import Wrench
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM
from helisim.physics.main_rotor import turning
from helisim.physics.tail_rotor import tail_v


@kernel()
def wrench(par, a, b, flow, mast):
    """Return the aerodynamic force and moment at the body's origin, a `Wrench`.

    Args:
        par: parameters.
        a: rearward tilt, rad.
        b: right tilt, rad.
        flow: the `Flow` past it.
        mast: torque that turns the main rotor, N m.
    """
    motion, main = flow.motion, flow.main
    u, v, w = motion.u, motion.v, motion.w
    stop = par[PARAM.flap_stop]
    a = rotor.soft_limit(a, stop, 0.7)
    b = rotor.soft_limit(b, stop, 0.7)
    _, share = turning(flow.speed)
    stiffness = share * par[PARAM.hub_stiffness]
    # hub: thrust along the tip-path plane's normal, the blades' drag in the plane of the hub,
    # springs, torque against the blades' turning
    hub_x = -main.thrust * math.sin(a) + main.drag_x
    hub_y = main.thrust * math.sin(b) + main.drag_y
    hub_z = -main.thrust * math.cos(a) * math.cos(b)
    arm_x, arm_z = par[PARAM.hub_x], par[PARAM.hub_z]
    moment_l = stiffness * b - arm_z * hub_y
    moment_m = stiffness * a + arm_z * hub_x - arm_x * hub_z
    moment_n = arm_x * hub_y - par[PARAM.main_direction] * mast
    # drag of fuselage and fin
    density = par[PARAM.air_density]
    pressure = 0.5 * density * math.sqrt(u**2 + v**2 + w**2)
    side_speed = tail_v(par, motion)
    fin = -0.5 * density * par[PARAM.fin_area] * abs(side_speed) * side_speed
    side = fin - par[PARAM.main_direction] * flow.tail.thrust
    return Wrench(
        hub_x - pressure * par[PARAM.drag_x] * u,
        hub_y - pressure * par[PARAM.drag_y] * v + side,
        hub_z - pressure * par[PARAM.drag_z] * w,
        moment_l - par[PARAM.tail_z] * side,
        moment_m,
        moment_n + par[PARAM.tail_x] * side,
    )
