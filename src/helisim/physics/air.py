"""The air at a vehicle: steady wind (`opt.wind`), gust, turbulence, and the ground below its rotor.

Dryden turbulence after MIL-F-8785C, section 3.7, in axes along the path (x forward, y right, z
down), from noise held for each gyro tick. The ground is planes and boxes; its effect is the source
and image of Cheeseman and Bennett (R&M 3021), (R / 4d)^2 cos(slope), by the disc's share above it.
"""

import math

import mujoco

from helisim.physics.inflow import soft_limit
from helisim.physics.kernel import buffer, doubles_at, from_element, kernel
from helisim.physics.layout import PARAM, STATE
from helisim.physics.memory import clock, double, doubles_from, ints, long, tick_number
from helisim.physics.motion import Velocities, flip, rates, rotation, to_body, to_world, velocity
from helisim.physics.pilot import hashed_noise

_ROOT_3 = math.sqrt(3.0)
_TURBULENCE_STATES = 8


@kernel()
def motion(view):
    """Return how the air itself moves at a vehicle, `Velocities` in its body axes."""
    par, matrix = view.par, rotation(view)
    wind = doubles_at(view.m + view.offsets.wind)
    x, y, z = wind[0], wind[1], wind[2]
    p, q, r = 0.0, 0.0, 0.0
    if par[PARAM.gust_rise] > 0.0:
        since = double(view.d, view.offsets.time) - par[PARAM.gust_start]
        share = one_minus_cosine(since, par[PARAM.gust_rise], par[PARAM.gust_hold])
        x += share * par[PARAM.gust_north]
        y -= share * par[PARAM.gust_east]
        z -= share * par[PARAM.gust_down]
    if par[PARAM.turbulence_on] != 0.0:
        blown = turbulence(from_element(view.act, STATE.air_u), par[PARAM.turbulence_span])
        dx, dy, dz = along_path(par, blown.u, blown.v, blown.w)
        x, y, z = x + dx, y + dy, z + dz
        p, q, r = to_body(matrix, *along_path(par, blown.p, blown.q, blown.r))
    u, v, w = to_body(matrix, x, y, z)
    return Velocities(u, v, w, p, q, r)


@kernel()
def along_path(par, x, y, z):
    """Turn a vector from the turbulence's axes to the world, north-west-up."""
    cosine, sine = par[PARAM.turbulence_cosine], par[PARAM.turbulence_sine]
    return flip(cosine * x - sine * y, sine * x + cosine * y, z)


@kernel()
def relative_motion(view, air):
    """Return a vehicle's `Velocities` through air that moves with velocities of its own."""
    u, v, w = to_body(rotation(view), *velocity(view))
    p, q, r = rates(view)
    return Velocities(u - air.u, v - air.v, w - air.w, p - air.p, q - air.q, r - air.r)


@kernel()
def write_turbulence_rates(view, step):
    """Write the derivatives of the turbulence's states; the noise is that of the last tick."""
    par = view.par
    if par[PARAM.turbulence_on] == 0.0 or view.sensors < 0:
        return
    tick = tick_number(par, clock(view))
    noise, stage = buffer(4), buffer(_TURBULENCE_STATES)
    for channel in range(4):
        level, lag = par[PARAM.turbulence_u + channel], par[PARAM.turbulence_lag_u + channel]
        hashed = hashed_noise(par[PARAM.turbulence_seed], channel, tick)
        noise[channel] = level * math.sqrt(2.0 * lag / par[PARAM.gyro_period]) * hashed
    lags = (
        par[PARAM.turbulence_lag_u],
        par[PARAM.turbulence_lag_v],
        par[PARAM.turbulence_lag_w],
        par[PARAM.turbulence_lag_p],
    )
    state, rate = from_element(view.act, STATE.air_u), from_element(view.rate, STATE.air_u)
    turbulence_rates(state, noise, lags, rate)
    if step > 0.0:
        for divisor in (4.0, 3.0, 2.0):
            for k in range(_TURBULENCE_STATES):
                stage[k] = state[k] + step / divisor * rate[k]
            turbulence_rates(stage, noise, lags, rate)


@kernel()
def one_minus_cosine(since, rise, hold):
    """Return a gust's share of full strength (MIL-F-8785C, section 3.7.1.3); arguments in s."""
    grown = 0.5 - 0.5 * math.cos(math.pi * min(rise, max(0.0, since)) / rise)
    past = min(rise, max(0.0, since - rise - hold))
    return grown * (0.5 + 0.5 * math.cos(math.pi * past / rise))


@kernel()
def turbulence(state, span):
    """Return the velocities of turbulent air along the path: q = -dw/dx, r = dv/dx, p = dw/dy.

    state: u, lags of v and w, p, then v, w, and both over the span, m/s and rad/s, (8,); span: m.
    """
    v = state[4] + _ROOT_3 * (state[1] - state[4])
    w = state[5] + _ROOT_3 * (state[2] - state[5])
    q = -math.pi / (4.0 * span) * (w - state[6])
    r = math.pi / (3.0 * span) * (v - state[7])
    return Velocities(state[0], v, w, state[3], q, r)


@kernel(forceinline=False)
def turbulence_rates(state, noise, lags, rate):
    """Write the derivatives of the eight states, (8,).

    noise: for u, v, w, p, (4,); lags: s, scale length / speed of u, v, w, and 4 b / (pi V), (4,).
    """
    for k in range(4):
        rate[k] = (noise[k] - state[k]) / lags[k]
    rate[4] = (state[1] - state[4]) / lags[1]
    rate[5] = (state[2] - state[5]) / lags[2]
    v = state[4] + _ROOT_3 * (state[1] - state[4])
    w = state[5] + _ROOT_3 * (state[2] - state[5])
    rate[6] = (w - state[6]) / lags[3]
    rate[7] = (v - state[7]) / (0.75 * lags[3])


_PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
_BOX = int(mujoco.mjtGeom.mjGEOM_BOX)
_DEEPEST = 0.4  # limit of (R / 4d)^2, reached within half a radius of the ground
_EXACT = 0.625  # part of the limit, at d = R/2, below which the formula is exact
_MOST = 4  # surfaces
_NUMBERS = 2 * _MOST


@kernel()
def nearness(view):
    """Return (R / 4d)^2 of the ground under a vehicle's hub, kept finite at any distance."""
    par, matrix = view.par, rotation(view)
    if par[PARAM.ground_effect] == 0.0:
        return 0.0
    m, d, offsets = view.m, view.d, view.offsets
    origin = doubles_from(d, offsets.xpos, 3 * view.body)
    cosine, sine = par[PARAM.shaft_cosine], par[PARAM.shaft_sine]
    ahead = par[PARAM.hub_x] * cosine - par[PARAM.hub_z] * sine
    below = par[PARAM.hub_z] * cosine + par[PARAM.hub_x] * sine
    x, y, z = to_world(matrix, ahead, 0.0, below)
    hub = (origin[0] + x, origin[1] + y, origin[2] + z)
    shaft = to_world(matrix, sine, 0.0, -cosine)
    roots, bodies = ints(m, offsets.body_rootid), ints(m, offsets.geom_bodyid)
    shapes, near, count = ints(m, offsets.geom_type), buffer(_NUMBERS), 0
    grounded = False
    for geom in range(long(m, offsets.ngeom)):
        if shapes[geom] != _PLANE and shapes[geom] != _BOX:
            continue
        touched = ints(m, offsets.geom_contype)[geom] | ints(m, offsets.geom_conaffinity)[geom]
        if touched == 0 or roots[bodies[geom]] == roots[view.body]:
            continue
        grounded = True
        one, share = _surface(view, geom, shapes[geom], hub, shaft)
        if share > 0.0:
            count = _insert(near, count, one, share)
    if not grounded:
        return _nearness(par, hub[2], shaft[2])
    left, total = 1.0, 0.0
    for k in range(count):
        covered = min(left, near[2 * k + 1])
        total += covered * near[2 * k]
        left -= covered
    return total


@kernel()
def _surface(view, geom, shape, hub, shaft):
    """Return the nearness of a geom's surface below a hub, and its share of the disc."""
    centre = doubles_from(view.d, view.offsets.geom_xpos, 3 * geom)
    axes = doubles_from(view.d, view.offsets.geom_xmat, 9 * geom)
    size = doubles_from(view.m, view.offsets.geom_size, 3 * geom)
    x, y, z = hub[0] - centre[0], hub[1] - centre[1], hub[2] - centre[2]
    up = 2
    if shape == _BOX:  # the face that looks up
        for k in range(2):
            if abs(axes[6 + k]) > abs(axes[6 + up]):
                up = k
    side = 1.0 if shape == _PLANE or axes[6 + up] >= 0.0 else -1.0
    height = side * (axes[up] * x + axes[3 + up] * y + axes[6 + up] * z)
    cosine = side * (axes[up] * shaft[0] + axes[3 + up] * shaft[1] + axes[6 + up] * shaft[2])
    if shape == _PLANE:
        return _nearness(view.par, height, cosine), 1.0
    height -= size[up]
    if height <= 0.0:
        return 0.0, 0.0
    i, j = (up + 1) % 3, (up + 2) % 3
    radius = view.par[PARAM.main_radius]
    share = disc_share(
        (axes[i] * x + axes[3 + i] * y + axes[6 + i] * z) / radius,
        (axes[j] * x + axes[3 + j] * y + axes[6 + j] * z) / radius,
        size[i] / radius,
        size[j] / radius,
    )
    return _nearness(view.par, height, cosine), share


@kernel()
def _nearness(par, height, cosine):
    """Return (R / 4d)^2 of one surface, for a distance of the hub and the shaft's lean to it."""
    far = max(4.0 * height / par[PARAM.main_radius], 1e-3)  # at most a thousand radii inside
    near = par[PARAM.ground_effect] * max(0.0, cosine) / far**2
    return soft_limit(near, _DEEPEST, _EXACT)


@kernel()
def _insert(near, count, one, share):
    """Insert a surface among the nearest, sorted; return how many."""
    k = count
    while k > 0 and near[2 * k - 2] < one:
        if k < _MOST:
            near[2 * k], near[2 * k + 1] = near[2 * k - 2], near[2 * k - 1]
        k -= 1
    if k < _MOST:
        near[2 * k], near[2 * k + 1] = one, share
    return min(count + 1, _MOST)


@kernel()
def disc_share(x, y, a, b):
    """Return the share of a unit disc around (x, y) that lies over a rectangle |x| < a, |y| < b."""
    right, left, top, bottom = a - x, -a - x, b - y, -b - y
    beyond, within = _corner(left, top) - _corner(left, bottom), _corner(right, top)
    return max(0.0, within - _corner(right, bottom) - beyond) / math.pi


@kernel()
def _corner(a, b):
    a, b = min(1.0, max(-1.0, a)), min(1.0, max(-1.0, b))
    below = 0.5 * (a * math.sqrt(1.0 - a * a) + math.asin(a))
    beside = 0.5 * (b * math.sqrt(1.0 - b * b) + math.asin(b))
    if a * a + b * b < 1.0:
        return a * b + below + beside + 0.25 * math.pi
    if a <= 0.0 and b <= 0.0:
        return 0.0
    if a > 0.0 and b > 0.0:
        return 2.0 * (below + beside)
    return 0.5 * math.pi + 2.0 * (below if a <= 0.0 else beside)


@kernel()
def wash_residual(par, nearness, z):
    """Return the share of the main rotor's wake left at a place above the ground; z: m, body."""
    drop = max(0.0, z - par[PARAM.hub_z])
    below = min(1.0, 4.0 * math.sqrt(nearness) * drop / par[PARAM.main_radius])  # over d
    return 1.0 - (below / (2.0 - below)) ** 2
