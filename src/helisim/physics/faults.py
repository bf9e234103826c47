"""What a fault leaves of servos and gyro. Nothing of this is computed in a flight without any.

A fault comes, and goes, at one of the gyro's ticks, whatever the time step.
"""

from helisim.physics.kernel import kernel
from helisim.physics.layout import STATE
from helisim.physics.params import PARAM, READS_HELD, READS_ZERO
from helisim.physics.timing import TIME_TOLERANCE, last_tick


@kernel()
def servos_left(par, time, commands, limits):
    """Return the commands that the four servos can follow, and how fast each can be.

    A servo that is stuck where it is has no speed, one that is stuck elsewhere one command.

    Args:
        par: parameters.
        time: of the gyro's last tick, s.
        commands: of the front, left, right and tail servo, unitised, (4,).
        limits: their rate limits, 1/s, (4,).
    """
    front, front_limit = servo_left(par, time, PARAM.front_fault_at, commands[0], limits[0])
    left, left_limit = servo_left(par, time, PARAM.left_fault_at, commands[1], limits[1])
    right, right_limit = servo_left(par, time, PARAM.right_fault_at, commands[2], limits[2])
    tail, tail_limit = servo_left(par, time, PARAM.tail_fault_at, commands[3], limits[3])
    return (front, left, right, tail), (front_limit, left_limit, right_limit, tail_limit)


@kernel()
def servo_left(par, time, fault, command, limit):
    """Return command and speed that one servo's fault leaves.

    Args:
        par: parameters.
        time: of the gyro's last tick, s.
        fault: index of the fault's four parameters: since when (s), rate limit (1/s), lowest and
            highest command.
        command: unitised.
        limit: the servo's own rate limit, 1/s.
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
def rates_left(view, p, q, r):
    """Return the rates that the gyro reads, rad/s: a dropped one is 0, or what it read last.

    Args:
        view: of the vehicle.
        p: sensed roll rate, rad/s.
        q: sensed pitch rate, rad/s.
        r: sensed yaw rate, rad/s.
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
