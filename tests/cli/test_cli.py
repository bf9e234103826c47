"""The command line: what it prints, what it writes, and how it fails."""

import json
import math

import pytest

from helisim import load, read_record
from helisim.base.settings import FrozenMap
from helisim.cli import main
from helisim.study import models
from helisim.study.models import Tolerance


def test_a_flight_is_recorded_as_it_was_asked_for(tmp_path, capsys):
    """Duration, faults and weather; a seed gives the same bytes again, another gives others."""
    paths = [tmp_path / f"flug über {k}.parquet" for k in range(3)]
    asked = ["--wind", "2", "--wind-from-deg", "90", "--turbulence", "light"]
    asked += ["--fault", "servostuck,servo=servo_tail,at=12.8"]
    asked += ["--fault", "recordgap,at=5,lasts=0.5"]
    for path, seed in zip(paths, ("5", "5", "6")):
        words = ["--axis", "ped", "--duration", "13", "--seed", seed, "--out", str(path), *asked]
        assert main(["fly", *words]) == 0
    assert str(paths[0]) in capsys.readouterr().out
    record = read_record(paths[0])
    assert len(record) == 1301 - 50  # whole samples of 10 ms, less the gap
    assert {"ped", "PED", "servo_tail", "r"} <= set(record.names)
    kinds = [fault["kind"] for fault in record.provenance["faults"]]
    assert kinds == ["ServoStuck", "RecordGap"]
    weather = record.provenance["weather"]
    assert (weather["wind"], weather["turbulence"]) == (2.0, "light")
    assert weather["wind_from"] == pytest.approx(math.pi / 2)
    first, second, other = (path.read_bytes() for path in paths)
    assert first == second != other


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


@pytest.mark.study
def test_a_missed_tolerance_is_status_1(tmp_path, capsys, monkeypatch):
    """A parameter off its tolerance is listed, and the exit status is 1."""
    strict = Tolerance(percent=1e-9, reason="no estimate is this good")
    items = vars(FrozenMap)["_items"].__get__(models.HEAVE.tolerances)
    monkeypatch.setitem(items, "Z_w", strict)
    assert main(["reproduce", "--flights", "1", "--quiet", "--out", str(tmp_path)]) == 1
    printed = capsys.readouterr().out
    assert "missed:" in printed
    assert "heave: Z_w" in " ".join(printed.split())
    assert (tmp_path / "results.json").exists()
