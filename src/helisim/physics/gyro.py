"""The three-axis gyro: yaw PI with heading lock, cyclic rate control with phase rotation.

Yaw: Wu and Chen, eq. (7), with a lead on the rate. Cyclic: commanded rates R d of the sticks
d are tracked by u = (Kp + M Ki/s)(R d - y) - M Kd s/(td s + 1) y, where y is the filtered
rate and M turns by the phase angle of the swashplate.

Both are sampled laws: called at a tick with what is `Seen` then, a law returns its servos' commands
and moves its state on to the next tick. What it sees is held in between, so filters are sampled
exactly and integrals are those of what is held. The settings are the vehicle's, by `PARAM`.
"""

import math
from collections import namedtuple
from typing import NamedTuple

from helisim.physics.kernel import kernel, known
from helisim.physics.layout import PARAM, STATE

_HIGHEST = 0.5
"""The most that the gyro commands of a cyclic axis, and of the tail servo, unitised."""


class Seen(NamedTuple):
    """Everything that a control law sees at a tick. Body axes forward, right, down; SI.

    Attributes:
        time: s.
        p: roll rate that the gyro read, rad/s, late by `gyro.latency`.
        q: pitch rate.
        r: yaw rate.
        phi: roll angle now, rad.
        theta: pitch angle.
        psi: heading, in (-pi, pi].
        ax: specific force at the IMU one time step ago, m/s^2; where a flight starts, that of
            steady flight.
        ay: to the right.
        az: down; about -9.8 in the hover.
        front: position of the front servo now, unitised.
        left: of the left servo.
        right: of the right servo.
        tail: of the tail servo.
        COL: collective stick, unitised.
        LON: longitudinal stick.
        LAT: lateral stick.
        PED: pedals, late by `gyro.ped_latency`.
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
known(CyclicStates)


YawStates = namedtuple("YawStates", "r_lead r_integral")
"""The yaw law's states: the filter of its lead, and the integral."""
known(YawStates)


CYCLIC = CyclicStates(*range(STATE.gyro_r_lead - STATE.gyro_q_filter))
_CYCLIC_STATES = len(CYCLIC)
YAW = YawStates(*range(STATE.gyro_r_integral - STATE.gyro_r_lead + 1))


@kernel()
def gyro_law(seen, state, settings):
    """Return the commands of front, left, right and tail servo: both of the gyro's laws as one.

    Args:
        seen: `Seen`.
        state: of the cyclic law, then of the yaw law, (8,), moved on to the next tick.
        settings: of the gyro, (n_param,), by `PARAM`.
    """
    front, left, right = cyclic_law(seen, state, settings)
    return front, left, right, yaw_law(seen, state, settings, _CYCLIC_STATES)


@kernel()
def yaw_law(seen, state, settings, first=0):
    """Return the tail servo's command.

    The state integrates what is held, and half a period of the whole error makes the rule
    trapezoidal; the integral of the lead's part of the rate is the lead times the filtered rate.

    seen: `Seen`; state: of the law, (2,) from `first` on, moved on to the next tick; settings: of
    the gyro, (n_param,), by `PARAM`; first: where its states start.
    """
    lead, summed = first + YAW.r_lead, first + YAW.r_integral
    k_delta, k_a = settings[PARAM.gyro_k_delta], settings[PARAM.gyro_k_a]
    plain = k_delta * seen.PED - k_a * seen.r
    error = yaw_error(
        seen.PED,
        seen.r,
        state[lead],
        k_delta,
        k_a,
        settings[PARAM.gyro_lead],
        settings[PARAM.gyro_lead_lag],
    )
    period, lock = settings[PARAM.gyro_period], settings[PARAM.gyro_heading_lock]
    led = k_a * settings[PARAM.gyro_lead] * state[lead]
    integral = lock * (state[summed] - led + 0.5 * period * error)
    command = yaw_command(error, integral, settings[PARAM.gyro_k_p], settings[PARAM.gyro_k_i])
    if not winds_up(plain, command, settings[PARAM.gyro_hold_above]):
        state[summed] += period * lock * plain
    state[lead] += settings[PARAM.gyro_lead_share] * (seen.r - state[lead])
    return limited(command)


@kernel()
def cyclic_law(seen, state, settings):
    """Return the commands of the front, left and right servo.

    seen: `Seen`; state: of the law, (6,), moved on to the next tick; settings: of the gyro,
    (n_param,), by `PARAM`.
    """
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
    """Move the filters and the integral of one cyclic axis on to the next tick.

    state: of the cyclic law, (6,); first: of the axis's three states; rate: that is read, rad/s;
    wanted: commanded rate, rad/s; command: of the axis, unitised, not yet limited; settings: of the
    gyro, (n_param,), by `PARAM`.
    """
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
def yaw_error(ped_stick, r, lead_state, k_delta, k_a, lead, lead_lag):
    """Return the rate error k_delta PED - k_a r of the yaw gyro, the rate led.

    The rate is led by `lead` at low frequency: (1 + (lead + lag) s) / (1 + lag s), where `lag`
    is by how much the sampled filter is late, `held_lag(lead_filter, period)`.

    ped_stick: unitised; r: sensed yaw rate, rad/s; lead_state: of the filter of the lead, rad/s;
    k_delta: gain of the stick; k_a: gain of the rate, s/rad; lead: s; lead_lag: s.
    """
    led = lead_state + (lead + lead_lag) / lead_lag * (r - lead_state)
    return k_delta * ped_stick - k_a * led


@kernel()
def yaw_command(error, integral, k_p, k_i):
    """Return the tail servo's command (unsaturated) of a PI controller."""
    return k_p * error + k_i * integral


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
    """Return the mean, over a period, of a first-order filter's distance from what is held.

    As a share of the distance that it starts with.
    """
    return filter_share(time_constant, period) * time_constant / period


@kernel()
def filter_through(first, second, period):
    """Return what of a first filter's distance gets through a second one within a period.

    What is held drives the first filter, this the second; both are first-order.

    first: time constant, s; second: time constant, s; period: s.
    """
    apart = period / second - period / first
    if abs(apart) > 1.0:  # where the exponential of a long period could overflow
        return period / second * (math.exp(-period / first) - math.exp(-period / second)) / apart
    ratio = -math.expm1(-apart) / apart if abs(apart) > 1e-8 else 1.0 - 0.5 * apart
    return period / second * math.exp(-period / first) * ratio


@kernel()
def mix(plate, col, lon, lat, first=0):
    """Return the positions of the front, left and right servo for a swashplate position.

    Positive `lon` raises the swashplate's front (nose up), positive `lat` its left.

    plate: where the servos stand under it, (21,): the vehicle's parameters from
    `PARAM.mix_front_col` on; col: unitised; lon: unitised; lat: unitised; first: where they start
    in `plate`, which may then be all of the parameters.
    """
    k = first
    return (
        plate[k] * col + plate[k + 1] * lon + plate[k + 2] * lat,
        plate[k + 3] * col + plate[k + 4] * lon + plate[k + 5] * lat,
        plate[k + 6] * col + plate[k + 7] * lon + plate[k + 8] * lat,
    )


@kernel()
def unmix(plate, front, left, right, first=0):
    """Return collective, longitudinal and lateral from three servo positions; undoes `mix`.

    Each row is whole numbers over a divisor where the geometry allows it, as at 120 degrees.
    `plate` and `first` are those of `mix`.
    """
    k = first
    return (
        (plate[k + 9] * front + plate[k + 10] * left + plate[k + 11] * right) / plate[k + 12],
        (plate[k + 13] * front + plate[k + 14] * left + plate[k + 15] * right) / plate[k + 16],
        (plate[k + 17] * front + plate[k + 18] * left + plate[k + 19] * right) / plate[k + 20],
    )


@kernel()
def servo_rates(position, rate, command, frequency, damping, rate_limit, travel):
    """Return d(position)/dt and d(rate)/dt of a second-order servo with two limits.

    The command saturates at the travel; the speed saturates at the rate limit.

    position: unitised; rate: 1/s; command: unitised; frequency: natural frequency, rad/s; damping:
    damping ratio; rate_limit: 1/s; travel: greatest |command| that is followed.
    """
    target = min(travel, max(-travel, command))
    limited = min(rate_limit, max(-rate_limit, rate))
    acceleration = frequency**2 * (target - position) - 2.0 * damping * frequency * rate
    return limited, acceleration


@kernel()
def equivalent_delay(frequency, damping):
    """Return the delay that a second-order servo looks like at low frequency, s."""
    return 2.0 * damping / frequency


@kernel(forceinline=False)
def write_servo_rates(par, act, rate, commands, limits):
    """Write the derivatives of the four servos' states.

    act: states of the vehicle; rate: their derivatives, written; commands: of the front, left,
    right and tail servo, unitised, (4,); limits: how fast each can be, 1/s, (4,).
    """
    for k in range(4):
        position = STATE.front_position + 2 * k
        frequency, damping = par[PARAM.swash_frequency], par[PARAM.swash_damping]
        if k == 3:
            frequency, damping = par[PARAM.tail_frequency], par[PARAM.tail_damping]
        rate[position], rate[position + 1] = servo_rates(
            act[position],
            act[position + 1],
            commands[k],
            frequency,
            damping,
            limits[k],
            par[PARAM.servo_travel],
        )
        if limits[k] < par[PARAM.servo_rate_limit]:
            # a fault made it slow: its rate follows frequency / (2 damping) times the error no
            # further than the limit, so that it is also what the servo will do next
            wanted = 0.5 * frequency / damping * (commands[k] - act[position])
            wanted = min(limits[k], max(-limits[k], wanted))
            rate[position + 1] = 2.0 * damping * frequency * (wanted - act[position + 1])
