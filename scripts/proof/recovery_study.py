"""Recovery with default options: parameters inside their bounds, errors as stated.

    python scripts/proof/recovery_study.py [SEEDS] [AIRCRAFT,...] [ESTIMATOR]

Each aircraft of `tests/recovery` is flown in sweeps with sensor noise and gusts, in closed loop
where it needs one, and identified as `helisim identify` does without options. Printed are, for
each seed and over all: parameters inside their bounds, the share of usable frequency points
whose error is below three stated ones, the parameter furthest off in terms of its bound with its
error and bound in percent, the average cost J, and processor seconds of the frequency response
and of the fit.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "recovery"))
from closed_loop import Aircraft
from fleet import FLEET
from recovering import Recovery, bound, recover

HEAD = (
    f"{'aircraft':<12}{'seed':>5}{'inside':>10}{'< 3 errors':>12}{'worst':>12}"
    f"{'error %':>10}{'bound %':>10}{'J':>9}{'frf s':>8}{'fit s':>8}"
)


def row(aircraft: Aircraft, seed: int, one: Recovery) -> str:
    name = one.worst
    truth, found = aircraft.truth[name], one.fit[name]
    size = 100.0 / abs(truth)
    return (
        f"{aircraft.name:<12}{seed:>5}{one.inside:>6}/{len(one.excess):<3}"
        f"{100 * one.share:>10.2f} %{name:>12}"
        f"{size * (found.value - truth):>10.2f}{size * bound(one.fit, name):>10.2f}"
        f"{one.fit.cost:>9.2f}{one.response_seconds:>8.2f}{one.fit_seconds:>8.2f}"
    )


def study(aircraft: Aircraft, seeds: int, estimator: str) -> bool:
    found = []
    for seed in range(seeds):
        found.append(recover(aircraft, seed, estimator))
        print(row(aircraft, seed, found[-1]), flush=True)
    whole = sum(one.inside == len(one.excess) for one in found)
    share = float(np.mean(np.concatenate([one.points for one in found]) <= 3.0))
    print(
        f"{aircraft.name}: all {len(aircraft.truth)} parameters inside their bounds on {whole} of "
        f"{seeds} seeds; {100 * share:.2f} % of the frequency points below three stated errors; "
        f"{np.mean([one.response_seconds for one in found]):.2f} s + "
        f"{np.mean([one.fit_seconds for one in found]):.2f} s\n",
        flush=True,
    )
    return whole == seeds and share >= 0.99


def main(seeds: str = "20", names: str = ",".join(FLEET), estimator: str = "local") -> int:
    print(HEAD)
    met = [study(FLEET[name](), int(seeds), estimator) for name in names.split(",")]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
