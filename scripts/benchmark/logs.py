"""CPU time and peak memory of what a log goes through, each in a process of its own.

The log is read by `helisim.DataFlash`, by pymavlink where it is installed (an object a message),
and then taken through `helisim identify LOG` with nothing else, whose output is left out.

    python scripts/benchmark/logs.py flight.bin
"""

import subprocess
import sys
from pathlib import Path

STEPS = {
    "opened, parameters and texts": (
        "import helisim as hs; log = hs.DataFlash(path); log.parameters(), log.messages()"
    ),
    "every column of every type": (
        "import helisim as hs; log = hs.DataFlash(path)\n"
        "for name in log.types:\n"
        "    for one in log.instances(name):\n"
        "        log.table(name, one, fields=tuple(log.columns(name, one)))"
    ),
    "pymavlink, every message": (
        "from pymavlink import DFReader; log = DFReader.DFReader_binary(path)\n"
        "while log.recv_msg() is not None: pass"
    ),
    "helisim identify": (
        "import contextlib, io; from helisim.cli import main\n"
        "with contextlib.redirect_stdout(io.StringIO()):\n"
        "    status = main(['identify', path, '--quiet'])\n"
        "assert status in (0, 1), status"
    ),
}
"""What is done -> how. `path` is the log."""

MEASURED = """
import sys, time
from pathlib import Path
path = sys.argv[1]
{step}
state = Path("/proc/self/status").read_text().splitlines()
print(time.process_time(), *(one.split()[1] for one in state if one.startswith("VmHWM")))
"""
"""The peak is this process's own: getrusage's would begin with that of the one that started it."""


def measure(step: str, path: str) -> tuple[float, float]:
    """Return CPU time, s, and peak memory, MB, of a process (Linux). Raises RuntimeError."""
    command = [sys.executable, "-c", MEASURED.format(step=step), path]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    seconds, kilobytes = map(float, done.stdout.split()[-2:])
    return seconds, kilobytes / 1024.0


def main(path: str) -> None:
    """Print a line for each step."""
    size = Path(path).stat().st_size / 2**20
    print(f"{path}: {size:.1f} MB")
    print(f"{'':32}{'CPU, s':>10}{'peak, MB':>12}{'of the log':>12}")
    for name, step in STEPS.items():
        try:
            seconds, peak = measure(step, path)
        except RuntimeError as error:
            print(f"{name:32}{error}")
            continue
        print(f"{name:32}{seconds:10.2f}{peak:12.1f}{peak / size:12.2f}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
