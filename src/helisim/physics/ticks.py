"""The gyro's ticks, and what is held between them."""

import math

from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM
from helisim.physics.memory import double, doubles, ints


@kernel()
def is_tick(m, d, offsets, par, clock):
    """Tell whether the gyro acts now: at a step's start, once in each of its periods.

    MuJoCo computes sensors at the start of a step only, so the clock tells the start from the
    later stages of the integrator.
    """
    time = double(d, offsets.time)
    if time != clock:
        return False
    period = par[PARAM.gyro_period]
    before = time - double(m, offsets.timestep)
    return math.floor(time / period + 1e-6) != math.floor(before / period + 1e-6)


@kernel()
def tick_number(par, clock):
    """Return how many times the gyro has acted since time 0."""
    return math.floor(clock / par[PARAM.gyro_period] + 1e-6)


@kernel()
def last_tick(par, clock):
    """Return the time at which the gyro last acted, s."""
    return par[PARAM.gyro_period] * tick_number(par, clock)


@kernel()
def delayed_control(m, d, offsets, actuator, address, now, period):
    """Return an actuator's control as it was one delay before `now`, linear between ticks.

    Args:
        m: address of mjModel.
        d: address of mjData.
        offsets: of the fields.
        actuator: its id.
        address: of its control.
        now: s.
        period: s, for which the control is held; whatever the time step, it is read at ticks.
    """
    buffer = ints(m, offsets.actuator_historyadr)[actuator]
    delay = doubles(m, offsets.actuator_delay)[actuator]
    if buffer < 0 or delay <= 0.0:
        return doubles(d, offsets.ctrl)[address]
    wanted = now - delay
    tick = period * math.floor(wanted / period + 1e-6)
    ahead = max(0.0, (wanted - tick) / period)
    before, after = past_controls(m, d, offsets, actuator, tick, tick + period)
    return before + ahead * (after - before)


@kernel()
def past_controls(m, d, offsets, actuator, earlier, later):
    """Return an actuator's control at two past times: each its newest sample not after it."""
    buffer = ints(m, offsets.actuator_historyadr)[actuator]
    count = ints(m, offsets.actuator_history)[2 * actuator]
    history = doubles(d, offsets.history)
    times, values = buffer + 2, buffer + 2 + count
    k = int(history[buffer + 1])
    left = count - 1
    while left > 0 and history[times + k] > later + 1e-9:
        k = k - 1 if k > 0 else count - 1
        left -= 1
    value_later = history[values + k]
    while left > 0 and history[times + k] > earlier + 1e-9:
        k = k - 1 if k > 0 else count - 1
        left -= 1
    return history[values + k], value_later
