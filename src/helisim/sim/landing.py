"""What becomes of a flight that meets the ground: a landing, a rotor's strike, a fall."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.sim.clearance import Outline
from helisim.sim.ground import Ground
from helisim.sim.trajectory import Trajectory

HARDEST_LANDING = 2.5
"""m/s, of sinking, that landing gear stands: a drop from 13 inches (14 CFR 27.725)."""
_ROTORS = ("main", "tail")
_JUST = 0.2
"""s after which a helicopter that has left the ground is in the air."""


def touching(trajectory: Trajectory) -> NDArray[np.bool_]:
    """Return at which samples the helicopter touches something, (n_time,)."""
    return np.any(trajectory.contact != 0.0, axis=1)


def touched_before(trajectory: Trajectory, there: NDArray[np.bool_]) -> bool:
    """Return whether the helicopter has just touched something where a flag (n_time,) goes up."""
    first, before = int(np.argmax(there)), round(_JUST / trajectory.timestep)
    return bool(touching(trajectory)[max(0, first - before) : first + 1].any())


def strikes(
    shape: Outline, ground: Ground, trajectory: Trajectory, least: float
) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Yield what each rotor does and where it does so, (n_time,), as an envelope's limit.

    Args:
        shape: of the vehicle.
        ground: below the flight.
        trajectory: of the flight.
        least: clearance below which a rotor's disc strikes, m.
    """
    imu = ground.heights(trajectory.time, trajectory.positions[:, None])[:, 0]
    low = imu < least + shape.reach
    if not low.any():
        return
    near = np.zeros_like(low)
    for name, rim in rims(shape):
        near[low] = point_heights(ground, trajectory.rows(low), rim).min(axis=1) < least
        if not near.any():
            continue
        rolled = "tipped over and " if touched_before(trajectory, near) else ""
        yield f"{rolled}struck the ground with its {name} rotor", near.copy()


def rims(shape: Outline) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield each rotor's name and sixteen points on its disc's rim from the IMU, (16, 3), m."""
    angles = np.arange(16) * np.pi / 8.0
    for name, (centre, axis, radius) in zip(_ROTORS, shape.discs):
        aside = np.cross(axis, [1.0, 0.0, 0.0])
        rim = np.outer(np.cos(angles), np.cross(aside, axis)) + np.outer(np.sin(angles), aside)
        yield name, centre + radius * rim


def point_heights(
    ground: Ground, trajectory: Trajectory, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how high points of the vehicle are above what is below, (n_time, n_point), m.

    Args:
        ground: below the flight.
        trajectory: of the flight.
        points: (n_point, 3) from the vehicle's IMU, m, body axes.
    """
    turns = Rotation.from_euler("ZYX", trajectory.attitudes[:, ::-1]).as_matrix()
    places = trajectory.positions[:, None] + np.einsum("tij,nj->tni", turns, points)
    return ground.heights(trajectory.time, places)


def hard_landings(
    shape: Outline, ground: Ground, trajectory: Trajectory, limit: float
) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Yield what the first touch-down is that is too fast, and from where on, (n_time,).

    The speed is that at which the lowest point of the landing gear came down on the ground, a
    deck's own motion counted.

    Args:
        shape: of the vehicle.
        ground: below the flight.
        trajectory: of the flight.
        limit: m/s.
    """
    touches = touching(trajectory)
    starts = np.flatnonzero(touches[1:] & ~touches[:-1]) + 1
    for start in starts[starts >= 2]:
        near = trajectory.rows(slice(start - 2, start))
        gear = (point_heights(ground, near, shape.points) - shape.radii).min(axis=1)
        speed = float(gear[0] - gear[1]) / trajectory.timestep
        if speed > limit:
            yield f"hit the ground at {speed:.1f} m/s", np.arange(touches.size) >= start
            return


def ditchings(
    shape: Outline, ground: Ground, trajectory: Trajectory
) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Yield where a helicopter is beside the deck and down, (n_time,), as an envelope's limit."""
    if ground.deck is None:
        return
    above_water = trajectory.positions - [0.0, 0.0, ground.deck.above]
    yield (
        "came down beside the deck",
        shape.closer_than(0.0, above_water, trajectory.attitudes),
    )
