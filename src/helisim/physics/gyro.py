"""The three-axis gyro: yaw PI with heading lock, cyclic rate control with phase rotation.

Yaw: Wu and Chen, eq. (7), with a lead on the rate. Cyclic: commanded rates R d of the sticks
d are tracked by u = (Kp + M Ki/s)(R d - y) - M Kd s/(td s + 1) y, where y is the filtered
rate and M turns by the phase angle of the swashplate.
"""

import math

from helisim.physics.kernel import kernel


@kernel()
def yaw_error(ped_stick, r, lead_state, k_delta, k_a, lead, lead_filter, lead_lag):
    """Return the rate error k_delta PED - k_a r of the yaw gyro and d(lead_state)/dt.

    The rate is led by `lead` at low frequency: (1 + (lead + lag) s) / (1 + lag s), where `lag`
    is by how much the sampled filter is late, `held_lag(lead_filter, period)`.
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
