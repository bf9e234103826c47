"""The commands: what they print, what they write, and how they fail."""

import json
import math
import re
import sys

import numpy as np
import pytest

import helisim as hs
from closed_loops import flown, known_loop
from command import parm_file
from helisim import ident, load, read_record
from helisim.base.settings import FrozenMap
from helisim.cli import main
from helisim.cli.vehicle import speeds_of
from helisim.records.storage import write_record
from helisim.study import models
from helisim.study.models import Tolerance
from ident_data import found
from tabled import section, tabled


def test_a_flight_is_recorded_as_it_was_asked_for(tmp_path, capsys):
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
    assert [one["kind"] for one in record.provenance["faults"]] == ["ServoStuck", "RecordGap"]
    weather = record.provenance["weather"]
    assert (weather["wind"], weather["turbulence"]) == (2.0, "light")
    assert weather["wind_from"] == pytest.approx(math.pi / 2)
    first, second, other = (path.read_bytes() for path in paths)
    assert first == second != other


def test_linearize_prints_the_truth(capsys):
    assert main(["vehicle", "linearize"]) == 0
    assert "N_r" in capsys.readouterr().out
    assert main(["vehicle", "linearize", "--inputs", "IN2", "--json"]) == 0
    model = json.loads(capsys.readouterr().out)
    assert len(model["A"]) == len(model["states"])
    assert model["inputs"] == ["COL", "LON", "LAT", "PED"]
    assert model["delays_s"] == {"PED": load().parameters["gyro.ped_latency"]}
    assert model["derivatives"]["N_r"] == pytest.approx(-0.7512, rel=1e-3)  # calibration


@pytest.mark.study
def test_a_missed_tolerance_is_status_1(tmp_path, capsys, monkeypatch):
    strict = Tolerance(percent=1e-9, reason="no estimate is this good")
    items = vars(FrozenMap)["_items"].__get__(models.HEAVE.tolerances)
    monkeypatch.setitem(items, "Z_w", strict)
    assert main(["reproduce", "--flights", "1", "--quiet", "--out", str(tmp_path)]) == 1
    printed = capsys.readouterr().out
    assert "missed:" in printed
    assert "heave: Z_w" in " ".join(printed.split())
    assert (tmp_path / "results.json").exists()


def test_what_ardupilot_reads_of_a_model_and_of_a_vehicle_is_written(tmp_path, capsys):
    """Half the pedal's travel is ArduPilot's 1, and the recorder's latency is none of the delay."""
    model, out = tmp_path / "yaw.json", tmp_path / "heli.json"
    found(ident.structures.yaw_base, N_r=-2.0, N_ped=60.0, tau_r_base=0.0505).save(model)
    words = ["--rpm", "1700", "--lean", "4", "--hover", "0.5", "--full", "ped=0.5"]
    words += ["--late", "r=0.0405", "--out", str(out)]
    assert main(["ardupilot", "export", str(model), *words]) == 0
    text = capsys.readouterr().out
    assert "Nped            30" in text
    assert f"Written: {out}" in text
    values = json.loads(out.read_text(encoding="utf-8"))
    assert values["Nped"] == pytest.approx(30.0)
    assert values["time_delay_ped"] == 10.0
    assert values["nominal_rpm"] == pytest.approx(1700.0)
    path = tmp_path / "jr700.parm"
    assert main(["ardupilot", "parm", "--vehicle", "jr700", "--out", str(path), "--quiet"]) == 0
    shown = capsys.readouterr().out
    assert shown == path.read_text()
    assert "the command that holds 1 rad/s of p" in shown
    assert parm_file(path)["FRAME_CLASS"] == 6.0


@pytest.fixture(scope="module")
def record():
    return flown(known_loop(), seed=3, noise=0.02)


def test_margins_need_no_option_of_a_record_and_names_of_other_columns(record, tmp_path, capsys):
    path, out = tmp_path / "loop.parquet", tmp_path / "found.json"
    write_record(record, path)
    words = ["--band", "4", "20", "--json", str(out), "--quiet"]
    assert main(["margins", str(path), *words]) == 0
    text = capsys.readouterr().out
    assert all(words in text for words in ("phase margin", "gain margin", "crossover", "lat"))
    figures = {one["figure"]: one for one in json.loads(out.read_text())["figures"]}
    assert figures["phase_margin"]["low"] < 51.4 < figures["phase_margin"]["high"]  # the loop's own
    assert figures["phase_margin"]["unit"] == "deg"
    path, out = tmp_path / "own.csv", tmp_path / "found.json"
    table = np.column_stack([1e3 * record.time, record.values[:, 0], -record.values[:, 1]])
    np.savetxt(path, table, delimiter=",", header="t,dither,mixer", comments="")
    words = ["--time", "t:ms", "--channel", "dither=dither:1", "--channel", "mixer=mixer:1:sign=-1"]
    given = ["--axis", "roll", "--injected", "dither", "--total", "mixer", "--band", "4", "9"]
    json_ = ["--json", str(out), "--quiet"]
    page = tmp_path / "loops.html"
    assert main(["margins", str(path), *words, *given, *json_, "--report", str(page)]) == 0
    assert "Broken loop, " in page.read_text()
    figures = {one["figure"]: one for one in json.loads(out.read_text())["figures"]}
    assert figures["phase_margin"]["value"] == pytest.approx(51.4, abs=3.0)  # three deviations
    assert "gain margin of lat at actuators isn't within" in capsys.readouterr().out


def test_json_goes_to_a_file_or_in_place_of_the_text(tmp_path, capsys, record):
    path, out = tmp_path / "loop.parquet", tmp_path / "found.json"
    write_record(record, path)
    trim, margins = (
        ["vehicle", "trim", "--speeds", "0"],
        ["margins", str(path), "--band", "4", "20"],
    )
    for words in (["vehicle", "linearize"], trim, margins, ["look", str(path)]):
        status = main([*words, "--json", str(out)])
        assert f"Written: {out}" in capsys.readouterr().out
        assert main([*words, "--json"]) == status
        assert json.loads(capsys.readouterr().out) == json.loads(out.read_text())


def printed(capsys, *arguments):
    assert main(["vehicle", "trim", *arguments]) == 0
    text = capsys.readouterr().out
    assert max(len(line) for line in text.splitlines() if "Written" not in line) <= 80
    rows = [line.split() for line in text.splitlines() if re.match(r"^ +[\d.]+ +[\d.]+ ", line)]
    return {float(row[0]): np.array(row[1:], float) for row in rows}, text


def test_the_table_has_a_power_bucket_and_a_stick_that_goes_forward(capsys):
    rows, text = printed(capsys, "--speeds", "0:20:4")
    assert list(rows) == [0.0, 4.0, 8.0, 12.0, 16.0, 20.0]
    power, lon, theta = (np.array([row[k] for row in rows.values()]) for k in (0, 2, 5))
    assert np.argmin(power) == 3
    assert f"Least power: {power[3]:.1f} W at 12 m/s" in text
    assert (np.diff(lon) < 0.0).all()
    assert (np.diff(theta) < 0.0).all()


def test_each_speed_has_its_linearisation(tmp_path, capsys, jr700):
    path = tmp_path / "trim.json"
    rows, text = printed(capsys, "--speeds", "0,15", "--json", str(path))
    assert f"Written: {path}" in text
    written = json.loads(path.read_text())
    assert written["provenance"]["vehicle"] == "jr700"
    hover, fast = written["flights"]
    assert [hover["speed_m_s"], fast["trim"]["speed"]] == [0.0, 15.0]
    assert fast["power_w"] == pytest.approx(rows[15.0][0], abs=0.05)  # printed to 0.1 W
    np.testing.assert_allclose(hover["A"], jr700.linearize().system.A, rtol=1e-6, atol=1e-6)
    linear = jr700.trimmed(speed=15.0)
    for name in ("X_u", "Z_w", "M_a"):
        # central differences of 1e-10
        assert fast["derivatives"][name] == pytest.approx(linear.derivatives[name], rel=1e-6)
    assert fast["inputs"] == ["col", "lon", "lat", "ped"]


@tabled("text", "speeds")
def test_speeds_are_read_as_they_are_meant(text, speeds):
    assert speeds_of(text) == pytest.approx(speeds, abs=1e-12)


LAWS = "\n" + section(globals(), "LAWS")
FLY = ["fly", "--axis", "ped", "--duration", "12", "--quiet", "--out", "ped.parquet"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "laws_of_the_folder.py").write_text(LAWS)
    (tmp_path / "json.py").write_text(LAWS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "laws_of_the_folder", raising=False)
    return tmp_path


@pytest.mark.parametrize("word", ["laws/of_a_file.py:tail", "./laws/of_a_file:tail"])
def test_a_law_of_a_file_flies(folder, monkeypatch, word):
    monkeypatch.delitem(sys.modules, "of_a_file", raising=False)
    (folder / "laws").mkdir()
    (folder / "laws" / "of_a_file.py").write_text(LAWS)
    assert main([*FLY, "--controller", word]) == 0
    law = hs.read_record(folder / "ped.parquet").provenance["controller"]["tail"]["law"]
    assert law == "of_a_file:yaw"


def test_a_law_that_raises_is_told_with_its_traceback(folder, capsys):
    assert main([*FLY, "--controller", "laws_of_the_folder:breaks"]) == 3
    said = capsys.readouterr().err.splitlines()
    assert 'File "laws_of_the_folder.py", line 13, in breaks' in said[1]
    assert said[-1].startswith("helisim fly: controller 'breaks' raised ValueError: no fuel at 1.0")
    assert hs.read_record(folder / "ped.parquet").ended
