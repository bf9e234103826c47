"""Controllers of a vehicle at a tick: their inputs, states and servo commands, with faults."""

import math

from helisim.physics.gyro import Seen, cyclic_law, yaw_law
from helisim.physics.kernel import buffer, from_element, kernel
from helisim.physics.laws import COMMANDS, SEEN, ask, row_of
from helisim.physics.layout import (
    CONTROL,
    FIRST_LAW_STATE,
    HISTORY,
    INJECTION,
    NO_LAW,
    PARAM,
    SENSOR,
    SHIPPED_LAW,
    STATE,
)
from helisim.physics.memory import (
    delayed_control,
    double,
    doubles,
    last_tick,
    long,
    report,
    sensor_numbers,
    states_end,
    tick_number,
)
from helisim.physics.motion import euler_angles, flip, rotation

_STARTS, _FAILED = 0.5, -1.0
_NUMBERS = SEEN + 1
_INJECTED = len(INJECTION)


@kernel()
def command_servos(view):
    """Write the laws' commands to the four servos."""
    par, controls = view.par, view.controls
    if par[PARAM.planned] == 0.0 and par[PARAM.swash_law] == par[PARAM.tail_law] == NO_LAW:
        return
    if has_failed(view) or FIRST_LAW_STATE + 2 * law_states(view) > states_end(view):
        return
    if par[PARAM.planned] != 0.0:
        for k in range(4):
            law = par[PARAM.tail_law] if k == 3 else par[PARAM.swash_law]
            if law == NO_LAW:
                controls[CONTROL.servo_front + k] = par[PARAM.planned_front + k]
    starts, seen = begin_tick(view), seen_now(view)
    command_by_shipped_laws(view, seen)
    if has_own_law(par):
        command_by_own_laws(view, seen, starts)
    if is_injected(view):
        added = injected(view)
        for k in range(4):
            controls[CONTROL.servo_front + k] += added[INJECTION.command_front + k]


@kernel()
def has_own_law(par):
    """Return whether one of a vehicle's laws is not shipped."""
    return par[PARAM.swash_law] > SHIPPED_LAW or par[PARAM.tail_law] > SHIPPED_LAW


@kernel(forceinline=False)
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
def command_by_own_laws(view, seen, starts):
    """Write the laws' commands where one is not shipped; starts: whether it is their first tick."""
    numbers, commands = buffer(_NUMBERS), buffer(COMMANDS)
    for k in range(SEEN):
        numbers[k] = seen[k]
    numbers[SEEN] = 1.0 if starts else 0.0
    swash, tail = view.par[PARAM.swash_law], view.par[PARAM.tail_law]
    last = 3 if tail == swash else 2
    works = swash <= SHIPPED_LAW or command_by(view, swash, numbers, commands, 0, last)
    if tail > SHIPPED_LAW and tail != swash:
        works = command_by(view, tail, numbers, commands, 3, 3) and works
    if not works:
        view.act[STATE.law_tick] = _FAILED


@kernel()
def command_by(view, handle, numbers, commands, first, last):
    """Write a law's commands, (4,); return if they are finite; numbers: `Seen`, starts, (19,)."""
    par = view.par
    start, states = FIRST_LAW_STATE, int(par[PARAM.swash_states])
    if first == 3:
        start, states = start + states, int(par[PARAM.tail_states])
    row = row_of(handle, par[PARAM.law_token], states)
    if row == 0:
        report(view.m)
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
    """Keep the laws' states before they act, or put them back if they have acted at this tick."""
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


@kernel(forceinline=False)
def seen_now(view):
    """Return `Seen` of this tick."""
    rates, controls, act = sensor_numbers(view), view.controls, view.act
    phi, theta, psi = turned(view, euler_angles(rotation(view)))
    p, q, r = flip(rates[SENSOR.gyro_x], rates[SENSOR.gyro_y], rates[SENSOR.gyro_z])
    if is_injected(view):
        added = injected(view)
        p, q = p + added[INJECTION.rate_p], q + added[INJECTION.rate_q]
        r += added[INJECTION.rate_r]
    return Seen(
        double(view.d, view.offsets.time),
        p,
        q,
        r,
        phi,
        theta,
        psi,
        act[STATE.felt_x],
        act[STATE.felt_y],
        act[STATE.felt_z],
        act[STATE.front_position],
        act[STATE.left_position],
        act[STATE.right_position],
        act[STATE.tail_position],
        controls[CONTROL.col],
        controls[CONTROL.lon],
        controls[CONTROL.lat],
        delayed_control(view, CONTROL.ped, last_tick(view)),
    )


@kernel()
def feel(view):
    """Keep what the accelerometer feels in this time step, for laws that look at it."""
    if has_own_law(view.par):
        seen = sensor_numbers(view)
        forces = flip(seen[SENSOR.imu_ax], seen[SENSOR.imu_ay], seen[SENSOR.imu_az])
        for k in range(3):
            view.act[STATE.feels_x + k] = forces[k]


@kernel()
def is_injected(view):
    """Return whether a manoeuvre's numbers, by `INJECTION`, are in `mjData.userdata`."""
    if view.par[PARAM.excitation] != HISTORY:
        return False
    return long(view.m, view.offsets.nuserdata) >= _INJECTED


@kernel()
def injected(view):
    """Return what a manoeuvre adds in this time step, by `INJECTION`."""
    return doubles(view.d, view.offsets.userdata)


@kernel()
def at_actuators(view, commands):
    """Return what reaches the four servos: their commands, and a manoeuvre's disturbances."""
    if not is_injected(view):
        return commands
    added = injected(view)
    return (
        commands[0] + added[INJECTION.actuator_front],
        commands[1] + added[INJECTION.actuator_left],
        commands[2] + added[INJECTION.actuator_right],
        commands[3] + added[INJECTION.actuator_tail],
    )


@kernel()
def turned(view, angles):
    """Return roll, pitch and heading, rad, disturbed by a manoeuvre; heading in (-pi, pi]."""
    if not is_injected(view):
        return angles
    added = injected(view)
    psi = angles[2]
    if added[INJECTION.angle_psi] != 0.0:
        psi = math.pi - (math.pi - psi - added[INJECTION.angle_psi]) % (2.0 * math.pi)
    return (
        angles[0] + added[INJECTION.angle_phi],
        angles[1] + added[INJECTION.angle_theta],
        psi,
    )
