"""The three-axis gyro: yaw PI with heading lock, cyclic rate control with phase rotation.

Yaw: Wu and Chen, eq. (7), with a lead on the rate. Cyclic: commanded rates R d of the sticks
d are tracked by u = (Kp + M Ki/s)(R d - y) - M Kd s/(td s + 1) y, where y is the filtered
rate and M turns by the phase angle of the swashplate.
"""

import math
from typing import NamedTuple

from helisim.physics import faults, frames
from helisim.physics.kernel import kernel
from helisim.physics.layout import CONTROL, PARAM, SENSOR, STATE
from helisim.physics.memory import sensor_numbers
from helisim.physics.timing import delayed_control, last_tick


class Rates(NamedTuple):
    """What the gyro senses, rad/s."""

    p: float
    q: float
    r: float


class Sticks(NamedTuple):
    """The sticks as they reach the gyro, unitised."""

    lon: float
    lat: float
    ped: float


class YawLaw(NamedTuple):
    """What the gyro's yaw law gives.

    Attributes:
        error: what its integrator integrates, the rate error without its lead.
        lead_rate: d/dt of the lead's state, rad/s^2.
        command: to the tail servo, unitised, not yet limited.
    """

    error: float
    lead_rate: float
    command: float


class CyclicLaw(NamedTuple):
    """What the gyro's cyclic law gives.

    Attributes:
        p_error: commanded less filtered roll rate, rad/s.
        q_error: commanded less filtered pitch rate, rad/s.
        lat: lateral command, unitised, not yet limited.
        lon: longitudinal command, likewise.
    """

    p_error: float
    q_error: float
    lat: float
    lon: float


@kernel()
def yaw_error(ped_stick, r, lead_state, k_delta, k_a, lead, lead_filter, lead_lag):
    """Return the rate error k_delta PED - k_a r of the yaw gyro and d(lead_state)/dt.

    The rate is led by `lead` at low frequency: (1 + (lead + lag) s) / (1 + lag s), where `lag`
    is by how much the sampled filter is late, `held_lag(lead_filter, period)`.

    Args:
        ped_stick: unitised.
        r: sensed yaw rate, rad/s.
        lead_state: of the filter of the lead, rad/s.
        k_delta: gain of the stick.
        k_a: gain of the rate, s/rad.
        lead: s.
        lead_filter: time constant of the lead's filter, s.
        lead_lag: s.
    """
    behind = r - lead_state
    led = lead_state + (lead + lead_lag) / lead_lag * behind
    return k_delta * ped_stick - k_a * led, behind / lead_filter


@kernel()
def held_lag(time_constant, period):
    """Return by how much a first-order filter of samples held for a period is late, s."""
    return period / -math.expm1(-period / time_constant)


@kernel()
def yaw_command(error, integral, k_p, k_i):
    """Return the tail servo's command (unsaturated) of a PI controller."""
    return k_p * error + k_i * integral


@kernel()
def rotate(cosine, sine, lat, lon):
    """Turn the pair (lat, lon) by the swashplate phase angle."""
    return cosine * lat + sine * lon, -sine * lat + cosine * lon


@kernel()
def filter_rate(state, signal, time_constant):
    """Return d(state)/dt of a first-order low-pass filter."""
    return (signal - state) / time_constant


@kernel()
def hold_when_saturated(error, command, limit):
    """Return d(integral)/dt: the error, or 0 where it would push a saturated command further."""
    if abs(command) > limit and error * command > 0.0:
        return 0.0
    return error


@kernel()
def sensed_rates(view):
    """Return the `Rates` as the gyro saw them last."""
    seen = sensor_numbers(view)
    p, q, r = frames.flip(seen[SENSOR.gyro_x], seen[SENSOR.gyro_y], seen[SENSOR.gyro_z])
    if view.par[PARAM.faults] != 0.0:
        p, q, r = faults.rates_left(view, p, q, r)
    return Rates(p, q, r)


@kernel()
def stick_positions(view):
    """Return the `Sticks` as they reach the gyro: PED late."""
    ped = delayed_control(view, CONTROL.ped, last_tick(view))
    return Sticks(view.controls[CONTROL.lon], view.controls[CONTROL.lat], ped)


@kernel()
def yaw_law(par, act, r, ped_stick):
    """Return the yaw law at a sensed rate `r` (rad/s) and a position of the pedals."""
    error, lead_rate = yaw_error(
        ped_stick,
        r,
        act[STATE.gyro_r_lead],
        par[PARAM.gyro_k_delta],
        par[PARAM.gyro_k_a],
        par[PARAM.gyro_lead],
        par[PARAM.gyro_lead_filter],
        par[PARAM.gyro_lead_lag],
    )
    # The state integrates what is held, and half a period of the whole error makes the rule
    # trapezoidal; the integral of the lead's part of the rate is the lead times the filtered rate.
    plain = par[PARAM.gyro_k_delta] * ped_stick - par[PARAM.gyro_k_a] * r
    led = par[PARAM.gyro_k_a] * par[PARAM.gyro_lead] * act[STATE.gyro_r_lead]
    integral = act[STATE.gyro_r_integral] - led + 0.5 * par[PARAM.gyro_period] * error
    integral *= par[PARAM.gyro_heading_lock]
    command = yaw_command(error, integral, par[PARAM.gyro_k_p], par[PARAM.gyro_k_i])
    return YawLaw(plain, lead_rate, command)


@kernel()
def cyclic_law(par, act, lat_stick, lon_stick):
    """Return the cyclic law at positions of the lateral and the longitudinal stick."""
    p = act[STATE.gyro_p_filter]
    q = act[STATE.gyro_q_filter]
    p_error = par[PARAM.gyro_p_per_lat] * lat_stick + par[PARAM.gyro_p_per_lon] * lon_stick - p
    q_error = par[PARAM.gyro_q_per_lat] * lat_stick + par[PARAM.gyro_q_per_lon] * lon_stick - q
    slow = par[PARAM.gyro_derivative_lag]
    p_rate = (p - act[STATE.gyro_p_derivative]) / slow
    q_rate = (q - act[STATE.gyro_q_derivative]) / slow
    lat, lon = rotate(
        par[PARAM.gyro_phase_cosine],
        par[PARAM.gyro_phase_sine],
        par[PARAM.gyro_ki_lat] * act[STATE.gyro_p_integral] - par[PARAM.gyro_kd_lat] * p_rate,
        par[PARAM.gyro_ki_lon] * act[STATE.gyro_q_integral] - par[PARAM.gyro_kd_lon] * q_rate,
    )
    lat += par[PARAM.gyro_kp_lat] * p_error
    lon += par[PARAM.gyro_kp_lon] * q_error
    return CyclicLaw(p_error, q_error, lat, lon)


@kernel()
def write_gyro_rates(par, act, rate, sensed, sticks):
    """Write the derivatives of the gyro's states.

    What the gyro sees and the sticks are held between its ticks, so the integrals are exactly
    those of a sampled controller, and the filters its exact discretisation.

    Args:
        par: parameters.
        act: states of the vehicle.
        rate: their derivatives, written.
        sensed: `Rates`.
        sticks: `Sticks`.
    """
    yaw = yaw_law(par, act, sensed.r, sticks.ped)
    rate[STATE.gyro_r_lead] = yaw.lead_rate
    above = par[PARAM.gyro_hold_above]
    held = hold_when_saturated(yaw.error, yaw.command, above)
    rate[STATE.gyro_r_integral] = par[PARAM.gyro_heading_lock] * held
    cyclic = cyclic_law(par, act, sticks.lat, sticks.lon)
    p_seen, q_seen = act[STATE.gyro_p_filter], act[STATE.gyro_q_filter]
    fast, slow = par[PARAM.gyro_filter], par[PARAM.gyro_derivative_filter]
    rate[STATE.gyro_p_filter] = filter_rate(p_seen, sensed.p, fast)
    rate[STATE.gyro_q_filter] = filter_rate(q_seen, sensed.q, fast)
    lock = par[PARAM.gyro_attitude_lock]
    rate[STATE.gyro_p_integral] = lock * hold_when_saturated(cyclic.p_error, cyclic.lat, above)
    rate[STATE.gyro_q_integral] = lock * hold_when_saturated(cyclic.q_error, cyclic.lon, above)
    rate[STATE.gyro_p_derivative] = filter_rate(act[STATE.gyro_p_derivative], p_seen, slow)
    rate[STATE.gyro_q_derivative] = filter_rate(act[STATE.gyro_q_derivative], q_seen, slow)
