"""Ordinary flights under Rotorflight's law, as Blackbox logs: what `helisim tune` makes of them.

A vehicle flies seed by seed for two minutes under the law, its gyro noisy, in light turbulence.
Printed: the verdicts on models; how often 95 % intervals of main derivatives, of today's and of new
gains' loops hold the truth, and how far they are off at the median; each margin that isn't within
1 dB and 5 degrees of the predicted one. The truth of a flight is the mean of the exact
linearisations at the airspeeds of its moments, and of their loops' figures, with O as at its mean
collective. Bars: 93 to 98 % of intervals (but of new gains, which are sought by the same models);
no such margin. Exit status 1 if missed.

    python scripts/proof/rotorflight_study.py [--vehicle NAME] [--first SEED] [--seeds N] [--size X]
"""

import sys
import tempfile
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import common
import numpy as np
import rotorflight_flights as flights

import helisim as hs
from helisim.base.errors import HelisimError
from helisim.design.laws.rotorflight import CYCLIC_PITCH
from helisim.handling.predicted import PredictedLoop
from helisim.study.rotorflight_tune import Feedback, tune_blackbox

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

import blackbox_logs  # pyright: ignore[reportMissingImports]  # of tests, on the path above

SEEN = ("p", "q", "r", "phi", "theta", "psi")
FIGURES = ("crossover", "phase_margin", "gain_margin", "DRB", "DRP")
LOWEST = 2.0  # rad/s, from which flights tell models: below, the pilot holds the hover's slow mode
MARGINS = {"gain_margin": 1.0, "phase_margin": 5.0, "DRB": np.inf}  # dB, degrees: what is far off
MAIN = ("L_b", "M_a", "tau_f", "N_ped", "Z_w", "Z_col")
WORDS = {"lat": "roll", "lon": "pitch", "ped": "yaw"}
AT = 20.0  # rad/s, where the delay to the accelerometer, a time step late, is that of the phase
MOMENTS = 32  # of a flight


def main(*, vehicle: str = "jr700", first: int = 1, seeds: int = 5, size: float = 1.0) -> int:
    flown, verdicts, told = hs.load(vehicle), Counter(), {}
    law, period = flights.law_for(flown), flown.parameters["gyro.period"]

    def derivatives(one: hs.Vehicle) -> dict[str, float]:
        found = {name: one.derivatives[name] for name in MAIN}
        lifts = found["Z_col"] * 1j * AT / (1j * AT - found["Z_w"])
        az = one.linearize("IN1").select(("col",), ("az",)).response(np.array([AT]))[0, 0, 0]
        found["tau_col"] = flown.model.opt.timestep - np.angle(az / lifts) / AT
        found["Z_col"] /= law.collective.range
        return found | {"N_ped": found["N_ped"] / law.yaw.range}

    def loops_of(plants: list, own: hs.Rotorflight) -> list[PredictedLoop]:
        feedback = Feedback(own, period, {})
        return [PredictedLoop.of([one] * 2, feedback, LOWEST) for one in plants]

    for seed in range(first, first + seeds):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "flight.bbl"
            flight, rows = flights.fly(flown, law, seed=seed, size=size)
            columns = flights.columns(flown, law, flight, rows)
            path.write_bytes(blackbox_logs.encode(columns, flights.header(law, period)))
            found = tune_blackbox([str(path)])
        air, along = flight.velocities - flight.air[:, :3], []
        for ahead, right, _ in air[np.linspace(0, len(air) - 1, MOMENTS, dtype=int)].tolist():
            with suppress(HelisimError):  # the pedals would be beyond their end
                along.append(flown.trimmed(wind=(-ahead, -right, 0.0)))
        # half a tick of delay is in it
        exact = [one.linearize("IN1").select(tuple(WORDS), SEEN) for one in along]
        each = [derivatives(one) for one in along]
        verdicts.update(f"{fit.structure.name} {fit.verdict.word}" for fit in found.fits)
        sound = [one.parameters for one in found.fits if one.verdict.word == "sound"]
        for name, one in ((name, x[name]) for x in sound for name in each[0].keys() & x.keys()):
            row = seed, one.value, *one.interval, np.mean([own[name] for own in each])
            told.setdefault(("model", name), []).append(row)
        better = {".".join(one.name.split("_")[:2]): one.after for one in found.changes}
        centre = CYCLIC_PITCH * 1e-3 * np.mean(columns["mixer[3]"])  # pitch by which O acts
        flew = replace(law, collective=replace(law.collective, centre=centre))
        today, new = loops_of(exact, flew), loops_of(exact, flew.replace(better))
        for one in found.axes:
            own = ("", one.today, today, FIGURES), ("new ", one.tuned, new, MARGINS)
            for of, shown, loops, names in own if one.tuned else own[:1]:
                true = [loop.figures(one.axis) for loop in loops]
                for name in (name for name in names if np.isfinite(shown[name].low)):  # in the band
                    mean = np.mean([figures[name].value for figures in true])
                    row = seed, shown[name].value, shown[name].low, shown[name].high, mean
                    told.setdefault((of + WORDS[one.axis], name), []).append(row)
    print("verdicts:", ", ".join(f"{count} {word}" for word, count in verdicts.items()))
    rows, far, inside = [], [], []
    for (of, name), some in sorted(told.items()):
        _, value, low, high, true = np.array(some).T
        holds, off = (low <= true) & (true <= high), np.abs(value / true - 1.0)
        middle = np.median([value - true, 100.0 * off], axis=1)
        rows.append((of, name, len(some), 100.0 * holds.mean(), *middle))
        if of.startswith("new"):
            wide = np.abs(value - true) > MARGINS[name]
            far += [(row[0], of, name, *row[1:]) for row, one in zip(some, wide) if one]
        else:
            inside += [*holds]
    heads = "flights:8d|inside, %:10.0f|off, median:+12.3f|error, %:9.1f"
    common.table(f"of:<10|figure:<13|{heads}", rows)
    heads = "predicted:10.2f|from:8.2f|to:8.2f|exact:8.2f"
    common.table(f"seed:4d|gains:>11|far off:>13|{heads}", far)
    share = 100.0 * np.mean(inside or [0.0])
    count = sum(len(some) for (of, _), some in told.items() if of.startswith("new"))
    print(f"{share:.0f} % of {len(inside)} intervals hold; {len(far)} of {count} are far off")
    return int(not 93.0 <= share <= 98.0 or bool(far))


if __name__ == "__main__":
    common.run(main)
