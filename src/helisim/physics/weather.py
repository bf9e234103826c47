"""Turbulence and gusts: the air's own motion as a function of time, seed and a few states.

Dryden turbulence after MIL-F-8785C, section 3.7: white noise through lags, in axes along the
path through the air (x forward, y right, z down). The noise is a hash of the seed and of the
gyro's tick, held for the tick, so it depends neither on threads nor on the time step.
"""

import math

from helisim.physics.kernel import kernel
from helisim.physics.pilot import hashed_noise

_ROOT_3 = math.sqrt(3.0)


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
    """Return velocity (m/s) and rotation (rad/s) of turbulent air from its eight states.

    A field that drifts past unchanged has d/dx = (1/V) d/dt along the path. Air that sinks
    the faster the further ahead turns nose down: q = -dw/dx, r = dv/dx, p = dw/dy.

    Args:
        state: u, lags of v and w, p; then v, w, and what they are over the span, m/s and rad/s.
        span: m, the rotor's diameter in place of the wing's span.
    """
    v = state[4] + _ROOT_3 * (state[1] - state[4])
    w = state[5] + _ROOT_3 * (state[2] - state[5])
    q = -math.pi / (4.0 * span) * (w - state[6])
    r = math.pi / (3.0 * span) * (v - state[7])
    return state[0], v, w, state[3], q, r


@kernel()
def turbulence_rates(state, noise, lags, rate):
    """Write the derivatives of the eight states.

    Along the path, and in roll, the spectrum is that of one lag; across and down it is that of
    (1 + sqrt(3) T s) / (1 + T s)^2.

    Args:
        state: as in `turbulence`.
        noise: four, of this tick, in place of u, v, w and p.
        lags: four, s, of u, v, w (scale length over speed) and p (4 b / (pi V)).
        rate: written.
    """
    for k in range(4):
        rate[k] = (noise[k] - state[k]) / lags[k]
    rate[4] = (state[1] - state[4]) / lags[1]
    rate[5] = (state[2] - state[5]) / lags[2]
    v = state[4] + _ROOT_3 * (state[1] - state[4])
    w = state[5] + _ROOT_3 * (state[2] - state[5])
    rate[6] = (w - state[6]) / lags[3]
    rate[7] = (v - state[7]) / (0.75 * lags[3])
