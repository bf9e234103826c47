"""How far each number of a design made on an identified model is from what flies.

The chain of `helisim design` on the JR700: sweeps, identification, design, flown proof, page.
Predicted and flown figures stand beside the exact sampled linearisation, each error beside its
bar; in turbulence flown figures are held against the exact ones over the air that is met. What the
flown intervals hold is counted by `python scripts/proof/margins_study.py 200`.

    python scripts/design_study.py [FLIGHTS] [SEED]        flights on each axis, 10 by default
"""

import math
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parent / "proof"))
import common

import helisim as hs
from helisim.design.exact import air_met, exact_loop, hands_off
from helisim.show.design_page import write_design_page
from helisim.study.design_chain import DesignRun, run_design, write_design

BARS = {
    "crossover": (2.0, "%"),
    "phase_margin": (1.5, "deg"),
    "gain_margin": (0.3, "dB"),
    "drb": (3.0, "%"),
    "bandwidth": (3.0, "%"),
    "phase_delay": (5.0, "ms"),
}
"""Figure -> largest error of a prediction, and of a flight, against the exact."""
LASTS = 300.0  # s, of all of it on an idle machine
CRITERIA = ("stability_margins", "disturbance_rejection", "attitude_bandwidth")


class Error(NamedTuple):
    """One figure against the exact one, in the bar's unit."""

    axis: str
    figure: str
    exact: float
    predicted: float
    flown: float

    @property
    def fine(self) -> bool:
        bar, _ = BARS[self.figure]
        return max(abs(self.predicted), abs(self.flown)) <= bar


def main(flights: int = 10, seed: int = 1) -> int:
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        hs.reproduce(out=Path(folder) / "run", flights=flights, seed=seed)
        run = run_design(Path(folder) / "run")
        write_design(run, Path(folder) / "design")
        write_design_page(Path(folder) / "design" / "report.html", run.result, proof=run.proof)
        took = time.perf_counter() - began
    print(f"sweeps, identification, design, proof, page: {took:.0f} s (bar: {LASTS:g} s, idle)\n")
    found = list(errors(run))
    common.table(
        "axis:<6|figure:<14|exact:10.4g|predicted:+13.3f|flown:+13.3f|bar:10|:<8",
        (
            (*one, f"{bar:>6g} {unit:3}", "" if one.fine else "  missed")
            for one in found
            for bar, unit in [BARS[one.figure]]
        ),
    )
    print(f"\nat its stops in light turbulence: {dict(run.proof.stops)}")
    fine = took < LASTS and not run.proof.stops and all(one.fine for one in found)
    print("every bar is met" if fine else "a bar is missed")
    return int(not fine)


def errors(run: DesignRun) -> Iterator[Error]:
    assert run.proof is not None
    plan = hs.ProofPlan()
    flies = hands_off(run.vehicle).with_controller(run.result.law)
    air = [
        (share, exact_loop(one, run.proof.exact.frequency))
        for share, one in air_met(flies, plan.weather)
    ]
    for row in run.proof.table:
        if row.spec.criterion.name not in CRITERIA:
            continue
        rated = [(share, row.spec.criterion.rate(loop).figures) for share, loop in air]
        over = {name: sum(share * of[name] for share, of in rated) for name in rated[0][1]}
        for name, one in row.figures.items():
            known = {who: math.nan if value is None else value for who, value in one.items()}
            if name in BARS:
                exact, predicted, flown = (known[who] for who in ("exact", "predicted", "flown"))
                apart = off(name, predicted, exact), off(name, flown, over[name])
                yield Error(row.spec.criterion.axis, name, exact, *apart)


def off(figure: str, value: float, exact: float) -> float:
    unit = BARS[figure][1]
    return {
        "%": 100.0 * (value / exact - 1.0),
        "deg": math.degrees(value - exact),
        "dB": value - exact,
        "ms": 1e3 * (value - exact),
    }[unit]


if __name__ == "__main__":
    with common.quiet():  # what flights say of themselves is in the proof's remarks
        common.run(main)
