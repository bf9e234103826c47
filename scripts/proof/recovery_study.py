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
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import common
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "recovery"))
from fleet import FLEET
from recovering import Recovery, bound, recover


def rows(name: str, seeds: int, estimator: str, kept: list[Recovery]) -> Iterator[tuple[Any, ...]]:
    aircraft = FLEET[name]()
    for seed in range(seeds):
        one = recover(aircraft, seed, estimator)
        kept.append(one)
        truth, size = aircraft.truth[one.worst], 100.0 / abs(aircraft.truth[one.worst])
        off, most = size * (one.fit[one.worst].value - truth), size * bound(one.fit, one.worst)
        inside, points = f"{one.inside}/{len(one.excess):<3}", f"{100 * one.share:.2f} %"
        times = one.fit.cost, one.response_seconds, one.fit_seconds
        yield aircraft.name, seed, inside, points, one.worst, off, most, *times


def main(seeds: int = 20, names: str = ",".join(FLEET), estimator: str = "local") -> int:
    met = True
    for name in names.split(","):
        found: list[Recovery] = []
        common.table(
            "aircraft:<12|seed:5|inside:10|< 3 errors:12|worst:12|error %:10.2f|bound %:10.2f"
            "|J:9.2f|frf s:8.2f|fit s:8.2f",
            rows(name, seeds, estimator, found),
        )
        whole = sum(one.inside == len(one.excess) for one in found)
        share = float(np.mean(np.concatenate([one.points for one in found]) <= 3.0))
        print(
            f"{name}: all {len(found[0].excess)} parameters inside their bounds on {whole} of "
            f"{seeds} seeds; {100 * share:.2f} % of the frequency points below three stated "
            f"errors; {np.mean([one.response_seconds for one in found]):.2f} s + "
            f"{np.mean([one.fit_seconds for one in found]):.2f} s\n",
            flush=True,
        )
        met = met and whole == seeds and share >= 0.99
    return int(not met)


if __name__ == "__main__":
    common.run(main)
