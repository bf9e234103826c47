"""Rebuild what in this folder is computed, and print what it adds up to.

Run it as `python models/blade360/build.py` with one of

- `parts`: print mass, position and inertia part by part, and the totals;
- `close`: rewrite the fuselage's inertial element in blade360.xml, so that the totals are those of
  parameters.toml and calibrated.toml.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from balance import Balance

TOTAL_MASS_KG = 0.95  # chosen, see README.md

if __name__ == "__main__":
    balance = Balance(Path(__file__).resolve().parent, total_mass_kg=TOTAL_MASS_KG)
    jobs = {"parts": balance.print_parts, "close": balance.close}
    if len(sys.argv) != 2 or sys.argv[1] not in jobs:
        sys.exit(__doc__)
    jobs[sys.argv[1]]()
