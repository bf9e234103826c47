"""The three-axis gyro: yaw PI with heading lock, cyclic rate control with phase rotation.

Yaw: Wu and Chen, eq. (7), with a lead on the rate. Cyclic: u = (Kp + M Ki/s)(R d - y) -
M Kd s/(td s + 1) y, where R d are commanded rates, y filtered ones, M a turn by the phase angle.
Both are sampled at ticks; settings are the vehicle's, (n_param,) by `PARAM`; sticks, commands and
positions are unitised.
"""

import math
from collections import namedtuple
from typing import NamedTuple

from helisim.physics.kernel import kernel, known
from helisim.physics.layout import PARAM, SWASH_STATES, TAIL_STATES

_HIGHEST = 0.5  # most of a cyclic axis and the tail servo, unitised


class Seen(NamedTuple):
    """Everything that a control law sees at a tick. Body axes forward, right, down; SI.

    time: s; p, q, r: read by the gyro, rad/s, late by `gyro.latency`; phi, theta, psi: rad, now;
    heading in (-pi, pi]; ax, ay, az: specific force at the IMU one time step ago, m/s^2, az about
    -9.8 in the hover; servos and sticks: unitised, now; pedals late by `gyro.ped_latency`.
    """

    time: float
    p: float
    q: float
    r: float
    phi: float
    theta: float
    psi: float
    ax: float
    ay: float
    az: float
    front: float
    left: float
    right: float
    tail: float
    COL: float
    LON: float
    LAT: float
    PED: float


CyclicStates = namedtuple(
    "CyclicStates",
    "q_filter q_integral q_derivative p_filter p_integral p_derivative",
)
"""The cyclic law's states: filtered rates, integrals and slower filtered rates."""


YawStates = namedtuple("YawStates", "r_lead r_integral")
"""The yaw law's states: the filter of its lead, and the integral."""


CYCLIC = known(CyclicStates)(*range(SWASH_STATES))
_CYCLIC_STATES = len(CYCLIC)
YAW = known(YawStates)(*range(TAIL_STATES))


@kernel()
def gyro_law(seen, state, settings):
    """Return the commands of front, left, right, tail; state: cyclic, then yaw, (8,), updated."""
    front, left, right = cyclic_law(seen, state, settings)
    return front, left, right, yaw_law(seen, state, settings, _CYCLIC_STATES)


@kernel()
def yaw_law(seen, state, settings, first=0):
    """Return the tail servo's command; state: (2,) from `first` on, updated."""
    lead, summed = first + YAW.r_lead, first + YAW.r_integral
    k_delta, k_a = settings[PARAM.gyro_k_delta], settings[PARAM.gyro_k_a]
    plain = k_delta * seen.PED - k_a * seen.r
    lag = settings[PARAM.gyro_lead_lag]
    led_rate = state[lead] + (settings[PARAM.gyro_lead] + lag) / lag * (seen.r - state[lead])
    error = k_delta * seen.PED - k_a * led_rate
    period, lock = settings[PARAM.gyro_period], settings[PARAM.gyro_heading_lock]
    led = k_a * settings[PARAM.gyro_lead] * state[lead]
    integral = lock * (state[summed] - led + 0.5 * period * error)
    command = settings[PARAM.gyro_k_p] * error + settings[PARAM.gyro_k_i] * integral
    if not winds_up(plain, command, settings[PARAM.gyro_hold_above]):
        state[summed] += period * lock * plain
    state[lead] += settings[PARAM.gyro_lead_share] * (seen.r - state[lead])
    return limited(command)


@kernel()
def cyclic_law(seen, state, settings):
    """Return the commands of front, left and right servo; state: (6,), updated."""
    p, q = state[CYCLIC.p_filter], state[CYCLIC.q_filter]
    p_wanted = settings[PARAM.gyro_p_per_lat] * seen.LAT + settings[PARAM.gyro_p_per_lon] * seen.LON
    q_wanted = settings[PARAM.gyro_q_per_lat] * seen.LAT + settings[PARAM.gyro_q_per_lon] * seen.LON
    slow = settings[PARAM.gyro_derivative_lag]
    p_rate, q_rate = (
        (p - state[CYCLIC.p_derivative]) / slow,
        (q - state[CYCLIC.q_derivative]) / slow,
    )
    lat, lon = rotate(
        settings[PARAM.gyro_phase_cosine],
        settings[PARAM.gyro_phase_sine],
        settings[PARAM.gyro_ki_lat] * state[CYCLIC.p_integral]
        - settings[PARAM.gyro_kd_lat] * p_rate,
        settings[PARAM.gyro_ki_lon] * state[CYCLIC.q_integral]
        - settings[PARAM.gyro_kd_lon] * q_rate,
    )
    lat += settings[PARAM.gyro_kp_lat] * (p_wanted - p)
    lon += settings[PARAM.gyro_kp_lon] * (q_wanted - q)
    track_rate(state, CYCLIC.p_filter, seen.p, p_wanted, lat, settings)
    track_rate(state, CYCLIC.q_filter, seen.q, q_wanted, lon, settings)
    col = settings[PARAM.gyro_collective] * seen.COL
    return mix(settings, col, limited(lon), limited(lat), PARAM.mix_front_col)


@kernel()
def track_rate(state, first, rate, wanted, command, settings):
    """Update filters and integral of a cyclic axis; rates in rad/s, command not yet limited."""
    summed, slow = first + 1, first + 2
    off = state[first] - rate
    if not winds_up(wanted - state[first], command, settings[PARAM.gyro_hold_above]):
        mean_error = wanted - rate - settings[PARAM.gyro_filter_mean] * off
        state[summed] += (
            settings[PARAM.gyro_period] * settings[PARAM.gyro_attitude_lock] * mean_error
        )
    state[slow] += settings[PARAM.gyro_derivative_share] * (rate - state[slow])
    state[slow] += settings[PARAM.gyro_derivative_through] * off
    state[first] -= settings[PARAM.gyro_filter_share] * off


@kernel()
def rotate(cosine, sine, lat, lon):
    """Turn the pair (lat, lon) by the swashplate phase angle."""
    return cosine * lat + sine * lon, -sine * lat + cosine * lon


@kernel()
def winds_up(error, command, limit):
    """Return whether an integral of the error would push a saturated command further."""
    return abs(command) > limit and error * command > 0.0


@kernel()
def limited(command):
    """Return a command within what the gyro gives."""
    return min(_HIGHEST, max(-_HIGHEST, command))


@kernel()
def held_lag(time_constant, period):
    """Return by how much a first-order filter of samples held for a period is late, s."""
    return period / -math.expm1(-period / time_constant)


@kernel()
def filter_share(time_constant, period):
    """Return by what share a first-order filter nears what is held for a period."""
    return -math.expm1(-period / time_constant)


@kernel()
def filter_mean(time_constant, period):
    """Return the mean, over a period, of a first-order filter's distance from what is held."""
    return filter_share(time_constant, period) * time_constant / period


@kernel()
def filter_through(first, second, period):
    """Return what of a first filter's distance gets through a second one in a period; all in s."""
    apart = period / second - period / first
    if abs(apart) > 1.0:  # where the exponential of a long period could overflow
        return period / second * (math.exp(-period / first) - math.exp(-period / second)) / apart
    ratio = -math.expm1(-apart) / apart if apart != 0.0 else 1.0
    return period / second * math.exp(-period / first) * ratio


@kernel()
def mix(plate, col, lon, lat, first=0):
    """Return front, left and right servo positions; plate: (21,) from `PARAM.mix_front_col` on."""
    k = first
    return (
        plate[k] * col + plate[k + 1] * lon + plate[k + 2] * lat,
        plate[k + 3] * col + plate[k + 4] * lon + plate[k + 5] * lat,
        plate[k + 6] * col + plate[k + 7] * lon + plate[k + 8] * lat,
    )


@kernel()
def unmix(plate, front, left, right, first=0):
    """Return collective, longitudinal and lateral from three servo positions; undoes `mix`."""
    k = first
    return (
        (plate[k + 9] * front + plate[k + 10] * left + plate[k + 11] * right) / plate[k + 12],
        (plate[k + 13] * front + plate[k + 14] * left + plate[k + 15] * right) / plate[k + 16],
        (plate[k + 17] * front + plate[k + 18] * left + plate[k + 19] * right) / plate[k + 20],
    )


@kernel()
def servo_rates(position, rate, command, frequency, damping, rate_limit, travel):
    """Return d(position)/dt and d(rate)/dt of a second-order servo limited in rate and travel.

    rate, rate_limit: 1/s; frequency: rad/s; travel: greatest |command| that is followed.
    """
    target = min(travel, max(-travel, command))
    limited = min(rate_limit, max(-rate_limit, rate))
    acceleration = frequency**2 * (target - position) - 2.0 * damping * frequency * rate
    return limited, acceleration


@kernel()
def equivalent_delay(frequency, damping):
    """Return the delay that a second-order servo looks like at low frequency, s."""
    return 2.0 * damping / frequency
