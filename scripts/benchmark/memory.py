"""Memory against the number of flights that are flown into a folder.

Each number is flown in a process of its own, 90 s a flight, by `helisim.fly_to`. Printed are the
peak, and the most that is held after a flight. The C library gives large blocks back at once here;
left alone it keeps holes of a few flights' size, which come and go.

    python scripts/benchmark/memory.py [FLIGHTS ...]
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import helisim as hs

JOBS = 2
FLIGHTS = (5, 20, 80)
GIVE_BACK = {"MALLOC_MMAP_THRESHOLD_": str(2**20)}
"""Of glibc's: blocks from 1 MiB on are the system's again as soon as they are free."""


def peak_memory(flights: int) -> float:
    """Return the peak resident memory, MB, of a process that flies so many flights."""
    return memory(flights)[0]


def memory(flights: int) -> tuple[float, float]:
    """Return the peak, and the most held after a flight, MB, of a process that flies so many."""
    command = [sys.executable, __file__, "--fly", str(flights)]
    environment = {**os.environ, **GIVE_BACK}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    peak, held = map(float, done.stdout.split())
    return peak, held


def fly(flights: int) -> None:
    """Fly into a folder that is removed again, and print both in MB."""
    held: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        sweep = hs.Sweep(axis="lat", duration=90.0)
        hs.fly_to(
            Path(folder),
            hs.load("jr700"),
            sweep,
            count=flights,
            seed=1,
            jobs=JOBS,
            on_flight=lambda: held.append(resident()),
        )
    # Linux counts in kB
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0, max(held))


def resident() -> float:
    """Return the memory that this process holds now, MB (Linux)."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def main(flights: tuple[int, ...]) -> None:
    """Print a line for each number of flights."""
    print(f"{'flights of 90 s':>16}{'peak, MB':>12}{'after a flight, MB':>20}{'ratio':>8}")
    first = None
    for number in flights:
        peak, held = memory(number)
        first = first or held
        print(f"{number:16d}{peak:12.1f}{held:20.1f}{held / first:8.3f}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--fly"]:
        fly(int(sys.argv[2]))
    else:
        main(tuple(map(int, sys.argv[1:])) or FLIGHTS)
