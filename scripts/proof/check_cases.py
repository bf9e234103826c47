"""NASA/NESC check cases 1 to 3: errors of helisim's integrator against the printed digits.

The cases, what stands in for a turning earth, and where the digits come from:
tests/verification/nesc.py and nesc_sim04.csv. Cases 4 and up need atmospheres, winds and earths
that helisim does not have.

    python scripts/proof/check_cases.py
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "verification"))
import nesc

from helisim.vehicle import load

TITLES = {1: "dropped sphere", 2: "tumbling brick", 3: "tumbling brick with damping"}
GROUPS = (
    ("altitude", "ft", slice(0, 1)),
    ("velocity east, down", "ft/s", slice(1, 3)),
    ("yaw, pitch, roll", "deg", slice(3, 6)),
    ("p, q, r", "deg/s", slice(6, 9)),
)


def main() -> None:
    vehicle = load("jr700")
    step = 1e3 * vehicle.model.opt.timestep
    print(f"RK4, {step:g} ms, against SIM 4 of NASA/TM-2015-218675 (12 digits printed)")
    for case, title in TITLES.items():
        printed = nesc.digits(case)
        found = nesc.drop(vehicle, case, list(printed))
        differences = np.abs(found - np.array(list(printed.values())))
        print(f"\ncase {case}, {title}: {len(printed)} instants to {max(printed):g} s")
        for name, unit, columns in GROUPS:
            largest = np.max(np.abs(np.array(list(printed.values()))[:, columns]))
            worst = np.max(differences[:, columns])
            print(f"  {name:<20} off by at most {worst:8.1e} {unit:<6} of up to {largest:.6g}")
    print("\ncase 1 over helisim's flat earth, gravity that of the start")
    printed = nesc.digits(2)  # the brick falls as the sphere
    for time in (1.0, 10.0, 30.0):
        fallen = 0.5 * nesc.start_gravity() * time**2
        wanted = nesc.START - printed[time][0] * nesc.FOOT
        print(
            f"  after {time:2.0f} s and {wanted:7.1f} m: {1e3 * (fallen - wanted):8.2f} mm, "
            f"{100.0 * (fallen / wanted - 1.0):.1g} %"
        )


if __name__ == "__main__":
    main()
