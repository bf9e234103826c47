"""Controllers of a vehicle at a tick: what they see, their state, the servos' commands.

And what a manoeuvre adds and a fault takes away between sensors, laws and servos. A fault comes,
and goes, at one of the gyro's ticks, whatever the time step; in a flight without any nothing of it
is computed.
"""

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
    READS_HELD,
    READS_ZERO,
    SENSOR,
    SHIPPED_LAW,
    STATE,
)
from helisim.physics.memory import (
    TIME_TOLERANCE,
    UNKNOWN_LAW,
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

_STARTS = 0.5
"""Added to `law_tick` at a law's first tick."""
_FAILED = -1.0
"""Value of `law_tick` for a law that failed."""
_NUMBERS = SEEN + 1
_INJECTED = len(INJECTION)


@kernel()
def command_servos(view):
    """Write the laws' commands to the four servos; a gyro that restarts has none of its own.

    Nor has a law that failed, or one for whose states there is no room.
    """
    par, controls = view.par, view.controls
    if par[PARAM.planned] == 0.0 and par[PARAM.swash_law] == par[PARAM.tail_law] == NO_LAW:
        return
    if restarts(view):
        forget(view)
        if par[PARAM.restart_neutral] != 0.0:
            for k in range(CONTROL.servo_front, CONTROL.servo_tail + 1):
                controls[k] = 0.0
        return
    if has_failed(view) or FIRST_LAW_STATE + 2 * law_states(view) > states_end(view):
        return
    if par[PARAM.planned] != 0.0:
        for k in range(4):
            law = par[PARAM.tail_law] if k == 3 else par[PARAM.swash_law]
            if law == NO_LAW:
                controls[CONTROL.servo_front + k] = par[PARAM.planned_front + k]
    if has_own_law(par):
        command_by_own_laws(view)
    else:
        begin_tick(view)
        nowhere = (0.0, 0.0, 0.0)
        seen = seen_now(view, nowhere, nowhere, (0.0, 0.0, 0.0, 0.0))  # all that these laws use
        command_by_shipped_laws(view, seen)
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
def command_by_own_laws(view):
    """Write the laws' commands where one is not shipped."""
    par, act = view.par, view.act
    starts = begin_tick(view)
    angles = turned(view, euler_angles(rotation(view)))
    felt = act[STATE.felt_x], act[STATE.felt_y], act[STATE.felt_z]
    front, left = act[STATE.front_position], act[STATE.left_position]
    positions = front, left, act[STATE.right_position], act[STATE.tail_position]
    seen = seen_now(view, angles, felt, positions)
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

    handle: of the law; numbers: what it sees, and whether it starts, (19,); commands: room for
    them, (4,); first: servo; last: servo.
    """
    par = view.par
    start, states = FIRST_LAW_STATE, int(par[PARAM.swash_states])
    if first == 3:
        start, states = start + states, int(par[PARAM.tail_states])
    row = row_of(handle, par[PARAM.law_token], states)
    if row == 0:
        report(view.m, UNKNOWN_LAW, view.rotor)
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


@kernel(forceinline=False)
def seen_now(view, angles, forces, servos):
    """Return what laws see at this tick.

    angles: roll, pitch and heading, rad; forces: specific, m/s^2, body axes; servos: positions of
    the front, left, right and tail servo, unitised.
    """
    rates, controls = sensor_numbers(view), view.controls
    p, q, r = flip(rates[SENSOR.gyro_x], rates[SENSOR.gyro_y], rates[SENSOR.gyro_z])
    if is_injected(view):
        added = injected(view)
        p, q = p + added[INJECTION.rate_p], q + added[INJECTION.rate_q]
        r += added[INJECTION.rate_r]
    if view.par[PARAM.faults] != 0.0:
        p, q, r = rates_read(view, p, q, r)
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
    """Return the attitude that a law sees, rad: that sensed, and a manoeuvre's disturbances.

    angles: roll, pitch and heading, rad.

    Returns:
        The same, disturbed; the heading in (-pi, pi].
    """
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


@kernel()
def faulty_servos(par, time, commands, limits):
    """Return the commands that the four servos can follow, and how fast each can be.

    A servo that is stuck where it is has no speed, one that is stuck elsewhere one command.

    time: of the gyro's last tick, s; commands: of the front, left, right and tail servo, unitised,
    (4,); limits: their rate limits, 1/s, (4,).
    """
    front, front_limit = faulty_servo(par, time, PARAM.front_fault_at, commands[0], limits[0])
    left, left_limit = faulty_servo(par, time, PARAM.left_fault_at, commands[1], limits[1])
    right, right_limit = faulty_servo(par, time, PARAM.right_fault_at, commands[2], limits[2])
    tail, tail_limit = faulty_servo(par, time, PARAM.tail_fault_at, commands[3], limits[3])
    return (front, left, right, tail), (front_limit, left_limit, right_limit, tail_limit)


@kernel()
def faulty_servo(par, time, fault, command, limit):
    """Return command and speed that one servo's fault leaves.

    time: of the gyro's last tick, s; fault: index of the fault's four parameters: since when (s),
    rate limit (1/s), lowest and highest command; command: unitised; limit: the servo's own rate
    limit, 1/s.
    """
    since, rate_limit, low, high = par[fault], par[fault + 1], par[fault + 2], par[fault + 3]
    if time < since - TIME_TOLERANCE:
        return command, limit
    return min(high, max(low, command)), min(rate_limit, limit)


@kernel()
def restarts(view):
    """Return whether the gyro is restarting now."""
    par = view.par
    if par[PARAM.faults] == 0.0:
        return False
    time = last_tick(view) + TIME_TOLERANCE
    return par[PARAM.restart_at] <= time < par[PARAM.restart_until]


@kernel()
def rates_read(view, p, q, r):
    """Return the rates that the gyro reads, rad/s: a dropped one is 0, or what it read last.

    p: sensed roll rate, rad/s; q: sensed pitch rate, rad/s; r: sensed yaw rate, rad/s.
    """
    par, act, time = view.par, view.act, last_tick(view) + TIME_TOLERANCE
    if par[PARAM.dropout_at] <= time < par[PARAM.dropout_until]:
        p = dropped(par[PARAM.dropout_p], p, act[STATE.read_p])
        q = dropped(par[PARAM.dropout_q], q, act[STATE.read_q])
        r = dropped(par[PARAM.dropout_r], r, act[STATE.read_r])
    act[STATE.read_p], act[STATE.read_q], act[STATE.read_r] = p, q, r
    return p, q, r


@kernel()
def dropped(reading, rate, held):
    """Return a rate as it reads when dropped out in one of the ways, or not."""
    if reading == READS_ZERO:
        return 0.0
    return held if reading == READS_HELD else rate
