"""How long `helisim reproduce` takes, cold and warm, and what compiling alone takes of it.

Each is a process of its own: the force laws compiled with nothing there, then the command with
nothing compiled before, then with what that compiled. Printed are wall and processor seconds and
the load of the machine before; nothing is left behind. With other programs at work only the
processor seconds mean something.

    OPENBLAS_NUM_THREADS=1 python scripts/benchmark/experiment.py [FLIGHTS]
"""

import os
import resource
import subprocess
import sys
import tempfile
import time

COMPILE = ["-c", "from helisim.physics import native; native.compiled()"]


def now() -> tuple[float, float]:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter(), used.ru_utime + used.ru_stime


def main(flights: int = 10) -> None:
    command = ["-m", "helisim", "reproduce", "--quiet", "--flights", str(flights)]
    print(f"{f'load of the machine {os.getloadavg()[0]:.1f}':<30}{'wall s':>8}{'CPU s':>8}")
    with tempfile.TemporaryDirectory() as folder:
        for name, cache, words in (
            ("compilation alone", "alone", COMPILE),
            ("helisim reproduce, cold", "kept", [*command, "--out", f"{folder}/cold"]),
            ("helisim reproduce, warm", "kept", [*command, "--out", f"{folder}/warm"]),
        ):
            own, begun = {**os.environ, "NUMBA_CACHE_DIR": f"{folder}/{cache}"}, now()
            # with few flights a tolerance may be missed
            done = subprocess.run([sys.executable, *words], env=own, stdout=subprocess.DEVNULL)
            if done.returncode not in (0, 1):
                sys.exit(f"{name} ended with status {done.returncode}")
            wall, spent = (after - before for after, before in zip(now(), begun))
            print(f"{name:<30}{wall:>8.1f}{spent:>8.1f}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
