"""The controllers of a vehicle at a tick: what they see, their state, the servos' commands."""

import math

from helisim.physics import faults, frames
from helisim.physics.body import rotation
from helisim.physics.examination import STRANGE_LAW
from helisim.physics.gyro import Seen, cyclic_law, yaw_law
from helisim.physics.injection import add_to_commands, at_sensors, turned
from helisim.physics.kernel import kernel
from helisim.physics.laws import COMMANDS, SEEN, ask, row_of
from helisim.physics.layout import CONTROL, FIRST_LAW_STATE, SENSOR, STATE
from helisim.physics.memory import buffer, double, from_element, sensor_numbers, states_end
from helisim.physics.notes import REFUSED, note
from helisim.physics.params import NO_LAW, PARAM, SHIPPED_LAW
from helisim.physics.timing import delayed_control, last_tick, tick_number

_STARTS = 0.5
"""Added to `law_tick` at a law's first tick."""
_FAILED = -1.0
"""What `law_tick` is of a law that failed."""
_NUMBERS = SEEN + 1


@kernel()
def command_servos(view):
    """Write the laws' commands to the four servos; a gyro that restarts has none of its own.

    Nor has a law that failed, or one for whose states there is no room.
    """
    par, controls = view.par, view.controls
    if par[PARAM.planned] == 0.0 and par[PARAM.swash_law] == par[PARAM.tail_law] == NO_LAW:
        return
    if faults.restarts(view):
        forget(view)
        if par[PARAM.restart_neutral] != 0.0:
            for k in range(CONTROL.servo_front, CONTROL.servo_tail + 1):
                controls[k] = 0.0
        return
    if has_failed(view) or FIRST_LAW_STATE + 2 * law_states(view) > states_end(view):
        return
    if par[PARAM.planned] != 0.0:
        command_by_plan(view)
    if has_own_law(par):
        command_by_own_laws(view)
    else:
        begin_tick(view)
        nowhere = (0.0, 0.0, 0.0)
        seen = seen_now(view, nowhere, nowhere, (0.0, 0.0, 0.0, 0.0))  # all that these laws use
        command_by_shipped_laws(view, seen)
    add_to_commands(view)


@kernel()
def command_by_plan(view):
    """Write the commands of a plan's flight to those servos that no law moves."""
    par = view.par
    for k in range(4):
        law = par[PARAM.tail_law] if k == 3 else par[PARAM.swash_law]
        if law == NO_LAW:
            view.controls[CONTROL.servo_front + k] = par[PARAM.planned_front + k]


@kernel()
def has_own_law(par):
    """Return whether one of a vehicle's laws is not shipped."""
    return par[PARAM.swash_law] > SHIPPED_LAW or par[PARAM.tail_law] > SHIPPED_LAW


@kernel()
def command_by_shipped_laws(view, seen):
    """Write the commands of those servos that a shipped law moves."""
    par, controls = view.par, view.controls
    if par[PARAM.swash_law] == SHIPPED_LAW:
        front, left, right = cyclic_law(seen, from_element(view.act, FIRST_LAW_STATE), par)
        controls[CONTROL.servo_front] = front
        controls[CONTROL.servo_left] = left
        controls[CONTROL.servo_right] = right
    if par[PARAM.tail_law] == SHIPPED_LAW:
        state = from_element(view.act, FIRST_LAW_STATE + int(par[PARAM.swash_states]))
        controls[CONTROL.servo_tail] = yaw_law(seen, state, par)


@kernel()
def has_failed(view):
    """Return whether one of a vehicle's laws failed; the servos then keep their last commands."""
    return view.act[STATE.law_tick] == _FAILED


@kernel()
def command_by_own_laws(view):
    """Write the laws' commands where one is not shipped."""
    par, act = view.par, view.act
    starts = begin_tick(view)
    seen = seen_now(view, turned(view, attitude(view)), felt(view), servo_positions(view))
    command_by_shipped_laws(view, seen)
    numbers, commands = buffer(_NUMBERS), buffer(COMMANDS)
    for k in range(SEEN):
        numbers[k] = seen[k]
    numbers[SEEN] = 1.0 if starts else 0.0
    swash, tail = par[PARAM.swash_law], par[PARAM.tail_law]
    last = 3 if tail == swash else 2
    works = swash <= SHIPPED_LAW or command_by(view, swash, numbers, commands, 0, last)
    if tail > SHIPPED_LAW and tail != swash:
        works = command_by(view, tail, numbers, commands, 3, 3) and works
    if not works:
        act[STATE.law_tick] = _FAILED


@kernel()
def command_by(view, handle, numbers, commands, first, last):
    """Write one law's commands, from the first to the last servo; return whether it works.

    The servos of a law that this process does not know stay with their caller.

    Args:
        view: of the vehicle.
        handle: of the law.
        numbers: what it sees, and whether it starts, (19,).
        commands: room for them, (4,).
        first: servo.
        last: servo.
    """
    par = view.par
    start, states = FIRST_LAW_STATE, int(par[PARAM.swash_states])
    if first == 3:
        start, states = start + states, int(par[PARAM.tail_states])
    row = row_of(handle, par[PARAM.law_token], states)
    if row == 0:
        m, offsets = view.m, view.offsets
        note(REFUSED, STRANGE_LAW, m, offsets, offsets.name_actuatoradr, view.rotor, handle, 0.0)
        return True
    state = from_element(view.act, start)
    if numbers[SEEN] != 0.0:  # a keyframe may have put the shipped laws' there
        for k in range(states):
            state[k] = 0.0
    works = ask(row, numbers, state, states, commands, first, last)
    if works:
        for k in range(first, last + 1):
            view.controls[CONTROL.servo_front + k] = commands[k]
    return works


@kernel()
def law_states(view):
    """Return how many states the laws of a vehicle have."""
    return int(view.par[PARAM.swash_states]) + int(view.par[PARAM.tail_states])


@kernel()
def begin_tick(view):
    """Keep the laws' states before they act, or put them back if they have acted at this tick.

    So an evaluation can be made again, as `mj_forward` may, and gives the same. Returns whether
    the laws start.
    """
    act, count = view.act, law_states(view)
    state, kept = from_element(act, FIRST_LAW_STATE), from_element(act, FIRST_LAW_STATE + count)
    number = tick_number(view.par, double(view.d, view.offsets.time)) + 1.0
    if math.floor(act[STATE.law_tick]) == number:
        for k in range(count):
            state[k] = kept[k]
        return act[STATE.law_tick] != number
    starts = act[STATE.law_tick] == 0.0
    act[STATE.law_tick] = number + _STARTS if starts else number
    for k in range(count):
        kept[k] = state[k]
    for k in range(3):
        act[STATE.felt_x + k] = act[STATE.feels_x + k]
    return starts


@kernel()
def forget(view):
    """Set all that the laws know to zero, as before they first acted."""
    for k in range(STATE.law_tick, FIRST_LAW_STATE + 2 * law_states(view)):
        view.act[k] = 0.0


@kernel()
def seen_now(view, angles, forces, servos):
    """Return what laws see at this tick.

    Args:
        view: of the vehicle.
        angles: roll, pitch and heading, rad.
        forces: specific, m/s^2, body axes.
        servos: positions of the front, left, right and tail servo, unitised.
    """
    rates, controls = sensor_numbers(view), view.controls
    p, q, r = frames.flip(rates[SENSOR.gyro_x], rates[SENSOR.gyro_y], rates[SENSOR.gyro_z])
    p, q, r = at_sensors(view, p, q, r)
    if view.par[PARAM.faults] != 0.0:
        p, q, r = faults.rates_left(view, p, q, r)
    return Seen(
        double(view.d, view.offsets.time),
        p,
        q,
        r,
        angles[0],
        angles[1],
        angles[2],
        forces[0],
        forces[1],
        forces[2],
        servos[0],
        servos[1],
        servos[2],
        servos[3],
        controls[CONTROL.col],
        controls[CONTROL.lon],
        controls[CONTROL.lat],
        delayed_control(view, CONTROL.ped, last_tick(view)),
    )


@kernel()
def attitude(view):
    """Return roll, pitch and heading, rad."""
    return frames.euler_angles(rotation(view))


@kernel()
def felt(view):
    """Return what the accelerometer felt a time step before this tick, m/s^2, body axes."""
    act = view.act
    return act[STATE.felt_x], act[STATE.felt_y], act[STATE.felt_z]


@kernel()
def servo_positions(view):
    """Return where the front, left, right and tail servo stand, unitised."""
    act = view.act
    return (
        act[STATE.front_position],
        act[STATE.left_position],
        act[STATE.right_position],
        act[STATE.tail_position],
    )


@kernel()
def feel(view):
    """Keep what the accelerometer feels in this time step, for laws that look at it."""
    if has_own_law(view.par):
        seen = sensor_numbers(view)
        forces = frames.flip(seen[SENSOR.imu_ax], seen[SENSOR.imu_ay], seen[SENSOR.imu_az])
        for k in range(3):
            view.act[STATE.feels_x + k] = forces[k]
