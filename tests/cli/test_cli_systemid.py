"""`helisim identify flight.bin`, and nothing else."""

import json
from pathlib import Path

import numpy as np
import pytest

from command import fails, python
from helisim.cli import main
from sid_logs import TRUTH, SidLog, four_axes

SHORT = {"length": 12.0, "low": 1.0}


@pytest.mark.slow
def test_a_log_alone_gives_its_models_which_are_verified_on_another(tmp_path, capsys):
    path = four_axes(tmp_path / "flight.bin")
    out = tmp_path / "model.json"
    main(["identify", str(path), "--json", str(out), "--quiet"])
    text = capsys.readouterr().out
    assert "SID_AXIS 13, mixer thrust" in text
    for name in TRUTH:
        model = json.loads((tmp_path / f"model-{name}.json").read_text())
        assert model["structure"]["name"] == name
    assert not out.exists()
    first = SidLog().sweep(12, **SHORT).save(tmp_path)
    log = SidLog().sweep(10, **SHORT).sweep(12, seed=3, noise=0.1, **SHORT)
    second = log.save(tmp_path, "b.bin")
    model = tmp_path / "yaw.json"
    main(["identify", str(first), "--json", str(model), "--quiet"])
    capsys.readouterr()
    assert main(["verify", str(model), str(second), "--quiet"]) == 0
    assert "r " in capsys.readouterr().out
    assert main(["verify", str(model), str(first), "--quiet"]) == 2


def test_options_overrule_what_the_log_says(tmp_path, capsys):
    path = SidLog().sweep(10, **SHORT).sweep(12, **SHORT).save(tmp_path)
    out = tmp_path / "yaw.json"
    words = ["--structure", "yaw_base", "--band", "8", "40", "--channel", "r=RATE.Y:deg/s"]
    main(["identify", str(path), *words, "--json", str(out), "--quiet"])
    text = capsys.readouterr().out
    assert "r = RATE.Y [deg/s], 100 Hz: given" in text
    assert "from 8 to 40 rad/s" in text.replace("\n", " ")
    assert out.exists()


def test_what_cannot_be_used_is_said_in_one_line(tmp_path, capsys):
    path, other = SidLog().save(tmp_path), tmp_path / "a.csv"
    assert "no SystemID messages (SIDS, SIDD)" in fails(capsys, "identify", path)
    assert "has one" in fails(capsys, "identify", path, "--time", "t:s")
    other.write_text("t,p\n0,0\n")
    assert "--structure has to be said" in fails(capsys, "identify", other)
    SidLog().sweep(10, **SHORT).sweep(12, **SHORT).save(tmp_path)
    assert "choose one by --structure" in fails(capsys, "identify", path, "--fix", "N_r=-3")


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
    fields = [("head", "u1", 3), ("us", "<u8"), ("numbers", "<f4", 10), ("flag", "u1")]
    rows = np.zeros(count, fields)
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
    status, seconds, kilobytes, fitted = python(CODE, path).split()
    assert (status, fitted) == ("0", "True")
    assert float(seconds) < 10.0
    assert 1024.0 * float(kilobytes) < 2.0 * size
