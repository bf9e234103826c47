"""What an uncorrected lever arm does to identified parameters.

python scripts/lever_arm_study.py [FLIGHTS] [SEED]
"""

import sys

from helisim.sim.trajectory import imu_offset
from helisim.study.lever_arm import lever_arm_study
from helisim.vehicle import load


def main(flights: int = 4, seed: int = 1) -> None:
    """Print each parameter with the correction, without it, and by how much it moves."""
    vehicle = load()
    x, y, z = 1e3 * imu_offset(vehicle)
    print(f"IMU {x:.0f} mm ahead, {y:.0f} mm right and {z:.0f} mm below the centre of gravity;")
    print(f"{flights} sweeps an axis, seed {seed}")
    print(f"{'model':<15}{'parameter':<12}{'corrected':>12}{'uncorrected':>13}{'moves by %':>12}")
    for one in lever_arm_study(vehicle, flights=flights, seed=seed):
        print(
            f"{one.model:<15}{one.name:<12}{one.corrected:12.5g}{one.uncorrected:13.5g}"
            f"{one.percent:12.2f}"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
