"""The air where a vehicle is: steady wind, gust and turbulence.

The steady wind is MuJoCo's own `opt.wind`; gust and turbulence are the vehicle's, set in its
parameters, and turbulence has its states among the vehicle's activations.

Dryden turbulence after MIL-F-8785C, section 3.7: white noise through lags, in axes along the
path through the air (x forward, y right, z down). The noise is a hash of the seed and of the
gyro's tick, held for the tick, so it depends neither on threads nor on the time step.
"""

import math

from helisim.physics import frames
from helisim.physics.body import Velocities, rates, rotation, velocity
from helisim.physics.kernel import kernel
from helisim.physics.layout import STATE
from helisim.physics.memory import buffer, double, doubles_at, from_element
from helisim.physics.params import PARAM
from helisim.physics.pilot import hashed_noise
from helisim.physics.timing import clock, tick_number

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
        p, q, r = frames.to_body(matrix, *along_path(par, blown.p, blown.q, blown.r))
    u, v, w = frames.to_body(matrix, x, y, z)
    return Velocities(u, v, w, p, q, r)


@kernel()
def along_path(par, x, y, z):
    """Turn a vector from the turbulence's axes to the world, north-west-up."""
    cosine, sine = par[PARAM.turbulence_cosine], par[PARAM.turbulence_sine]
    return frames.flip(cosine * x - sine * y, sine * x + cosine * y, z)


@kernel()
def relative_motion(view, air):
    """Return a vehicle's `Velocities` through air that moves with velocities of its own."""
    u, v, w = frames.to_body(rotation(view), *velocity(view))
    p, q, r = rates(view)
    return Velocities(u - air.u, v - air.v, w - air.w, p - air.p, q - air.q, r - air.r)


@kernel()
def write_turbulence_rates(view, step):
    """Write the derivatives of the turbulence's states; the noise is that of the last tick.

    Over a `step` (s) that an evaluation is held for, their mean: the Taylor series of the
    exponential to fourth order, as Runge-Kutta's. At 0 the derivatives now.
    """
    par = view.par
    if par[PARAM.turbulence_on] == 0.0 or view.sensors < 0:
        return
    tick = tick_number(par, clock(view))
    noise, stage = buffer(4), buffer(_TURBULENCE_STATES)
    for channel in range(4):
        level, lag = par[PARAM.turbulence_u + channel], par[PARAM.turbulence_lag_u + channel]
        noise[channel] = white(
            level, lag, par[PARAM.gyro_period], par[PARAM.turbulence_seed], channel, tick
        )
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
    """Return a gust's share of its full strength (MIL-F-8785C, section 3.7.1.3).

    Args:
        since: s since its start.
        rise: s from nothing to full strength, and back.
        hold: s at full strength.
    """
    if since <= 0.0:
        return 0.0
    if since < rise:
        return 0.5 - 0.5 * math.cos(math.pi * since / rise)
    past = since - rise - hold
    if past <= 0.0:
        return 1.0
    if past < rise:
        return 0.5 + 0.5 * math.cos(math.pi * past / rise)
    return 0.0


@kernel()
def white(level, lag, period, seed, channel, tick):
    """Return the noise of one tick that gives a first-order lag an output of rms `level`."""
    return level * math.sqrt(2.0 * lag / period) * hashed_noise(seed, channel, tick)


@kernel()
def turbulence(state, span):
    """Return the velocities of turbulent air, in axes along the path, from its eight states.

    A field that drifts past unchanged has d/dx = (1/V) d/dt along the path. Air that sinks
    the faster the further ahead turns nose down: q = -dw/dx, r = dv/dx, p = dw/dy.

    Args:
        state: u, lags of v and w, p; then v, w, and what they are over the span, m/s and rad/s,
            (8,).
        span: m, the rotor's diameter in place of the wing's span.
    """
    v = state[4] + _ROOT_3 * (state[1] - state[4])
    w = state[5] + _ROOT_3 * (state[2] - state[5])
    q = -math.pi / (4.0 * span) * (w - state[6])
    r = math.pi / (3.0 * span) * (v - state[7])
    return Velocities(state[0], v, w, state[3], q, r)


@kernel()
def turbulence_rates(state, noise, lags, rate):
    """Write the derivatives of the eight states.

    Along the path, and in roll, the spectrum is that of one lag; across and down it is that of
    (1 + sqrt(3) T s) / (1 + T s)^2.

    Args:
        state: as in `turbulence`, (8,).
        noise: of this tick, in place of u, v, w and p, (4,).
        lags: s, of u, v, w (scale length over speed) and p (4 b / (pi V)), (4,).
        rate: written, (8,).
    """
    for k in range(4):
        rate[k] = (noise[k] - state[k]) / lags[k]
    rate[4] = (state[1] - state[4]) / lags[1]
    rate[5] = (state[2] - state[5]) / lags[2]
    v = state[4] + _ROOT_3 * (state[1] - state[4])
    w = state[5] + _ROOT_3 * (state[2] - state[5])
    rate[6] = (w - state[6]) / lags[3]
    rate[7] = (v - state[7]) / (0.75 * lags[3])
