"""Make a helicopter of your own from the JR700's folder, with a larger and slower rotor.

Changes two lines of its parameters, solves for what follows from them, says what it is then, flies
it and identifies its yaw.

python scripts/own_vehicle.py [NAME [FLIGHTS]]
"""

import sys
from pathlib import Path

import helisim as hs
from helisim.show.terminal import render_check
from helisim.study.new_vehicle import calibrated_text
from helisim.study.tune import tune
from helisim.vehicle.build import write_numbers
from helisim.vehicle.parameters import to_toml

CHANGES = (
    ("\nradius = { value = 0.767", "\nradius = { value = 0.800"),  # m
    ("\nspeed = { value = 178.0", "\nspeed = { value = 157.0"),  # rad/s, 1500 rpm
)


def main(name: str = "myheli", count: int = 3) -> None:
    """Print what is wrong after the change, what the vehicle is after solving, and its yaw."""
    folder = hs.new_vehicle(name, like="jr700")
    change(folder / "parameters.toml")
    print("Changed:", *hs.check_vehicle(folder).problems, sep="\n- ", end="\n\n")
    solve(folder)
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


def change(parameters: Path) -> None:
    """Change lines of a parameter file, as an editor would."""
    text = parameters.read_text(encoding="utf-8")
    for old, new in CHANGES:
        assert old in text
        text = text.replace(old, new, 1)
    parameters.write_text(text, encoding="utf-8")


def solve(folder: Path) -> None:
    """Do what `helisim vehicle calibrate --write` and `helisim tune --write` do."""
    (folder / "calibrated.toml").write_text(calibrated_text(folder), encoding="utf-8")
    settings = tune(hs.load(folder, tuned=False))
    text = to_toml(settings, "Written by own_vehicle.py.")
    (folder / "tuned.toml").write_text(text, encoding="utf-8")
    write_numbers(folder)  # into the MJCF, for stock MuJoCo


if __name__ == "__main__":
    main(*sys.argv[1:2], *map(int, sys.argv[2:]))
