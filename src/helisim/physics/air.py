"""The air where a vehicle is: steady wind, gust and turbulence, and the ground below.

The steady wind is MuJoCo's own `opt.wind`; gust and turbulence are the vehicle's, set in its
parameters, and turbulence has its states among the vehicle's activations.
"""

from helisim.physics import frames, rotor, weather
from helisim.physics.addresses import REPORTS, body_of, reports, state_of
from helisim.physics.body import rates, rotation, velocity
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, STATE
from helisim.physics.memory import double, doubles, doubles_at, doubles_from, room
from helisim.physics.ticks import tick_number

_DEEPEST = 0.4
"""Limit of (R / 4z)^2, reached within half a radius of the ground, where no rotor gets."""
_CORE = 0.625
"""Up to this part of the limit, at z = R/2, Cheeseman and Bennett's formula holds exactly."""


@kernel()
def motion(m, d, offsets, rotor_id, par, body):
    """Return the air's velocity (m/s) and rotation (rad/s) at a body, body axes."""
    matrix = rotation(d, offsets, body)
    wind = doubles_at(m + offsets.wind)
    x, y, z = wind[0], wind[1], wind[2]
    p, q, r = 0.0, 0.0, 0.0
    if par[PARAM.gust_rise] > 0.0:
        since = double(d, offsets.time) - par[PARAM.gust_start]
        share = weather.one_minus_cosine(since, par[PARAM.gust_rise], par[PARAM.gust_hold])
        x += share * par[PARAM.gust_north]
        y -= share * par[PARAM.gust_east]
        z -= share * par[PARAM.gust_down]
    if par[PARAM.turbulence_on] != 0.0:
        state = doubles_from(d, offsets.act, state_of(m, offsets, rotor_id) + STATE.air_u)
        u, v, w, p, q, r = weather.turbulence(state, par[PARAM.turbulence_span])
        dx, dy, dz = along_path(par, u, v, w)
        x, y, z = x + dx, y + dy, z + dz
        p, q, r = frames.to_body(matrix, *along_path(par, p, q, r))
    u, v, w = frames.to_body(matrix, x, y, z)
    return u, v, w, p, q, r


@kernel()
def along_path(par, x, y, z):
    """Turn a vector from the turbulence's axes to the world, north-west-up."""
    cosine, sine = par[PARAM.turbulence_cosine], par[PARAM.turbulence_sine]
    return frames.flip(cosine * x - sine * y, sine * x + cosine * y, z)


@kernel()
def relative_motion(m, d, offsets, body, air):
    """Return a body's velocity (m/s) and rotation (rad/s) through moving air, body axes."""
    u, v, w = frames.to_body(rotation(d, offsets, body), *velocity(m, d, offsets, body))
    p, q, r = rates(d, offsets, body)
    return u - air[0], v - air[1], w - air[2], p - air[3], q - air[4], r - air[5]


@kernel()
def ground_nearness(d, offsets, par, body):
    """Return (R / 4z)^2 of the hub above the ground (z = 0), kept finite at any height."""
    if par[PARAM.ground_effect] == 0.0:
        return 0.0
    matrix = rotation(d, offsets, body)
    _, _, rise = frames.to_world(matrix, par[PARAM.hub_x], 0.0, par[PARAM.hub_z])
    height = doubles(d, offsets.xpos)[3 * body + 2] + rise
    ratio = par[PARAM.main_radius] / (4.0 * height)
    return rotor.soft_limit(par[PARAM.ground_effect] * ratio**2, _DEEPEST, _CORE)


@kernel()
def turbulence_rates(m, d, offsets, rotor_id, par, step):
    """Write the derivatives of the turbulence's states; the noise is that of the last tick.

    Over a `step` (s) that an evaluation is held for, their mean: the Taylor series of the
    exponential to fourth order, as Runge-Kutta's. At 0 the derivatives now.
    """
    seen = reports(m, offsets, body_of(m, offsets, rotor_id))
    if par[PARAM.turbulence_on] == 0.0 or seen < 0:
        return
    tick = tick_number(par, doubles(d, offsets.sensordata)[seen + REPORTS])
    noise, stage = room(4), room(8)
    for channel in range(4):
        level, lag = par[PARAM.turbulence_u + channel], par[PARAM.turbulence_lag_u + channel]
        noise[channel] = weather.white(
            level, lag, par[PARAM.gyro_period], par[PARAM.turbulence_seed], channel, tick
        )
    lags = (
        par[PARAM.turbulence_lag_u],
        par[PARAM.turbulence_lag_v],
        par[PARAM.turbulence_lag_w],
        par[PARAM.turbulence_lag_p],
    )
    first = state_of(m, offsets, rotor_id) + STATE.air_u
    state = doubles_from(d, offsets.act, first)
    rate = doubles_from(d, offsets.act_dot, first)
    weather.turbulence_rates(state, noise, lags, rate)
    if step > 0.0:
        for divisor in (4.0, 3.0, 2.0):
            for k in range(8):
                stage[k] = state[k] + step / divisor * rate[k]
            weather.turbulence_rates(stage, noise, lags, rate)
