"""How rotors are drawn where they are looked at: tilted further, and turning slower, than true."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

TILT_GAIN = 10.0
"""The disc is drawn tilted this many times as far: a sweep's half a degree would not be seen."""
SLOWED = 30.0
"""Blades are drawn turning this many times slower: 28 turns a second would only flicker."""


def drawn_tilt(a: ArrayLike, b: ArrayLike) -> Rotation:
    """Return how the tip-path plane is drawn, from the hub's axes, forward-right-down.

    Args:
        a: rearward tilt, rad, (n_time,) or a number.
        b: rightward tilt, rad, of the same shape.
    """
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    return Rotation.from_rotvec(TILT_GAIN * np.stack([b, a, np.zeros_like(a)], axis=-1))


def drawn_turn(time: ArrayLike, speed: float) -> NDArray[np.float64]:
    """Return how far blades of a speed in rad/s are drawn to have turned, rad; (n_time,) each."""
    return np.asarray(time, dtype=np.float64) * speed / SLOWED


@dataclass(frozen=True, eq=False)
class RotorGeoms:
    """The geoms of one rotor, moved in mjData for a picture alone; the next step undoes it.

    Attributes:
        body: that carries them.
        ids: (n,) of the geoms.
        positions: (n, 3) m, in the body's axes.
        matrices: (n, 3, 3), from the geoms' axes to the body's.
    """

    body: int
    ids: NDArray[np.intp]
    positions: NDArray[np.float64]
    matrices: NDArray[np.float64]

    @classmethod
    def of(cls, model: mujoco.MjModel, body: str) -> "RotorGeoms":
        """Return those of a body, none of which may collide."""
        number = model.body(body).id
        ids = np.flatnonzero((model.geom_bodyid == number) & (model.geom_contype == 0))
        turns = Rotation.from_quat(model.geom_quat[ids], scalar_first=True)
        return cls(number, ids, model.geom_pos[ids].copy(), turns.as_matrix())

    def place(self, data: mujoco.MjData, turn: NDArray[np.float64]) -> None:
        """Turn the geoms by a (3, 3) rotation in the body's axes."""
        frame = data.xmat[self.body].reshape(3, 3) @ turn
        data.geom_xpos[self.ids] = data.xpos[self.body] + self.positions @ frame.T
        data.geom_xmat[self.ids] = (frame @ self.matrices).reshape(-1, 9)
