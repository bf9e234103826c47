"""Identify roll-pitch, yaw and heave from four axes flown at once, in a fifth of the sweeps' time.

Four sweeps on each of four axes, 1440 s, beside two flights of one multisine on all sticks, 288 s.
The models, their bands and the estimator are those of `helisim reproduce`. Half of the sweeps'
amplitude on collective, roll and pitch keeps products of four motions at once small; the pedal,
which the gyro moves with the collective, keeps its own, so that the two can be told apart.

python scripts/multisine.py [SEEDS]
"""

import sys
import warnings

import numpy as np

import helisim as hs
from helisim.ident.frf import CrossControlWarning
from helisim.sim import Recorder
from helisim.study.comparison import identify_model
from helisim.study.models import HEAVE, ROLLPITCH_IN1, YAW_BASE
from helisim.study.truth import true_values

AXES = ("col", "lon", "lat", "ped")
MODELS = (ROLLPITCH_IN1, YAW_BASE, HEAVE)

MULTISINE = hs.Multisine(
    axis="+".join(AXES),
    duration=144.0,
    period=138.0,  # one period a flight: the more harmonics, the finer windows tell the axes apart
    band=(0.25, 13.0, 2.5, 45.0, 2.5, 45.0, 0.5, 27.0),  # what each axis's model is fitted in
    amplitude=(0.015, 0.035, 0.035, 0.01),
    slope=1.0,  # as much power in each octave, as a sweep has
)


def identified(vehicle: hs.Vehicle, flights: dict[str, list[hs.FlightRecord]]) -> dict:
    """Return value, Cramér-Rao bound, standard error and error of each parameter, percent."""
    found = {}
    for model in MODELS:
        fit = identify_model(model, flights)
        truth = true_values(vehicle, model, Recorder.of(vehicle), like=fit.data)
        for name in model.tolerances:
            one, true = fit[name], truth[name]
            scale = 100.0 / abs(true)
            errors = (one.cramer_rao, one.standard_error, one.value - true)
            found[model.name, name] = scale * np.array(errors)
    return found


def main(seeds: int = 3) -> None:
    """Print bounds and errors of both, parameter by parameter."""
    vehicle = hs.load("jr700")
    swept, together = [], []
    for seed in range(seeds):
        sweeps = {
            axis: hs.fly(vehicle, hs.Sweep(axis=axis), count=4, seed=4 * seed + k)
            for k, axis in enumerate(AXES)
        }
        at_once = hs.fly(vehicle, MULTISINE, count=2, seed=4 * seed)
        swept.append(identified(vehicle, sweeps))
        # roll and pitch pool the flights of lat and lon: each of the two once
        shared = {"lat": at_once[:1], "lon": at_once[1:], "ped": at_once, "col": at_once}
        together.append(identified(vehicle, shared))
    times = [sum(one.duration for flights in sweeps.values() for one in flights)]
    times.append(sum(one.duration for one in at_once))
    factors = MULTISINE.relative_peak_factor
    print("relative peak factor:", ", ".join(f"{axis} {one:.2f}" for axis, one in factors.items()))
    print(f"\n{'percent of the true value':26}{'Cramér-Rao':>15}{'standard error':>17}", end="")
    print(f"{'largest |error|':>18}\n{'':26}" + f"{'sweeps':>8}{'at once':>8}" * 3)
    worst, beyond = 0.0, 0
    for model, name in swept[0]:
        rows = [np.array([one[model, name] for one in each]) for each in (swept, together)]
        mean = [row.mean(axis=0) for row in rows]
        largest = [np.abs(row[:, 2]).max() for row in rows]
        numbers = (mean[0][0], mean[1][0], mean[0][1], mean[1][1], *largest)
        print(f"{model:14}{name:12}" + "".join(f"{one:8.2f}" for one in numbers))
        worst = max(worst, mean[1][0] / mean[0][0])
        beyond += int(np.sum(np.abs(rows[1][:, 2]) > rows[1][:, 0]))
    print(f"\nflight time: {times[1]:.0f} s instead of {times[0]:.0f} s, {times[1] / times[0]:.2f}")
    print(f"Cramér-Rao bounds: {worst:.2f} of the sweeps' at most; errors beyond them: {beyond}")


if __name__ == "__main__":
    warnings.simplefilter("error", CrossControlWarning)
    main(*map(int, sys.argv[1:]))
