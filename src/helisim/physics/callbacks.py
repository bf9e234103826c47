"""What MuJoCo calls in every evaluation of the dynamics, written for numba.

Each function takes the addresses of mjModel and mjData and the tuple of field offsets. They
read and write nothing but those two, so any number of threads and vehicles can share them.
`helisim.physics.memory` says what `m`, `d`, `par`, `act` and the like are.
"""

from typing import NamedTuple

import mujoco

from helisim.physics import faults
from helisim.physics.air import write_turbulence_rates
from helisim.physics.body import apply_wrench
from helisim.physics.flapping import tilt_rates
from helisim.physics.gyro import (
    Rates,
    Sticks,
    cyclic_law,
    sensed_rates,
    stick_positions,
    write_gyro_rates,
    yaw_law,
)
from helisim.physics.kernel import kernel
from helisim.physics.layout import CONTROL, PARAM, SENSOR, STATE
from helisim.physics.loads import flow, tail_rotor, wrench
from helisim.physics.memory import (
    body_of,
    buffer,
    controls_of,
    doubles_from,
    is_rotor,
    parameters_of,
    sensors_of,
    state_rates_of,
    states_of,
    vehicles,
)
from helisim.physics.pilot import fly
from helisim.physics.servo import mix, write_servo_rates
from helisim.physics.timing import held_for, is_tick, last_tick, position_ahead

_ACCELERATION_STAGE = int(mujoco.mjtStage.mjSTAGE_ACC)
_DRIVEN = STATE.tail_rate + 1
"""The first states of a vehicle, those of gyro and servos, which held inputs alone drive."""


@kernel()
def passive(m, d, offsets):
    """Add the aerodynamic forces of every vehicle: what mjcb_passive does."""
    for rotor_id in vehicles(m, offsets):
        par = parameters_of(m, offsets, rotor_id)
        act = states_of(m, d, offsets, rotor_id)
        step = held_for(m, offsets)
        past = flow(m, d, offsets, rotor_id, par, act, 0.5 * step)
        a, b = act[STATE.flap_a], act[STATE.flap_b]
        if step > 0.0:
            a_rate, b_rate = tilt_rates(par, act, past, step)
            a, b = a + step * a_rate, b + step * b_rate
        pedal = position_ahead(par, act, STATE.tail_position, 0.5 * step)
        force = wrench(par, pedal, a, b, past.motion, past.speed_ratio, past.main)
        apply_wrench(m, d, offsets, body_of(m, offsets, rotor_id), force)


@kernel()
def control(m, d, offsets):
    """Fly every vehicle: pilot to sticks, gyro to servo commands. What mjcb_control does.

    Both act at the gyro's ticks; in between, sticks and servo commands are held.
    """
    for rotor_id in vehicles(m, offsets):
        par = parameters_of(m, offsets, rotor_id)
        body = body_of(m, offsets, rotor_id)
        sensors = sensors_of(m, offsets, body)
        if sensors < 0 or not is_tick(m, d, offsets, par, sensors):
            continue
        if par[PARAM.pilot_on] != 0.0:
            fly(m, d, offsets, par, body, controls_of(m, d, offsets, rotor_id))
        if par[PARAM.gyro_on] != 0.0:
            command_servos(m, d, offsets, rotor_id, par, sensors)


@kernel()
def command_servos(m, d, offsets, rotor_id, par, sensors):
    """Write the gyro's commands to the four servos; a gyro that restarts has none of its own."""
    controls = controls_of(m, d, offsets, rotor_id)
    act = states_of(m, d, offsets, rotor_id)
    if faults.restarts(d, offsets, par, sensors):
        faults.reset_gyro(act)
        if par[PARAM.restart_neutral] != 0.0:
            for k in range(CONTROL.servo_front, CONTROL.servo_tail + 1):
                controls[k] = 0.0
        return
    sensed = sensed_rates(d, offsets, par, act, sensors)
    sticks = stick_positions(m, d, offsets, rotor_id, par, sensors)
    ped = yaw_law(par, act, sensed.r, sticks.ped).command
    cyclic = cyclic_law(par, act, sticks.lat, sticks.lon)
    lat = min(0.5, max(-0.5, cyclic.lat))
    lon = min(0.5, max(-0.5, cyclic.lon))
    col = par[PARAM.gyro_collective] * controls[CONTROL.col]
    front, left, right = mix(col, lon, lat)
    controls[CONTROL.servo_front] = front
    controls[CONTROL.servo_left] = left
    controls[CONTROL.servo_right] = right
    controls[CONTROL.servo_tail] = min(0.5, max(-0.5, ped))


@kernel()
def activation_rates(m, d, offsets, actuator):
    """Write the derivatives of all activations of a vehicle, at the turn of its rotor, the last.

    What mjcb_act_dyn does.
    """
    if not is_rotor(m, offsets, actuator):
        return 0.0
    par = parameters_of(m, offsets, actuator)
    act = states_of(m, d, offsets, actuator)
    rate = state_rates_of(m, d, offsets, actuator)
    held = held_inputs(m, d, offsets, actuator, par, act)
    if not held.gyro_works:
        faults.reset_gyro(rate)
    step = held_for(m, offsets)
    if step > 0.0:
        write_mean_driven_rates(par, held, act, rate, step)
    else:
        write_driven_rates(par, held, act, rate)
    past = flow(m, d, offsets, actuator, par, act, 0.5 * step)
    rate[STATE.flap_a], rate[STATE.flap_b] = tilt_rates(par, act, past, step)
    write_turbulence_rates(m, d, offsets, actuator, par, step)
    return 0.0


class HeldInputs(NamedTuple):
    """What drives gyro and servos, all of it held between the gyro's ticks.

    The body's motion within a step does not reach them.

    Attributes:
        gyro_works: whether the gyro works at all.
        sensed: rates that it sees.
        sticks: as they reach it.
        commands: of the front, left, right and tail servo, unitised.
        limits: how fast each can be, 1/s.
    """

    gyro_works: bool
    sensed: Rates
    sticks: Sticks
    commands: tuple[float, float, float, float]
    limits: tuple[float, float, float, float]


@kernel()
def held_inputs(m, d, offsets, rotor_id, par, act):
    """Return what drives a vehicle's gyro and servos."""
    controls = controls_of(m, d, offsets, rotor_id)
    commands = (
        controls[CONTROL.servo_front],
        controls[CONTROL.servo_left],
        controls[CONTROL.servo_right],
        controls[CONTROL.servo_tail],
    )
    limit = par[PARAM.servo_rate_limit]
    limits = (limit, limit, limit, limit)
    sensors = sensors_of(m, offsets, body_of(m, offsets, rotor_id))
    if par[PARAM.faults] != 0.0:
        time = last_tick(d, offsets, par, sensors)
        commands, limits = faults.servos_left(par, time, commands, limits)
    if par[PARAM.gyro_on] == 0.0 or sensors < 0 or faults.restarts(d, offsets, par, sensors):
        nothing = Rates(0.0, 0.0, 0.0)
        return HeldInputs(False, nothing, Sticks(0.0, 0.0, 0.0), commands, limits)
    sensed = sensed_rates(d, offsets, par, act, sensors)
    sticks = stick_positions(m, d, offsets, rotor_id, par, sensors)
    return HeldInputs(True, sensed, sticks, commands, limits)


@kernel()
def write_driven_rates(par, held, act, rate):
    """Write the derivatives of the states of gyro and servos.

    Args:
        par: parameters.
        held: `HeldInputs`.
        act: states of the vehicle.
        rate: their derivatives, written.
    """
    if held.gyro_works:
        write_gyro_rates(par, act, rate, held.sensed, held.sticks)
    write_servo_rates(par, act, rate, held.commands, held.limits)


@kernel()
def write_mean_driven_rates(par, held, act, rate, step):
    """Write the mean derivatives over a time step in which all that drives them is held.

    The Taylor series of the exponential, from the inside out, to sixth order where the laws
    are linear: with the gyro's filters of 3 ms and steps of 2 ms, exact to 2e-5.

    Args:
        par: parameters.
        held: `HeldInputs`.
        act: states of the vehicle.
        rate: their mean derivatives, written.
        step: s.
    """
    stage = buffer(_DRIVEN)
    write_driven_rates(par, held, act, rate)
    for divisor in (6.0, 5.0, 4.0, 3.0, 2.0):
        for k in range(_DRIVEN):
            stage[k] = act[k] + step / divisor * rate[k]
        write_driven_rates(par, held, stage, rate)


@kernel()
def sensor(m, d, offsets, stage):
    """Write what the recorder needs beside MuJoCo's own sensors. What mjcb_sensor does."""
    if stage != _ACCELERATION_STAGE:
        return
    for rotor_id in vehicles(m, offsets):
        sensors = sensors_of(m, offsets, body_of(m, offsets, rotor_id))
        if sensors >= 0:
            report(m, d, offsets, rotor_id, sensors)


@kernel()
def report(m, d, offsets, rotor_id, sensors):
    """Write the numbers of a vehicle's own sensors."""
    par = parameters_of(m, offsets, rotor_id)
    act = states_of(m, d, offsets, rotor_id)
    rate = state_rates_of(m, d, offsets, rotor_id)
    controls = controls_of(m, d, offsets, rotor_id)
    out = doubles_from(d, offsets.sensordata, sensors)
    for k in range(CONTROL.rotor):
        out[SENSOR.stick_col + k] = controls[k]
    for k in range(4):
        out[SENSOR.position_front + k] = act[STATE.front_position + 2 * k]
    since = 0.5 * held_for(m, offsets)  # by which the tilt is kept early
    out[SENSOR.flap_a] = act[STATE.flap_a] + since * rate[STATE.flap_a]
    out[SENSOR.flap_b] = act[STATE.flap_b] + since * rate[STATE.flap_b]
    past = flow(m, d, offsets, rotor_id, par, act, 0.0)
    out[SENSOR.thrust] = past.main.thrust
    out[SENSOR.torque] = past.main.torque
    out[SENSOR.inflow] = past.main.inflow
    pedal = act[STATE.tail_position]
    out[SENSOR.tail_thrust] = tail_rotor(par, past.motion, past.speed_ratio, pedal)
    out[SENSOR.air_u], out[SENSOR.air_v], out[SENSOR.air_w] = past.air.u, past.air.v, past.air.w
    out[SENSOR.air_p], out[SENSOR.air_q], out[SENSOR.air_r] = past.air.p, past.air.q, past.air.r
