"""The whole experiment with several seeds: the worst deviation of each value beside its limit.

Each seed flies, records and identifies anew (about a minute). Flights that an earlier run left in
the folder, of the same vehicle, are used again.

    python scripts/seed_study.py [SEEDS] [FOLDER]
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from helisim.errors import InputError, StorageError
from helisim.study.reproduce import reproduce
from helisim.study.results import ParameterRow, Results

FORM = "{:<15}{:<12}{:>10}{:>9}{:>7}{:>12}{:>9}{:>7}"


def run(seed: int, folder: Path) -> Results:
    """Return the results of one seed, from the flights in the folder if it holds them."""
    out = folder / f"seed_{seed}"
    try:
        results = reproduce(out=out, seed=seed, reuse=True).results
    except (InputError, StorageError):
        results = reproduce(out=out, seed=seed).results
    return results


def worst(errors: Sequence[float | None], limit: float | None) -> tuple[str, str, str]:
    """Return the largest error in percent, its limit, and a mark."""
    known = [error for error in errors if error is not None]
    if not known:
        return "-", "-", ""
    largest = max(known, key=abs)
    if limit is None:
        return f"{largest:+.2f}", "-", ""
    return f"{largest:+.2f}", f"{limit:.3g}", "MISSED" if abs(largest) > limit else "ok"


def line(table: str, rows: Sequence[ParameterRow]) -> str:
    """Return one parameter's line."""
    paper = worst([row.paper_error_percent for row in rows], rows[0].paper_tolerance_percent)
    truth = worst([row.error_percent for row in rows], rows[0].tolerance_percent)
    return FORM.format(table, rows[0].name, *paper, *truth).rstrip()


def main(seeds: int = 5, folder: Path = Path("seed_study")) -> int:
    """Print the worst of all seeds; return 1 if a tolerance was missed."""
    found = []
    for seed in range(1, seeds + 1):
        found.append(run(seed, folder))
        print(f"seed {seed}: {len(found[-1].misses)} missed", file=sys.stderr)
    print(f"Worst of {seeds} seeds, percent")
    print(FORM.format("model", "parameter", "of paper", "limit", "", "of truth", "limit", ""))
    for table in found[0].tables:
        for row in table.parameters:
            print(line(table.name, [results[table.name][row.name] for results in found]))
    misses = [f"seed {one.seed}: {miss}" for one in found for miss in one.misses]
    print("\n".join(misses) or f"All tolerances hold for {seeds} seeds.")
    return 1 if misses else 0


if __name__ == "__main__":
    raise SystemExit(main(*map(int, sys.argv[1:2]), *map(Path, sys.argv[2:3])))
