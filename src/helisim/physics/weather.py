"""Turbulence and gusts: the air's own motion as a function of time, seed and a few states.

Dryden turbulence after MIL-F-8785C, section 3.7: white noise through lags, in axes along the
path through the air (x forward, y right, z down). The noise is a hash of the seed and of the
gyro's tick, held for the tick, so it depends neither on threads nor on the time step.
"""

import math

from helisim.physics.gyro import filter_rate
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
def lead_lag(slow, fast):
    """Return (1 + sqrt(3) T s) / (1 + T s)^2 of a signal, from the states of its two lags."""
    return fast + _ROOT_3 * (slow - fast)


@kernel()
def span_lags(speed, span):
    """Return the lags (s) that a span puts on the rates in pitch and roll, and in yaw."""
    return 4.0 * span / (math.pi * speed), 3.0 * span / (math.pi * speed)


@kernel()
def turbulence(u, v_lag, v, w_lag, w, p, q_lag, r_lag, span):
    """Return velocity (m/s) and rotation (rad/s) of turbulent air from the filters' states.

    A field that drifts past unchanged has d/dx = (1/V) d/dt along the path. Air that sinks
    the faster the further ahead turns nose down: q = -dw/dx, r = dv/dx, p = dw/dy.

    Args:
        u: m/s, the lagged noise along the path.
        v_lag: m/s, the first lag across the path.
        v: m/s, the second.
        w_lag: m/s, the first lag down.
        w: m/s, the second.
        p: rad/s, the lagged noise in roll.
        q_lag: m/s, w smoothed over the span.
        r_lag: m/s, v smoothed over the span.
        span: m, rotor diameter in place of the wing's span.
    """
    across, down = lead_lag(v_lag, v), lead_lag(w_lag, w)
    q = -math.pi / (4.0 * span) * (down - q_lag)
    r = math.pi / (3.0 * span) * (across - r_lag)
    return u, across, down, p, q, r


@kernel()
def turbulence_rates(u, v_lag, v, w_lag, w, p, q_lag, r_lag, noise, lags, speed, span):
    """Return the derivatives of the filters' eight states.

    Args:
        u: and the next seven, the states as in `turbulence`.
        v_lag: m/s.
        v: m/s.
        w_lag: m/s.
        w: m/s.
        p: rad/s.
        q_lag: m/s.
        r_lag: m/s.
        noise: of this tick, for u, v, w and p.
        lags: s, scale lengths over speed, of u, v and w.
        speed: m/s, at which the field drifts past.
        span: m.
    """
    pitch_lag, yaw_lag = span_lags(speed, span)
    return (
        filter_rate(u, noise[0], lags[0]),
        filter_rate(v_lag, noise[1], lags[1]),
        filter_rate(v, v_lag, lags[1]),
        filter_rate(w_lag, noise[2], lags[2]),
        filter_rate(w, w_lag, lags[2]),
        filter_rate(p, noise[3], pitch_lag),
        filter_rate(q_lag, lead_lag(w_lag, w), pitch_lag),
        filter_rate(r_lag, lead_lag(v_lag, v), yaw_lag),
    )
