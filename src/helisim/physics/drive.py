"""The rotor's drive: an ideal governor, or an engine with freewheel and governor.

The ideal one keeps the commanded speed, whatever torque that takes. An engine turns the inertia of
all that goes round with the main shaft, against the torques of main and tail rotor and friction:

    I dOmega/dt = Q_engine - Q_main - ratio Q_tail - Q_friction

Its states are the rotor's speed over the nominal one, the engine's throttle (0 to 1), which lags,
and the governor's integral, a throttle too. The rotor's speed is that through the air: what a body
that yaws at r adds to it is 1/178 at 1 rad/s of a JR700, and is left out.

The freewheel lets go smoothly: below a small torque (`_GRIP`) the engine's hold on the shaft fades
as a cubic, with the torque and its slope continuous. So nothing is faster than the electric motor's
own mode, its back-EMF against the inertia, about 17 1/s in a JR700: 3 % of it in a step of 2 ms.
"""

from collections import namedtuple

from helisim.physics.inflow import soft_limit
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, STATE
from helisim.physics.memory import commanded_speed
from helisim.physics.motion import to_shaft

IDEAL, MOTOR = 0.0, 1.0
"""Values of `PARAM.drive_governor`."""

ELECTRIC, COMBUSTION = 0.0, 1.0
"""Values of `PARAM.drive_engine`."""

_CUT = 0.05
"""Commanded speed, over the nominal one, below which the throttle is shut."""
_GRIP = 0.01
"""Share of the torque that gives the rotor its speed within a second; the freewheel grips above."""
_SLIPPING = 0.02
"""Speed over the nominal one below which friction fades."""
_CAUGHT = 0.3
"""Above this speed a rotor is caught after a cut with the throttle it had; below it starts anew."""
_FORGETS = 1.0
"""s, in which the governor forgets that throttle once the rotor stands."""
_REACH = 0.05
"""Error of speed, over the nominal one, beyond which the governor doesn't act any harder."""
_HEADROOM = 0.05
"""Throttle left, or share of the current's limit, at which the integral begins to be held."""
_BEHIND = 0.1
"""Throttle that the engine is yet to take up, at which the integral is held."""
_LINEAR = 0.9
"""Share of its limit up to which the current is not limited at all."""


Drive = namedtuple("Drive", "speed_rate engine_rate governor_rate mast power")
"""Rates, torque and power of the drive.

speed_rate: of the rotor's speed over the nominal one, 1/s; engine_rate: of the engine's
throttle, 1/s; governor_rate: of the governor's integral, 1/s; mast: torque that turns the main
rotor, N m; the body feels its reaction; power: that reaches the two shafts and what turns with
them, W; a shaft turns against the body.
"""


@kernel()
def drive(view, flow, step):
    """Return what the `Drive` does: the mean over a time step (s), or now at 0."""
    par, act = view.par, view.act
    ratio = par[PARAM.tail_speed] / par[PARAM.main_speed]
    tail = ratio * flow.tail.torque
    speed_rate, engine_rate, governor_rate = 0.0, 0.0, 0.0
    mast = flow.main.torque
    if par[PARAM.drive_governor] != IDEAL:
        commanded = commanded_speed(view)
        collective = (flow.main.pitch - par[PARAM.main_pitch_trim]) / par[PARAM.main_pitch_range]
        load = flow.main.torque + tail
        speed, engine, governor = act[STATE.speed], act[STATE.engine], act[STATE.governor]
        for _ in range(2):
            at = speed + 0.5 * step * speed_rate
            throttle = engine + 0.5 * step * engine_rate
            integral = governor + 0.5 * step * governor_rate
            engine_rate, governor_rate = governing(
                par, commanded, collective, at, throttle, integral
            )
            turning = shaft_torque(par, throttle, at) - friction(par, at)
            speed_rate = (turning - load) / (par[PARAM.drive_inertia] * par[PARAM.main_speed])
            mast = turning - tail
    spin = flow.speed * par[PARAM.main_speed]
    power = (mast + tail) * spin
    power -= mast * par[PARAM.main_direction] * (flow.hub.r + to_shaft(par, flow.air).r)
    power -= flow.tail.torque * par[PARAM.tail_direction] * (flow.motion.q + flow.air.q)
    return Drive(speed_rate, engine_rate, governor_rate, mast, power)


@kernel()
def governing(par, commanded, collective, speed, throttle, integral):
    """Return the rates of the engine's throttle and of the governor's integral, 1/s.

    Proportional and integral in the error of speed, and in the collective, whose torque it meets
    before the speed has fallen. The integral grows no faster than from nothing to full throttle in
    the time of a spool-up, which makes that from rest. It is held where throttle or current can't
    grow, where the engine is behind, and where the freewheel has let go. While the throttle is cut
    it is kept as long as the rotor turns, for the engine to catch it again (bail-out), which takes
    the throttle up at a rate of its own.

    commanded: speed over the nominal one; near 0 the throttle is cut; collective: unitised; speed:
    of the rotor, over the nominal one; throttle: of the engine, 0 to 1; integral: the governor's.
    """
    wanted, growth = 0.0, 0.0
    if commanded < _CUT:
        growth = -integral / _FORGETS * max(0.0, 1.0 - speed / _CAUGHT)
    else:
        error = min(_REACH, max(-_REACH, commanded - speed))
        raw = integral + par[PARAM.drive_collective_gain] * collective
        raw += par[PARAM.drive_k_p] * error * speed
        growth = min(par[PARAM.drive_k_i] * error, 1.0 / par[PARAM.drive_spool_up])
        growth *= growth_share(par, raw, throttle, speed, error)
        wanted = min(1.0, max(0.0, raw))
    rate = (wanted - throttle) / par[PARAM.drive_lag]
    return min(rate, 1.0 / par[PARAM.drive_bail_out]), growth


@kernel()
def growth_share(par, raw, throttle, speed, error):
    """Return the share, 0 to 1, of its growth that the governor's integral is let to have.

    raw: throttle that the governor asks for, unlimited; throttle: of the engine; speed: of the
    rotor, over the nominal one; error: speed that is missing.
    """
    if error < 0.0:
        held = engine_torque(par, throttle, speed) / grip(par)
        return min(1.0, max(0.0, min(raw / _HEADROOM, held)))
    left = min(1.0 - raw, _BEHIND - (raw - throttle)) / _HEADROOM
    if par[PARAM.drive_engine] == ELECTRIC:
        share = motor_current(par, throttle, speed) / par[PARAM.drive_current_limit]
        left = min(left, (1.0 - share) / _HEADROOM)
    return min(1.0, max(0.0, left))


@kernel()
def motor_current(par, throttle, speed):
    """Return the current that an electric motor would take, A: negative where it would brake.

    The throttle's share of the battery's voltage, less the back-EMF, over all resistance.

    throttle: 0 to 1; speed: of the rotor, over the nominal one.
    """
    turning = speed * par[PARAM.main_speed] * par[PARAM.drive_gear]
    emf = turning / par[PARAM.drive_speed_constant]
    return (throttle * par[PARAM.drive_voltage] - emf) / par[PARAM.drive_resistance]


@kernel()
def engine_torque(par, throttle, speed):
    """Return the torque at the main shaft that the engine would turn it with, N m.

    Negative where it would brake it. Electric: proportional to the current beyond that of no load.
    Combustion: of a spark-ignition engine, whose power is P (x + x^2 - x^3) at x of the speed of
    its greatest, P (Jazar, Vehicle Dynamics, section 4.1), times the throttle.

    throttle: 0 to 1; speed: of the rotor, over the nominal one.
    """
    gear = par[PARAM.drive_gear]
    if par[PARAM.drive_engine] == ELECTRIC:
        wanted = motor_current(par, throttle, speed)
        current = soft_limit(wanted, par[PARAM.drive_current_limit], _LINEAR)
        return gear / par[PARAM.drive_speed_constant] * (current - par[PARAM.drive_no_load_current])
    best = par[PARAM.drive_power_speed]
    x = speed * par[PARAM.main_speed] * gear / best
    return gear * throttle * par[PARAM.drive_power] / best * (1.0 + x - x * x)


@kernel()
def shaft_torque(par, throttle, speed):
    """Return the torque that reaches the main shaft through the freewheel, N m: never negative.

    throttle: 0 to 1; speed: of the rotor, over the nominal one.
    """
    torque, whole = engine_torque(par, throttle, speed), grip(par)
    if torque >= whole:
        return torque
    if torque <= 0.0:
        return 0.0
    return torque**2 * (2.0 * whole - torque) / whole**2


@kernel()
def grip(par):
    """Return the torque at which the freewheel has all its grip, N m."""
    return _GRIP * par[PARAM.drive_inertia] * par[PARAM.main_speed]


@kernel()
def friction(par, speed):
    """Return the torque of gears and bearings on the main shaft, N m."""
    return par[PARAM.drive_friction] * min(1.0, speed / _SLIPPING)


def throttle_for(par, torque):
    """Return the throttle at which the engine holds the nominal speed against a torque.

    torque: at the main shaft, of both rotors, N m.

    Returns:
        0 to 1; more than 1 where the engine is too weak.
    """
    low, high = 0.0, 2.0
    wanted = torque + friction(par, 1.0)
    while (middle := 0.5 * (low + high)) not in (low, high):
        if shaft_torque(par, middle, 1.0) < wanted:
            low = middle
        else:
            high = middle
    return high
