"""The gyro in the step: its laws on sensed rates, sticks and states."""

from helisim.physics import frames, gyro
from helisim.physics.addresses import REPORTS, body_of, control_of, reports
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, ROTOR, STATE
from helisim.physics.memory import doubles
from helisim.physics.ticks import delayed_control, last_tick


@kernel()
def yaw_law(m, d, offsets, rotor_id, par, act, first, control, seen):
    """Return what the yaw gyro integrates, the derivative of its lead, and the tail command."""
    sensordata = doubles(d, offsets.sensordata)
    _, _, r = frames.flip(sensordata[seen - 3], sensordata[seen - 2], sensordata[seen - 1])
    now = last_tick(par, sensordata[seen + REPORTS])
    period = par[PARAM.gyro_period]
    stick = delayed_control(m, d, offsets, rotor_id - ROTOR + 3, control + 3, now, period)
    error, lead_rate = gyro.yaw_error(
        stick,
        r,
        act[first + STATE.gyro_r_lead],
        par[PARAM.gyro_k_delta],
        par[PARAM.gyro_k_a],
        par[PARAM.gyro_lead],
        par[PARAM.gyro_lead_filter],
        par[PARAM.gyro_lead_lag],
    )
    # The state integrates what is held, and half a period of the whole error makes the rule
    # trapezoidal; the integral of the lead's part of the rate is the lead times the filtered rate.
    plain = par[PARAM.gyro_k_delta] * stick - par[PARAM.gyro_k_a] * r
    led = par[PARAM.gyro_k_a] * par[PARAM.gyro_lead] * act[first + STATE.gyro_r_lead]
    integral = act[first + STATE.gyro_r_integral] - led + 0.5 * par[PARAM.gyro_period] * error
    integral *= par[PARAM.gyro_heading_lock]
    command = gyro.yaw_command(error, integral, par[PARAM.gyro_k_p], par[PARAM.gyro_k_i])
    return plain, lead_rate, command


@kernel()
def cyclic_law(par, act, first, lat_stick, lon_stick):
    """Return the two rate errors and the cyclic commands lat, lon of the gyro."""
    p = act[first + STATE.gyro_p_filter]
    q = act[first + STATE.gyro_q_filter]
    p_error = par[PARAM.gyro_p_per_lat] * lat_stick + par[PARAM.gyro_p_per_lon] * lon_stick - p
    q_error = par[PARAM.gyro_q_per_lat] * lat_stick + par[PARAM.gyro_q_per_lon] * lon_stick - q
    slow = par[PARAM.gyro_derivative_lag]
    p_rate = (p - act[first + STATE.gyro_p_derivative]) / slow
    q_rate = (q - act[first + STATE.gyro_q_derivative]) / slow
    lat, lon = gyro.rotate(
        par[PARAM.gyro_phase_cosine],
        par[PARAM.gyro_phase_sine],
        par[PARAM.gyro_ki_lat] * act[first + STATE.gyro_p_integral]
        - par[PARAM.gyro_kd_lat] * p_rate,
        par[PARAM.gyro_ki_lon] * act[first + STATE.gyro_q_integral]
        - par[PARAM.gyro_kd_lon] * q_rate,
    )
    lat += par[PARAM.gyro_kp_lat] * p_error
    lon += par[PARAM.gyro_kp_lon] * q_error
    return p_error, q_error, lat, lon


@kernel()
def gyro_derivatives(m, d, offsets, rotor_id, par, first, ordinal):
    """Write the derivatives of the gyro's states that belong to one stick.

    What the gyro sees and the sticks are held between its ticks, so the integrals are exactly
    those of a sampled controller, and the filters its exact discretisation.
    """
    seen = reports(m, offsets, body_of(m, offsets, rotor_id))
    if par[PARAM.gyro_on] == 0.0 or seen < 0:
        return
    act = doubles(d, offsets.act)
    rate = doubles(d, offsets.act_dot)
    address = control_of(m, offsets, rotor_id)
    sticks = doubles(d, offsets.ctrl)
    sensordata = doubles(d, offsets.sensordata)
    p, q, _ = frames.flip(sensordata[seen - 3], sensordata[seen - 2], sensordata[seen - 1])
    if ordinal == 3:
        error, lead_rate, command = yaw_law(m, d, offsets, rotor_id, par, act, first, address, seen)
        rate[first + STATE.gyro_r_lead] = lead_rate
        held = gyro.hold_when_saturated(error, command, par[PARAM.gyro_hold_above])
        rate[first + STATE.gyro_r_integral] = par[PARAM.gyro_heading_lock] * held
        return
    p_error, q_error, lat, lon = cyclic_law(
        par, act, first, sticks[address + 2], sticks[address + 1]
    )
    slow, fast = par[PARAM.gyro_derivative_filter], par[PARAM.gyro_filter]
    if ordinal == 2:
        signal, error, command, k = p, p_error, lat, STATE.gyro_p_filter
    else:
        signal, error, command, k = q, q_error, lon, STATE.gyro_q_filter
    rate[first + k] = gyro.filter_rate(act[first + k], signal, fast)
    held = gyro.hold_when_saturated(error, command, par[PARAM.gyro_hold_above])
    rate[first + k + 1] = par[PARAM.gyro_attitude_lock] * held
    rate[first + k + 2] = gyro.filter_rate(act[first + k + 2], act[first + k], slow)
