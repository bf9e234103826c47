"""What attitudes, velocities and positions say that other channels must be.

Body axes forward, right, down; the world north, east, down; angles of Euler, so that large
attitudes are right too.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from helisim.base.units import STANDARD_GRAVITY

Columns = Mapping[str, NDArray[np.float64]]


def rates(columns: Columns, step: float, *, factor: float = 1.0) -> dict[str, NDArray[np.float64]]:
    """Return the rates that attitudes imply, as far as there are attitudes.

    Args:
        columns: of phi, theta, psi, (n_time,) each, as far as they are known.
        step: s.
        factor: of the angles, as if they were in another unit.
    """
    angles = {name: factor * columns[name] for name in ("phi", "theta", "psi") if name in columns}
    slope = {name: np.gradient(angle, step) for name, angle in angles.items()}
    if len(angles) < 3:
        names = {"phi": "p", "theta": "q", "psi": "r"}
        return {names[name]: values for name, values in slope.items()}
    phi, theta = angles["phi"], angles["theta"]
    return {
        "p": slope["phi"] - slope["psi"] * np.sin(theta),
        "q": slope["theta"] * np.cos(phi) + slope["psi"] * np.sin(phi) * np.cos(theta),
        "r": slope["psi"] * np.cos(phi) * np.cos(theta) - slope["theta"] * np.sin(phi),
    }


def velocities(columns: Columns, step: float) -> dict[str, NDArray[np.float64]]:
    """Return the body velocities that positions imply: all with attitudes, else w by `down`.

    Args:
        columns: of positions and attitudes, (n_time,) each.
        step: s.
    """
    names = ("north", "east", "down")
    if not {*names, "phi", "theta", "psi"} <= set(columns):
        return {"w": np.gradient(columns["down"], step)} if "down" in columns else {}
    world = np.stack([np.gradient(columns[name], step) for name in names])
    rows = to_body(columns["phi"], columns["theta"], columns["psi"])
    return dict(zip("uvw", np.einsum("ijt,jt->it", rows, world)))


def accelerations(columns: Columns, step: float) -> dict[str, NDArray[np.float64]]:
    """Return the specific forces that velocities imply, less what attitudes add where known.

    Args:
        columns: of velocities, rates and attitudes, (n_time,) each.
        step: s.
    """
    found = {name: np.gradient(columns[v], step) for name, v in _OF.items() if v in columns}
    if {"p", "q", "r", "u", "v", "w"} <= set(columns):
        p, q, r, u, v, w = (columns[name] for name in "pqruvw")
        found["ax"] = found["ax"] + q * w - r * v
        found["ay"] = found["ay"] + r * u - p * w
        found["az"] = found["az"] + p * v - q * u
    if {"phi", "theta"} <= set(columns):
        phi, theta = columns["phi"], columns["theta"]
        gravity = {
            "ax": -np.sin(theta),
            "ay": np.sin(phi) * np.cos(theta),
            "az": np.cos(phi) * np.cos(theta),
        }
        found = {name: one - STANDARD_GRAVITY * gravity[name] for name, one in found.items()}
    return found


_OF = {"ax": "u", "ay": "v", "az": "w"}


def to_body(
    phi: NDArray[np.float64], theta: NDArray[np.float64], psi: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the matrices from world to body axes, (3, 3, n_time), by angles, (n_time,) each."""
    sf, cf = np.sin(phi), np.cos(phi)
    st, ct = np.sin(theta), np.cos(theta)
    sp, cp = np.sin(psi), np.cos(psi)
    return np.array(
        [
            [ct * cp, ct * sp, -st],
            [sf * st * cp - cf * sp, sf * st * sp + cf * cp, sf * ct],
            [cf * st * cp + sf * sp, cf * st * sp - sf * cp, cf * ct],
        ]
    )
