"""The command line: what it prints, what it writes, and how it fails."""

import json
import math
import subprocess
import sys

import pytest

from helisim import load, read_record
from helisim.cli import main
from helisim.study import models
from helisim.study.models import Tolerance


def test_a_flight_is_recorded(tmp_path, capsys):
    """`fly` writes a record with sticks, servos and motion, and says so."""
    path = tmp_path / "flug über.parquet"
    assert main(["fly", "--axis", "ped", "--duration", "15", "--out", str(path)]) == 0
    record = read_record(path)
    assert record.duration == pytest.approx(15.0, abs=1e-9)  # whole samples of 10 ms
    assert {"ped", "PED", "servo_tail", "r"} <= set(record.names)
    assert str(path) in capsys.readouterr().out


def test_a_flight_is_the_same_for_the_same_seed(tmp_path):
    """Two runs of one seed give the same bytes; another seed gives others."""
    paths = [tmp_path / f"{k}.parquet" for k in range(3)]
    for path, seed in zip(paths, ("5", "5", "6")):
        arguments = ["--duration", "13", "--seed", seed, "--out", str(path)]
        assert main(["fly", "--axis", "col", *arguments]) == 0
    first, second, other = (path.read_bytes() for path in paths)
    assert first == second
    assert first != other


def test_a_flight_has_the_faults_asked_for(tmp_path):
    """`fly --fault` puts faults into the flight and into its provenance."""
    path = tmp_path / "faulty.parquet"
    faults = ["--fault", "servo_tail:stuck@8", "--fault", "recorder:gap@5,lasts=0.5"]
    flight = ["--duration", "13", "--envelope", "off", *faults, "--out", str(path)]
    assert main(["fly", "--axis", "ped", *flight]) == 0
    record = read_record(path)
    kinds = [fault["kind"] for fault in record.provenance["faults"]]
    assert kinds == ["ServoStuck", "RecordGap"]
    assert len(record) == 1301 - 50


def test_a_flight_has_the_weather_asked_for(tmp_path):
    """It stands in the record's provenance, with the heading in rad."""
    path = tmp_path / "gusty.parquet"
    wind = ["--wind", "2", "--wind-from-deg", "90", "--turbulence", "light"]
    assert main(["fly", "--axis", "ped", "--duration", "13", *wind, "--out", str(path)]) == 0
    weather = read_record(path).provenance["weather"]
    assert (weather["wind"], weather["turbulence"]) == (2.0, "light")
    assert weather["wind_from"] == pytest.approx(math.pi / 2)


def test_a_recording_is_written(tmp_path):
    """`fly --rerun` writes a Rerun recording beside the record."""
    out, recording = tmp_path / "a.csv", tmp_path / "a.rrd"
    arguments = ["--duration", "13", "--out", str(out), "--rerun", str(recording)]
    assert main(["fly", "--axis", "lat", *arguments]) == 0
    assert recording.stat().st_size > 0
    assert out.stat().st_size > 0


def test_linearize_prints_the_truth(capsys):
    """`linearize` prints the derivatives, and with --json the matrices and names."""
    assert main(["linearize"]) == 0
    assert "N_r" in capsys.readouterr().out
    assert main(["linearize", "--inputs", "IN2", "--json"]) == 0
    model = json.loads(capsys.readouterr().out)
    assert len(model["A"]) == len(model["states"])
    assert model["inputs"] == ["COL", "LON", "LAT", "PED"]
    assert model["delays_s"] == {"PED": load().parameters["gyro.ped_latency"]}
    assert model["derivatives"]["N_r"] == pytest.approx(-0.7512, rel=1e-3)  # calibration


def test_parameters_can_be_set(capsys):
    """`--set` changes the truth."""
    assert main(["linearize", "--json", "--set", "main_rotor.hub_stiffness=100"]) == 0
    model = json.loads(capsys.readouterr().out)
    assert model["derivatives"]["L_b"] > 580.0  # (100 + T h) / I_xx = 609


@pytest.mark.slow
def test_a_missed_tolerance_is_status_1(tmp_path, capsys, monkeypatch):
    """A parameter off its tolerance is listed, and the exit status is 1."""
    strict = Tolerance(percent=1e-9, reason="no estimate is this good")
    monkeypatch.setitem(models.HEAVE.tolerances, "Z_w", strict)
    assert main(["reproduce", "--flights", "1", "--quiet", "--out", str(tmp_path)]) == 1
    printed = capsys.readouterr().out
    assert "missed:" in printed
    assert "heave: Z_w" in " ".join(printed.split())
    assert (tmp_path / "results.json").exists()


def test_the_module_runs_as_a_program():
    """`python -m helisim --version` prints the version."""
    command = [sys.executable, "-m", "helisim", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("helisim ")
