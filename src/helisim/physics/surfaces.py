"""Fin and tailplane: small flat surfaces that lift, stall, and stand against any flow."""

import math

from helisim.physics.body import Wrench
from helisim.physics.kernel import kernel
from helisim.physics.params import PARAM

_STILL = 1e-60
"""(m/s)^2, below which its own square is lost."""


def lift_slope(aspect_ratio):
    """Return the lift slope, 1/rad, of a flat surface (Helmbold's formula).

    From 2 pi of an endless one to pi A / 2 of a slender one (Anderson, Fundamentals of
    Aerodynamics, section 5.3).

    Args:
        aspect_ratio: A, span squared over area.
    """
    return 2.0 * math.pi * aspect_ratio / (2.0 + math.hypot(aspect_ratio, 2.0))


@kernel()
def normal_force(density, area, slope, greatest, square, normal):
    """Return the force on a flat surface along its normal, N, against the flow through it.

    The coefficient is the lift slope times the sine of the angle to the flow up to where the
    surface stalls; from there to the flow at right angles, 90 degrees, it stays at the greatest,
    as of low and flat plates (Hoerner, Fluid-Dynamic Drag, chapter 3: 1.17 at right angles). A thin
    plate has no suction at its edge, so the whole force stands on its normal; leaned back, it is
    the induced drag too, and takes energy from every motion through the air.

    Args:
        density: of the air, kg/m^3.
        area: m^2.
        slope: lift slope, 1/rad.
        greatest: greatest coefficient.
        square: of the airspeed, (m/s)^2.
        normal: component of the surface's velocity through the air along its normal, m/s.
    """
    if square < _STILL:
        return 0.0
    stalled = (slope * normal / greatest) ** 2
    lifting = square / math.sqrt(math.sqrt(square**2 + stalled**2))
    return -0.5 * density * area * slope * normal * lifting


@kernel()
def fin(par, motion, wash):
    """Return the wrench of the vertical fin.

    Args:
        par: parameters.
        motion: `Velocities` of the body through the air.
        wash: velocity of the main rotor's wake there, m/s downwards.
    """
    x, z = par[PARAM.fin_x], par[PARAM.fin_z]
    u = motion.u + motion.q * z
    v = motion.v + motion.r * x - motion.p * z
    w = motion.w - motion.q * x - wash
    cosine, sine = par[PARAM.fin_cosine], par[PARAM.fin_sine]
    force = normal_force(
        par[PARAM.air_density],
        par[PARAM.fin_area],
        par[PARAM.fin_slope],
        par[PARAM.fin_stall],
        u**2 + v**2 + w**2,
        u * sine + v * cosine,
    )
    fx, fy = force * sine, force * cosine
    return Wrench(fx, fy, 0.0, -z * fy, z * fx, x * fy)


@kernel()
def tailplane(par, motion, wash):
    """Return the wrench of the horizontal tailplane.

    Args:
        par: parameters.
        motion: `Velocities` of the body through the air.
        wash: velocity of the main rotor's wake there, m/s downwards.
    """
    if par[PARAM.tailplane_area] == 0.0:
        return Wrench(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    x, z = par[PARAM.tailplane_x], par[PARAM.tailplane_z]
    u = motion.u + motion.q * z
    v = motion.v + motion.r * x - motion.p * z
    w = motion.w - motion.q * x - wash
    cosine, sine = par[PARAM.tailplane_cosine], par[PARAM.tailplane_sine]
    force = normal_force(
        par[PARAM.air_density],
        par[PARAM.tailplane_area],
        par[PARAM.tailplane_slope],
        par[PARAM.tailplane_stall],
        u**2 + v**2 + w**2,
        u * sine + w * cosine,
    )
    fx, fz = force * sine, force * cosine
    return Wrench(fx, 0.0, fz, 0.0, z * fx - x * fz, 0.0)
