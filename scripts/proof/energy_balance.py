"""Energy of whole flights: what motor, height, speed and wind give, and what the air gets.

The flights and how their energy is summed: tests/verification/energy.py.

    python scripts/proof/energy_balance.py
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "verification"))
import energy

from helisim.vehicle import load

COLUMNS = ("motor", "stored", "wind", "heat", "missing", "legs")


def main() -> None:
    vehicle = load("jr700", parameters={"drive.governor": "motor"})
    print(f"{'J':30s}" + "".join(f"{name:>10s}" for name in COLUMNS) + "   of heat")
    for name in energy.FLIGHTS:
        found, end = energy.flown(vehicle, name)
        missing = float(np.abs(found.missing[:end]).max())
        row = (
            found.delivered[-1],
            found.stored[0] - found.stored[-1],
            found.wind[-1],
            found.lost[-1],
            missing,
            found.missing[end - 1] - found.missing[-1],
        )
        share = missing / found.turned_over
        print(f"{name:30s}" + "".join(f"{one:10.1f}" for one in row) + f"   {share:.1e}")


if __name__ == "__main__":
    main()
