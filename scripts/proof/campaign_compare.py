"""Two campaigns with the same seeds beside each other: what their difference moves.

Printed are, for every parameter, the mean and the greatest difference of the estimates of the
same replicates, in percent of the truth, beside their scatter over the replicates.

    helisim campaign scripts/campaigns/rk4.toml --out rk4
    helisim campaign scripts/campaigns/euler.toml --out euler
    python scripts/proof/campaign_compare.py rk4 euler
"""

import sys
from typing import Any

import numpy as np

from helisim.study.replicates import read_dataset

_SAME = ("replicate", "seed", "flights", "method", "model", "parameter")


def relative_errors(path: str) -> dict[tuple[Any, ...], float]:
    """Return the errors relative to the truth of a campaign's estimates, by what they are of."""
    table, _ = read_dataset(path)
    return {
        tuple(row[name] for name in _SAME): (row["estimate"] - row["truth"]) / abs(row["truth"])
        for row in table.to_pylist()
        if row["failure"] is None
    }


def main(first: str, second: str) -> None:
    """Print a line for each parameter."""
    one, other = relative_errors(first), relative_errors(second)
    both = [key for key in one if key in other]
    print(f"{second} less {first}, {len(both)} estimates in both; % of the truth\n")
    print(f"{'parameter':<26}{'n':>4}{'mean':>9}{'greatest':>10}{'scatter':>9}{'mean/scatter':>14}")
    for group in dict.fromkeys(key[2:] for key in both):
        keys = [key for key in both if key[2:] == group]
        moved = 100.0 * np.array([other[key] - one[key] for key in keys])
        scatter = 100.0 * np.std([one[key] for key in keys], ddof=1)
        print(
            f"{f'{group[2]} {group[3]}':<26}{len(keys):>4}{moved.mean():>9.3f}"
            f"{np.abs(moved).max():>10.3f}{scatter:>9.3f}{abs(moved.mean()) / scatter:>14.2f}"
        )


if __name__ == "__main__":
    main(*sys.argv[1:])
