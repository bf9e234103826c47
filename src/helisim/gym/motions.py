"""Where helicopters are and how they move, a column each: what tasks observe and reward."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.physics.layout import STATE
from helisim.vehicle.motion import addresses

Columns = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motions:
    """The motions of n helicopters, all arrays with a column each. SI, field axes.

    Angles and sums are computed element by element, so that a helicopter's numbers are the same
    to the bit alone and among others.

    Attributes:
        time: (n,) s since the start of the episode.
        position: (3, n) north, east, down of the centre of gravity, m.
        velocity: (3, n) the same axes, over the ground, m/s.
        rates: (3, n) p, q, r, rad/s.
        flapping: (2, n) rearward and right tilt of the tip-path plane, rad.
        axes: (3, 3, n): row i holds the north, east or down component of forward, right and down.
    """

    time: Columns
    position: Columns
    velocity: Columns
    rates: Columns
    flapping: Columns
    axes: Columns

    @cached_property
    def body_velocity(self) -> Columns:
        """u, v, w over the ground in body axes, m/s, (3, n)."""
        north, east, down = self.velocity
        return self.axes[0] * north + self.axes[1] * east + self.axes[2] * down

    @cached_property
    def tilt(self) -> Columns:
        """Roll and pitch angle, phi and theta, rad, (2, n)."""
        axes, angles = self.axes, np.empty_like(self.flapping)
        np.arctan2(axes[2, 1], axes[2, 2], out=angles[0])
        np.arcsin(np.minimum(np.maximum(-axes[2, 0], -1.0), 1.0), out=angles[1])
        return angles

    @property
    def psi(self) -> Columns:
        """The heading from -pi to pi, rad, (n,)."""
        return np.arctan2(self.axes[1, 0], self.axes[0, 0])

    @cached_property
    def heading(self) -> Columns:
        """Cosine and sine of the heading, (2, n)."""
        ahead = self.axes[:2, 0]
        return ahead / np.maximum(np.hypot(ahead[0], ahead[1]), 1e-9)

    def level(self, vectors: Columns) -> Columns:
        """Return vectors in earth axes, (3, n), as ahead, right and below along the heading."""
        (cosine, sine), turned = self.heading, np.empty_like(vectors)
        turned[0] = cosine * vectors[0] + sine * vectors[1]
        turned[1] = cosine * vectors[1] - sine * vectors[0]
        turned[2] = vectors[2]
        return turned


class StateReader:
    """Reads `Motions` from MuJoCo's full physics states of one vehicle's model."""

    def __init__(self, model: mujoco.MjModel) -> None:
        first = 1 + model.nq + model.nv + addresses(model).state
        velocity = 1 + model.nq
        self._rows = np.array([*range(8), *range(velocity, velocity + 6), first + STATE.flap_a,
                               first + STATE.flap_b])  # fmt: skip

    def read(self, states: NDArray[np.float64]) -> Motions:
        """Return the motions of states, (n, n_state)."""
        rows = np.ascontiguousarray(states[:, self._rows].T)
        rows[2:4] *= -1.0  # to north, east, down, as `frames.flip` does
        rows[9:11] *= -1.0
        rows[12:14] *= -1.0
        return Motions(rows[0], rows[1:4], rows[8:11], rows[11:14], rows[14:16], _axes(rows[4:8]))


def _axes(quaternions: Columns) -> Columns:
    """Return the body's axes in the earth's, (3, 3, n), of MuJoCo's quaternions, (4, n).

    Turning both frames from north-west-up to north-east-down changes the sign of y and z.
    """
    doubled = (2.0 * quaternions)[:, None] * quaternions  # of w, x, y, z, (4, 4, n)
    wx, wy, wz = doubled[0, 1:]
    xx, xy, xz = doubled[1, 1:]
    yy, yz = doubled[2, 2:]
    zz = doubled[3, 3]
    axes = np.empty((3, 3, quaternions.shape[1]))
    np.subtract(1.0, yy + zz, out=axes[0, 0])
    np.subtract(1.0, xx + zz, out=axes[1, 1])
    np.subtract(1.0, xx + yy, out=axes[2, 2])
    np.subtract(-wz, xy, out=axes[1, 0])
    np.subtract(wz, xy, out=axes[0, 1])
    np.subtract(wy, xz, out=axes[2, 0])
    np.subtract(-wy, xz, out=axes[0, 2])
    np.add(wx, yz, out=axes[2, 1])
    np.subtract(yz, wx, out=axes[1, 2])
    return axes
