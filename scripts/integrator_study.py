"""What the integrator and its step do to the identified parameters.

The paper's experiment is flown with each integrator, by the same pilots and sensors, so what
differs between the columns is the integration alone. Printed are, for each parameter, its error
against the exact linearisation, percent, and at the end the processor seconds that the flights took
and the largest change of any parameter, in percent and in parts of its standard error (half the
Cramér-Rao bound).

    python scripts/integrator_study.py [FLIGHTS [SEED]]
"""

import sys
import time

from helisim.sim import Recorder
from helisim.sim.rigs import run_rigs
from helisim.study.flights import fly_sweeps
from helisim.study.identification import comparison_table, identify_model
from helisim.study.models import MODELS
from helisim.study.results import ComparisonTable
from helisim.vehicle import load
from helisim.vehicle.assembly import Integrator

SETTINGS: tuple[tuple[Integrator, float], ...] = (("RK4", 0.002), ("Euler", 0.002))
"""Integrator and step, s: the default first."""


def tables(
    integrator: Integrator, timestep: float, flights: int, seed: int
) -> tuple[dict[str, ComparisonTable], float]:
    """Return the experiment's tables, and the processor seconds of the flights."""
    vehicle = load("jr700", integrator=integrator, timestep=timestep)
    recorder = Recorder.of(vehicle)
    begun = time.process_time()
    kept, _ = fly_sweeps(vehicle, flights, seed, None, recorder, None, lambda _: None)
    spent = time.process_time() - begun
    ground = {test.rig: test for test in run_rigs(load("jr700"), seed=seed, recorder=recorder)}
    found: dict[str, ComparisonTable] = {}
    for model in MODELS:
        fit = identify_model(model, kept, before=found, ground=ground)
        found[model.name] = comparison_table(vehicle, model, fit, recorder)
    return found, spent


def main(flights: int = 10, seed: int = 1) -> None:
    """Print the study."""
    names = [f"{integrator} {1e3 * step:g} ms" for integrator, step in SETTINGS]
    each = [tables(*setting, flights, seed) for setting in SETTINGS]
    print(f"{'error against truth, %':<30}" + "".join(f"{name:>14}" for name in names))
    change, in_errors = 0.0, 0.0
    for model in MODELS:
        rows = [found[model.name] for found, _ in each]
        for row in rows[0].parameters:
            if row.truth is None:
                continue
            values = [one[row.name].identified for one in rows]
            errors = "".join(f"{100.0 * (value / row.truth - 1.0):14.3f}" for value in values)
            print(f"{model.name + ' ' + row.name:<30}{errors}")
            moved = 100.0 * max(abs(value / values[0] - 1.0) for value in values)
            change = max(change, moved)
            if row.cr_percent:
                in_errors = max(in_errors, moved / (0.5 * row.cr_percent))
    print(f"{'processor s of the flights':<30}" + "".join(f"{spent:14.1f}" for _, spent in each))
    print(f"largest change: {change:.2f} %; {in_errors:.2f} standard errors")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
