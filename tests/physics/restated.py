"""Pilot, gyro, servos and air a second time, from the same sources, in vectors and matrices.

Wu and Chen's eqs. (7) and (8), MIL-F-8785C's turbulence: numpy, body axes forward-right-down,
north-east-down, no address of MuJoCo's. Rotors and airframe have references of their own, and are
not restated; noise and the sweep's shape are tested by themselves and called here.
"""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
from numba import njit
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from helisim.physics import layout, pilot

hashed_noise, remnant, sweep = map(njit, (pilot.hashed_noise, pilot.remnant, pilot.sweep))

GYRO_STATES = slice(layout.STATE.gyro_q_filter, layout.STATE.gyro_r_integral + 1)
SERVOS = ("front", "left", "right", "tail")
MIX = np.array([[1, 1, 0], [1, -0.5, np.sqrt(0.75)], [1, -0.5, -np.sqrt(0.75)]])
"""Front, left and right servo from collective, longitudinal and lateral."""


@dataclass
class Moment:
    """A moment of a flight, and the vehicle's numbers by name."""

    par: np.ndarray
    time: float
    clock: float
    tick: bool
    earth: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    rates: np.ndarray
    act: np.ndarray
    ctrl: np.ndarray
    late_pedal: float
    lags: dict
    """Of the gyro's filters, s, which the force laws know by what they do in a period."""
    wind: np.ndarray = field(default_factory=lambda: np.zeros(3))
    added: np.ndarray = field(default_factory=lambda: np.zeros(len(layout.INJECTION)))
    """What a manoeuvre adds, where it is flown as a history: sticks, commands, servos, rates."""

    @property
    def p(self) -> SimpleNamespace:
        return SimpleNamespace(**dict(zip(layout.PARAM._fields, self.par)), **self.lags)

    @property
    def s(self) -> SimpleNamespace:
        return SimpleNamespace(**dict(zip(layout.STATE._fields, self.act)))

    def injected(self, first: int, count: int) -> np.ndarray:
        on = self.p.excitation == layout.HISTORY
        return on * self.added[first : first + count]

    @property
    def last_tick(self) -> float:
        return self.p.gyro_period * np.floor(self.clock / self.p.gyro_period + 1e-6)


def turbulence(p):
    """Return C, A and b: what the eight states mean, and their rates by themselves and noise."""
    unit, root = np.eye(8), np.sqrt(3.0)
    u, v_lag, w_lag, roll, v, w, q_lag, r_lag = unit
    lag_u, lag_v, lag_w, lag_p = (
        p.turbulence_lag_u,
        p.turbulence_lag_v,
        p.turbulence_lag_w,
        p.turbulence_lag_p,
    )
    side, down = root * v_lag + (1.0 - root) * v, root * w_lag + (1.0 - root) * w
    span = p.turbulence_span
    yaw, pitch = np.pi / (3.0 * span), np.pi / (4.0 * span)
    c = np.array([u, side, down, roll, pitch * (q_lag - down), yaw * (side - r_lag)])
    lags = np.array([lag_u, lag_v, lag_w, lag_p, lag_v, lag_w, lag_p, 0.75 * lag_p])
    follows = np.array([0 * u, 0 * u, 0 * u, 0 * u, v_lag, w_lag, down, side])
    levels = np.array([p.turbulence_u, p.turbulence_v, p.turbulence_w, p.turbulence_p])
    b = np.vstack([np.diag(levels * np.sqrt(2.0 * lags[:4] / p.gyro_period)), np.zeros((4, 4))])
    return c, (follows - unit) / lags[:, None], b / lags[:, None]


def gust(since, rise, hold):
    """Return the share of a gust's strength, floats or (n,): half a cosine up, half a one down."""
    knots = np.cumsum([0.0, rise, hold, rise])
    return 0.5 - 0.5 * np.cos(np.pi * np.interp(since, knots, [0.0, 1.0, 1.0, 0.0]))


def air(m):
    """Return the air's velocity and rotation, body axes, (6,)."""
    p = m.p
    velocity, rates = m.wind.copy(), np.zeros(3)
    if p.gust_rise > 0.0:
        share = gust(m.time - p.gust_start, p.gust_rise, p.gust_hold)
        velocity += share * np.array([p.gust_north, p.gust_east, p.gust_down])
    if p.turbulence_on:
        turn = Rotation.from_euler("z", np.arctan2(p.turbulence_sine, p.turbulence_cosine))
        moving = turbulence(p)[0] @ m.act[layout.STATE.air_u : layout.STATE.air_r_lag + 1]
        velocity += turn.apply(moving[:3])
        rates = turn.apply(moving[3:])
    return np.concatenate([m.earth.T @ velocity, m.earth.T @ rates])


def gyro(m):
    """Return the commands lat, lon, ped, not yet limited, and the gyro's states at the next tick.

    Filters and integrals by the matrix exponential of their equations, what is read being held.
    """
    p, s = m.p, m.s
    roll, pitch, yaw = m.rates + m.injected(layout.INJECTION.rate_p, 3)

    def unless_saturated(error, command):
        return 0.0 if abs(command) > p.gyro_hold_above and error * command > 0.0 else 1.0

    behind = yaw - s.gyro_r_lead
    plain = p.gyro_k_delta * m.late_pedal - p.gyro_k_a * yaw
    error = plain - p.gyro_k_a * p.gyro_lead / p.gyro_lead_lag * behind
    integral = s.gyro_r_integral - p.gyro_k_a * p.gyro_lead * s.gyro_r_lead
    integral += 0.5 * p.gyro_period * error
    ped = p.gyro_k_p * error + p.gyro_k_i * p.gyro_heading_lock * integral
    reach = [[p.gyro_p_per_lat, p.gyro_p_per_lon], [p.gyro_q_per_lat, p.gyro_q_per_lon]]
    y = np.array([s.gyro_p_filter, s.gyro_q_filter])
    slow = np.array([s.gyro_p_derivative, s.gyro_q_derivative])
    wanted = np.array(reach) @ m.ctrl[[2, 1]]
    errors = wanted - y
    turn = np.array(
        [[p.gyro_phase_cosine, p.gyro_phase_sine], [-p.gyro_phase_sine, p.gyro_phase_cosine]]
    )
    integrals = np.array([s.gyro_p_integral, s.gyro_q_integral])
    inner = np.array([p.gyro_ki_lat, p.gyro_ki_lon]) * integrals
    inner -= np.array([p.gyro_kd_lat, p.gyro_kd_lon]) * (y - slow) / p.gyro_derivative_lag
    cyclic = np.array([p.gyro_kp_lat, p.gyro_kp_lon]) * errors + turn @ inner
    moved = {}
    for k, (axis, rate) in enumerate((("p", roll), ("q", pitch))):
        locked = p.gyro_attitude_lock * unless_saturated(errors[k], cyclic[k])
        # of the filtered rate, the slower one and the integral of the error; then of 1
        equations = np.zeros((4, 4))
        equations[0, [0, 3]] = np.array([-1.0, rate]) / p.filter
        equations[1, [0, 1]] = np.array([1.0, -1.0]) / p.derivative_filter
        equations[2, [0, 3]] = np.array([-1.0, wanted[k]]) * locked
        after = expm(equations * p.gyro_period) @ [y[k], slow[k], integrals[k], 1.0]
        for name, value in zip(("filter", "derivative", "integral"), after):
            moved[f"gyro_{axis}_{name}"] = value
    moved["gyro_r_lead"] = yaw - np.exp(-p.gyro_period / p.lead_filter) * behind
    held = p.gyro_heading_lock * unless_saturated(plain, ped)
    moved["gyro_r_integral"] = s.gyro_r_integral + p.gyro_period * held * plain
    return np.array([*cyclic, ped]), moved


def sticks(m):
    """Return what the pilot does to COL, LON, LAT and PED."""
    p = m.p
    psi, theta, phi = Rotation.from_matrix(m.earth).as_euler("ZYX")
    heading = Rotation.from_euler("z", psi).as_matrix()
    off = np.array([p.pilot_north, p.pilot_east, p.pilot_down]) - m.position
    wanted = p.pilot_k_position * (heading.T @ off)[:2] - m.velocity[:2]
    climb = p.pilot_k_height * off[2] - m.velocity[2]
    off_heading = np.angle(np.exp(1j * (p.pilot_psi - psi)))
    held = np.array(
        [
            p.pilot_col - p.pilot_k_heave * climb,
            p.pilot_lon
            + p.pilot_k_attitude * (p.pilot_theta - p.pilot_k_velocity * wanted[0] - theta),
            p.pilot_lat
            + (p.pilot_k_attitude + m.par[layout.ROLL_ATTITUDE])
            * (p.pilot_phi + (p.pilot_k_velocity + m.par[layout.ROLL_VELOCITY]) * wanted[1] - phi),
            p.pilot_ped + p.pilot_k_heading * off_heading,
        ]
    )
    since, excited = m.time - p.excitation_start, 0.0
    if p.excitation == layout.SWEEP:
        shape = (p.sweep_w_min, p.sweep_w_max, p.sweep_fade, p.sweep_unsteadiness, p.pilot_seed)
        excited = sweep(since, p.excitation_duration, *shape)
    if p.excitation == layout.DOUBLET:
        excited = pilot.doublet(since, p.excitation_duration)
    for k, axis in enumerate(("col", "lon", "lat", "ped")):
        noise = remnant(m.time, p.remnant_interval, p.pilot_seed, k)
        held[k] += (
            getattr(p, f"excitation_{axis}") * excited + getattr(p, f"remnant_{axis}") * noise
        )
    return np.clip(held + m.injected(layout.INJECTION.stick_col, 4), -0.5, 0.5)


def control(m):
    """Return controls and states after pilot and gyro have acted, if this is one of its ticks."""
    p, ctrl, act = m.p, m.ctrl.copy(), m.act.copy()
    if not m.tick:
        return ctrl, act
    if p.pilot_on:
        ctrl[:4], ctrl[8] = sticks(m), 1.0 if p.pilot_on != layout.HANDS_OFF_ROTOR else ctrl[8]
    if p.gyro_on:
        m.ctrl = ctrl
        (lat, lon, ped), moved = gyro(m)
        starts = 0.5 if act[layout.STATE.law_tick] == 0.0 else 0.0
        act[layout.STATE.law_tick] = np.floor(m.time / p.gyro_period + 1e-6) + 1.0 + starts
        act[layout.STATE.felt_x : layout.STATE.felt_z + 1] = act[
            layout.STATE.feels_x : layout.STATE.feels_z + 1
        ]
        act[len(layout.STATE) :] = act[GYRO_STATES]
        for name, value in moved.items():
            act[getattr(layout.STATE, name)] = value
        lat, lon, ctrl[7] = np.clip([lat, lon, ped], -0.5, 0.5)
        ctrl[4:7] = MIX @ [p.gyro_collective * ctrl[0], lon, lat]
        ctrl[4:8] += m.injected(layout.INJECTION.command_front, 4)
    return ctrl, act


def state_rates(m):
    """Return the derivatives of servos and air, (n_state,), 0 for the others."""
    p, s = m.p, m.s
    rates = dict.fromkeys(layout.STATE._fields, 0.0)
    for k, name in enumerate(SERVOS):
        part = "tail" if name == "tail" else "swash"
        frequency, damping = getattr(p, f"{part}_frequency"), getattr(p, f"{part}_damping")
        command = m.ctrl[4 + k] + m.injected(layout.INJECTION.actuator_front, 4)[k]
        limit = p.servo_rate_limit
        position, rate = getattr(s, f"{name}_position"), getattr(s, f"{name}_rate")
        if p.faults and m.last_tick >= getattr(p, f"{name}_fault_at") - 1e-9:
            low, high = getattr(p, f"{name}_fault_low"), getattr(p, f"{name}_fault_high")
            command = np.clip(command, low, high)
            limit = min(limit, getattr(p, f"{name}_fault_rate_limit"))
        error = np.clip(command, -p.servo_travel, p.servo_travel) - position
        rates[f"{name}_position"] = np.clip(rate, -limit, limit)
        rates[f"{name}_rate"] = frequency**2 * error - 2.0 * damping * frequency * rate
        if limit < p.servo_rate_limit:
            wanted = np.clip(0.5 * frequency / damping * (command - position), -limit, limit)
            rates[f"{name}_rate"] = 2.0 * damping * frequency * (wanted - rate)
    if p.turbulence_on:
        noise = [
            hashed_noise(p.turbulence_seed, k, round(m.last_tick / p.gyro_period)) for k in range(4)
        ]
        _, a, b = turbulence(p)
        air_states = slice(layout.STATE.air_u, layout.STATE.air_r_lag + 1)
        rates |= dict(zip(layout.STATE._fields[air_states], a @ m.act[air_states] + b @ noise))
    moved = np.array([rates[name] for name in layout.STATE._fields])
    return np.concatenate([moved, np.zeros(m.act.size - len(layout.STATE))])
