"""Compare Blackbox logs with another decoder's tables of them, value by value.

    python scripts/proof/blackbox_values.py FOLDER REFERENCE.csv...

A table NAME.03.csv is of the third log in FOLDER/NAME.*, as Betaflight's blackbox_decode writes it
with `--unit-vbat raw --unit-amperage raw`; without a number it is of the only one. Rows are matched
by their times. Columns that a decoder computes are left out, and so is loopIteration, which that
one counts by frames instead of by the header's P interval.
"""

import re
from pathlib import Path

import common
import numpy as np

from helisim.logs.blackbox import Blackbox

NAME = re.compile(r"(?P<stem>.+?)(\.(?P<number>\d\d))?\.csv")


def compared(log: Blackbox, other: dict[str, np.ndarray]) -> str:
    """Return how a log and a decoder's table of it differ."""
    mine = np.rint(1e6 * log.time()).astype(np.int64)
    _, ours, theirs = np.intersect1d(mine, other["time"].astype(np.int64), return_indices=True)
    names = [one for one, clock in log.columns.items() if clock == "main" and one in other]
    names = [one for one in names if one != "loopIteration" and not one.startswith("axisSum")]
    differ = {one: int(np.count_nonzero(log.raw(one)[ours] != other[one][theirs])) for one in names}
    wrong = ", ".join(f"{name} {count}" for name, count in differ.items() if count) or "none"
    own = log.counts
    return (
        f"{own['main']} frames, {own['corrupt']} places without one, time goes back "
        f"{np.count_nonzero(np.diff(mine) <= 0)} times; {other['time'].size} of the other decoder, "
        f"{ours.size} of both; of their {len(names)} columns {sum(differ.values())} of "
        f"{len(names) * ours.size} values differ: {wrong}"
    )


def main(folder: Path, *tables: Path) -> None:
    """Print a line for each table."""
    for path in tables:
        name = NAME.fullmatch(path.name)
        if name is None or path.name.endswith(".gps.csv"):
            continue
        other = common.decoded(path)
        if "time" not in other:
            print(f"{path.name}: no frame")
            continue
        (log,) = (one for one in folder.iterdir() if one.stem == name["stem"])
        print(f"{path.name}: {compared(Blackbox(log, int(name['number'] or 1)), other)}")


if __name__ == "__main__":
    common.run(main)
