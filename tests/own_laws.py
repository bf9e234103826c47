"""Control laws of a user: at the top of a module, as another process must find them."""

import math

import numba

from helisim.vehicle import Controller


def attitude(seen, state, settings):
    """Hold roll and pitch by rates, angles, forces and servo positions, and the heading."""
    k_rate, k_angle, k_force, k_servo, k_sum, phi, theta, ax, ay, lon_0, lat_0 = settings
    state[0] = 0.9 * state[0] + 0.1 * seen.p
    state[1] = 0.9 * state[1] + 0.1 * seen.q
    lat = k_angle * (seen.LAT + phi - seen.phi) - k_rate * state[0] - k_force * (seen.ay - ay)
    lon = k_angle * (seen.LON + theta - seen.theta) - k_rate * state[1] + k_force * (seen.ax - ax)
    lat, lon = lat + lat_0, lon + lon_0
    error = seen.PED - seen.r
    state[2] += k_sum * error
    ped = 0.3 * error + state[2] + 0.02 * math.sin(seen.psi)
    col = seen.COL + k_servo * (seen.front + seen.left + seen.right - 3.0 * seen.COL)
    across = 0.5 * math.sqrt(3.0) * lat
    return col + lon, col - 0.5 * lon + across, col - 0.5 * lon - across, ped


def attitude_from_trim(seen, state):
    """Start with the pedal where the tail servo stands."""
    state[2] = seen.tail


def attitude_settings(vehicle):
    """Return the settings of `attitude` with which centred sticks hold the vehicle's trim."""
    trim = vehicle.trim
    phi, theta = trim.phi, trim.theta
    gravity = -vehicle.model.opt.gravity[2]
    force = (gravity * math.sin(theta), -gravity * math.sin(phi) * math.cos(theta))
    return [0.06, 0.25, 0.002, 0.1, 0.002, phi, theta, *force, trim.lon, trim.lat]


attitude_native = numba.njit(attitude)
attitude_from_trim_native = numba.njit(attitude_from_trim)


class Counter:
    """An object as a law: remembers outside of its state how often it was called."""

    states = 1

    def __init__(self):
        self.calls = 0
        self.resets = 0

    def __call__(self, seen, state):
        self.calls += 1
        state[0] += 1.0
        return seen.front, seen.left, seen.right, seen.tail + 1e-7 * math.sin(self.calls)

    def reset(self, seen, state):
        self.resets += 1
        state[0] = 100.0 * self.resets + seen.time


def attitude_controllers(vehicle, settings=None):
    """Return `attitude` as controllers of a vehicle: in Python, and compiled."""
    given = {"states": 3, "settings": settings or attitude_settings(vehicle)}
    python = Controller(attitude, reset=attitude_from_trim, **given)
    reset = attitude_from_trim_native
    return python, Controller(attitude_native, reset=reset, **given)
