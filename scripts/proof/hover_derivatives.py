"""Derivatives about the hover, with both laws of inflow: what drift does to roll and pitch.

The linearisation's states for tilt and inflow follow at once (residualised), so that both laws have
the same derivatives; the time to double is of the whole linear model's least stable mode.

    python scripts/proof/hover_derivatives.py [VEHICLE [SPEED ...]]
"""

import common
import numpy as np

import helisim as hs

LAWS = ("quasi-steady", "pitt-peters")
SPEEDS = (0.0, 0.1, 0.3, 1.0, 2.0, 3.0)  # m/s ahead
NAMES = {"L_u": ("p", "u"), "M_u": ("q", "u"), "L_v": ("p", "v"), "M_v": ("q", "v")}


def rows(vehicle: hs.Vehicle, speeds: tuple[float, ...]) -> list[list[float]]:
    """Return the derivatives of `NAMES`, rad/(s m), and the time to double, s, of each speed."""
    found = []
    for speed in speeds:
        linear = vehicle.trimmed(speed=speed).linearize("IN1")
        kept = linear.rigid_body()
        growth = float(np.max(np.linalg.eigvals(linear.a).real))
        doubles = np.log(2.0) / growth if growth > 0.0 else np.inf
        found.append([*(kept.derivative(*pair) for pair in NAMES.values()), float(doubles)])
    return found


def main(name: str = "jr700", *speeds: float) -> None:
    """Print a table of both laws."""
    lines, wanted = [], speeds or SPEEDS
    for law in LAWS:
        found = rows(hs.load(name, parameters={"main_rotor.inflow": law}), wanted)
        lines += [(law, speed, *row) for speed, row in zip(wanted, found)]
    heads = [f"{name}:<14", "m/s:5g", *(f"{one}:9.3f" for one in (*NAMES, "T2, s"))]
    common.table("|".join(heads), lines)


if __name__ == "__main__":
    common.run(main)
