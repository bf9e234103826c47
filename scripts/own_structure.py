"""Identify a structure of your own: roll alone, a rotor that lags and a delay.

    p' = L_b b,  tau_f b' = -b - tau_f p + B_lat lat(t - tau_lat)

python scripts/own_structure.py [FLIGHTS]
"""

import sys

import helisim as hs
from helisim.ident import Parameter

ROLL = hs.Structure(
    name="roll",
    meaning="roll rate from lateral input",
    parameters=(
        Parameter("L_b", "1/s^2", 300.0, (10.0, 3000.0), "roll acceleration by flapping"),
        Parameter("tau_f", "s", 0.05, (0.005, 0.5), "the rotor's time constant"),
        Parameter("B_lat", "rad", 0.3, None, "flapping by lateral input"),
        Parameter("tau_lat", "s", 0.01, (0.0, 0.1), "delay"),
    ),
    states=("p", "b"),
    inputs=("lat",),
    outputs=("p",),
    F=(("0", "L_b"), ("-1", "-1/tau_f")),
    G=(("0",), ("B_lat/tau_f",)),
    input_delays={"lat": "tau_lat"},
)


def main(flights: int = 4) -> None:
    """Print the model, and the structure as a file that `helisim identify --structure` takes."""
    vehicle = hs.load("jr700")
    records = []
    for axis in ("lat", "lon"):  # both, so that conditioning can tell one input from the other
        records += hs.fly(vehicle, hs.Sweep(axis=axis), count=flights, seed=1)
    frf = hs.frequency_response(
        records, inputs="lat", outputs="p", conditioning=("lon", "ped", "col"), band=(3.0, 30.0)
    )
    print(hs.identify(frf, ROLL))
    print(ROLL.to_toml())


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
