"""The three-axis gyro: yaw PI with heading lock, cyclic rate control with phase rotation.

Yaw: Wu and Chen, eq. (7), with a lead on the rate. Cyclic: commanded rates R d of the sticks
d are tracked by u = (Kp + M Ki/s)(R d - y) - M Kd s/(td s + 1) y, where y is the filtered
rate and M turns by the phase angle of the swashplate.
"""

from helisim.physics.kernel import kernel


@kernel()
def yaw_error(ped_stick, r, lead_state, k_delta, k_a, lead, lead_filter):
    """Return the rate error k_delta PED - k_a r of the yaw gyro and d(lead_state)/dt.

    The rate passes (1 + (lead + filter) s) / (1 + filter s): a net lead at low frequency.
    """
    lead_rate = (r - lead_state) / lead_filter
    led = lead_state + (lead + lead_filter) * lead_rate
    return k_delta * ped_stick - k_a * led, lead_rate


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
