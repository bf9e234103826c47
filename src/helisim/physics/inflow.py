"""Induced velocity of a rotor: momentum balance through the vortex ring, and dynamic inflow.

Velocities are ratios to the tip speed, positive when air passes the disc against the thrust, as
in a climb; CT = T / (rho A (Omega R)^2).

Momentum theory, T = 2 rho A v V with V the air's speed through the disc, holds in hover, in climb,
in forward flight and, from a descent of twice the hover's induced velocity on, in the windmill
state. Between, where V would be that of a wake that can't leave, it has three roots or
none that is measured. There V is taken from tests instead, as a function of v and of the flow past
the rotor, so that the balance keeps its form. It then rises with v everywhere: blade elements,
whose thrust falls with v, meet it once.

Dynamic inflow is Pitt and Peters', Theoretical prediction of dynamic-inflow derivatives (Vertica 5,
1981), in the nonlinear form of Peters and HaQuang, Dynamic inflow for practical applications
(J. AHS 33, 1988). The induced velocity has a mean and a slope across the disc,

    v(x, y) = v_0 + (v_s y - v_c x) / R    (x ahead, y to the right, v downwards),

and M dv/dt + V L^-1 v = loads: those of thrust and of the aerodynamic moments on the hub, with M
the apparent mass of the air and L the wake's influence at its angle of skew. Where it rests, the
mean is the momentum balance. Its states are velocities, not ratios: rotor speed may change, and
the air knows nothing of it.
"""

import math
from collections import namedtuple

from helisim.physics.kernel import kernel

_LAST_STEP = 1e-8
"""Newton converges quadratically: after a step this small the error is near rounding."""
_MAX_ITERATIONS = 60
_STALL_CORE = 0.7
"""Below this fraction of the stall limit the blades are untouched by it."""


def _measured(x: float) -> tuple[float, float, float]:
    """Return v and v V at a descent of 1, and the slope between them, at x = V_c / v_h.

    Leishman's fit of measured v / v_h (Principles of Helicopter Aerodynamics, chapter 2).
    """
    ratio = 1.0 - 1.125 * x - 1.372 * x**2 - 1.718 * x**3 - 0.655 * x**4
    slope = -1.125 - 2.744 * x - 5.154 * x**2 - 2.62 * x**3
    return -ratio / x, 1.0 / x**2, -2.0 / (x * (ratio - x * slope))


_WINDMILL = (0.5, 0.25, 0.0)
"""v and v V at a descent of 1, and the slope, where the windmill state begins: v_h = 0.5."""
_FAST = _measured(-1.75)
_SLOW = _measured(-1.25)
_HOVER = (4.0, 12.0, 7.0)
"""The same on the branch of the hover, v (v - 1), at a descent of 0.29 v_h.

Johnson (NASA TP-2005-213477) has the vortex ring begin at 0.2 v_h.
"""


@kernel()
def soft_limit(x, limit, core):
    """Return x itself while |x| <= core * limit, then approach the limit smoothly."""
    edge = core * limit
    rest = limit - edge
    if x > edge:
        return edge + rest * math.tanh((x - edge) / rest)
    if x < -edge:
        return -edge + rest * math.tanh((x + edge) / rest)
    return x


@kernel()
def _cubic(x, start, end):
    """Return the cubic through two knots (x, y, slope), and its derivative."""
    width = end[0] - start[0]
    t = (x - start[0]) / width
    mean = (end[1] - start[1]) / width
    bend = start[2] + end[2] - 2.0 * mean
    lean = 3.0 * mean - 2.0 * start[2] - end[2]
    value = start[1] + width * t * (start[2] + t * (lean + t * bend))
    return value, start[2] + t * (2.0 * lean + 3.0 * t * bend)


@kernel()
def ring_thrust(induced):
    """Return v V in the vortex ring at a descent of 1 without edgewise flow, and its slope by v.

    Leishman's fit where the ring is fully formed; from there to momentum theory on either side
    with its value and slope, which the fit itself doesn't meet (in hover it is twice as steep).
    """
    if induced < _FAST[0]:
        return _cubic(induced, _WINDMILL, _FAST)
    if induced < _SLOW[0]:
        return _cubic(induced, _FAST, _SLOW)
    return _cubic(induced, _SLOW, _HOVER)


@kernel()
def mass_flow(induced, climb, advance):
    """Return V, the ratio of the air's speed through the disc, and its slope by v.

    induced: v; climb: V_c; advance: mu.
    """
    square, half_slope = flow_square(induced, climb, advance)
    flow = math.sqrt(square)
    if flow == 0.0:
        return 0.0, 0.0
    return flow, half_slope / flow


@kernel()
def flow_square(induced, climb, advance):
    """Return V^2 and half of its slope by v.

    Thrust is 2 v V. Glauert's sqrt(mu^2 + (V_c + v)^2) but in the vortex ring, where the axial
    part is measured. Edgewise flow as fast as v has blown the ring away: Johnson (NASA
    TP-2005-213477) has it gone at 0.95 v_h, where v is about v_h.

    induced: v; climb: V_c; advance: mu.
    """
    through = climb + induced
    square, half_slope = advance**2 + through**2, through
    up = math.copysign(1.0, induced)
    descent, speed = -up * climb, abs(induced)
    if _WINDMILL[0] * descent < speed < _HOVER[0] * descent and advance < speed:
        thrust, slope = ring_thrust(speed / descent)
        axial = thrust * descent**2 / speed
        axial_slope = up * (slope * descent - axial) / speed
        edgewise = (advance / speed) ** 2
        share = (1.0 - edgewise) ** 2 * (1.0 + 2.0 * edgewise)
        share_slope = 12.0 * edgewise**2 * (1.0 - edgewise) / induced
        gain = axial**2 - through**2
        square += share * gain
        half_slope += share * (axial * axial_slope - through) + 0.5 * share_slope * gain
    return square, half_slope


@kernel()
def ground_share(nearness, induced, advance):
    """Return the share of thrust that drives the inflow near the ground, and its derivative.

    Cheeseman and Bennett (R&M 3021): at one induced power the thrust is T_inf / k with
    k = 1 - (R / 4z)^2 / (1 + (mu / lambda_i)^2). Momentum theory has T lambda_i and
    lambda_i^2 proportional to share x T, so the share is k^3.

    nearness: (R / 4z)^2; induced: lambda_i; advance: mu.
    """
    square = induced**2 + advance**2
    if nearness == 0.0 or square == 0.0:
        return (1.0 - nearness) ** 3, 0.0
    k = 1.0 - nearness * induced**2 / square
    return k**3, -6.0 * k**2 * nearness * induced * (advance / square) ** 2


@kernel()
def carried(free, slope, limit, induced):
    """Return CT of blades in an induced velocity; arguments as of `balance`."""
    return soft_limit(slope * (free - induced), limit, _STALL_CORE)


@kernel()
def balance(free, slope, limit, climb, advance, nearness):
    """Return v where blade elements and momentum meet, and the CT of both.

    2 v V = CT, near the ground a share of it, and CT = slope (free - v) up to the stall. Newton's
    method between 0 and `free`, to rounding. Turned upside down all signs change, to the bit.

    free: v at which the blades carry nothing; slope: of the blades' CT, by v; limit: greatest |CT|
    that the blades carry; climb: along the thrust; advance: mu; nearness: (R / 4z)^2 of the ground,
    0 far from it.
    """
    if free == 0.0:
        return 0.0, 0.0
    up = math.copysign(1.0, free)
    low, high = 0.0, up * free
    climb = up * climb
    # in hover and axial climb the balance is quadratic, 2 v (climb + v) = slope (free - v)
    half = 0.25 * (2.0 * climb + slope)
    induced = -half + math.sqrt(half * half + 0.5 * slope * high)
    edge = _STALL_CORE * limit
    for _ in range(_MAX_ITERATIONS):
        square, half_slope = flow_square(induced, climb, advance)
        linear = slope * (up * free - induced)
        thrust, fade = linear, 1.0
        if linear > edge:
            thrust = soft_limit(linear, limit, _STALL_CORE)
            fade = 1.0 - ((thrust - edge) / (limit - edge)) ** 2
        share, share_slope = ground_share(nearness, induced, advance)
        flow = math.sqrt(square)
        residual = 2.0 * induced * flow - share * thrust
        # of the balance, times the flow: one division less to wait for
        steepness = 2.0 * (square + induced * half_slope)
        steepness += flow * (share * slope * fade - share_slope * thrust)
        if residual > 0.0:
            high = induced
        else:
            low = induced
        step = flow * residual / steepness if steepness > 0.0 else math.inf
        induced -= step
        if abs(step) <= _LAST_STEP:
            break
        if not low < induced < high:
            induced = 0.5 * (low + high)
    thrust = carried(up * free, slope, limit, induced)
    return up * induced, up * thrust


MEAN_MASS = 8.0 / (3.0 * math.pi)
"""Apparent mass of the air over rho pi R^3: an impermeable disc's, as the untwisted blades of
Carpenter and Fridovich have it (NACA TN 3044, 1953). Pitt and Peters' corrected 128 / (75 pi) is
36 % less."""
SLOPE_MASS = 16.0 / (45.0 * math.pi)
"""Apparent inertia of the air under rolling and pitching moments, over rho pi R^4."""
_SKEW = 15.0 * math.pi / 64.0
"""Coupling: mean load slopes the inflow of a skewed wake, and a slope of load changes its mean."""
_LEAST = 0.5
"""V_m is at least so much of V_T: at the edges of the vortex ring momentum theory would have 0,
where nothing carries a moment's air away."""


Wake = namedtuple("Wake", "flow slope_flow skew_x skew_y")
"""The air that leaves a rotor, over the tip speed.

flow: V_T of Peters and HaQuang; slope_flow: V_m of theirs; skew_x: tan(chi / 2) times the
cosine of the hub's way through the air; skew_y: the same times the sine, positive to the right.
"""


@kernel()
def inflow_rates(mean, right, aft, thrust, roll, pitch, wake, speed, radius):
    """Return the derivatives of mean, right and aft induced velocity, m/s^2.

    mean: v_0, m/s; right: v_s, by which more air goes down at the right tip, m/s; aft: v_c,
    likewise at the rear tip, m/s; thrust: T / (rho pi R^2), m^2/s^2; roll: L / (rho pi R^3),
    m^2/s^2, of the aerodynamic moment, right side down; pitch: M / (rho pi R^3), likewise, nose up;
    wake: the `Wake`; speed: of the tips, m/s; radius: m.
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

    induced: mean induced velocity; climb: of the hub through the air, against its thrust; edgewise:
    the hub's velocity across the thrust; ahead: velocity that skews the wake; right: likewise.
    """
    flow, slope = mass_flow(induced, climb, edgewise)
    if flow == 0.0:
        return Wake(0.0, 0.0, 0.0, 0.0)
    # tan(chi / 2) = mu / (V + |lambda|)
    skew = 1.0 / (flow + math.sqrt(max(0.0, flow**2 - edgewise**2)))
    return Wake(flow, max(flow + induced * slope, _LEAST * flow), skew * ahead, skew * right)
