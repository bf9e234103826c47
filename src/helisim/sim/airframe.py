"""How far the lowest point of a helicopter is from the ground."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.physics.frames import flip
from helisim.vehicle import Vehicle


def clearance(
    vehicle: Vehicle, positions: NDArray[np.float64], attitudes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the height of the lowest point of landing gear and rotor discs, m, (n,).

    Args:
        vehicle: that flies over a ground at height 0.
        positions: (n, 3) north, east, down of the IMU, m.
        attitudes: (n, 3) phi, theta, psi, rad.
    """
    points, radii = _gear(vehicle)
    discs = _discs(vehicle)
    phi, theta = attitudes[:, 0], attitudes[:, 1]
    level = np.cos(theta)
    down = np.column_stack([-np.sin(theta), level * np.sin(phi), level * np.cos(phi)])
    lowest = (down @ points.T + radii).max(axis=1)
    for centre, axis, radius in discs:
        rim = radius * np.sqrt(np.maximum(0.0, 1.0 - (down @ axis) ** 2))
        lowest = np.maximum(lowest, down @ centre + rim)
    return -positions[:, 2] - lowest


def closer_than(
    vehicle: Vehicle,
    least: float,
    positions: NDArray[np.float64],
    attitudes: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Return where the clearance is less than some metres, (n,); the rest is as for `clearance`.

    High above the ground no attitude matters, and none is looked at.
    """
    points, radii = _gear(vehicle)
    reach = float(np.max(np.linalg.norm(points, axis=1) + radii, initial=0.0))
    reach = max(
        [reach, *(np.linalg.norm(centre) + radius for centre, _, radius in _discs(vehicle))]
    )
    low = -positions[:, 2] < least + reach
    low[low] = clearance(vehicle, positions[low], attitudes[low]) < least
    return low


def _gear(vehicle: Vehicle) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the ends of what collides, (n, 3) m from the IMU in body axes, and radii, m.

    Capsules by their two ends; another shape by the sphere around it.
    """
    model, data = vehicle.model, _at_rest(vehicle)
    imu = data.site("imu").xpos
    points, radii = [], []
    for geom in np.flatnonzero(model.geom_conaffinity | model.geom_contype):
        centre = data.geom_xpos[geom] - imu
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
            half = data.geom_xmat[geom].reshape(3, 3)[:, 2] * model.geom_size[geom, 1]
            points += [flip(*(centre + half)), flip(*(centre - half))]
            radii += [model.geom_size[geom, 0]] * 2
        else:
            points.append(flip(*centre))
            radii.append(model.geom_rbound[geom])
    return np.array(points).reshape(-1, 3), np.array(radii)


def _discs(vehicle: Vehicle) -> list[tuple[NDArray[np.float64], NDArray[np.float64], float]]:
    """Return centre (m from the IMU), axis and radius (m) of both rotors' discs, body axes."""
    data, own = _at_rest(vehicle), vehicle.parameters
    imu = data.site("imu").xpos
    hub, tail = (np.array(flip(*(data.site(one).xpos - imu))) for one in ("hub", "tail_hub"))
    return [
        (hub, np.array([0.0, 0.0, 1.0]), own["main_rotor.radius"]),
        (tail, np.array([0.0, 1.0, 0.0]), own["tail_rotor.radius"]),
    ]


def _at_rest(vehicle: Vehicle) -> mujoco.MjData:
    """Return the vehicle where its model is drawn, level and heading north."""
    data = mujoco.MjData(vehicle.model)
    mujoco.mj_kinematics(vehicle.model, data)
    return data
