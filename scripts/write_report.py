"""Write a report of a model, one page with its parameters, Bode plots and verification.

python scripts/write_report.py [FILE.html [FLIGHTS]]
"""

import sys

import helisim as hs
from helisim.show.report import write_fit_report


def main(path: str = "yaw.html", flights: int = 4) -> None:
    """Fly pedal sweeps, identify the yaw model, and verify it on a doublet that no fit saw."""
    vehicle = hs.load("jr700")
    sweeps = hs.fly(vehicle, hs.Sweep(axis="ped"), count=flights, seed=1)
    frf = hs.frequency_response(
        sweeps,
        inputs="ped",
        outputs="r",
        conditioning=("v", "col"),
        reference=("PED", "LAT", "COL"),
        band=(0.6, 25.0),
    )
    fit = hs.identify(frf, hs.structures.yaw_base)
    (doublet,) = hs.fly(vehicle, hs.Doublet(axis="ped"), seed=2)
    records = {"first sweep": sweeps[0], "doublet": doublet}
    verification = hs.verify(fit, doublet)
    print("Written:", write_fit_report(path, fit, records=records, verification=verification))


if __name__ == "__main__":
    main(*sys.argv[1:2], *map(int, sys.argv[2:3]))
