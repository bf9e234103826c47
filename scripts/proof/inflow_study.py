"""What dynamic inflow does to identified models, and structures with inflow states that undo it.

The vehicle flies sweeps with `main_rotor.inflow = "pitt-peters"`, faster than a pilot's. Heave and
roll-pitch are identified with structures without inflow, as the paper's, and with those that have
it; each is set beside the truth. For roll-pitch the latter is fitted to the exact response too:
what the structure can do, apart from what flights do to an estimate. So is the hover's, whole and
without what it has no states for.

    python scripts/proof/inflow_study.py [FLIGHTS]
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import common
import numpy as np

import helisim as hs
from helisim import ident
from helisim.base.linear import LinearSystem
from helisim.study.models import ROLLPITCH_IN1
from helisim.study.truth import exact_response
from helisim.vehicle.swashplate import TipPathPlane

HEAVE_BAND, CYCLIC_BAND = (0.8, 60.0), (3.0, 42.0)
FAST_BAND = (10.0, 60.0)  # rad/s, of flights with drift through the air as a further input.
EXACT_BAND = (15.0, 60.0)  # rad/s, above what drift tilts the disc by.
SWEEPS = {
    "col": hs.Sweep(axis="col", band=(0.5, 70.0), amplitude=0.03),
    "lat": hs.Sweep(axis="lat", band=(0.8, 70.0)),
    "lon": hs.Sweep(axis="lon", band=(0.8, 70.0)),
}
QUASI_STEADY, PITT_PETERS, EXACT = "without inflow states", "with", "with, exact response"


def truth(vehicle: hs.Vehicle, recorder: hs.Recorder) -> dict[str, float]:
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
    structure = hs.structures.hover_inflow.with_fixed({"turn": true["turn"]})
    sides = {"inputs": structure.inputs, "outputs": structure.outputs}
    linear, omega = vehicle.linearize("IN1").select(**sides), np.geomspace(1.0, 40.0, 150)
    names, a, fits = list(linear.states), np.array(linear.a), {}
    states = np.eye(len(names))[[names.index(name) for name in structure.outputs]]
    for label, columns, rows in (
        ("whole exact response", (), names),
        ("without yaw", ("r",), names),
        ("nor drift on the disc", ("u", "v"), ("flap_a", "flap_b", "inflow_s", "inflow_c")),
    ):
        a[np.ix_([names.index(row) for row in rows], [names.index(one) for one in columns])] = 0.0
        moved = LinearSystem(a, linear.b, states, linear.d, None, *sides.values()).response(omega)
        exact = ident.FrequencyResponse.exact(omega, moved, **sides)
        fits[label] = hs.identify(exact, structure)
    return fits


def table(name: str, fits: Mapping[str, ident.Fit], true: Mapping[str, float]) -> None:
    rows = []
    for one in dict.fromkeys(one for fit in reversed(list(fits.values())) for one in fit.values):
        cells = []
        for fit in fits.values():
            own = fit.parameters.get(one)
            error = f"+- {own.standard_error:8.2g}" if own and not own.fixed else "given"
            cells.append(f"{own.value:14.5g}{error:>12}" if own else None)
        rows.append((one, true.get(one), *cells))
    common.table("|".join([f"{name}:<10|truth:11.5g", *(f"{one}:26" for one in fits)]), rows)
    for head, cell in (
        ("average J", lambda fit: f"{fit.cost:.3g}"),
        ("errors off", partial(worst, true)),
    ):
        print(f"{head:<20}" + "".join(f"{cell(fit):>15}{'':11}" for fit in fits.values()).rstrip())
    for one, fit in fits.items():
        for first, second, much in fit.correlated:
            if {first, second} & {"C", "tau_0", "tau_1"}:
                print(f"{one}: {first} and {second} correlated by {much:.2f}")
    print()


def worst(true: Mapping[str, float], fit: ident.Fit) -> str:
    off = {
        name: abs(fit[name].value - true[name]) / fit[name].standard_error
        for name in fit.values
        if name in true and not fit[name].fixed
    }
    name = max(off, key=off.__getitem__)
    return f"{name} {off[name]:.1f}"


def main(flights: int = 4) -> None:
    moving = hs.load("jr700", parameters={"main_rotor.inflow": "pitt-peters"})
    recorder = hs.Recorder.of(moving)
    flown = {axis: hs.fly(moving, sweep, count=flights, seed=1) for axis, sweep in SWEEPS.items()}
    true = truth(moving, recorder)
    known = hs.structures.rollpitch_inflow.with_fixed({"turn": true["turn"]})
    col, both = flown["col"], flown["lat"] + flown["lon"]
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
        table(name, both, true)
    lag = moving.servo_delay("lat") - 0.5 * moving.parameters["gyro.period"]
    known_lag = {**true, "tau_lat": lag, "tau_lon": lag}
    table("hover", hover_fits(moving, true), known_lag)


if __name__ == "__main__":
    common.run(main)
