"""Make a helicopter of your own from three numbers, fly it, and identify its yaw.

python scripts/own_vehicle.py [NAME [FLIGHTS]]
"""

import sys

import helisim as hs
from helisim.show.terminal import render_check

AIRFRAME = hs.Airframe(mass=6.5, rotor=1.6, rpm=1500)  # kg, m; all else in proportion to the JR700


def main(name: str = "myheli", count: int = 3) -> None:
    """Print what the vehicle is, and its yaw as it is and as it is identified."""
    folder = hs.new_vehicle(name, like="jr700", airframe=AIRFRAME)
    print(render_check(hs.check_vehicle(folder)))

    vehicle = hs.load(folder)
    flights = hs.fly(vehicle, hs.Sweep(axis="ped"), count=count, seed=1)
    frf = hs.frequency_response(
        flights,
        inputs=("ped",),
        outputs=("r",),
        conditioning=("v", "col"),
        reference=("PED", "LAT", "COL"),
        band=(0.6, 25.0),
    )
    fit = hs.identify(frf, hs.structures.yaw_base)
    print(f"\n{fit}")
    for name in ("N_r", "N_ped"):
        print(f"truth: {name} {vehicle.derivatives[name]:.4g}, identified {fit[name].value:.4g}")


if __name__ == "__main__":
    main(*sys.argv[1:2], *map(int, sys.argv[2:]))
