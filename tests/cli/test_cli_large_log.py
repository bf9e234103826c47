"""Ten minutes of log are identified in seconds, and in less memory than twice the log."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sid_logs import SidLog

CODE = """
import contextlib, io, sys, time
from pathlib import Path
from helisim.cli import main
with contextlib.redirect_stdout(io.StringIO()) as said:
    status = main(["identify", sys.argv[1], "--quiet"])
state = Path("/proc/self/status").read_text().splitlines()
peak = next(one.split()[1] for one in state if one.startswith("VmHWM"))  # of this process alone
print(status, time.process_time(), peak, "rollpitch" in said.getvalue())
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peak memory is read of Linux")
def test_ten_minutes_are_identified_within_ten_seconds_and_twice_the_logs_memory(tmp_path):
    """Sweeps at 400 Hz between what an autopilot logs besides: 110 MB, 2 million messages."""
    log = SidLog(rate=400.0)
    count = 250_000
    rows = np.zeros(
        count, [("head", "u1", 3), ("us", "<u8"), ("numbers", "<f4", 10), ("flag", "u1")]
    )
    rows["head"] = (0xA3, 0x95, 90)
    rows["us"] = 2500 * np.arange(count)
    rows["numbers"] = np.random.default_rng(1).normal(size=(count, 10)) * 20.0
    for number in (90, 91):
        log.define(number, f"PI{number}", "Q" + 10 * "f" + "B", "TimeUS,A,B,C,D,E,F,G,H,I,J,K")
    for axis in (10, 11, 12, 13):
        for number in (90, 91):
            rows["head"][:, 2] = number
            log.messages.append(rows.tobytes())
        log.sweep(axis)
    path = log.save(tmp_path)
    size = path.stat().st_size
    assert size > 100e6
    done = subprocess.run(
        [sys.executable, "-c", CODE, str(path)], capture_output=True, text=True, check=True
    )
    status, seconds, kilobytes, fitted = done.stdout.split()
    assert (status, fitted) == ("0", "True")
    assert float(seconds) < 10.0
    assert 1024.0 * float(kilobytes) < 2.0 * size
