"""The rotor's drive: an ideal governor, or an engine with supply, freewheel and governor.

I dOmega/dt = Q_engine - Q_main - ratio Q_tail - Q_friction. Omega is that through the air; engine,
governor and tail rotor have the shaft's in the body, less by its yaw rate. The body feels the main
rotor's torque and its blades' inertia. `speed` is over the nominal one, `throttle` 0 to 1. The
freewheel releases smoothly: below a torque of `_GRIP` the engine's torque fades as a cubic.
"""

from collections import namedtuple

from helisim.physics.battery import battery_current, battery_rates, supply
from helisim.physics.inflow import soft_limit
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, STATE
from helisim.physics.memory import commanded_speed
from helisim.physics.motion import to_shaft

IDEAL, MOTOR = 0.0, 1.0  # values of `PARAM.drive_governor`

ELECTRIC, COMBUSTION, TURBINE = 0.0, 1.0, 2.0  # values of `PARAM.drive_engine`

_CUT = 0.05  # commanded speed, over the nominal one, that shuts the throttle
_GRIP = 0.01  # share of the torque that gives full speed in a second; the freewheel grips above
_SLIPPING = 0.02  # speed over the nominal one below which friction fades
_CAUGHT = 0.3  # speed above which a rotor is caught with its old throttle
_FORGETS = 1.0  # s, in which the governor forgets that throttle at a standstill
_REACH = 0.05  # error of speed beyond which the governor acts no harder
_HEADROOM = 0.05  # throttle, or share of the current's limit, at which the integral is held
_BEHIND = 0.1  # throttle that the engine is yet to take up, at which the integral is held
_LINEAR = 0.9  # share of its limit up to which the current is not limited at all


Drive = namedtuple("Drive", "rates mast power voltage current")
"""rates: of the states from speed to warming, 1/s, (7,); mast: torque on the main rotor, N m.

power: W, of the engine less friction; voltage, current: of the battery, V and A.
"""


@kernel()
def drive(view, flow, step):
    """Return what the `Drive` does: the mean over a time step (s), or now at 0."""
    par, act = view.par, view.act
    tail = par[PARAM.tail_speed] / par[PARAM.main_speed] * flow.tail.torque
    if par[PARAM.drive_governor] == IDEAL:
        mast = flow.main.torque
        power = (mast + tail) * (flow.speed * par[PARAM.main_speed])
        power -= mast * par[PARAM.main_direction] * (flow.hub.r + to_shaft(par, flow.air).r)
        power -= flow.tail.torque * par[PARAM.tail_direction] * (flow.motion.q + flow.air.q)
        return Drive((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), mast, power, 0.0, 0.0)
    commanded, lag = commanded_speed(view), par[PARAM.drive_lag]
    collective = (flow.main.pitch - par[PARAM.main_pitch_trim]) / par[PARAM.main_pitch_range]
    load, is_turbine = flow.main.torque + tail, par[PARAM.drive_engine] == TURBINE
    has_battery = par[PARAM.drive_supply] != 0.0
    speed_rate = engine_rate = governor_rate = fuel_rate = 0.0
    discharge_rate = polarisation_rate = warming_rate = turning = current = voltage = 0.0
    for _ in range(2):
        at = flow.shaft + 0.5 * step * speed_rate
        engine = throttle = act[STATE.engine] + 0.5 * step * engine_rate
        integral = act[STATE.governor] + 0.5 * step * governor_rate
        polarisation = act[STATE.polarisation] + 0.5 * step * polarisation_rate
        warming = act[STATE.warming] + 0.5 * step * warming_rate
        discharge = act[STATE.discharge] + 0.5 * step * discharge_rate
        source = supply(par, discharge, polarisation, warming)
        if is_turbine:
            fuel = act[STATE.fuel] + 0.5 * step * fuel_rate
            engine_rate = (fuel - engine) / lag
            throttle += par[PARAM.drive_lead] * engine_rate
            fuel_rate, governor_rate = governing(
                par, commanded, collective, at, fuel, integral, source
            )
        else:
            engine_rate, governor_rate = governing(
                par, commanded, collective, at, throttle, integral, source
            )
        gripping = shaft_torque(par, throttle, at, source)
        turning = gripping - friction(par, at)
        speed_rate = (turning - load) / (par[PARAM.drive_inertia] * par[PARAM.main_speed])
        if has_battery:
            current = drawn(par, throttle, at, gripping, source)
            voltage = source.voltage - source.resistance * current
            discharge_rate, polarisation_rate, warming_rate = battery_rates(
                par, source, current, polarisation, warming
            )
        if step == 0.0:
            break
    rates = (
        speed_rate,
        engine_rate,
        governor_rate,
        fuel_rate,
        discharge_rate,
        polarisation_rate,
        warming_rate,
    )
    power = turning * flow.shaft * par[PARAM.main_speed]
    mast = flow.main.torque + par[PARAM.drive_mast_inertia] * par[PARAM.main_speed] * speed_rate
    return Drive(rates, mast, power, voltage, current)


@kernel()
def drawn(par, throttle, speed, torque, source):
    """Return the battery's current, A, with a torque behind the freewheel, N m."""
    if throttle <= 0.0:
        return 0.0
    constant = par[PARAM.drive_speed_constant]
    amperes = par[PARAM.drive_no_load_current] + torque * constant / par[PARAM.drive_gear]
    emf = speed * par[PARAM.main_speed] * par[PARAM.drive_gear] / constant
    volts = emf + par[PARAM.drive_resistance] * amperes
    # slipping, the motor turns more slowly than the rotor: as the throttle lets it without load
    return battery_current(source, min(volts, throttle * source.voltage), amperes)


@kernel()
def governing(par, commanded, collective, speed, throttle, integral, source):
    """Return the rates of throttle and integral, 1/s; `commanded` near 0 cuts the throttle.

    A turbine's governor moves the fuel flow; with a droop none integrates.
    """
    wanted, growth, fastest = 0.0, 0.0, par[PARAM.drive_bail_out]
    if commanded < _CUT:
        growth = -integral / _FORGETS * max(0.0, 1.0 - speed / _CAUGHT)
    elif par[PARAM.drive_droop] != 0.0:
        wanted = integral + par[PARAM.drive_collective_gain] * collective
        wanted = min(1.0, max(0.0, wanted + (commanded - speed) / par[PARAM.drive_droop]))
        fastest = par[PARAM.drive_spool_up] if speed < _CAUGHT else fastest
    else:
        error = min(_REACH, max(-_REACH, commanded - speed))
        raw = integral + par[PARAM.drive_collective_gain] * collective
        raw += par[PARAM.drive_k_p] * error * speed
        growth = min(par[PARAM.drive_k_i] * error, 1.0 / par[PARAM.drive_spool_up])
        growth *= growth_share(par, raw, throttle, speed, error, source)
        wanted = min(1.0, max(0.0, raw))
    lag = PARAM.drive_fuel_lag if par[PARAM.drive_engine] == TURBINE else PARAM.drive_lag
    return min((wanted - throttle) / par[lag], 1.0 / fastest), growth


@kernel()
def growth_share(par, raw, throttle, speed, error, source):
    """Return the share, 0 to 1, of the integral's growth allowed; raw: the unlimited throttle."""
    if error < 0.0:
        held = engine_torque(par, throttle, speed, source) / grip(par)
        return min(1.0, max(0.0, min(raw / _HEADROOM, held)))
    left = min(1.0 - raw, _BEHIND - (raw - throttle)) / _HEADROOM
    if par[PARAM.drive_engine] == ELECTRIC:
        share = motor_current(par, throttle, speed, source) / par[PARAM.drive_current_limit]
        left = min(left, (1.0 - share) / _HEADROOM)
    return min(1.0, max(0.0, left))


@kernel()
def motor_current(par, throttle, speed, source):
    """Return the current of an electric motor, A: negative where it would brake.

    The speed controller takes that current times the throttle of the battery.
    """
    emf = speed * par[PARAM.main_speed] * par[PARAM.drive_gear] / par[PARAM.drive_speed_constant]
    resistance = par[PARAM.drive_resistance] + throttle**2 * source.resistance
    return (throttle * source.voltage - emf) / resistance


@kernel()
def engine_torque(par, throttle, speed, source):
    """Return the engine's torque at the main shaft, N m."""
    gear = par[PARAM.drive_gear]
    if par[PARAM.drive_engine] == ELECTRIC:
        wanted = motor_current(par, throttle, speed, source)
        current = soft_limit(wanted, par[PARAM.drive_current_limit], _LINEAR)
        return gear / par[PARAM.drive_speed_constant] * (current - par[PARAM.drive_no_load_current])
    best = par[PARAM.drive_power_speed]
    x = speed * par[PARAM.main_speed] * gear / best
    bend = 2.0 - x if par[PARAM.drive_engine] == TURBINE else 1.0 + x - x * x
    return gear * throttle * par[PARAM.drive_power] / best * bend


@kernel()
def shaft_torque(par, throttle, speed, source):
    """Return the torque that reaches the main shaft through the freewheel, N m: never negative."""
    torque, whole = max(0.0, engine_torque(par, throttle, speed, source)), grip(par)
    return torque if torque >= whole else torque**2 * (2.0 * whole - torque) / whole**2


@kernel()
def grip(par):
    """Return the torque at which the freewheel has all its grip, N m."""
    return _GRIP * par[PARAM.drive_inertia] * par[PARAM.main_speed]


@kernel()
def friction(par, speed):
    """Return the torque of gears and bearings on the main shaft, N m."""
    return par[PARAM.drive_friction] * min(1.0, max(-1.0, speed / _SLIPPING))


def throttle_for(par, torque, source):
    """Return the throttle that holds nominal speed against a torque, N m; above 1: too weak."""
    low, high = 0.0, 2.0
    wanted = torque + friction(par, 1.0)
    while (middle := 0.5 * (low + high)) not in (low, high):
        if shaft_torque(par, middle, 1.0, source) < wanted:
            low = middle
        else:
            high = middle
    return high
