"""How far the lowest point of a helicopter is from the ground."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.physics.motion import flip
from helisim.vehicle import Vehicle


class Outline(NamedTuple):
    """What can touch the ground, from the IMU, body axes, m.

    Attributes:
        points: (n, 3): ends of capsules; of another shape the centre.
        radii: (n,): of the spheres around the points.
        discs: centre, axis and radius of each rotor's disc.
    """

    points: NDArray[np.float64]
    radii: NDArray[np.float64]
    discs: tuple[tuple[NDArray[np.float64], NDArray[np.float64], float], ...]

    @property
    def reach(self) -> float:
        """How far any of it is from the IMU, m: higher above the ground no attitude matters."""
        reach = float(np.max(np.linalg.norm(self.points, axis=1) + self.radii, initial=0.0))
        for centre, _, radius in self.discs:
            reach = max(reach, float(np.linalg.norm(centre)) + radius)
        return reach

    def closer_than(
        self,
        least: float,
        positions: NDArray[np.float64],
        attitudes: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Return where the clearance is less than some metres, (n_time,).

        Positions and attitudes, (n_time, 3) each, are those of `clearance`. High above the ground
        no attitude is looked at.
        """
        low = -positions[:, 2] < least + self.reach
        if low.any():
            low[low] = _clearance(self, positions[low], attitudes[low]) < least
        return low


def clearance(
    vehicle: Vehicle, positions: NDArray[np.float64], attitudes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the height of the lowest point of landing gear and rotor discs, m, (n_time,).

    Args:
        vehicle: that flies over a ground at height 0.
        positions: (n_time, 3) north, east, down of the IMU, m.
        attitudes: (n_time, 3) phi, theta, psi, rad.
    """
    return _clearance(outline(vehicle), positions, attitudes)


def _clearance(
    outline: Outline, positions: NDArray[np.float64], attitudes: NDArray[np.float64]
) -> NDArray[np.float64]:
    phi, theta = attitudes[:, 0], attitudes[:, 1]
    level = np.cos(theta)
    down = np.column_stack([-np.sin(theta), level * np.sin(phi), level * np.cos(phi)])
    lowest = (down @ outline.points.T + outline.radii).max(axis=1)
    for centre, axis, radius in outline.discs:
        rim = radius * np.sqrt(np.maximum(0.0, 1.0 - (down @ axis) ** 2))
        lowest = np.maximum(lowest, down @ centre + rim)
    return -positions[:, 2] - lowest


def outline(vehicle: Vehicle) -> Outline:
    """Return what can touch the ground: what collides in MuJoCo, and both rotors' discs."""
    model, own = vehicle.model, vehicle.parameters
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)  # level and heading north, as the model is drawn
    imu = data.site(vehicle.roles.site("imu")).xpos

    def place(where: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array(flip(*(where - imu)))

    points, radii = [], []
    for geom in np.flatnonzero(model.geom_conaffinity | model.geom_contype):
        centre = data.geom_xpos[geom]
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
            half = data.geom_xmat[geom].reshape(3, 3)[:, 2] * model.geom_size[geom, 1]
            points += [place(centre + half), place(centre - half)]
            radii += [model.geom_size[geom, 0]] * 2
        else:
            points.append(place(centre))
            radii.append(model.geom_rbound[geom])
    hub, tail = (place(data.site(vehicle.roles.site(role)).xpos) for role in ("hub", "tail_hub"))
    discs = (
        (hub, np.array([0.0, 0.0, 1.0]), own["main_rotor.radius"]),
        (tail, np.array([0.0, 1.0, 0.0]), own["tail_rotor.radius"]),
    )
    return Outline(np.array(points).reshape(-1, 3), np.array(radii), discs)
