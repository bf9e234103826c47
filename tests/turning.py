"""A flight that turns much, integrated by scipy's rotations: every channel of its motion.

Attitudes to 60 degrees, so that Euler's angles' derivatives are not the rates.
"""

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

RATE = 100.0
GRAVITY = 9.80665
_FINE = 1000.0
_POLE, _SLOW = np.exp(-2.0 * np.pi * np.array([1.2, 0.15]) / _FINE)


def flight(duration=60.0, seed=0, *, size=1.0, noise=0.0):
    """Return time, and SI channels by name: p to r, phi to psi, u to w, north to down, ax to az.

    Rates and velocities are noise from 0.15 to 1.2 Hz; the rest follows from them.
    """
    random = np.random.default_rng(seed)
    fine, every = _FINE, round(_FINE / RATE)
    count = int(duration * fine)
    white = random.standard_normal((count, 6))
    columns = white - np.mean(white, axis=0)
    for _ in range(3):  # to about 1 Hz
        columns = lfilter([1.0 - _POLE], [1.0, -_POLE], columns, axis=0)
    drift = lfilter([1.0 - _SLOW], [1.0, -_SLOW], columns, axis=0)
    columns = (columns - drift) / np.std(columns - drift, axis=0)
    rates, velocity = 0.5 * size * columns[:, :3], 2.0 * size * columns[:, 3:]
    attitude = np.empty((count, 4))
    quaternions = Rotation.from_rotvec(rates / fine).as_quat()  # exact for a constant rate
    q = Rotation.identity().as_quat()
    for k in range(count):
        attitude[k] = q
        x, y, z, w = q
        a, b, c, d = quaternions[k]
        q = np.array(
            [
                w * a + x * d + y * c - z * b,
                w * b - x * c + y * d + z * a,
                w * c + x * b - y * a + z * d,
                w * d - x * a - y * b - z * c,
            ]
        )
    turned = Rotation.from_quat(attitude)
    psi, theta, phi = turned.as_euler("ZYX").T
    world = turned.apply(velocity)
    position = np.cumsum(world, axis=0) / fine
    force = turned.inv().apply(np.gradient(world, 1.0 / fine, axis=0) - [0.0, 0.0, GRAVITY])
    table = {
        **dict(zip("pqr", rates.T)),
        "phi": phi,
        "theta": theta,
        "psi": np.unwrap(psi),
        **dict(zip("uvw", velocity.T)),
        **dict(zip(("north", "east", "down"), position.T)),
        **dict(zip(("ax", "ay", "az"), force.T)),
    }
    time = np.arange(count) / fine
    spoiled = {
        name: values[::every] + noise * np.std(values) * random.standard_normal(count // every)
        for name, values in table.items()
    }
    return time[::every], spoiled
