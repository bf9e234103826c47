"""Servos, and the mixing of three of them under one swashplate (CCPM)."""

from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, STATE


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
