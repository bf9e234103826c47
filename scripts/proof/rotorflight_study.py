"""Ordinary flights under Rotorflight's law, as Blackbox logs: what `helisim tune` makes of them.

A vehicle flies seed by seed for two minutes under the law, its gyro noisy, in light turbulence;
the flight becomes a log. Printed by axis: of how many flights a model is told, and the verdicts;
how often the 95 % intervals of today's loop hold the exact linearisation's figures, and how far
they are off at the median; of new gains, the exact loop's margins beside the predicted ones. Bars:
93 to 98 % of intervals; margins within 1 dB and 5 degrees. Exit status 1 if one is missed.

    python scripts/proof/rotorflight_study.py [--vehicle NAME] [--seeds N] [--seconds S] [--size X]
"""

import sys
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import common
import numpy as np
import rotorflight_flights as flights

import helisim as hs
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.predicted import PredictedLoop
from helisim.study.rotorflight_tune import Feedback, tune_blackbox

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

import blackbox_logs  # pyright: ignore[reportMissingImports]  # of tests, on the path above

SEEN = ("p", "q", "r", "phi", "theta", "psi")
FIGURES = ("crossover", "phase_margin", "gain_margin", "DRB", "DRP")
LOWEST = 2.0  # rad/s, from which flights tell models: below, the pilot holds the hover's slow mode
WITHIN = {"gain_margin": 1.0, "phase_margin": 5.0}  # dB, degrees
WORDS = {"lat": "roll", "lon": "pitch", "ped": "yaw"}


def main(
    *, vehicle: str = "jr700", seeds: int = 5, seconds: float = 120.0, size: float = 1.0
) -> int:
    flown, told, held, off, new = hs.load(vehicle), Counter(), {}, {}, []
    law, period = flights.law_for(flown), flown.parameters["gyro.period"]
    linear = flown.linearize("IN1").select(tuple(WORDS), SEEN)
    held_for = {one: linear.delays.get(one, 0.0) + 0.5 * period for one in WORDS}  # half a tick
    exact = replace(linear, delays=held_for)

    def figures(own: hs.Rotorflight) -> PredictedLoop:
        feedback, band = Feedback(own, period, {}), np.geomspace(LOWEST, np.pi / period, 500)
        return PredictedLoop(exact, feedback, band, (ClosedLoop(exact, feedback, band),) * 2)

    today = figures(law)
    for seed in range(1, seeds + 1):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "flight.bbl"
            how = {"duration": seconds, "size": size, "shaking": flights.Shaking()}
            flight, loops = flights.fly(flown, law, seed=seed, **how)
            columns = flights.columns(flown, law, flight, loops)
            path.write_bytes(blackbox_logs.encode(columns, flights.header(law, period)))
            found = tune_blackbox([str(path)])
        told.update(fit.verdict.word or "excellent" for fit in found.fits)
        better = {".".join(one.name.split("_")[:2]): one.after for one in found.changes}
        flies = figures(law.replace(better))
        for one in found.axes:
            true = today.figures(one.axis)
            for name in FIGURES:
                own = one.today[name]
                if not np.isfinite(own.low):  # beyond the band of the models
                    continue
                inside = own.low <= true[name].value <= own.high
                held.setdefault((one.axis, name), []).append(inside)
                off.setdefault((one.axis, name), []).append(own.value - true[name].value)
            if one.tuned:
                flown_by = flies.figures(one.axis)
                new += [
                    (seed, WORDS[one.axis], name, one.tuned[name].value, flown_by[name].value)
                    for name in ("gain_margin", "phase_margin", "DRB")
                    if np.isfinite(one.tuned[name].low)
                ]
    print("verdicts:", ", ".join(f"{count} {word}" for word, count in told.items()))
    rows = [
        (WORDS[axis], name, len(some), 100.0 * np.mean(some), float(np.median(off[axis, name])))
        for (axis, name), some in held.items()
    ]
    common.table("axis:<6|figure:<13|flights:8d|inside, %:10.0f|off, median:+12.3f", rows)
    common.table("seed:4d|axis:<6|new gains':<13|predicted:10.2f|exact:8.2f", new)
    each = [one for some in held.values() for one in some]
    share = 100.0 * np.mean(each or [0.0])
    far = [row for row in new if abs(row[3] - row[4]) > WITHIN.get(row[2], np.inf)]
    print(f"{share:.0f} % of {len(each)} intervals hold; {len(far)} of {len(new)} are far off")
    return int(not 93.0 <= share <= 98.0 or bool(far))


if __name__ == "__main__":
    common.run(main)
