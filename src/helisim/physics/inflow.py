"""Induced velocity of a rotor from climb through the vortex ring to the windmill: one answer.

Velocities are ratios to the tip speed, positive when air passes the disc against the thrust, as
in a climb; CT = T / (rho A (Omega R)^2).

Momentum theory, T = 2 rho A v V with V the air's speed through the disc, holds in hover, in climb,
in forward flight and, from a descent of twice the hover's induced velocity on, in the windmill
state. Between, where V would be that of a wake that can't leave, it has three roots or
none that is measured. There V is taken from tests instead, as a function of v and of the flow past
the rotor, so that the balance keeps its form. It then rises with v everywhere: blade elements,
whose thrust falls with v, meet it once.
"""

import math

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

    Args:
        induced: v.
        climb: V_c.
        advance: mu.
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

    Args:
        induced: v.
        climb: V_c.
        advance: mu.
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

    Args:
        nearness: (R / 4z)^2.
        induced: lambda_i.
        advance: mu.
    """
    square = induced**2 + advance**2
    if nearness == 0.0 or square == 0.0:
        return (1.0 - nearness) ** 3, 0.0
    k = 1.0 - nearness * induced**2 / square
    return k**3, -6.0 * k**2 * nearness * induced * (advance / square) ** 2


@kernel()
def hover_or_climb(free, slope, climb):
    """Return v in hover and axial climb, where the balance is quadratic; elsewhere a start.

    2 v (climb + v) = slope (free - v) for free > 0.
    """
    half = 0.25 * (2.0 * climb + slope)
    return -half + math.sqrt(half * half + 0.5 * slope * free)


@kernel()
def carried(free, slope, limit, induced):
    """Return CT of blades in an induced velocity; arguments as of `balance`."""
    return soft_limit(slope * (free - induced), limit, _STALL_CORE)


@kernel()
def balance(free, slope, limit, climb, advance, nearness):
    """Return v where blade elements and momentum meet, and the CT of both.

    2 v V = CT, near the ground a share of it, and CT = slope (free - v) up to the stall. Newton's
    method between 0 and `free`, to rounding. Turned upside down all signs change, to the bit.

    Args:
        free: v at which the blades carry nothing.
        slope: of the blades' CT, by v.
        limit: greatest |CT| that the blades carry.
        climb: along the thrust.
        advance: mu.
        nearness: (R / 4z)^2 of the ground, 0 far from it.
    """
    if free == 0.0:
        return 0.0, 0.0
    up = math.copysign(1.0, free)
    low, high = 0.0, up * free
    climb = up * climb
    induced = hover_or_climb(high, slope, climb)
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
