"""Fly lateral and longitudinal sweeps, identify the roll-pitch model, verify it on a doublet.

python scripts/fly_and_identify.py [FLIGHTS]
"""

import sys

import helisim as hs


def main(count: int = 4) -> None:
    """Print the identified model and how well it predicts a flight that no fit has seen."""
    vehicle = hs.load("jr700")
    flights = []
    for axis in ("lat", "lon"):
        flights += hs.fly(vehicle, hs.Sweep(axis=axis), count=count, seed=1)
    frf = hs.frequency_response(
        flights,
        inputs=("lat", "lon"),
        outputs=("p", "q"),
        conditioning=("col", "ped"),
        band=(3.0, 42.0),
    )
    fit = hs.identify(frf, hs.structures.rollpitch)
    print(fit)
    print(f"truth: L_b {vehicle.derivatives['L_b']:.1f}, M_a {vehicle.derivatives['M_a']:.1f}")
    (doublet,) = hs.fly(vehicle, hs.Doublet(axis="lat"), seed=2)
    print(hs.verify(fit, doublet))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
