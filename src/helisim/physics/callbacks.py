"""What MuJoCo calls in every evaluation of the dynamics, written for numba.

Each function takes the addresses of mjModel and mjData and the tuple of field offsets. They
read and write nothing but those two, so any number of threads and vehicles can share them.
"""

import mujoco

from helisim.physics import air, faults, flapping, servo
from helisim.physics.addresses import (
    REPORTS,
    body_of,
    control_of,
    is_rotor,
    parameters,
    reports,
    speed_ratio,
    state_of,
    vehicles,
)
from helisim.physics.body import apply_wrench
from helisim.physics.commanded import (
    commanded_rates,
    mean_commanded_rates,
    sensed_rates,
    stick_positions,
    what_is_held,
)
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, ROTOR, STATE
from helisim.physics.loads import STOPPED, main_rotor, tail_rotor, wrench
from helisim.physics.memory import doubles, doubles_from
from helisim.physics.piloting import fly
from helisim.physics.stabilizing import cyclic_law, yaw_law
from helisim.physics.stepping import held_for, position_ahead
from helisim.physics.ticks import is_tick

_ACCELERATION_STAGE = int(mujoco.mjtStage.mjSTAGE_ACC)


@kernel()
def passive(m, d, offsets):
    """Add the aerodynamic forces of every vehicle: what mjcb_passive does."""
    for rotor_id in vehicles(m, offsets):
        par = parameters(m, offsets, rotor_id)
        body = body_of(m, offsets, rotor_id)
        act = doubles_from(d, offsets.act, state_of(m, offsets, rotor_id))
        step = held_for(m, offsets)
        past = flow(m, d, offsets, rotor_id, par, act, 0.5 * step)
        a, b = act[STATE.flap_a], act[STATE.flap_b]
        if step > 0.0:
            a_rate, b_rate = tilt_rates(par, act, past, step)
            a, b = a + step * a_rate, b + step * b_rate
        pedal = position_ahead(par, act, STATE.tail_position, 0.5 * step)
        u, v, w, p, q, r, speed, main, _ = past
        force = wrench(par, pedal, a, b, u, v, w, p, q, r, speed, main[0], main[1])
        apply_wrench(m, d, offsets, body, *force)


@kernel()
def flow(m, d, offsets, rotor_id, par, act, ahead):
    """Return u, v, w, p, q, r through the air, the rotor's speed ratio and its `main_rotor`.

    Last stands how the air itself moves. The collective is that of a time `ahead` (s).
    """
    body = body_of(m, offsets, rotor_id)
    moving = air.motion(m, d, offsets, rotor_id, par, body)
    u, v, w, p, q, r = air.relative_motion(m, d, offsets, body, moving)
    speed = speed_ratio(m, d, offsets, rotor_id, par)
    collective, _, _ = servo.unmix(
        position_ahead(par, act, STATE.front_position, ahead),
        position_ahead(par, act, STATE.left_position, ahead),
        position_ahead(par, act, STATE.right_position, ahead),
    )
    nearness = air.ground_nearness(d, offsets, par, body)
    main = main_rotor(par, u, v, w, p, q, speed, collective, nearness)
    return u, v, w, p, q, r, speed, main, moving


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
        controls = doubles_from(d, offsets.ctrl, control_of(m, offsets, rotor_id))
        act = doubles_from(d, offsets.act, state_of(m, offsets, rotor_id))
        if par[PARAM.pilot_on] != 0.0:
            fly(m, d, offsets, rotor_id, par, body, controls)
            controls[ROTOR] = 1.0
        if par[PARAM.gyro_on] != 0.0 and faults.restarts(d, offsets, par, seen):
            faults.forget(act)
            if par[PARAM.restart_neutral] != 0.0:
                controls[4] = controls[5] = controls[6] = controls[7] = 0.0
        elif par[PARAM.gyro_on] != 0.0:
            _, _, r = sensed_rates(d, offsets, par, act, seen)
            lon, lat, ped = stick_positions(m, d, offsets, rotor_id, par, seen)
            _, _, ped = yaw_law(par, act, r, ped)
            _, _, lat, lon = cyclic_law(par, act, lat, lon)
            lat = min(0.5, max(-0.5, lat))
            lon = min(0.5, max(-0.5, lon))
            col = par[PARAM.gyro_collective] * controls[0]
            controls[4], controls[5], controls[6] = servo.mix(col, lon, lat)
            controls[7] = min(0.5, max(-0.5, ped))


@kernel()
def activation_rates(m, d, offsets, actuator):
    """Write the derivatives of all activations of a vehicle, at the turn of its rotor, the last.

    What mjcb_act_dyn does.
    """
    if not is_rotor(m, offsets, actuator):
        return 0.0
    par = parameters(m, offsets, actuator)
    first = state_of(m, offsets, actuator)
    act = doubles_from(d, offsets.act, first)
    rate = doubles_from(d, offsets.act_dot, first)
    held = what_is_held(m, d, offsets, actuator, par, act)
    if not held[0]:
        faults.forget(rate)
    step = held_for(m, offsets)
    if step > 0.0:
        mean_commanded_rates(par, held, act, rate, step)
    else:
        commanded_rates(par, held, act, rate)
    past = flow(m, d, offsets, actuator, par, act, 0.5 * step)
    rate[STATE.flap_a], rate[STATE.flap_b] = tilt_rates(par, act, past, step)
    air.turbulence_rates(m, d, offsets, actuator, par, step)
    return 0.0


@kernel()
def tilt_rates(par, act, past, step):
    """Return the mean da/dt and db/dt of the tip-path plane over a time step (s), or now at 0."""
    u, v, _, p, q, _, speed, main, moving = past
    _, _, inflow, tip_speed, pitch = main
    _, lon, lat = servo.unmix(
        act[STATE.front_position], act[STATE.left_position], act[STATE.right_position]
    )
    a_target = par[PARAM.a_lat] * lat + par[PARAM.a_lon] * lon
    b_target = par[PARAM.b_lat] * lat + par[PARAM.b_lon] * lon
    if speed >= STOPPED:
        a_target += par[PARAM.flap_back] * flapping.flap_back(pitch, inflow, u / tip_speed)
        b_target -= par[PARAM.flap_back] * flapping.flap_back(pitch, inflow, v / tip_speed)
        a_turn, b_turn = flapping.cyclic_of_turning_air(
            moving[3], moving[4], speed * par[PARAM.main_speed]
        )
        a_target, b_target = a_target + a_turn, b_target + b_turn
    p, q = p + moving[3], q + moving[4]  # the blades' inertia knows no air
    a, b = act[STATE.flap_a], act[STATE.flap_b]
    tau_f, a_b, b_a = par[PARAM.tau_f], par[PARAM.a_b], par[PARAM.b_a]
    a_rate, b_rate = 0.0, 0.0
    for _ in range(2):
        a_rate, b_rate = flapping.flapping_rates(
            a + 0.5 * step * a_rate,
            b + 0.5 * step * b_rate,
            p,
            q,
            a_target,
            b_target,
            tau_f,
            a_b,
            b_a,
        )
    return a_rate, b_rate


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
    """Write the numbers of a vehicle's own sensors; they are consecutive."""
    par = parameters(m, offsets, rotor_id)
    first = state_of(m, offsets, rotor_id)
    act = doubles_from(d, offsets.act, first)
    rate = doubles_from(d, offsets.act_dot, first)
    control = doubles_from(d, offsets.ctrl, control_of(m, offsets, rotor_id))
    out = doubles_from(d, offsets.sensordata, address)
    for k in range(8):
        out[k] = control[k]
    for k in range(4):
        out[8 + k] = act[STATE.front_position + 2 * k]
    since = 0.5 * held_for(m, offsets)  # by which the tilt is kept early
    for k in range(2):
        out[12 + k] = act[STATE.flap_a + k] + since * rate[STATE.flap_a + k]
    _, v, _, p, _, r, speed, main, moving = flow(m, d, offsets, rotor_id, par, act, 0.0)
    out[14], out[15], out[16] = main[0], main[1], main[2]
    out[17] = tail_rotor(par, v, p, r, speed, out[11])
    for k in range(6):
        out[18 + k] = moving[k]
