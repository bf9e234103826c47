"""The pilot: holds the hover, flies sweeps and doublets, with a human's remnant.

All are functions of time, state and parameters: independent of threads and time step.
"""

import math

import numpy as np

from helisim.physics.controller import injected, is_injected
from helisim.physics.kernel import kernel
from helisim.physics.layout import (
    CONTROL,
    DOUBLET,
    HANDS_OFF_ROTOR,
    INJECTION,
    PARAM,
    ROLL_ATTITUDE,
    ROLL_VELOCITY,
    SWEEP,
)
from helisim.physics.memory import double, doubles_from
from helisim.physics.motion import euler_angles, flip, rotation, to_body, velocity

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_CHANNEL_STRIDE = np.uint64(0xD1342543DE82EF95)
_LANE = np.uint64(0xFFFF)
_EXPONENT = 4.0  # C1 (Tischler and Remple, ch. 5)


@kernel(forceinline=False)
def hashed_noise(seed, channel, knot):
    """Return a number of zero mean and unit variance (SplitMix64: Steele, Lea and Flood, 2014)."""
    x = np.uint64(np.int64(seed)) * _GOLDEN + np.uint64(np.int64(channel)) * _CHANNEL_STRIDE
    x = x + np.uint64(np.int64(knot)) * _MIX_1
    for _ in range(2):
        x = x + _GOLDEN
        x = (x ^ (x >> np.uint64(30))) * _MIX_1
        x = (x ^ (x >> np.uint64(27))) * _MIX_2
        x = x ^ (x >> np.uint64(31))
    total = (x & _LANE) + ((x >> np.uint64(16)) & _LANE)
    total = total + ((x >> np.uint64(32)) & _LANE) + (x >> np.uint64(48))
    return (float(total) / 65535.0 - 2.0) * math.sqrt(3.0)


@kernel(forceinline=False)
def remnant(time, interval, seed, channel):
    """Return noise of unit variance, white at knots `interval` apart and linear between."""
    position = time / interval
    knot = math.floor(position)
    ahead = position - knot
    before = hashed_noise(seed, channel, int(knot))
    after = hashed_noise(seed, channel, int(knot) + 1)
    return ((1.0 - ahead) * before + ahead * after) * math.sqrt(1.5)


@kernel()
def sweep_phase(time, duration, w_min, w_max):
    """Return the phase (rad) of an exponential sweep, time in s, frequencies in rad/s.

    Integral of w_min + C2 (exp(C1 t/T) - 1)(w_max - w_min), with C1 = 4 and C2 = 1/(e^4 - 1).
    """
    grown = math.expm1(_EXPONENT * time / duration)
    span = (w_max - w_min) / math.expm1(_EXPONENT)
    return w_min * time + span * (duration / _EXPONENT * grown - time)


@kernel()
def sweep(time, duration, w_min, w_max, fade, unsteadiness, seed):
    """Return an imperfect sweep of about unit amplitude; zero before 0 and after `duration`.

    time, duration, fade: s; w_min, w_max: rad/s; unsteadiness: of amplitude, and of phase in rad.
    """
    if time <= 0.0 or time >= duration:
        return 0.0
    envelope = min(1.0, time / fade, (duration - time) / fade)
    phase = sweep_phase(time, duration, w_min, w_max)
    if unsteadiness > 0.0:
        envelope *= 1.0 + unsteadiness * remnant(time, 2.0, seed, 11)
        phase += unsteadiness * remnant(time, 3.0, seed, 12)
    return envelope * math.sin(phase)


@kernel()
def doublet(time, duration):
    """Return +1 for the first half of `duration`, -1 for the second, 0 elsewhere."""
    if time < 0.0 or time >= duration:
        return 0.0
    return 1.0 if time < 0.5 * duration else -1.0


@kernel()
def wrap_to_pi(angle):
    """Return an angle's equal in [-pi, pi], rad."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@kernel()
def excitation(par, time):
    """Return what the pilot does on purpose, a sweep or a doublet of about unit amplitude."""
    since = time - par[PARAM.excitation_start]
    duration = par[PARAM.excitation_duration]
    if par[PARAM.excitation] == SWEEP:
        return sweep(
            since,
            duration,
            par[PARAM.sweep_w_min],
            par[PARAM.sweep_w_max],
            par[PARAM.sweep_fade],
            par[PARAM.sweep_unsteadiness],
            par[PARAM.pilot_seed],
        )
    return doublet(since, duration) if par[PARAM.excitation] == DOUBLET else 0.0


@kernel()
def hold(par, matrix, north, east, down, u, v, w):
    """Return the sticks COL, LON, LAT, PED that keep the hover, slowly.

    matrix: body to world, MuJoCo's axes, row-major, (9,); north, east, down: m; u, v, w: m/s, body.
    """
    phi, theta, psi = euler_angles(matrix)
    cosine, sine = math.cos(psi), math.sin(psi)
    off_north = par[PARAM.pilot_north] - north
    off_east = par[PARAM.pilot_east] - east
    ahead = cosine * off_north + sine * off_east
    right = -sine * off_north + cosine * off_east
    u_error = par[PARAM.pilot_k_position] * ahead - u
    v_error = par[PARAM.pilot_k_position] * right - v
    across = par[PARAM.pilot_k_velocity] + par[ROLL_VELOCITY]
    theta_error = par[PARAM.pilot_theta] - par[PARAM.pilot_k_velocity] * u_error - theta
    phi_error = par[PARAM.pilot_phi] + across * v_error - phi
    w_error = par[PARAM.pilot_k_height] * (par[PARAM.pilot_down] - down) - w
    psi_error = wrap_to_pi(par[PARAM.pilot_psi] - psi)
    return (
        par[PARAM.pilot_col] - par[PARAM.pilot_k_heave] * w_error,
        par[PARAM.pilot_lon] + par[PARAM.pilot_k_attitude] * theta_error,
        par[PARAM.pilot_lat] + (par[PARAM.pilot_k_attitude] + par[ROLL_ATTITUDE]) * phi_error,
        par[PARAM.pilot_ped] + par[PARAM.pilot_k_heading] * psi_error,
    )


@kernel()
def fly(view):
    """Write the pilot's four sticks, and keep the rotor's governor on, unless he leaves it."""
    par, controls = view.par, view.controls
    time = double(view.d, view.offsets.time)
    matrix = rotation(view)
    position = doubles_from(view.d, view.offsets.xpos, 3 * view.body)
    north, east, down = flip(position[0], position[1], position[2])
    u, v, w = to_body(matrix, *velocity(view))
    held = hold(par, matrix, north, east, down, u, v, w)
    seed, interval = par[PARAM.pilot_seed], par[PARAM.remnant_interval]
    excited = excitation(par, time)
    has_history, history = is_injected(view), injected(view)
    for axis in range(4):
        stick = held[axis] + par[PARAM.excitation_col + axis] * excited
        if has_history:
            stick += history[INJECTION.stick_col + axis]
        level = par[PARAM.remnant_col + axis]
        if level > 0.0:
            stick += level * remnant(time, interval, seed, axis)
        controls[CONTROL.col + axis] = min(0.5, max(-0.5, stick))
    if par[PARAM.pilot_on] != HANDS_OFF_ROTOR:
        controls[CONTROL.rotor] = 1.0
