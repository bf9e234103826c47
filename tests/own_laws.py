"""Control laws of a user: at the top of a module, as another process must find them."""

import math
from dataclasses import replace

import numba
import numpy as np

from helisim.design.laws import AttitudeAxis, AttitudeCommand, Lead, StateSpaceLaw, YawAxis
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


def attitude_controllers(vehicle):
    """Return `attitude` as controllers of a vehicle: in Python, and compiled."""
    given = {"states": 3, "settings": attitude_settings(vehicle)}
    python = Controller(attitude, reset=attitude_from_trim, **given)
    reset = attitude_from_trim_native
    return python, Controller(attitude_native, reset=reset, **given)


HOLDS = AttitudeCommand(
    lat=AttitudeAxis(stick=0.6, frequency=6.0, k_angle=0.6, k_rate=0.05, k_integral=0.3),
    lon=AttitudeAxis(stick=0.6, frequency=6.0, k_angle=1.0, k_rate=0.1, k_integral=0.3),
    ped=YawAxis(stick=3.0, frequency=8.0, k_angle=1.0, k_rate=0.2, k_integral=0.5),
    phase=0.365,
)
"""Gains found by hand."""
LAT = {"stick": 0.6, "frequency": 6.0, "k_angle": 0.6, "k_rate": 0.05}
MORE = {"k_angle_cross": 0.02, "k_rate_cross": 0.01, "ff_acceleration": 0.001, "ff_rate": 0.01}
LEADS = (Lead(zero=20.0, pole=80.0), Lead(zero=60.0, pole=15.0))
FULL = replace(
    HOLDS,
    lat=replace(HOLDS.lat, **MORE, damping=0.7, filters=LEADS),
    lon=replace(HOLDS.lon, damping=1.4),
    ped=replace(HOLDS.ped, ff_rate=0.02, ff_acceleration=0.003),
)
"""With all that the law can do."""

INPUTS = ("p", "phi", "psi", "LAT", "COL")


def random_law(seed: int = 1, **changes) -> StateSpaceLaw:
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((5, 5))
    a *= 0.9 / np.max(np.abs(np.linalg.eigvals(a)))
    shapes = {"b": (5, 5), "c": (4, 5), "d": (4, 5), "windup": (5, 4), "start": (5, 4)}
    matrices = {name: 0.1 * rng.standard_normal(shape) for name, shape in shapes.items()}
    return StateSpaceLaw(**{"period": 0.002, "inputs": INPUTS, "a": a, **matrices, **changes})
