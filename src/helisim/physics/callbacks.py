"""What MuJoCo calls in every evaluation of the dynamics, written for numba.

Each function takes the addresses of mjModel and mjData and the tuple of field offsets. They
read and write nothing but those two, so any number of threads and vehicles can share them.
"""

import math

import mujoco

from helisim.physics import controller, faults
from helisim.physics.air import write_turbulence_rates
from helisim.physics.body import apply_wrench, contact_force
from helisim.physics.commands import notice_others, remember
from helisim.physics.drive import drive
from helisim.physics.dynamic_inflow import keep_tilt_and_inflow_rates
from helisim.physics.examination import examine, examine_idle, examine_idler
from helisim.physics.flapping import tilt_rates
from helisim.physics.flow import flow, flow_later
from helisim.physics.injection import at_actuators
from helisim.physics.kernel import kernel
from helisim.physics.layout import CONTROL, SENSOR, STATE
from helisim.physics.loads import heat, wrench
from helisim.physics.memory import (
    buffer,
    is_rotor,
    sensor_numbers,
    states_end,
    vehicles,
    view_of,
)
from helisim.physics.params import PARAM
from helisim.physics.pilot import fly
from helisim.physics.servo import write_servo_rates
from helisim.physics.timing import held_for, is_tick, last_tick

_ACCELERATION_STAGE = int(mujoco.mjtStage.mjSTAGE_ACC)
_DRIVEN = STATE.tail_rate + 1
"""The first states of a vehicle, those of the servos, which held commands alone drive."""
_RATES_KEPT = STATE.flap_a_rate - STATE.flap_a
"""How far behind the rotor's states their rates are kept."""


@kernel()
def passive(m, d, offsets):
    """Add the aerodynamic forces of every vehicle: what mjcb_passive does.

    What its rotors do is found here, once in each evaluation, and all that follows from it is
    written at once. MuJoCo clears `act_dot` afterwards, so the rates of the rotor's states wait
    among the activations.
    """
    examine_idle(m, d, offsets)
    for view in vehicles(m, d, offsets):
        step = held_for(view)
        past = flow(view, 0.5 * step)
        keep_disc_rates(view, past, step)
        if step > 0.0 and view.par[PARAM.main_dynamic_inflow] != 0.0:
            mean = view.act[STATE.inflow_0] + step * view.act[STATE.inflow_0_rate]
            past = flow_later(view, past, mean, 0.5 * step)
        mast = keep_drive_rates(view, past, step)
        a = view.act[STATE.flap_a] + step * view.act[STATE.flap_a_rate]
        b = view.act[STATE.flap_b] + step * view.act[STATE.flap_b_rate]
        apply_wrench(view, wrench(view.par, a, b, past, mast))


@kernel()
def keep_disc_rates(view, past, step):
    """Keep the derivatives of tilt and inflow, their mean over a step (s), or now at 0."""
    act = view.act
    if view.par[PARAM.main_dynamic_inflow] != 0.0:
        keep_tilt_and_inflow_rates(view, past, step)
        return
    act[STATE.flap_a_rate], act[STATE.flap_b_rate] = tilt_rates(view, past, step)
    for k in range(STATE.inflow_0_rate, STATE.inflow_c_rate + 1):
        act[k] = 0.0


@kernel()
def keep_drive_rates(view, past, step):
    """Keep the derivatives of rotor speed and engine, likewise.

    Returns:
        The torque that turns the main rotor, N m.
    """
    act = view.act
    driven = drive(view, past, step)
    act[STATE.speed_rate] = driven.speed_rate
    act[STATE.engine_rate] = driven.engine_rate
    act[STATE.governor_rate] = driven.governor_rate
    return driven.mast


@kernel()
def control(m, d, offsets):
    """Fly every vehicle: pilot to sticks, gyro to servo commands. What mjcb_control does.

    Both act at the gyro's ticks; in between, sticks and servo commands are held. A model that is
    new is examined first.
    """
    examine(m, d, offsets)
    for view in vehicles(m, d, offsets):
        if view.sensors < 0 or not is_tick(view):
            continue
        if view.par[PARAM.pilot_on] != 0.0:
            fly(view)
        if view.par[PARAM.gyro_on] != 0.0:
            notice_others(view)
            controller.command_servos(view)
            remember(view)


@kernel()
def activation_rates(m, d, offsets, actuator):
    """Write the derivatives of a vehicle's activations, at the turn of its rotor, the last.

    What mjcb_act_dyn does. Those of the rotor were found with the forces.
    """
    if not is_rotor(m, offsets, actuator):
        return 0.0
    view = view_of(m, d, offsets, actuator)
    commands, limits = held_commands(view)
    step = held_for(view)
    if step > 0.0:
        write_mean_servo_rates(view.par, commands, limits, view.act, view.rate, step)
    else:
        write_servo_rates(view.par, view.act, view.rate, commands, limits)
    for k in range(STATE.flap_a, STATE.governor + 1):
        view.rate[k] = view.act[k + _RATES_KEPT]
    write_turbulence_rates(view, step)
    for k in range(STATE.feels_x, states_end(view)):  # written at ticks, not integrated
        view.rate[k] = 0.0
    return 0.0


@kernel()
def held_commands(view):
    """Return the commands that a vehicle's servos can follow, and how fast each can be, 1/s.

    Of the front, left, right and tail servo, unitised. They are held between the gyro's ticks, so
    the body's motion within a step does not reach them.
    """
    par, controls = view.par, view.controls
    commands = (
        controls[CONTROL.servo_front],
        controls[CONTROL.servo_left],
        controls[CONTROL.servo_right],
        controls[CONTROL.servo_tail],
    )
    commands = at_actuators(view, commands)
    limit = par[PARAM.servo_rate_limit]
    limits = (limit, limit, limit, limit)
    if par[PARAM.faults] != 0.0:
        return faults.servos_left(par, last_tick(view), commands, limits)
    return commands, limits


@kernel()
def write_mean_servo_rates(par, commands, limits, act, rate, step):
    """Write the mean derivatives of the servos' states over a time step with held commands.

    The Taylor series of the exponential, from the inside out, to sixth order where the laws
    are linear: with servos of 222 rad/s and steps of 2 ms, exact to 1e-6.

    Args:
        par: parameters.
        commands: of the four servos, unitised, (4,).
        limits: how fast each can be, 1/s, (4,).
        act: states of the vehicle.
        rate: their mean derivatives, written.
        step: s.
    """
    stage = buffer(_DRIVEN)
    write_servo_rates(par, act, rate, commands, limits)
    for divisor in (6.0, 5.0, 4.0, 3.0, 2.0):
        for k in range(_DRIVEN):
            stage[k] = act[k] + step / divisor * rate[k]
        write_servo_rates(par, stage, rate, commands, limits)


@kernel()
def sensor(m, d, offsets, stage):
    """Write what the recorder needs beside MuJoCo's own sensors. What mjcb_sensor does."""
    if stage != _ACCELERATION_STAGE:
        return
    examine_idler(m, d, offsets)
    for view in vehicles(m, d, offsets):
        if view.sensors >= 0:
            report(view)
            controller.feel(view)


@kernel()
def report(view):
    """Write the numbers of a vehicle's own sensors."""
    act, rate, out = view.act, view.rate, sensor_numbers(view)
    for k in range(CONTROL.rotor):
        out[SENSOR.stick_col + k] = view.controls[k]
    if controller.has_failed(view):
        for k in range(4):
            out[SENSOR.command_front + k] = math.nan
    for k in range(4):
        out[SENSOR.position_front + k] = act[STATE.front_position + 2 * k]
    since = 0.5 * held_for(view)  # by which tilt and inflow are kept early
    out[SENSOR.flap_a] = act[STATE.flap_a] + since * rate[STATE.flap_a]
    out[SENSOR.flap_b] = act[STATE.flap_b] + since * rate[STATE.flap_b]
    past = flow(view, 0.0)
    if since > 0.0 and view.par[PARAM.main_dynamic_inflow] != 0.0:
        past = flow_later(view, past, act[STATE.inflow_0] + since * rate[STATE.inflow_0], 0.0)
    report_rotors(view, past)
    held = contact_force(view)
    out[SENSOR.contact_north], out[SENSOR.contact_east], out[SENSOR.contact_down] = held


@kernel()
def report_rotors(view, past):
    """Write what the sensors say of the rotors and the air, from the `Flow`."""
    out, main, air = sensor_numbers(view), past.main, past.air
    out[SENSOR.thrust], out[SENSOR.torque], out[SENSOR.inflow] = (
        main.thrust,
        main.torque,
        main.inflow,
    )
    out[SENSOR.tail_thrust], out[SENSOR.speed] = past.tail.thrust, past.speed
    spin = past.speed * view.par[PARAM.main_speed]
    out[SENSOR.drive_power] = drive(view, past, 0.0).power
    out[SENSOR.main_power] = main.torque * spin
    out[SENSOR.tail_power] = past.tail.torque * past.speed * view.par[PARAM.tail_speed]
    out[SENSOR.heat] = heat(view.par, past)
    out[SENSOR.air_u], out[SENSOR.air_v], out[SENSOR.air_w] = air.u, air.v, air.w
    out[SENSOR.air_p], out[SENSOR.air_q], out[SENSOR.air_r] = air.p, air.q, air.r
