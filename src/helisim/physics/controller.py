"""The controllers of a vehicle at a tick: what they see, their state, the servos' commands."""

from helisim.physics import faults, frames
from helisim.physics.gyro import Seen, cyclic_law, yaw_law
from helisim.physics.injection import add_to_commands, at_sensors
from helisim.physics.kernel import kernel
from helisim.physics.layout import CONTROL, FIRST_LAW_STATE, PARAM, SENSOR, STATE
from helisim.physics.memory import double, from_element, sensor_numbers
from helisim.physics.timing import delayed_control, last_tick, tick_number


@kernel()
def command_servos(view):
    """Write the laws' commands to the four servos; a gyro that restarts has none of its own."""
    par, controls = view.par, view.controls
    if faults.restarts(view):
        forget(view)
        if par[PARAM.restart_neutral] != 0.0:
            for k in range(CONTROL.servo_front, CONTROL.servo_tail + 1):
                controls[k] = 0.0
        return
    begin_tick(view)
    seen = seen_by_gyro(view)
    state = from_element(view.act, FIRST_LAW_STATE)
    front, left, right = cyclic_law(seen, state, par)
    controls[CONTROL.servo_front] = front
    controls[CONTROL.servo_left] = left
    controls[CONTROL.servo_right] = right
    state = from_element(view.act, FIRST_LAW_STATE + int(par[PARAM.swash_states]))
    controls[CONTROL.servo_tail] = yaw_law(seen, state, par)
    add_to_commands(view)


@kernel()
def law_states(view):
    """Return how many states the laws of a vehicle have."""
    return int(view.par[PARAM.swash_states]) + int(view.par[PARAM.tail_states])


@kernel()
def begin_tick(view):
    """Keep the laws' states before they act, or put them back if they have acted at this tick.

    So an evaluation can be made again, as `mj_forward` may, and gives the same.
    """
    act, count = view.act, law_states(view)
    state, kept = from_element(act, FIRST_LAW_STATE), from_element(act, FIRST_LAW_STATE + count)
    number = tick_number(view.par, double(view.d, view.offsets.time)) + 1.0
    if act[STATE.law_tick] == number:
        for k in range(count):
            state[k] = kept[k]
        return
    act[STATE.law_tick] = number
    for k in range(count):
        kept[k] = state[k]


@kernel()
def forget(view):
    """Set all that the laws know to zero, as before they first acted."""
    for k in range(STATE.law_tick, FIRST_LAW_STATE + 2 * law_states(view)):
        view.act[k] = 0.0


@kernel()
def seen_by_gyro(view):
    """Return what the shipped laws use of what is `Seen`: rates and sticks; the rest is 0."""
    rates, controls = sensor_numbers(view), view.controls
    p, q, r = frames.flip(rates[SENSOR.gyro_x], rates[SENSOR.gyro_y], rates[SENSOR.gyro_z])
    p, q, r = at_sensors(view, p, q, r)
    if view.par[PARAM.faults] != 0.0:
        p, q, r = faults.rates_left(view, p, q, r)
    ped = delayed_control(view, CONTROL.ped, last_tick(view))
    col, lon, lat = controls[CONTROL.col], controls[CONTROL.lon], controls[CONTROL.lat]
    time = double(view.d, view.offsets.time)
    return Seen(time, p, q, r, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, col, lon, lat, ped)
