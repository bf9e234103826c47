"""Where helicopters are and how they move, a column each: what tasks observe and reward."""

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from helisim.physics import motion as frames
from helisim.physics.kernel import fingerprint
from helisim.physics.layout import STATE
from helisim.vehicle.motion import addresses

Columns = NDArray[np.float64]


class Motions(NamedTuple):
    """The motions of n helicopters, all arrays with a column each. SI, field axes.

    Attributes:
        time: (n,) s since the start of the episode.
        position: (3, n) north, east, down of the body's origin, m.
        velocity: (3, n) the same axes, over the ground, m/s.
        body_velocity: (3, n) u, v, w over the ground, body axes, m/s.
        rates: (3, n) p, q, r, rad/s.
        attitude: (3, n) phi, theta, psi, rad; psi from -pi to pi.
        heading: (2, n) cosine and sine of psi.
        flapping: (2, n) rearward and right tilt of the tip-path plane, rad.
    """

    time: Columns
    position: Columns
    velocity: Columns
    body_velocity: Columns
    rates: Columns
    attitude: Columns
    heading: Columns
    flapping: Columns

    def level(self, vectors: Columns) -> Columns:
        """Return vectors in earth axes, (3, n), as ahead, right and below along the heading."""
        (cosine, sine), turned = self.heading, np.empty_like(vectors)
        turned[0] = cosine * vectors[0] + sine * vectors[1]
        turned[1] = cosine * vectors[1] - sine * vectors[0]
        turned[2] = vectors[2]
        return turned


_ROWS = np.cumsum([0, 1, 3, 3, 3, 3, 3, 2, 2]).tolist()
"""Where each of the arrays starts in the memory that they share."""


class StateReader:
    """Reads `Motions` from MuJoCo's full physics states of one vehicle's model."""

    def __init__(self, model: mujoco.MjModel) -> None:
        velocity = 1 + model.nq
        flapping = velocity + model.nv + addresses(model).state + STATE.flap_a
        self._fill = _compiled(velocity, flapping, fingerprint())

    def read(self, states: NDArray[np.float64]) -> Motions:
        """Return the motions of states, (n, n_state).

        Each is read alone, so that a helicopter's numbers are the same to the bit among others.
        """
        rows = np.empty((_ROWS[-1], len(states)))
        self._fill(states, rows)
        time, *others = (rows[first:last] for first, last in pairwise(_ROWS))
        return Motions(time[0], *others)


@cache
def _compiled(velocity: int, flapping: int, sources: int) -> Callable[[Columns, Columns], None]:
    """Return what reads states whose velocities and flapping start at these elements.

    `sources` is a fingerprint of what it calls: a cache on disk knows a function by it too.
    """
    try:
        return _compile(velocity, flapping, sources, cached=True)
    except RuntimeError as error:
        if "cache" not in str(error):
            raise
        return _compile(velocity, flapping, sources, cached=False)


def _compile(
    velocity: int, flapping: int, sources: int, *, cached: bool
) -> Callable[[Columns, Columns], None]:
    @njit("void(float64[:, ::1], float64[:, ::1])", cache=cached, error_model="numpy")
    def fill(states, rows):
        _ = sources
        for n in range(states.shape[0]):
            state = states[n]
            xmat = _rotation(state[4], state[5], state[6], state[7])
            x, y, z = state[velocity], state[velocity + 1], state[velocity + 2]
            rows[0, n] = state[0]
            rows[1, n], rows[2, n], rows[3, n] = frames.flip(state[1], state[2], state[3])
            rows[4, n], rows[5, n], rows[6, n] = frames.flip(x, y, z)
            rows[7, n], rows[8, n], rows[9, n] = frames.to_body(xmat, x, y, z)
            p, q, r = state[velocity + 3], state[velocity + 4], state[velocity + 5]
            rows[10, n], rows[11, n], rows[12, n] = frames.flip(p, q, r)
            rows[13, n], rows[14, n], rows[15, n] = frames.euler_angles(xmat)
            rows[16, n], rows[17, n] = np.cos(rows[15, n]), np.sin(rows[15, n])
            rows[18, n], rows[19, n] = state[flapping], state[flapping + 1]

    return fill


@njit
def _rotation(w, x, y, z):
    """Return MuJoCo's rotation from body to world, row-major, (9,), of a quaternion."""
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
