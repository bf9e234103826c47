"""Bias, scatter and stated errors in closed loop with a gust, over many replicates.

Each replicate is four sweeps of 90 s under rate feedback (tests/recovery/monte_carlo.py), and
each is identified by the joint method, by the joint method with CIFER's weights, and by the
direct method. Wanted of the joint method: no bias beyond 3 % or half the scatter, and 95 %
intervals that hold the truth in 90 to 98 % of the replicates.

    python scripts/proof/coverage_study.py [REPLICATES] [CASE]
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "recovery"))
from monte_carlo import CASES, Replicates, replicate

METHODS = ("joint", "joint by coherence", "direct")


def table(name: str, found: Replicates) -> None:
    """Print one method's figures, a line a parameter; a star where a wish isn't met."""
    print(f"  {name}")
    print(f"    {'parameter':<12}{'bias %':>9}{'scatter %':>11}{'stated %':>10}{'covered %':>11}")
    for k, parameter in enumerate(found.names):
        bias, scatter, covered = found.bias[k], found.scatter[k], found.coverage[k]
        missed = abs(bias) > max(0.03, 0.5 * scatter) or not 0.90 <= covered <= 0.98
        print(
            f"    {parameter:<12}{100 * bias:9.2f}{100 * scatter:11.2f}"
            f"{100 * found.stated[k]:10.2f}{100 * covered:11.1f}{' *' if missed else ''}"
        )


def main(replicates: int = 200, only: str | None = None) -> None:
    """Print the study."""
    for name, case in CASES.items():
        if only is not None and name != only:
            continue
        print(f"{name}: {replicates} replicates")
        for method, found in replicate(case, range(replicates), METHODS).items():
            table(method, found)


if __name__ == "__main__":
    main(*(int(one) if one.isdigit() else one for one in sys.argv[1:]))
