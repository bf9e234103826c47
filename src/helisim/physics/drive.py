"""The rotor's drive: an ideal governor, or an engine with freewheel and governor.

I dOmega/dt = Q_engine - Q_main - ratio Q_tail - Q_friction, with the rotor's speed through the air
(the body's yaw rate is neglected). `speed` is the rotor's over the nominal one, `throttle` 0 to 1.
The freewheel releases smoothly: below a torque of `_GRIP` the engine's torque fades as a cubic.
"""

from collections import namedtuple

from helisim.physics.inflow import soft_limit
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, STATE
from helisim.physics.memory import commanded_speed
from helisim.physics.motion import to_shaft

IDEAL, MOTOR = 0.0, 1.0  # values of `PARAM.drive_governor`

ELECTRIC, COMBUSTION = 0.0, 1.0  # values of `PARAM.drive_engine`

_CUT = 0.05  # commanded speed, over the nominal one, that shuts the throttle
_GRIP = 0.01  # share of the torque that gives full speed in a second; the freewheel grips above
_SLIPPING = 0.02  # speed over the nominal one below which friction fades
_CAUGHT = 0.3  # speed above which a rotor is caught with its old throttle
_FORGETS = 1.0  # s, in which the governor forgets that throttle at a standstill
_REACH = 0.05  # error of speed beyond which the governor acts no harder
_HEADROOM = 0.05  # throttle, or share of the current's limit, at which the integral is held
_BEHIND = 0.1  # throttle that the engine is yet to take up, at which the integral is held
_LINEAR = 0.9  # share of its limit up to which the current is not limited at all


Drive = namedtuple("Drive", "speed_rate engine_rate governor_rate mast power")
"""speed_rate, engine_rate, governor_rate: 1/s; mast: torque on the main rotor, N m; power: W."""


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
    """Return the rates of throttle and integral, 1/s; `commanded` near 0 cuts the throttle."""
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
    """Return the share, 0 to 1, of the integral's growth allowed; raw: the unlimited throttle."""
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
    """Return the current of an electric motor, A: negative where it would brake."""
    turning = speed * par[PARAM.main_speed] * par[PARAM.drive_gear]
    emf = turning / par[PARAM.drive_speed_constant]
    return (throttle * par[PARAM.drive_voltage] - emf) / par[PARAM.drive_resistance]


@kernel()
def engine_torque(par, throttle, speed):
    """Return the engine's torque at the main shaft, N m."""
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
    """Return the torque that reaches the main shaft through the freewheel, N m: never negative."""
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
    """Return the throttle that holds nominal speed against a torque, N m; above 1: too weak."""
    low, high = 0.0, 2.0
    wanted = torque + friction(par, 1.0)
    while (middle := 0.5 * (low + high)) not in (low, high):
        if shaft_torque(par, middle, 1.0) < wanted:
            low = middle
        else:
            high = middle
    return high
