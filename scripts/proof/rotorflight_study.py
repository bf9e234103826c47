"""Ordinary flights under Rotorflight's law, as Blackbox logs: what `helisim tune` makes of them.

A vehicle flies seed by seed for two minutes under the law, its gyro noisy, in light turbulence;
the flight becomes a log. Printed by axis: of how many flights a model is told, and the verdicts;
how often the 95 % intervals of today's loop, and of heave's model, hold the exact linearisation's
figures, and how far they are off at the median; of new gains, the exact loop's margins beside the
predicted ones. Bars: 93 to 98 % of intervals; margins within 1 dB and 5 degrees. Exit status 1 if
one is missed.

    python scripts/proof/rotorflight_study.py [--vehicle NAME] [--seeds N] [--size X]
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
AT = 20.0  # rad/s, where the delay to the accelerometer, a time step late, is that of the phase


def main(*, vehicle: str = "jr700", seeds: int = 5, size: float = 1.0) -> int:
    flown, told, held, off, new = hs.load(vehicle), Counter(), {}, {}, []
    law, period = flights.law_for(flown), flown.parameters["gyro.period"]
    whole, heave = flown.linearize("IN1"), {one: flown.derivatives[one] for one in ("Z_w", "Z_col")}
    linear = whole.select(tuple(WORDS), SEEN)
    late = {one: linear.delays.get(one, 0.0) + 0.5 * period for one in WORDS}  # half a tick
    exact = replace(linear, delays=late)
    lifts = heave["Z_col"] * 1j * AT / (1j * AT - heave["Z_w"])
    turned = np.angle(whole.select(("col",), ("az",)).response(np.array([AT]))[0, 0, 0] / lifts)
    heave["tau_col"] = 0.5 * period + flown.model.opt.timestep - turned / AT
    heave["Z_col"] /= law.collective.range

    def tell(axis: str, name: str, own: tuple[float, float, float], true: float) -> None:
        held.setdefault((axis, name), []).append(own[0] <= true <= own[2])
        off.setdefault((axis, name), []).append(own[1] - true)

    def figures(own: hs.Rotorflight) -> PredictedLoop:
        feedback, band = Feedback(own, period, {}), np.geomspace(LOWEST, np.pi / period, 500)
        return PredictedLoop(exact, feedback, band, (ClosedLoop(exact, feedback, band),) * 2)

    today = figures(law)
    for seed in range(1, seeds + 1):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "flight.bbl"
            flight, loops = flights.fly(flown, law, seed=seed, size=size)
            columns = flights.columns(flown, law, flight, loops)
            path.write_bytes(blackbox_logs.encode(columns, flights.header(law, period)))
            found = tune_blackbox([str(path)])
        told.update(f"{fit.structure.name} {fit.verdict.word}" for fit in found.fits)
        sound = [one.parameters for one in found.fits if one.verdict.word == "sound"]
        for name, one in ((name, x[name]) for x in sound if "Z_col" in x for name in heave):
            tell("heave", name, (one.interval[0], one.value, one.interval[1]), heave[name])
        better = {".".join(one.name.split("_")[:2]): one.after for one in found.changes}
        flies = figures(law.replace(better))
        for one in found.axes:
            true = today.figures(one.axis)
            for name in FIGURES:
                own = one.today[name]
                if np.isfinite(own.low):  # not beyond the band of the models
                    bounds = own.low, own.value, own.high
                    tell(WORDS[one.axis], name, bounds, true[name].value)
            if one.tuned:
                flown_by = flies.figures(one.axis)
                new += [
                    (seed, WORDS[one.axis], name, one.tuned[name].value, flown_by[name].value)
                    for name in ("gain_margin", "phase_margin", "DRB")
                    if np.isfinite(one.tuned[name].low)
                ]
    print("verdicts:", ", ".join(f"{count} {word}" for word, count in told.items()))
    rows = [
        (axis, name, len(some), 100.0 * np.mean(some), float(np.median(off[axis, name])))
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
