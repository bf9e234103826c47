"""Induced velocity of a rotor: momentum balance through the vortex ring, and dynamic inflow.

Velocities are over the tip speed, positive when air passes the disc against the thrust (climb);
CT = T / (rho A (Omega R)^2); `induced` is v, `climb` V_c, `advance` mu. Thrust is 2 rho A v V, V
measured in the vortex ring. Dynamic inflow is Pitt and Peters' (Vertica 5, 1981) in the nonlinear
form of Peters and HaQuang (J. AHS 33, 1988), with velocities in m/s:

    v(x, y) = v_0 + (v_s y - v_c x) / R    (x ahead, y to the right, v downwards),
    M dv/dt + V L^-1 v = loads             (thrust, aerodynamic hub moments).
"""

import math
from collections import namedtuple

from helisim.physics.kernel import kernel

_LAST_STEP, _MAX_ITERATIONS = 1e-8, 60  # after that step Newton's error is near rounding
_STALL_CORE = 0.7  # part of the stall limit that it leaves free


def _measured(x: float) -> tuple[float, float, float]:
    """Return v, v V and slope at a descent of 1, x = V_c / v_h (Leishman, Principles, ch. 2)."""
    ratio = 1.0 - 1.125 * x - 1.372 * x**2 - 1.718 * x**3 - 0.655 * x**4
    slope = -1.125 - 2.744 * x - 5.154 * x**2 - 2.62 * x**3
    return -ratio / x, 1.0 / x**2, -2.0 / (x * (ratio - x * slope))


_WINDMILL = (0.5, 0.25, 0.0)
"""v and v V at a descent of 1, and the slope, where the windmill state begins: v_h = 0.5."""
_FAST = _measured(-1.75)
_SLOW = _measured(-1.25)
_HOVER = (4.0, 12.0, 7.0)
"""The same for hover's v (v - 1) at a descent of 0.29 v_h; ring from 0.2 (NASA TP-2005-213477)."""


@kernel()
def soft_limit(x, limit, core):
    """Return x itself while |x| <= core * limit, then approach the limit smoothly."""
    edge = core * limit
    rest = limit - edge
    if abs(x) <= edge:
        return x
    return math.copysign(edge + rest * math.tanh((abs(x) - edge) / rest), x)


@kernel()
def _cubic(x, start, end):
    width = end[0] - start[0]
    t = (x - start[0]) / width
    mean = (end[1] - start[1]) / width
    bend = start[2] + end[2] - 2.0 * mean
    lean = 3.0 * mean - 2.0 * start[2] - end[2]
    value = start[1] + width * t * (start[2] + t * (lean + t * bend))
    return value, start[2] + t * (2.0 * lean + 3.0 * t * bend)


@kernel()
def ring_thrust(induced):
    """Return v V in the vortex ring at a descent of 1, no edgewise flow, and its slope by v."""
    if induced < _FAST[0]:
        return _cubic(induced, _WINDMILL, _FAST)
    if induced < _SLOW[0]:
        return _cubic(induced, _FAST, _SLOW)
    return _cubic(induced, _SLOW, _HOVER)


@kernel()
def mass_flow(induced, climb, advance):
    """Return V, the ratio of the air's speed through the disc, and its slope by v."""
    square, half_slope = flow_square(induced, climb, advance)
    flow = math.sqrt(square)
    return flow, half_slope / flow if flow > 0.0 else 0.0


@kernel()
def flow_square(induced, climb, advance):
    """Return V^2 and half of its slope by v: Glauert's mu^2 + (V_c + v)^2, or the vortex ring's.

    Edgewise flow as fast as v ends the ring (Johnson, NASA TP-2005-213477: 0.95 v_h).
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
    """Return the share of thrust that drives the inflow near the ground, and its slope by v.

    k^3, k = 1 - (R / 4z)^2 / (1 + (mu / lambda_i)^2) (Cheeseman and Bennett, R&M 3021).
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

    Solves 2 v V = CT = slope (free - v), |CT| up to `limit`; nearness: (R / 4z)^2 of the ground.
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


MEAN_MASS = 8.0 / (3.0 * math.pi)  # over rho pi R^3 (NACA TN 3044); Pitt and Peters: 36 % less
SLOPE_MASS = 16.0 / (45.0 * math.pi)  # inertia under rolling and pitching, over rho pi R^4
_LEAST = 0.5  # least V_m over V_T, else 0 in the vortex ring


Wake = namedtuple("Wake", "flow slope_flow skew_x skew_y")
"""V_T and V_m of Peters and HaQuang over the tip speed; skew: tan(chi / 2), ahead and right."""


@kernel()
def inflow_rates(mean, right, aft, thrust, roll, pitch, wake, speed, radius, skew):
    """Return the derivatives of v_0, v_s and v_c (mean, right, aft), m/s^2.

    thrust: T / (rho pi R^2), m^2/s^2; roll, pitch: hub moment of the air / (rho pi R^3), m^2/s^2,
    right side down, nose up; speed: of the tips, m/s; skew: `main_rotor.inflow_skew`, twice the
    coupling of mean load and slope in a skewed wake; Pitt and Peters have 15 pi / 32.
    """
    skew_x, skew_y = wake.skew_x, wake.skew_y
    flow, slope_flow = speed * wake.flow, speed * wake.slope_flow
    square = skew_x**2 + skew_y**2
    share = 1.0 - (1.0 - 0.25 * skew**2) * square  # determinant of the wake's L across mean and way
    along = aft * skew_x - right * skew_y  # slope to the lee, times the skew
    held = (2.0 * (1.0 - square) * mean + 0.5 * skew * along) / share
    mean_rate = (thrust - flow * held) / (MEAN_MASS * radius)
    even = 0.5 / (1.0 + square)
    swept = ((2.0 - 0.25 * skew**2) * even * along - 0.5 * skew * mean) / share
    right_rate = (-roll - slope_flow * (even * right - swept * skew_y)) / (SLOPE_MASS * radius)
    aft_rate = (-pitch - slope_flow * (even * aft + swept * skew_x)) / (SLOPE_MASS * radius)
    return mean_rate, right_rate, aft_rate


@kernel()
def wake(induced, climb, edgewise, ahead, right):
    """Return the `Wake` of a rotor; ahead, right: velocities that skew it, over the tip speed."""
    flow, slope = mass_flow(induced, climb, edgewise)
    if flow == 0.0:
        return Wake(0.0, 0.0, 0.0, 0.0)
    # tan(chi / 2) = mu / (V + |lambda|)
    skew = 1.0 / (flow + math.sqrt(max(0.0, flow**2 - edgewise**2)))
    return Wake(flow, max(flow + induced * slope, _LEAST * flow), skew * ahead, skew * right)
