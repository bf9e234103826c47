"""How often the 95 % intervals of a loop's figures, as flown, hold the exact ones.

Each replicate flies the sweeps of a proof (`helisim.design.proof`) with the JR700's gyro,
hands off, with the noise of its flight computer, in light turbulence, and measures the loops from
the records alone. Exact is the sampled linearisation. Wanted: at least 94 % of the replicates, and
intervals as wide as the figures scatter: "stated" is the standard deviation that they state.

    python scripts/proof/margins_study.py [REPLICATES] [PERIOD]
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import common
import numpy as np

import helisim as hs
from helisim.design.exact import exact_loop, hands_off
from helisim.design.proof import SWEEPS, TRIM_TIME, sweep
from helisim.handling.measured.interval import figures_of

WANTED, _BATCH = 0.94, 10
_FINE = np.geomspace(1.0, 400.0, 2000)
_KINDS = dict.fromkeys(("DRB", "DRP"), "disturbance")
_KINDS |= dict.fromkeys(("bandwidth", "phase_delay"), "command")

Key = tuple[str, str, str]


class Covered(NamedTuple):
    """One figure over the replicates; (n,) of those that had it."""

    exact: float
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @property
    def share(self) -> float:
        return float(np.mean((self.low <= self.exact) & (self.exact <= self.high)))


def measured(vehicle: hs.Vehicle, replicates: int, period: float) -> Iterator[hs.MeasuredMargins]:
    flown = hands_off(vehicle)
    loop = exact_loop(flown)
    times = {"period": period, "duration": period + 2.0 * TRIM_TIME}
    made = [sweep(replace(wave, **times), loop, flown) for wave in SWEEPS.values()]
    calm = {"pilot": hs.Pilot(remnant=0.0), "weather": hs.Weather(turbulence="light")}
    calm["recorder"] = hs.Recorder.of(vehicle)
    plans = [hs.FlightPlan(excitation=one, **calm) for one in made]
    for batch in range(0, replicates, _BATCH):
        count = min(_BATCH, replicates - batch)
        flights = [
            hs.fly(flown, plan, seed=1000 * number + batch + 1, count=count)
            for number, plan in enumerate(plans)
        ]
        for records in zip(*flights):
            with common.quiet():
                found = hs.margins(records)
            yield found


def study(vehicle: hs.Vehicle, replicates: int, period: float = 60.0) -> dict[Key, Covered]:
    exact = exact_loop(hands_off(vehicle), _FINE)
    found: dict[Key, list[tuple[float, float, float]]] = {}
    for one in measured(vehicle, replicates, period):
        for figure in one.figures:
            each = figure.interval
            key = (figure.name, figure.axis, figure.at)
            found.setdefault(key, []).append((each.value, each.low, each.high))
    result = {}
    for (name, axis, at), rows in found.items():
        truth = figures_of(exact, _KINDS.get(name, "broken"), axis, at)[name]
        result[name, axis, at] = Covered(truth, *np.array(rows).T)
    return result


def main(replicates: int = 200, period: float = 60.0) -> None:
    found = study(hs.load("jr700"), replicates, period)
    print(f"{replicates} replicates; covered of those that had the figure")
    rows = []
    for key, one in sorted(found.items(), key=lambda item: item[0][1:]):
        stated = np.median(one.high - one.low) / 3.92
        numbers = one.exact, np.mean(one.value) - one.exact, np.std(one.value), stated
        shares = 100 * one.share, 100 * one.value.size / replicates
        rows.append((*key, *numbers, *shares, " *" if one.share < WANTED else ""))
    common.table(
        "figure:<13|axis:<5|at:<10|exact:10.4g|bias:10.4g|scatter:10.4g|stated:10.4g"
        "|covered %:10.1f|had %:10.0f|:<2",
        rows,
    )
    shares = [one.share for one in found.values()]
    print(f"covered: {100 * np.mean(shares):.1f} % of all, least {100 * min(shares):.1f} %")


if __name__ == "__main__":
    common.run(main)
