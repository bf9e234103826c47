"""What a manoeuvre adds at each time step: to sticks, servo commands, actuators and sensors."""

import math

from helisim.physics.kernel import kernel
from helisim.physics.layout import CONTROL, INJECTION
from helisim.physics.memory import doubles, long
from helisim.physics.params import HISTORY, PARAM

_NUMBERS = len(INJECTION)


@kernel()
def is_injected(view):
    """Return whether a manoeuvre's numbers, by `INJECTION`, are in `mjData.userdata`."""
    if view.par[PARAM.excitation] != HISTORY:
        return False
    return long(view.m, view.offsets.nuserdata) >= _NUMBERS


@kernel()
def injected(view):
    """Return what a manoeuvre adds in this time step, by `INJECTION`."""
    return doubles(view.d, view.offsets.userdata)


@kernel()
def add_to_commands(view):
    """Add a manoeuvre to the commands that have just been given to the four servos."""
    if is_injected(view):
        added = injected(view)
        for k in range(4):
            view.controls[CONTROL.servo_front + k] += added[INJECTION.command_front + k]


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
def at_sensors(view, p, q, r):
    """Return the rates that the gyro reads, rad/s: those sensed, and a manoeuvre's disturbances."""
    if not is_injected(view):
        return p, q, r
    added = injected(view)
    return p + added[INJECTION.rate_p], q + added[INJECTION.rate_q], r + added[INJECTION.rate_r]


@kernel()
def turned(view, angles):
    """Return the attitude that a law sees, rad: that sensed, and a manoeuvre's disturbances.

    Args:
        view: of the vehicle.
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
