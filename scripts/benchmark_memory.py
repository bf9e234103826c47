"""Peak memory against the number of flights that are flown into a folder.

Each number is flown in a process of its own, 90 s a flight, by `helisim.fly_to`.

    python scripts/benchmark_memory.py [FLIGHTS ...]
"""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import helisim as hs

JOBS = 2
FLIGHTS = (5, 20, 80)


def peak_memory(flights: int) -> float:
    """Return the peak resident memory, MB, of a process that flies so many flights."""
    command = [sys.executable, __file__, "--fly", str(flights)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def fly(flights: int) -> None:
    """Fly into a folder that is removed again, and print the peak memory in MB."""
    with tempfile.TemporaryDirectory() as folder:
        sweep = hs.Sweep(axis="lat", duration=90.0)
        hs.fly_to(Path(folder), hs.load("jr700"), sweep, count=flights, seed=1, jobs=JOBS)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)  # Linux counts in kB


def main(flights: tuple[int, ...]) -> None:
    """Print a line for each number of flights."""
    print(f"{'flights of 90 s':>16}{'peak memory, MB':>18}{'ratio':>8}")
    first = None
    for number in flights:
        peak = peak_memory(number)
        first = first or peak
        print(f"{number:16d}{peak:18.1f}{peak / first:8.3f}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--fly"]:
        fly(int(sys.argv[2]))
    else:
        main(tuple(map(int, sys.argv[1:])) or FLIGHTS)
