"""The pilot in the step: from what is seen to four sticks."""

import math

from helisim.physics import frames, pilot
from helisim.physics.body import rotation, velocity
from helisim.physics.kernel import kernel
from helisim.physics.layout import DOUBLET, PARAM, SWEEP
from helisim.physics.memory import double, doubles


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
