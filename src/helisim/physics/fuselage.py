"""The air's loads on the fuselage: drag, the rotor's wash on it, and a body's turning moments."""

import math

from helisim.physics.body import Wrench
from helisim.physics.kernel import kernel
from helisim.physics.params import PARAM


@kernel()
def fuselage(par, motion, wash):
    """Return the wrench of the fuselage.

    Its moments are those of a long body in potential flow, which would turn across the flow
    (Munk, NACA TR 184): proportional to the product of the speeds along it and across it.

    Args:
        par: parameters.
        motion: `Velocities` of the body through the air.
        wash: velocity of the main rotor's wake there, m/s downwards.
    """
    u, v, w = motion.u, motion.v, motion.w - wash
    x, z = par[PARAM.drag_centre_x], par[PARAM.drag_centre_z]
    half = 0.5 * par[PARAM.air_density]
    pressure = half * math.sqrt(u**2 + v**2 + w**2)
    fx = -pressure * par[PARAM.drag_x] * u
    fy = -pressure * par[PARAM.drag_y] * v
    fz = -pressure * par[PARAM.drag_z] * w
    return Wrench(
        fx,
        fy,
        fz,
        -z * fy,
        z * fx - x * fz + half * par[PARAM.pitch_volume] * u * (w - par[PARAM.pitch_zero] * u),
        x * fy - half * par[PARAM.yaw_volume] * u * v,
    )
