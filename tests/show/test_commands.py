"""The commands `record` and `report`: what they write."""

from pathlib import Path

import pytest

from command import fails, python
from helisim.cli import main
from helisim.records.storage import write_record
from made_run import make_flight, write_run


def test_a_log_becomes_a_recording(tmp_path, capsys):
    log, out = tmp_path / "a.parquet", tmp_path / "a.rrd"
    write_record(make_flight(), log)
    assert main(["rerun", str(log), "--out", str(out)]) == 0
    assert f"rerun {out}" in capsys.readouterr().out
    assert out.stat().st_size > 0
    assert main(["rerun", str(log), "--out", str(out), "--quiet"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_a_run_becomes_a_recording_and_a_report(tmp_path, capsys):
    write_run(tmp_path)
    assert main(["rerun", str(tmp_path), "--out", str(tmp_path / "run.rrd")]) == 0
    capsys.readouterr()
    assert main(["report", str(tmp_path)]) == 0
    assert f"Written: {tmp_path / 'report.html'}" in capsys.readouterr().out
    figures = list((tmp_path / "figures").iterdir())
    assert len(figures) == 5 + 2 + 1  # pairs, sweeps, a verification


def test_the_vehicle_that_flew_is_drawn(tmp_path, capsys, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "helisim.show.recording.write_recording",
        lambda path, flights, *, model, **_: drawn.append(model.names),
    )
    both = [str(tmp_path / f"{name}.parquet") for name in ("blade360", "jr700")]
    for path in both:
        write_record(make_flight(vehicle=Path(path).stem), path)
    out = ["--out", str(tmp_path / "a.rrd")]
    assert main(["rerun", both[0], *out]) == 0
    assert drawn[0].startswith(b"blade360 ")
    capsys.readouterr()
    assert "'blade360', 'jr700'" in fails(capsys, "rerun", *both, *out)


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
    pytest.importorskip("resource", reason="limits of a process are POSIX's")
    lines = [line.split("|") for line in python(WRITE, tmp_path).splitlines()]
    assert len(lines) == 15
    for name, kept, alone, message in lines:
        assert message.startswith(f"FOLDER/{name}: can't write it: "), (name, message)
        assert (kept, alone) == ("True", "True"), name
    assert list(tmp_path.iterdir()) == []
