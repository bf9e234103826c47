"""The gyro in the step: its laws on sensed rates, sticks and states."""

from helisim.physics import gyro
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, STATE


@kernel()
def yaw_law(par, act, r, stick):
    """Return what the yaw gyro integrates, the derivative of its lead, and the tail command."""
    error, lead_rate = gyro.yaw_error(
        stick,
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
    plain = par[PARAM.gyro_k_delta] * stick - par[PARAM.gyro_k_a] * r
    led = par[PARAM.gyro_k_a] * par[PARAM.gyro_lead] * act[STATE.gyro_r_lead]
    integral = act[STATE.gyro_r_integral] - led + 0.5 * par[PARAM.gyro_period] * error
    integral *= par[PARAM.gyro_heading_lock]
    command = gyro.yaw_command(error, integral, par[PARAM.gyro_k_p], par[PARAM.gyro_k_i])
    return plain, lead_rate, command


@kernel()
def cyclic_law(par, act, lat_stick, lon_stick):
    """Return the two rate errors and the cyclic commands lat, lon of the gyro."""
    p = act[STATE.gyro_p_filter]
    q = act[STATE.gyro_q_filter]
    p_error = par[PARAM.gyro_p_per_lat] * lat_stick + par[PARAM.gyro_p_per_lon] * lon_stick - p
    q_error = par[PARAM.gyro_q_per_lat] * lat_stick + par[PARAM.gyro_q_per_lon] * lon_stick - q
    slow = par[PARAM.gyro_derivative_lag]
    p_rate = (p - act[STATE.gyro_p_derivative]) / slow
    q_rate = (q - act[STATE.gyro_q_derivative]) / slow
    lat, lon = gyro.rotate(
        par[PARAM.gyro_phase_cosine],
        par[PARAM.gyro_phase_sine],
        par[PARAM.gyro_ki_lat] * act[STATE.gyro_p_integral] - par[PARAM.gyro_kd_lat] * p_rate,
        par[PARAM.gyro_ki_lon] * act[STATE.gyro_q_integral] - par[PARAM.gyro_kd_lon] * q_rate,
    )
    lat += par[PARAM.gyro_kp_lat] * p_error
    lon += par[PARAM.gyro_kp_lon] * q_error
    return p_error, q_error, lat, lon


@kernel()
def gyro_rates(par, act, rate, sensed, sticks):
    """Write the derivatives of the gyro's states.

    What the gyro sees and the sticks are held between its ticks, so the integrals are exactly
    those of a sampled controller, and the filters its exact discretisation.

    Args:
        par: parameters.
        act: states of the vehicle.
        rate: their derivatives, written.
        sensed: p, q, r.
        sticks: LON, LAT and the delayed PED.
    """
    p, q, r = sensed
    lon_stick, lat_stick, ped_stick = sticks
    error, lead_rate, command = yaw_law(par, act, r, ped_stick)
    rate[STATE.gyro_r_lead] = lead_rate
    above = par[PARAM.gyro_hold_above]
    held = gyro.hold_when_saturated(error, command, above)
    rate[STATE.gyro_r_integral] = par[PARAM.gyro_heading_lock] * held
    p_error, q_error, lat, lon = cyclic_law(par, act, lat_stick, lon_stick)
    p_seen, q_seen = act[STATE.gyro_p_filter], act[STATE.gyro_q_filter]
    fast, slow = par[PARAM.gyro_filter], par[PARAM.gyro_derivative_filter]
    rate[STATE.gyro_p_filter] = gyro.filter_rate(p_seen, p, fast)
    rate[STATE.gyro_q_filter] = gyro.filter_rate(q_seen, q, fast)
    lock = par[PARAM.gyro_attitude_lock]
    rate[STATE.gyro_p_integral] = lock * gyro.hold_when_saturated(p_error, lat, above)
    rate[STATE.gyro_q_integral] = lock * gyro.hold_when_saturated(q_error, lon, above)
    rate[STATE.gyro_p_derivative] = gyro.filter_rate(act[STATE.gyro_p_derivative], p_seen, slow)
    rate[STATE.gyro_q_derivative] = gyro.filter_rate(act[STATE.gyro_q_derivative], q_seen, slow)
