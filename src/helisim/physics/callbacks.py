"""What MuJoCo calls in every evaluation of the dynamics, written for numba.

Each function takes the addresses of mjModel and mjData and the tuple of field offsets. They
read and write nothing but those two, so any number of threads and vehicles can share them.
"""

import math

import mujoco
from numba import types
from numba.extending import intrinsic

from helisim.physics import flapping, frames, gyro, pilot, rotor, servo
from helisim.physics.kernel import kernel
from helisim.physics.layout import DOUBLET, MAGIC, PARAM, ROTOR, STATE, SWEEP

_NPARAM = len(PARAM)
_USER_SENSOR = int(mujoco.mjtSensor.mjSENS_USER)
_BODY = int(mujoco.mjtObj.mjOBJ_BODY)
_ACCELERATION_STAGE = int(mujoco.mjtStage.mjSTAGE_ACC)
_REPORTS = 18
"""Numbers in a vehicle's own sensors."""
_STOPPED = 0.05
"""Below this fraction of its speed the rotor counts as stopped."""


def _pointer_intrinsic(element: types.Type):
    @intrinsic
    def cast(typingctx, address):
        del typingctx
        signature = types.CPointer(element)(types.int64)

        def codegen(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return signature, codegen

    return cast


_doubles_at = _pointer_intrinsic(types.float64)
_ints_at = _pointer_intrinsic(types.int32)
_longs_at = _pointer_intrinsic(types.int64)


@kernel()
def doubles(base, offset):
    """Return the double array that a pointer field holds."""
    return _doubles_at(_longs_at(base + offset)[0])


@kernel()
def ints(base, offset):
    """Return the int array that a pointer field holds."""
    return _ints_at(_longs_at(base + offset)[0])


@kernel()
def long(base, offset):
    """Return the value of a 64-bit integer field."""
    return _longs_at(base + offset)[0]


@kernel()
def double(base, offset):
    """Return the value of a double field."""
    return _doubles_at(base + offset)[0]


@kernel()
def parameters(m, offsets, actuator):
    """Return the user numbers of an actuator; the rotor's are the vehicle's parameters."""
    stride = 8 * long(m, offsets.nuser_actuator)
    return _doubles_at(_longs_at(m + offsets.actuator_user)[0] + actuator * stride)


@kernel()
def is_rotor(m, offsets, actuator):
    """Tell whether an actuator is the rotor of one of our vehicles, all the others before it."""
    user = parameters(m, offsets, actuator)
    if user[PARAM.magic] != MAGIC or user[PARAM.ordinal] != ROTOR or actuator < ROTOR:
        return False
    first = parameters(m, offsets, actuator - ROTOR)
    return first[PARAM.magic] == MAGIC and first[PARAM.ordinal] == 0.0


@kernel()
def body_of(m, offsets, rotor_id):
    """Return the body that a vehicle's rotor actuator acts on."""
    joint = ints(m, offsets.actuator_trnid)[2 * rotor_id]
    return ints(m, offsets.jnt_bodyid)[joint]


@kernel()
def state_of(m, d, offsets, rotor_id):
    """Return the address of a vehicle's first activation."""
    address = ints(m, offsets.actuator_actadr)[rotor_id]
    return address - STATE.flap_a


@kernel()
def control_of(m, offsets, rotor_id):
    """Return the address of a vehicle's first control, the collective stick."""
    return ints(m, offsets.actuator_ctrladr)[rotor_id] - ROTOR


@kernel()
def speed_ratio(m, d, offsets, rotor_id, par):
    """Return the rotor's speed over its nominal one; a pilot flies with the governor on."""
    if par[PARAM.pilot_on] != 0.0:
        return 1.0
    return doubles(d, offsets.ctrl)[control_of(m, offsets, rotor_id) + ROTOR]


@kernel()
def reports(m, offsets, body):
    """Return where a vehicle's own sensors start: the first user sensor on its body, or -1.

    The gyro's rates stand in the three numbers before, the clock in the one behind the last.
    """
    for k in range(long(m, offsets.nsensor)):
        ours = ints(m, offsets.sensor_type)[k] == _USER_SENSOR
        ours = ours and ints(m, offsets.sensor_objtype)[k] == _BODY
        ours = ours and ints(m, offsets.sensor_dim)[k] == 4
        if ours and ints(m, offsets.sensor_objid)[k] == body:
            return ints(m, offsets.sensor_adr)[k]
    return -1


@kernel()
def is_tick(m, d, offsets, par, clock):
    """Tell whether the gyro acts now: at a step's start, once in each of its periods.

    MuJoCo computes sensors at the start of a step only, so the clock tells the start from the
    later stages of the integrator.
    """
    time = double(d, offsets.time)
    if time != clock:
        return False
    period = par[PARAM.gyro_period]
    before = time - double(m, offsets.timestep)
    return math.floor(time / period + 1e-6) != math.floor(before / period + 1e-6)


@kernel()
def rotation(d, offsets, body):
    """Return the nine numbers of a body's rotation to the world."""
    return _doubles_at(_longs_at(d + offsets.xmat)[0] + 72 * body)


@kernel()
def rates(d, offsets, body):
    """Return p, q, r (rad/s)."""
    cvel = doubles(d, offsets.cvel)
    k = 6 * body
    return frames.to_body(rotation(d, offsets, body), cvel[k], cvel[k + 1], cvel[k + 2])


@kernel()
def velocity(m, d, offsets, body):
    """Return the velocity of the body's origin in the world, north-west-up, m/s."""
    cvel = doubles(d, offsets.cvel)
    position = doubles(d, offsets.xpos)
    centre = doubles(d, offsets.subtree_com)
    root = ints(m, offsets.body_rootid)[body]
    x = position[3 * body] - centre[3 * root]
    y = position[3 * body + 1] - centre[3 * root + 1]
    z = position[3 * body + 2] - centre[3 * root + 2]
    k = 6 * body
    return (
        cvel[k + 3] + cvel[k + 1] * z - cvel[k + 2] * y,
        cvel[k + 4] + cvel[k + 2] * x - cvel[k] * z,
        cvel[k + 5] + cvel[k] * y - cvel[k + 1] * x,
    )


@kernel()
def air_velocity(m, d, offsets, body):
    """Return the body's velocity through the air in body axes u, v, w, m/s."""
    x, y, z = velocity(m, d, offsets, body)
    wind = _doubles_at(m + offsets.wind)
    return frames.to_body(rotation(d, offsets, body), x - wind[0], y - wind[1], z - wind[2])


@kernel()
def main_rotor(par, u, v, w, p, q, speed_ratio, collective):
    """Return thrust (N), torque (N m), inflow ratio, tip speed (m/s) and pitch (rad)."""
    tip_speed = par[PARAM.main_speed] * speed_ratio * par[PARAM.main_radius]
    pitch = par[PARAM.main_pitch_trim] + par[PARAM.main_pitch_range] * collective
    if speed_ratio < _STOPPED:
        return 0.0, 0.0, 0.0, tip_speed, pitch
    hub_u = u + q * par[PARAM.hub_z]
    hub_v = v - p * par[PARAM.hub_z]
    climb = -(w - q * par[PARAM.hub_x]) / tip_speed
    advance = math.sqrt(hub_u**2 + hub_v**2) / tip_speed
    inflow, ct = rotor.inflow_and_thrust(
        pitch,
        climb,
        advance,
        par[PARAM.main_solidity],
        par[PARAM.main_lift_slope],
        par[PARAM.main_stall],
        par[PARAM.main_inflow_floor],
    )
    cp = rotor.power(
        ct,
        inflow,
        climb,
        advance,
        par[PARAM.main_solidity],
        par[PARAM.main_induced_factor],
        par[PARAM.main_profile_drag],
    )
    radius = par[PARAM.main_radius]
    force = par[PARAM.air_density] * math.pi * radius**2 * tip_speed**2
    return force * ct, force * radius * cp, inflow, tip_speed, pitch


@kernel()
def tail_rotor(par, v, p, r, speed_ratio, pedal):
    """Return the tail rotor's thrust, N; it pushes the tail to the left (nose right)."""
    tip_speed = par[PARAM.tail_speed] * speed_ratio * par[PARAM.tail_radius]
    if speed_ratio < _STOPPED:
        return 0.0
    pitch = par[PARAM.tail_pitch_trim] + par[PARAM.tail_pitch_range] * pedal
    climb = -(v + r * par[PARAM.tail_x] - p * par[PARAM.tail_z]) / tip_speed
    _, ct = rotor.inflow_and_thrust(
        pitch,
        climb,
        0.0,
        par[PARAM.tail_solidity],
        par[PARAM.tail_lift_slope],
        par[PARAM.tail_stall],
        par[PARAM.tail_inflow_floor],
    )
    return par[PARAM.air_density] * math.pi * par[PARAM.tail_radius] ** 2 * tip_speed**2 * ct


@kernel()
def wrench(par, act, first, u, v, w, p, q, r, speed_ratio):
    """Return the aerodynamic force (N) and moment (N m) at the body's origin, body axes."""
    front = act[first + STATE.front_position]
    left = act[first + STATE.left_position]
    right = act[first + STATE.right_position]
    collective, _, _ = servo.unmix(front, left, right)
    thrust, torque, _, _, _ = main_rotor(par, u, v, w, p, q, speed_ratio, collective)
    tail = tail_rotor(par, v, p, r, speed_ratio, act[first + STATE.tail_position])
    stop = par[PARAM.flap_stop]
    a = rotor.soft_limit(act[first + STATE.flap_a], stop, 0.7)
    b = rotor.soft_limit(act[first + STATE.flap_b], stop, 0.7)
    stiffness = par[PARAM.hub_stiffness] if speed_ratio >= _STOPPED else 0.0
    # hub: thrust along the tip-path plane's normal, springs, torque (blades turn clockwise)
    hub_x = -thrust * math.sin(a)
    hub_y = thrust * math.sin(b)
    hub_z = -thrust * math.cos(a) * math.cos(b)
    arm_x, arm_z = par[PARAM.hub_x], par[PARAM.hub_z]
    moment_l = stiffness * b - arm_z * hub_y
    moment_m = stiffness * a + arm_z * hub_x - arm_x * hub_z
    moment_n = arm_x * hub_y - torque
    # drag of fuselage and fin
    density = par[PARAM.air_density]
    pressure = 0.5 * density * math.sqrt(u**2 + v**2 + w**2)
    tail_v = v + r * par[PARAM.tail_x] - p * par[PARAM.tail_z]
    fin = -0.5 * density * par[PARAM.fin_area] * abs(tail_v) * tail_v
    side = fin - tail
    return (
        hub_x - pressure * par[PARAM.drag_x] * u,
        hub_y - pressure * par[PARAM.drag_y] * v + side,
        hub_z - pressure * par[PARAM.drag_z] * w,
        moment_l - par[PARAM.tail_z] * side,
        moment_m,
        moment_n + par[PARAM.tail_x] * side,
    )


@kernel()
def apply_wrench(m, d, offsets, body, fx, fy, fz, mx, my, mz):
    """Add a wrench at the body's origin, body axes, to the passive forces of its joints."""
    matrix = rotation(d, offsets, body)
    fx, fy, fz = frames.to_world(matrix, fx, fy, fz)
    mx, my, mz = frames.to_world(matrix, mx, my, mz)
    position = doubles(d, offsets.xpos)
    centre = doubles(d, offsets.subtree_com)
    root = ints(m, offsets.body_rootid)[body]
    x = position[3 * body] - centre[3 * root]
    y = position[3 * body + 1] - centre[3 * root + 1]
    z = position[3 * body + 2] - centre[3 * root + 2]
    mx += y * fz - z * fy
    my += z * fx - x * fz
    mz += x * fy - y * fx
    force = doubles(d, offsets.qfrc_passive)
    axis = doubles(d, offsets.cdof)
    parent = ints(m, offsets.dof_parentid)
    dof = ints(m, offsets.body_dofadr)[body] + ints(m, offsets.body_dofnum)[body] - 1
    while dof >= 0:
        k = 6 * dof
        force[dof] += axis[k] * mx + axis[k + 1] * my + axis[k + 2] * mz
        force[dof] += axis[k + 3] * fx + axis[k + 4] * fy + axis[k + 5] * fz
        dof = parent[dof]


@kernel()
def passive(m, d, offsets):
    """Add the aerodynamic forces of every vehicle: what mjcb_passive does."""
    if long(m, offsets.nuser_actuator) < _NPARAM:
        return
    for rotor_id in range(long(m, offsets.nactuator)):
        if not is_rotor(m, offsets, rotor_id):
            continue
        par = parameters(m, offsets, rotor_id)
        body = body_of(m, offsets, rotor_id)
        first = state_of(m, d, offsets, rotor_id)
        u, v, w = air_velocity(m, d, offsets, body)
        p, q, r = rates(d, offsets, body)
        act = doubles(d, offsets.act)
        speed = speed_ratio(m, d, offsets, rotor_id, par)
        force = wrench(par, act, first, u, v, w, p, q, r, speed)
        apply_wrench(m, d, offsets, body, *force)


@kernel()
def excitation(par, time):
    """Return what the pilot does on purpose, a sweep or a doublet of about unit amplitude."""
    since = time - par[PARAM.excitation_start]
    duration = par[PARAM.excitation_duration]
    if par[PARAM.excitation] == SWEEP:
        return pilot.sweep(
            since,
            duration,
            par[PARAM.sweep_w_min],
            par[PARAM.sweep_w_max],
            par[PARAM.sweep_fade],
            par[PARAM.sweep_unsteadiness],
            par[PARAM.pilot_seed],
        )
    if par[PARAM.excitation] == DOUBLET:
        return pilot.doublet(since, duration)
    return 0.0


@kernel()
def hold(par, matrix, north, east, down, u, v, w):
    """Return the sticks COL, LON, LAT, PED that keep the hover, slowly."""
    phi, theta, psi = frames.euler_angles(matrix)
    cosine, sine = math.cos(psi), math.sin(psi)
    off_north = par[PARAM.pilot_north] - north
    off_east = par[PARAM.pilot_east] - east
    ahead = cosine * off_north + sine * off_east
    right = -sine * off_north + cosine * off_east
    u_error = par[PARAM.pilot_k_position] * ahead - u
    v_error = par[PARAM.pilot_k_position] * right - v
    theta_error = par[PARAM.pilot_theta] - par[PARAM.pilot_k_velocity] * u_error - theta
    phi_error = par[PARAM.pilot_phi] + par[PARAM.pilot_k_velocity] * v_error - phi
    w_error = par[PARAM.pilot_k_height] * (par[PARAM.pilot_down] - down) - w
    psi_error = pilot.turn(par[PARAM.pilot_psi] - psi)
    return (
        par[PARAM.pilot_col] - par[PARAM.pilot_k_heave] * w_error,
        par[PARAM.pilot_lon] + par[PARAM.pilot_k_attitude] * theta_error,
        par[PARAM.pilot_lat] + par[PARAM.pilot_k_attitude] * phi_error,
        par[PARAM.pilot_ped] + par[PARAM.pilot_k_heading] * psi_error,
    )


@kernel()
def fly(m, d, offsets, rotor_id, par, body, control):
    """Write the pilot's four sticks."""
    time = double(d, offsets.time)
    matrix = rotation(d, offsets, body)
    position = doubles(d, offsets.xpos)
    north, east, down = frames.flip(
        position[3 * body], position[3 * body + 1], position[3 * body + 2]
    )
    u, v, w = frames.to_body(matrix, *velocity(m, d, offsets, body))
    held = hold(par, matrix, north, east, down, u, v, w)
    seed, interval = par[PARAM.pilot_seed], par[PARAM.remnant_interval]
    excited = excitation(par, time)
    for axis in range(4):
        stick = held[axis] + par[PARAM.excitation_col + axis] * excited
        level = par[PARAM.remnant_col + axis]
        if level > 0.0:
            stick += level * pilot.remnant(time, interval, seed, axis)
        control[axis] = min(0.5, max(-0.5, stick))


@kernel()
def delayed_control(m, d, offsets, actuator, address, now, period):
    """Return an actuator's control as it was one delay before `now`, linear between ticks.

    Args:
        m: address of mjModel.
        d: address of mjData.
        offsets: of the fields.
        actuator: its id.
        address: of its control.
        now: s.
        period: s, for which the control is held; whatever the time step, it is read at ticks.
    """
    buffer = ints(m, offsets.actuator_historyadr)[actuator]
    delay = doubles(m, offsets.actuator_delay)[actuator]
    if buffer < 0 or delay <= 0.0:
        return doubles(d, offsets.ctrl)[address]
    wanted = now - delay
    tick = period * math.floor(wanted / period + 1e-6)
    ahead = max(0.0, (wanted - tick) / period)
    before = past_control(m, d, offsets, actuator, tick)
    return before + ahead * (past_control(m, d, offsets, actuator, tick + period) - before)


@kernel()
def past_control(m, d, offsets, actuator, time):
    """Return an actuator's control at a past time: its newest sample not after it."""
    buffer = ints(m, offsets.actuator_historyadr)[actuator]
    count = ints(m, offsets.actuator_history)[2 * actuator]
    history = doubles(d, offsets.history)
    times, values = buffer + 2, buffer + 2 + count
    newest = int(history[buffer + 1])
    for back in range(count):
        k = (newest - back) % count
        if history[times + k] <= time + 1e-9:
            return history[values + k]
    return history[values + (newest + 1) % count]


@kernel()
def last_tick(par, clock):
    """Return the time at which the gyro last acted, s."""
    period = par[PARAM.gyro_period]
    return period * math.floor(clock / period + 1e-6)


@kernel()
def yaw_law(m, d, offsets, rotor_id, par, act, first, control, seen):
    """Return what the yaw gyro integrates, the derivative of its lead, and the tail command."""
    sensordata = doubles(d, offsets.sensordata)
    _, _, r = frames.flip(sensordata[seen - 3], sensordata[seen - 2], sensordata[seen - 1])
    now = last_tick(par, sensordata[seen + _REPORTS])
    period = par[PARAM.gyro_period]
    stick = delayed_control(m, d, offsets, rotor_id - ROTOR + 3, control + 3, now, period)
    error, lead_rate = gyro.yaw_error(
        stick,
        r,
        act[first + STATE.gyro_r_lead],
        par[PARAM.gyro_k_delta],
        par[PARAM.gyro_k_a],
        par[PARAM.gyro_lead],
        par[PARAM.gyro_lead_filter],
        par[PARAM.gyro_lead_lag],
    )
    # The state integrates what is held, by the trapezoidal rule; the integral of the lead's
    # part of the rate is the lead times the filtered rate.
    plain = par[PARAM.gyro_k_delta] * stick - par[PARAM.gyro_k_a] * r
    led = par[PARAM.gyro_k_a] * par[PARAM.gyro_lead] * act[first + STATE.gyro_r_lead]
    integral = act[first + STATE.gyro_r_integral] - led + 0.5 * par[PARAM.gyro_period] * plain
    integral *= par[PARAM.gyro_heading_lock]
    command = gyro.yaw_command(error, integral, par[PARAM.gyro_k_p], par[PARAM.gyro_k_i])
    return plain, lead_rate, command


@kernel()
def cyclic_law(par, act, first, lat_stick, lon_stick):
    """Return the two rate errors and the cyclic commands lat, lon of the gyro."""
    p = act[first + STATE.gyro_p_filter]
    q = act[first + STATE.gyro_q_filter]
    p_error = par[PARAM.gyro_p_per_lat] * lat_stick + par[PARAM.gyro_p_per_lon] * lon_stick - p
    q_error = par[PARAM.gyro_q_per_lat] * lat_stick + par[PARAM.gyro_q_per_lon] * lon_stick - q
    slow = par[PARAM.gyro_derivative_lag]
    p_rate = (p - act[first + STATE.gyro_p_derivative]) / slow
    q_rate = (q - act[first + STATE.gyro_q_derivative]) / slow
    lat, lon = gyro.rotate(
        par[PARAM.gyro_phase_cosine],
        par[PARAM.gyro_phase_sine],
        par[PARAM.gyro_ki_lat] * act[first + STATE.gyro_p_integral]
        - par[PARAM.gyro_kd_lat] * p_rate,
        par[PARAM.gyro_ki_lon] * act[first + STATE.gyro_q_integral]
        - par[PARAM.gyro_kd_lon] * q_rate,
    )
    lat += par[PARAM.gyro_kp_lat] * p_error
    lon += par[PARAM.gyro_kp_lon] * q_error
    return p_error, q_error, lat, lon


@kernel()
def control(m, d, offsets):
    """Fly every vehicle: pilot to sticks, gyro to servo commands. What mjcb_control does.

    Both act at the gyro's ticks; in between, sticks and servo commands are held.
    """
    if long(m, offsets.nuser_actuator) < _NPARAM:
        return
    for rotor_id in range(long(m, offsets.nactuator)):
        if not is_rotor(m, offsets, rotor_id):
            continue
        par = parameters(m, offsets, rotor_id)
        body = body_of(m, offsets, rotor_id)
        seen = reports(m, offsets, body)
        if seen < 0 or not is_tick(
            m, d, offsets, par, doubles(d, offsets.sensordata)[seen + _REPORTS]
        ):
            continue
        first = state_of(m, d, offsets, rotor_id)
        address = control_of(m, offsets, rotor_id)
        controls = _doubles_at(_longs_at(d + offsets.ctrl)[0] + 8 * address)
        act = doubles(d, offsets.act)
        if par[PARAM.pilot_on] != 0.0:
            fly(m, d, offsets, rotor_id, par, body, controls)
            controls[ROTOR] = 1.0
        if par[PARAM.gyro_on] != 0.0:
            _, _, ped = yaw_law(m, d, offsets, rotor_id, par, act, first, address, seen)
            _, _, lat, lon = cyclic_law(par, act, first, controls[2], controls[1])
            lat = min(0.5, max(-0.5, lat))
            lon = min(0.5, max(-0.5, lon))
            controls[4], controls[5], controls[6] = servo.mix(controls[0], lon, lat)
            controls[7] = min(0.5, max(-0.5, ped))


@kernel()
def activation_rates(m, d, offsets, actuator):
    """Write the derivatives of one actuator's activations. What mjcb_act_dyn does."""
    if long(m, offsets.nuser_actuator) < _NPARAM:
        return 0.0
    user = parameters(m, offsets, actuator)
    if user[PARAM.magic] != MAGIC:
        return 0.0
    ordinal = int(user[PARAM.ordinal])
    rotor_id = actuator - ordinal + ROTOR
    par = parameters(m, offsets, rotor_id)
    first = state_of(m, d, offsets, rotor_id)
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
    if speed >= _STOPPED:
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
def gyro_derivatives(m, d, offsets, rotor_id, par, first, ordinal):
    """Write the derivatives of the gyro's states that belong to one stick.

    What the gyro sees and the sticks are held between its ticks, so the integrals are exactly
    those of a sampled controller, and the filters its exact discretisation.
    """
    seen = reports(m, offsets, body_of(m, offsets, rotor_id))
    if par[PARAM.gyro_on] == 0.0 or seen < 0:
        return
    act = doubles(d, offsets.act)
    rate = doubles(d, offsets.act_dot)
    address = control_of(m, offsets, rotor_id)
    sticks = doubles(d, offsets.ctrl)
    sensordata = doubles(d, offsets.sensordata)
    p, q, _ = frames.flip(sensordata[seen - 3], sensordata[seen - 2], sensordata[seen - 1])
    if ordinal == 3:
        error, lead_rate, command = yaw_law(m, d, offsets, rotor_id, par, act, first, address, seen)
        rate[first + STATE.gyro_r_lead] = lead_rate
        held = par[PARAM.gyro_heading_lock] * gyro.hold_when_saturated(error, command, 0.5)
        rate[first + STATE.gyro_r_integral] = held
        return
    p_error, q_error, lat, lon = cyclic_law(
        par, act, first, sticks[address + 2], sticks[address + 1]
    )
    slow, fast = par[PARAM.gyro_derivative_filter], par[PARAM.gyro_filter]
    if ordinal == 2:
        signal, error, command, k = p, p_error, lat, STATE.gyro_p_filter
    else:
        signal, error, command, k = q, q_error, lon, STATE.gyro_q_filter
    rate[first + k] = gyro.filter_rate(act[first + k], signal, fast)
    rate[first + k + 1] = gyro.hold_when_saturated(error, command, 0.5)
    rate[first + k + 2] = gyro.filter_rate(act[first + k + 2], act[first + k], slow)


@kernel()
def sensor(m, d, offsets, stage):
    """Write what the recorder needs beside MuJoCo's own sensors. What mjcb_sensor does."""
    if stage != _ACCELERATION_STAGE or long(m, offsets.nuser_actuator) < _NPARAM:
        return
    for rotor_id in range(long(m, offsets.nactuator)):
        if not is_rotor(m, offsets, rotor_id):
            continue
        body = body_of(m, offsets, rotor_id)
        address = reports(m, offsets, body)
        if address >= 0:
            report(m, d, offsets, rotor_id, body, address)


@kernel()
def report(m, d, offsets, rotor_id, body, address):
    """Write a vehicle's eighteen user-sensor numbers; they are consecutive."""
    par = parameters(m, offsets, rotor_id)
    first = state_of(m, d, offsets, rotor_id)
    act = doubles(d, offsets.act)
    control = _doubles_at(_longs_at(d + offsets.ctrl)[0] + 8 * control_of(m, offsets, rotor_id))
    out = _doubles_at(_longs_at(d + offsets.sensordata)[0] + 8 * address)
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
