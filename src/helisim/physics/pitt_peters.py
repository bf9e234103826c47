"""A rotor's wake: how the air through the disc follows the blades' loads, and how it slopes.

Pitt and Peters, Theoretical prediction of dynamic-inflow derivatives (Vertica 5, 1981), in the
nonlinear form of Peters and HaQuang, Dynamic inflow for practical applications (J. AHS 33, 1988).
The induced velocity has a mean and a slope across the disc,

    v(x, y) = v_0 + (v_s y - v_c x) / R    (x ahead, y to the right, v downwards),

and M dv/dt + V L^-1 v = loads: those of thrust and of the aerodynamic moments on the hub, with M
the apparent mass of the air and L the wake's influence at its angle of skew. Where it rests, the
mean is the momentum balance of `helisim.physics.inflow`, whose mass flow V is.

Velocities, not ratios: rotor speed may change, and the air knows nothing of it.
"""

import math
from typing import NamedTuple

from helisim.physics import inflow
from helisim.physics.kernel import kernel

MEAN_MASS = 8.0 / (3.0 * math.pi)
"""Of the air, over rho pi R^3: of an impermeable disc, as the untwisted blades of Carpenter and
Fridovich have it (NACA TN 3044, 1953). Pitt and Peters' corrected 128 / (75 pi) is 36 % less."""
SLOPE_MASS = 16.0 / (45.0 * math.pi)
"""Of the air under rolling and pitching moments, over rho pi R^4."""
_SKEW = 15.0 * math.pi / 64.0
"""How the mean load slopes the inflow of a skewed wake, and a slope of load changes its mean."""
_LEAST = 0.5
"""V_m is at least so much of V_T: at the edges of the vortex ring momentum theory would have 0,
where nothing carries a moment's air away."""


class Wake(NamedTuple):
    """The air that leaves a rotor, over the tip speed.

    Attributes:
        flow: V_T of Peters and HaQuang.
        slope_flow: V_m of theirs.
        skew_x: tan(chi / 2) times the cosine of the hub's way through the air.
        skew_y: the same times the sine, positive to the right.
    """

    flow: float
    slope_flow: float
    skew_x: float
    skew_y: float


@kernel()
def inflow_rates(mean, right, aft, thrust, roll, pitch, wake, speed, radius):
    """Return the derivatives of mean, right and aft induced velocity, m/s^2.

    Args:
        mean: v_0, m/s.
        right: v_s, by which more air goes down at the right tip, m/s.
        aft: v_c, likewise at the rear tip, m/s.
        thrust: T / (rho pi R^2), m^2/s^2.
        roll: L / (rho pi R^3), m^2/s^2, of the aerodynamic moment, right side down.
        pitch: M / (rho pi R^3), likewise, nose up.
        wake: the `Wake`.
        speed: of the tips, m/s.
        radius: m.
    """
    skew_x, skew_y = wake.skew_x, wake.skew_y
    flow, slope_flow = speed * wake.flow, speed * wake.slope_flow
    square = skew_x**2 + skew_y**2
    share = 1.0 - (1.0 - _SKEW**2) * square  # determinant of the wake's L across mean and way
    along = aft * skew_x - right * skew_y  # slope to the lee, times the skew
    held = (2.0 * (1.0 - square) * mean + _SKEW * along) / share
    mean_rate = (thrust - flow * held) / (MEAN_MASS * radius)
    even = 0.5 / (1.0 + square)
    swept = ((2.0 - _SKEW**2) * even * along - _SKEW * mean) / share
    right_rate = (-roll - slope_flow * (even * right - swept * skew_y)) / (SLOPE_MASS * radius)
    aft_rate = (-pitch - slope_flow * (even * aft + swept * skew_x)) / (SLOPE_MASS * radius)
    return mean_rate, right_rate, aft_rate


@kernel()
def wake(induced, climb, edgewise, ahead, right):
    """Return the `Wake` of a rotor; all velocities are over the tip speed.

    Args:
        induced: mean induced velocity.
        climb: of the hub through the air, against its thrust.
        edgewise: the hub's velocity across the thrust.
        ahead: velocity that skews the wake.
        right: likewise.
    """
    flow, slope = inflow.mass_flow(induced, climb, edgewise)
    if flow == 0.0:
        return Wake(0.0, 0.0, 0.0, 0.0)
    # tan(chi / 2) = mu / (V + |lambda|)
    skew = 1.0 / (flow + math.sqrt(max(0.0, flow**2 - edgewise**2)))
    return Wake(flow, max(flow + induced * slope, _LEAST * flow), skew * ahead, skew * right)
