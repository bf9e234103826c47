"""What MuJoCo calls in every evaluation of the dynamics, written for numba.

Each function takes the addresses of mjModel and mjData and the tuple of field offsets. They
read and write nothing but those two, so any number of threads and vehicles can share them.
"""

import mujoco

from helisim.physics import flapping, servo
from helisim.physics.addresses import (
    REPORTS,
    body_of,
    control_of,
    parameters,
    reports,
    speed_ratio,
    state_of,
    vehicles,
)
from helisim.physics.body import air_velocity, apply_wrench, rates
from helisim.physics.kernel import kernel
from helisim.physics.layout import MAGIC, PARAM, ROTOR, STATE
from helisim.physics.loads import STOPPED, main_rotor, tail_rotor, wrench
from helisim.physics.memory import doubles, doubles_from, long
from helisim.physics.piloting import fly
from helisim.physics.stabilizing import cyclic_law, gyro_derivatives, yaw_law
from helisim.physics.ticks import is_tick

_ACCELERATION_STAGE = int(mujoco.mjtStage.mjSTAGE_ACC)


@kernel()
def passive(m, d, offsets):
    """Add the aerodynamic forces of every vehicle: what mjcb_passive does."""
    for rotor_id in vehicles(m, offsets):
        par = parameters(m, offsets, rotor_id)
        body = body_of(m, offsets, rotor_id)
        first = state_of(m, offsets, rotor_id)
        u, v, w = air_velocity(m, d, offsets, body)
        p, q, r = rates(d, offsets, body)
        act = doubles(d, offsets.act)
        speed = speed_ratio(m, d, offsets, rotor_id, par)
        force = wrench(par, act, first, u, v, w, p, q, r, speed)
        apply_wrench(m, d, offsets, body, *force)


@kernel()
def control(m, d, offsets):
    """Fly every vehicle: pilot to sticks, gyro to servo commands. What mjcb_control does.

    Both act at the gyro's ticks; in between, sticks and servo commands are held.
    """
    for rotor_id in vehicles(m, offsets):
        par = parameters(m, offsets, rotor_id)
        body = body_of(m, offsets, rotor_id)
        seen = reports(m, offsets, body)
        if seen < 0 or not is_tick(
            m, d, offsets, par, doubles(d, offsets.sensordata)[seen + REPORTS]
        ):
            continue
        first = state_of(m, offsets, rotor_id)
        address = control_of(m, offsets, rotor_id)
        controls = doubles_from(d, offsets.ctrl, address)
        act = doubles(d, offsets.act)
        if par[PARAM.pilot_on] != 0.0:
            fly(m, d, offsets, rotor_id, par, body, controls)
            controls[ROTOR] = 1.0
        if par[PARAM.gyro_on] != 0.0:
            _, _, ped = yaw_law(m, d, offsets, rotor_id, par, act, first, address, seen)
            _, _, lat, lon = cyclic_law(par, act, first, controls[2], controls[1])
            lat = min(0.5, max(-0.5, lat))
            lon = min(0.5, max(-0.5, lon))
            col = par[PARAM.gyro_collective] * controls[0]
            controls[4], controls[5], controls[6] = servo.mix(col, lon, lat)
            controls[7] = min(0.5, max(-0.5, ped))


@kernel()
def activation_rates(m, d, offsets, actuator):
    """Write the derivatives of one actuator's activations. What mjcb_act_dyn does."""
    if long(m, offsets.nuser_actuator) < len(PARAM):
        return 0.0
    user = parameters(m, offsets, actuator)
    if user[PARAM.magic] != MAGIC:
        return 0.0
    ordinal = int(user[PARAM.ordinal])
    rotor_id = actuator - ordinal + ROTOR
    par = parameters(m, offsets, rotor_id)
    first = state_of(m, offsets, rotor_id)
    if ordinal == ROTOR:
        flapping_derivatives(m, d, offsets, rotor_id, par, first)
    elif ordinal >= 4:
        servo_derivatives(d, offsets, par, first, ordinal, control_of(m, offsets, rotor_id))
    else:
        gyro_derivatives(m, d, offsets, rotor_id, par, first, ordinal)
    return 0.0


@kernel()
def flapping_derivatives(m, d, offsets, rotor_id, par, first):
    """Write da/dt and db/dt of the tip-path plane."""
    body = body_of(m, offsets, rotor_id)
    act = doubles(d, offsets.act)
    rate = doubles(d, offsets.act_dot)
    u, v, w = air_velocity(m, d, offsets, body)
    p, q, _ = rates(d, offsets, body)
    speed = speed_ratio(m, d, offsets, rotor_id, par)
    col, lon, lat = servo.unmix(
        act[first + STATE.front_position],
        act[first + STATE.left_position],
        act[first + STATE.right_position],
    )
    _, _, inflow, tip_speed, pitch = main_rotor(par, u, v, w, p, q, speed, col)
    a_target = par[PARAM.a_lat] * lat + par[PARAM.a_lon] * lon
    b_target = par[PARAM.b_lat] * lat + par[PARAM.b_lon] * lon
    if speed >= STOPPED:
        a_target += par[PARAM.flap_back] * flapping.flap_back(pitch, inflow, u / tip_speed)
        b_target -= par[PARAM.flap_back] * flapping.flap_back(pitch, inflow, v / tip_speed)
    a, b = act[first + STATE.flap_a], act[first + STATE.flap_b]
    tau_f, a_b, b_a = par[PARAM.tau_f], par[PARAM.a_b], par[PARAM.b_a]
    rate[first + STATE.flap_a], rate[first + STATE.flap_b] = flapping.flapping_rates(
        a, b, p, q, a_target, b_target, tau_f, a_b, b_a
    )


@kernel()
def servo_derivatives(d, offsets, par, first, ordinal, address):
    """Write the derivatives of one servo's position and rate."""
    act = doubles(d, offsets.act)
    rate = doubles(d, offsets.act_dot)
    command = doubles(d, offsets.ctrl)[address + ordinal]
    k = first + STATE.front_position + 2 * (ordinal - 4)
    frequency, damping = par[PARAM.swash_frequency], par[PARAM.swash_damping]
    if ordinal == 7:
        frequency, damping = par[PARAM.tail_frequency], par[PARAM.tail_damping]
    rate[k], rate[k + 1] = servo.servo_rates(
        act[k],
        act[k + 1],
        command,
        frequency,
        damping,
        par[PARAM.servo_rate_limit],
        par[PARAM.servo_travel],
    )


@kernel()
def sensor(m, d, offsets, stage):
    """Write what the recorder needs beside MuJoCo's own sensors. What mjcb_sensor does."""
    if stage != _ACCELERATION_STAGE:
        return
    for rotor_id in vehicles(m, offsets):
        body = body_of(m, offsets, rotor_id)
        address = reports(m, offsets, body)
        if address >= 0:
            report(m, d, offsets, rotor_id, body, address)


@kernel()
def report(m, d, offsets, rotor_id, body, address):
    """Write a vehicle's eighteen user-sensor numbers; they are consecutive."""
    par = parameters(m, offsets, rotor_id)
    first = state_of(m, offsets, rotor_id)
    act = doubles(d, offsets.act)
    control = doubles_from(d, offsets.ctrl, control_of(m, offsets, rotor_id))
    out = doubles_from(d, offsets.sensordata, address)
    for k in range(8):
        out[k] = control[k]
    for k in range(4):
        out[8 + k] = act[first + STATE.front_position + 2 * k]
    out[12] = act[first + STATE.flap_a]
    out[13] = act[first + STATE.flap_b]
    u, v, w = air_velocity(m, d, offsets, body)
    p, q, r = rates(d, offsets, body)
    collective, _, _ = servo.unmix(out[8], out[9], out[10])
    speed = speed_ratio(m, d, offsets, rotor_id, par)
    thrust, torque, inflow, _, _ = main_rotor(par, u, v, w, p, q, speed, collective)
    out[14], out[15], out[16] = thrust, torque, inflow
    out[17] = tail_rotor(par, v, p, r, speed, out[11])
