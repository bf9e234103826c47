"""What follows sticks and gyro alone: the states of gyro and servos.

All that drives them is held between the gyro's ticks; the body's motion within a step does
not reach them.
"""

from helisim.physics import faults, frames, servo
from helisim.physics.addresses import REPORTS, body_of, control_of, reports
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, ROTOR, STATE
from helisim.physics.memory import doubles, doubles_from, room
from helisim.physics.stabilizing import gyro_rates
from helisim.physics.ticks import delayed_control, last_tick

_COUNT = STATE.tail_rate + 1
"""The first states of a vehicle are those of gyro and servos."""


@kernel()
def sensed_rates(d, offsets, par, act, seen):
    """Return p, q, r (rad/s) as the gyro saw them last; they stand before the own sensors."""
    sensordata = doubles(d, offsets.sensordata)
    p, q, r = frames.flip(sensordata[seen - 3], sensordata[seen - 2], sensordata[seen - 1])
    if par[PARAM.faults] != 0.0:
        return faults.rates_left(par, act, faults.now(d, offsets, par, seen), p, q, r)
    return p, q, r


@kernel()
def stick_positions(m, d, offsets, rotor_id, par, seen):
    """Return LON, LAT and PED as they reach the gyro: PED late."""
    address = control_of(m, offsets, rotor_id)
    controls = doubles_from(d, offsets.ctrl, address)
    now = last_tick(par, doubles(d, offsets.sensordata)[seen + REPORTS])
    period = par[PARAM.gyro_period]
    ped = delayed_control(m, d, offsets, rotor_id - ROTOR + 3, address + 3, now, period)
    return controls[1], controls[2], ped


@kernel()
def what_is_held(m, d, offsets, rotor_id, par, act):
    """Return what drives gyro and servos, and whether the gyro works at all.

    Sensed rates, sticks, the servos' commands, and how fast each servo can be.
    """
    controls = doubles_from(d, offsets.ctrl, control_of(m, offsets, rotor_id))
    commands = (controls[4], controls[5], controls[6], controls[7])
    limit = par[PARAM.servo_rate_limit]
    limits = (limit, limit, limit, limit)
    seen = reports(m, offsets, body_of(m, offsets, rotor_id))
    if par[PARAM.faults] != 0.0:
        commands, limits = faults.servos_left(
            par, faults.now(d, offsets, par, seen), commands, limits
        )
    if par[PARAM.gyro_on] == 0.0 or seen < 0 or faults.restarts(d, offsets, par, seen):
        return False, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), commands, limits
    sensed = sensed_rates(d, offsets, par, act, seen)
    return True, sensed, stick_positions(m, d, offsets, rotor_id, par, seen), commands, limits


@kernel()
def commanded_rates(par, held, act, rate):
    """Write the derivatives of the states of gyro and servos."""
    on, sensed, sticks, commands, limits = held
    if on:
        gyro_rates(par, act, rate, sensed, sticks)
    for k in range(4):
        position = STATE.front_position + 2 * k
        frequency, damping = par[PARAM.swash_frequency], par[PARAM.swash_damping]
        if k == 3:
            frequency, damping = par[PARAM.tail_frequency], par[PARAM.tail_damping]
        rate[position], rate[position + 1] = servo.servo_rates(
            act[position],
            act[position + 1],
            commands[k],
            frequency,
            damping,
            limits[k],
            par[PARAM.servo_travel],
        )
        if limits[k] < par[PARAM.servo_rate_limit]:
            rate[position + 1] = servo.held_back(
                act[position], act[position + 1], commands[k], frequency, damping, limits[k]
            )


@kernel()
def mean_commanded_rates(par, held, act, rate, step):
    """Write the mean derivatives over a time step in which all that drives them is held.

    The Taylor series of the exponential, from the inside out, to sixth order where the laws
    are linear: with the gyro's filters of 3 ms and steps of 2 ms, exact to 2e-5.

    Args:
        par: parameters.
        held: what is held.
        act: states of the vehicle.
        rate: their mean derivatives, written.
        step: s.
    """
    stage = room(_COUNT)
    commanded_rates(par, held, act, rate)
    for divisor in (6.0, 5.0, 4.0, 3.0, 2.0):
        for k in range(_COUNT):
            stage[k] = act[k] + step / divisor * rate[k]
        commanded_rates(par, held, stage, rate)
