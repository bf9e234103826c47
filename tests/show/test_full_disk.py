"""A disk that fills up while helisim writes: the system itself refuses, not a stand-in.

A process with a limit on the size of its files meets a refusal in the middle of a write, also in
the libraries that write without Python: pyarrow and Rerun.
"""

import subprocess
import sys

import pytest

resource = pytest.importorskip("resource", reason="limits of a process are POSIX's")

WRITE = """
import resource, sys
from pathlib import Path
import numpy as np
from helisim.records.record import channel
from helisim.base.errors import StorageError
from helisim.ident import structures
from helisim.show.recording import write_recording
from helisim.records.record import FlightRecord
from helisim.base.files import write_json
from helisim.records.storage import write_record
from helisim.vehicle import load

drawn = load("jr700").visual_model()
folder, endless = Path(sys.argv[1]), resource.RLIM_INFINITY
values = np.random.default_rng(1).normal(size=(2000, 2))
record = FlightRecord(0.01 * np.arange(2000), values, (channel("lat"), channel("p")))
writers = {
    "a.parquet": lambda path: write_record(record, path),
    "a.csv": lambda path: write_record(record, path),
    "a.json": lambda path: write_json({"a": [0.5] * 2000}, path),
    "a.toml": structures.heave.to_toml,
    "a.rrd": lambda path: write_recording(path, {"f": record}, model=drawn),
}
for name, write in writers.items():
    path = folder / name
    write(path)
    whole = path.stat().st_size
    path.write_bytes(b"old")
    for least in (lambda size: 0, lambda size: size // 2, lambda size: size - 60):
        message = "no error"
        while message == "no error":  # a recording's size varies by a few bytes from write to write
            limit = least(whole)
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, endless))
            try:
                write(path)
                whole = path.stat().st_size
                assert whole <= limit, (name, whole, limit)
                path.write_bytes(b"old")
            except StorageError as error:
                message = str(error).replace(str(folder), "FOLDER")
            resource.setrlimit(resource.RLIMIT_FSIZE, (endless, endless))
        left = sorted(file.name for file in folder.iterdir())
        print(name, path.read_bytes() == b"old", left == [name], message, sep="|")
    path.unlink()
"""


@pytest.mark.slow
def test_a_write_that_the_disk_refuses_leaves_the_old_file_and_one_clear_error(tmp_path):
    """At the start, half way, and at the last bytes: a recording's are its table of contents."""
    command = [sys.executable, "-c", WRITE, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = [line.split("|") for line in done.stdout.splitlines()]
    assert len(lines) == 15
    for name, kept, alone, message in lines:
        assert message.startswith(f"FOLDER/{name}: can't write it: "), (name, message)
        assert (kept, alone) == ("True", "True"), name
    assert list(tmp_path.iterdir()) == []
