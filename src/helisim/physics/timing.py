"""Time in the step: the gyro's ticks, what is held between them, and how integrators use rates.

The gyro acts at its ticks, once in each of its periods, and what it sees and says is held in
between.

Runge-Kutta asks for derivatives, four times a step. The other integrators ask once and hold the
answer for the step: v += h dv/dt, then x += h v, and act += h d(act)/dt. To be of second order with
one evaluation, they are given what the step's mean is, by a staggered (leapfrog) scheme:
velocities belong to the steps, positions and the tip-path plane's tilt to halfway between
them. The tilt kept at a step is half a step old; moved on by a step with the rates at its
middle, it acts on the body half a step ahead. Servos are driven by commands that are held, so
their mean is the exponential's.
"""

import math

import mujoco

from helisim.physics.kernel import kernel
from helisim.physics.layout import ROTOR, SENSOR
from helisim.physics.memory import double, doubles, integer, ints, sensor_numbers
from helisim.physics.params import PARAM

TICK_TOLERANCE = 1e-6
"""Of a period: a tick, or a whole number of steps, counts so much early, as times are rounded."""
TIME_TOLERANCE = 1e-9
"""s, by which equal times may differ: far above their rounding, far below any time step."""

_RUNGE_KUTTA = int(mujoco.mjtIntegrator.mjINT_RK4)


@kernel()
def held_for(view):
    """Return for how long (s) the integrator holds an evaluation; 0 if it wants derivatives."""
    if integer(view.m, view.offsets.integrator) == _RUNGE_KUTTA:
        return 0.0
    return double(view.m, view.offsets.timestep)


@kernel()
def position_ahead(view, position, ahead):
    """Return a servo's position a time `ahead` (s) from now; its rate stands behind it."""
    limit = view.par[PARAM.servo_rate_limit]
    rate = view.act[position + 1]
    return view.act[position] + ahead * min(limit, max(-limit, rate))


@kernel()
def clock(view):
    """Return the time at which this step started, s."""
    return sensor_numbers(view)[SENSOR.clock]


@kernel()
def tick_number(par, time):
    """Return how many times the gyro has acted from time 0 to a time (s)."""
    return math.floor(time / par[PARAM.gyro_period] + TICK_TOLERANCE)


@kernel()
def is_tick(view):
    """Return whether the gyro acts now: at a step's start, once in each of its periods.

    MuJoCo computes sensors at the start of a step only, so the clock separates the start from the
    later stages of the integrator.
    """
    time = double(view.d, view.offsets.time)
    if time != clock(view):
        return False
    before = time - double(view.m, view.offsets.timestep)
    return tick_number(view.par, time) != tick_number(view.par, before)


@kernel()
def last_tick(view):
    """Return the time at which the gyro last acted, s; 0 where there is no clock."""
    if view.sensors < 0:
        return 0.0
    return view.par[PARAM.gyro_period] * tick_number(view.par, clock(view))


@kernel()
def delayed_control(view, ordinal, now):
    """Return a control as it was one delay of its actuator before `now`, linear between ticks.

    Args:
        view: of the vehicle.
        ordinal: of the control, one of `CONTROL`.
        now: s.
    """
    m, offsets = view.m, view.offsets
    actuator = view.rotor - ROTOR + ordinal
    history = ints(m, offsets.actuator_historyadr)[actuator]
    delay = doubles(m, offsets.actuator_delay)[actuator]
    if history < 0 or delay <= 0.0:
        return view.controls[ordinal]
    period = view.par[PARAM.gyro_period]  # whatever the time step, the control is read at ticks
    wanted = now - delay
    tick = period * math.floor(wanted / period + TICK_TOLERANCE)
    ahead = max(0.0, (wanted - tick) / period)
    before, after = past_controls(view, actuator, tick, tick + period)
    return before + ahead * (after - before)


@kernel()
def past_controls(view, actuator, earlier, later):
    """Return an actuator's control at two past times: each its newest sample not after it.

    Args:
        view: of the vehicle.
        actuator: its id; it has a delay.
        earlier: s.
        later: s.
    """
    first = ints(view.m, view.offsets.actuator_historyadr)[actuator]
    count = ints(view.m, view.offsets.actuator_history)[2 * actuator]
    history = doubles(view.d, view.offsets.history)
    times, values = first + 2, first + 2 + count
    k = int(history[first + 1])
    left = count - 1
    while left > 0 and history[times + k] > later + TIME_TOLERANCE:
        k = k - 1 if k > 0 else count - 1
        left -= 1
    value_later = history[values + k]
    while left > 0 and history[times + k] > earlier + TIME_TOLERANCE:
        k = k - 1 if k > 0 else count - 1
        left -= 1
    return history[values + k], value_later
