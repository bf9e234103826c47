"""What dynamic inflow does to identified models, and structures with inflow states that undo it.

The vehicle flies sweeps with `main_rotor.inflow = "pitt-peters"`, faster than a pilot's. Heave and
roll-pitch are identified with structures without inflow, as the paper's, and with those that have
it; each is set beside the truth. For roll-pitch the latter is fitted to the exact response too:
what the structure can do, apart from what flights do to an estimate. So is the hover's, whole and
without what it has no states for.

    python scripts/proof/inflow_study.py [FLIGHTS]
"""

import sys
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

import helisim as hs
from helisim import ident
from helisim.sim import Recorder
from helisim.study.models import ROLLPITCH_IN1
from helisim.study.truth import exact_response
from helisim.vehicle.swashplate import TipPathPlane

VEHICLE = "jr700"
HEAVE_BAND, CYCLIC_BAND = (0.8, 60.0), (3.0, 42.0)
FAST_BAND = (10.0, 60.0)  # rad/s, of flights with drift through the air as a further input.
EXACT_BAND = (15.0, 60.0)  # rad/s, above what drift tilts the disc by.
SWEEPS = {
    "col": hs.Sweep(axis="col", band=(0.5, 70.0), amplitude=0.03),
    "lat": hs.Sweep(axis="lat", band=(0.8, 70.0)),
    "lon": hs.Sweep(axis="lon", band=(0.8, 70.0)),
}
HOVER_BAND = (1.0, 40.0)
QUASI_STEADY, PITT_PETERS, EXACT = "without inflow states", "with", "with, exact response"


def truth(vehicle: hs.Vehicle, recorder: Recorder) -> dict[str, float]:
    """Return the true parameters of the structures with inflow: closed forms and derivatives.

    Lags are those of the linearisation, minus one over what an inflow state does to itself; that of
    the slopes without what the disc's own speed of tilting takes from it, which the structure has
    apart. The couplings are those beside what that speed makes of them.
    """
    linear, own = vehicle.linearize("IN1"), vehicle.parameters
    delays = {
        f"tau_{axis}": vehicle.servo_delay(axis) + recorder.late(motion) - recorder.late(axis)
        for axis, motion in (("col", "w"), ("lat", "p"), ("lon", "q"))
    }
    disc = TipPathPlane.of(own)
    speed = own["main_rotor.speed"]
    (_, ab), (ba, _) = disc.springs
    whole = -1.0 / linear.derivative("inflow_0", "inflow_0")
    solidity = own["main_rotor.blades"] * own["main_rotor.chord"] / np.pi
    loading = own["main_rotor.lift_slope"] * solidity / own["main_rotor.radius"]
    mean = vehicle.trim.inflow_0 / (speed * own["main_rotor.radius"])
    return {
        **vehicle.derivatives,
        **delays,
        **dict(zip(("A_lat", "A_lon", "B_lat", "B_lon"), np.ravel(disc.cyclic))),
        "tau_0": whole,
        "tau_1": 16.0 / (45.0 * np.pi) / speed / (mean + loading / 16.0),
        "C": 1.0 / own["flapping.lock_reduction"],
        "tau_f": 1.0 / (disc.share * speed),
        "A_b": ab,
        "B_a": ba,
        "turn": own["main_rotor.direction"] / speed,
        "torque": -linear.derivative("p", "flap_a") / linear.derivative("p", "flap_b"),
    }


def hover_fits(vehicle: hs.Vehicle, true: Mapping[str, float]) -> dict[str, ident.Fit]:
    linear = vehicle.linearize("IN1").system
    structure = hs.structures.hover_inflow.with_fixed({"turn": true["turn"]})
    omega = np.geomspace(*HOVER_BAND, 150)
    inputs = [linear.input_labels.index(name) for name in structure.inputs]
    outputs = [linear.state_labels.index(name) for name in structure.outputs]
    names, a = list(linear.state_labels), np.array(linear.A)
    fits = {}
    for label, columns, rows in (
        ("whole exact response", (), names),
        ("without yaw", ("r",), names),
        ("nor drift on the disc", ("u", "v"), ("flap_a", "flap_b", "inflow_s", "inflow_c")),
    ):
        a[np.ix_([names.index(row) for row in rows], [names.index(one) for one in columns])] = 0.0
        pencils = 1j * omega[:, None, None] * np.eye(len(names)) - a
        moved = np.linalg.solve(pencils, np.asarray(linear.B)[None, :, inputs])
        sides = {"inputs": structure.inputs, "outputs": structure.outputs}
        moved = np.moveaxis(moved[:, outputs], 0, -1)
        exact = ident.FrequencyResponse.exact(omega, moved, **sides)
        fits[label] = hs.identify(exact, structure)
    return fits


def table(name: str, fits: Mapping[str, ident.Fit], true: Mapping[str, float]) -> str:
    rows = dict.fromkeys(one for fit in reversed(list(fits.values())) for one in fit.values)
    lines = [f"{name:<10}{'truth':>11}" + "".join(f"{one:>26}" for one in fits)]
    for parameter in rows:
        known = f"{true[parameter]:11.5g}" if parameter in true else " " * 11
        cells = [f"{parameter:<10}{known}"]
        for fit in fits.values():
            if parameter not in fit.values:
                cells.append(f"{'':26}")
            elif fit.structure.parameter(parameter).fixed:
                cells.append(f"{fit[parameter].value:14.5g}{'given':>12}")
            else:
                one = fit[parameter]
                cells.append(f"{one.value:14.5g} +- {one.standard_error:8.2g}")
        lines.append("".join(cells).rstrip())
    costs = "".join(f"{fit.cost:15.3g}{'':11}" for fit in fits.values()).rstrip()
    off = "".join(f"{worst(fit, true):>15}{'':11}" for fit in fits.values()).rstrip()
    ends = [f"{'average J':<20}{costs}", f"{'errors off':<20}{off}"]
    for one, fit in fits.items():
        for first, second, much in fit.correlated:
            if {first, second} & {"C", "tau_0", "tau_1"}:
                ends.append(f"{one}: {first} and {second} correlated by {much:.2f}")
    return "\n".join([*lines, *ends])


def worst(fit: ident.Fit, true: Mapping[str, float]) -> str:
    off = {
        name: abs(fit[name].value - true[name]) / fit[name].standard_error
        for name in fit.values
        if name in true and not fit.structure.parameter(name).fixed
    }
    name = max(off, key=off.__getitem__)
    return f"{name} {off[name]:.1f}"


def main(count: int = 4) -> None:
    moving = hs.load(VEHICLE, parameters={"main_rotor.inflow": "pitt-peters"})
    recorder = Recorder.of(moving)
    flights = {axis: hs.fly(moving, sweep, count=count, seed=1) for axis, sweep in SWEEPS.items()}
    true = truth(moving, recorder)
    known = hs.structures.rollpitch_inflow.with_fixed({"turn": true["turn"]})
    col, both = flights["col"], flights["lat"] + flights["lon"]
    heave = hs.frequency_response(col, inputs=("col",), outputs=("w", "az"), band=HEAVE_BAND)
    plain = hs.frequency_response(col, inputs=("col",), outputs=("w",), band=(0.8, 15.0))
    names, others = {"inputs": ("lat", "lon"), "outputs": ("p", "q")}, ("col", "ped")
    moving_air = {"conditioning": (*others, "u", "v"), "band": FAST_BAND, "estimator": "windows"}
    fast = hs.frequency_response(both, **names, **moving_air)
    cyclic = hs.frequency_response(both, **names, conditioning=others, band=CYCLIC_BAND)
    spec = replace(ROLLPITCH_IN1, structure=known)
    exact = exact_response(moving, spec, recorder, np.geomspace(*EXACT_BAND, 150))
    fits = {
        "heave": {
            QUASI_STEADY: hs.identify(plain, hs.structures.heave),
            PITT_PETERS: hs.identify(heave, hs.structures.heave_inflow),
        },
        "roll-pitch": {
            QUASI_STEADY: hs.identify(cyclic, hs.structures.rollpitch),
            PITT_PETERS: hs.identify(fast, known),
            EXACT: hs.identify(exact, known, seed=1),  # of seed 0 it says it didn't converge
        },
    }
    for name, both in fits.items():
        print(table(name, both, true), end="\n\n")
    lag = moving.servo_delay("lat") - 0.5 * moving.parameters["gyro.period"]
    known_lag = {**true, "tau_lat": lag, "tau_lon": lag}
    print(table("hover", hover_fits(moving, true), known_lag), end="\n\n")


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 4)
