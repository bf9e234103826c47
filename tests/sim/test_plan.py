"""The flight plan: one value in Python, data, TOML and a record; what it can't have is refused."""

import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

import helisim as hs
from helisim.base.errors import InputError, StorageError
from helisim.cli import main
from helisim.records.storage import read_record
from helisim.sim import fly, multisine, plan, read_plan, write_plan
from helisim.sim.missions import autopilot
from helisim.vehicle import load
from tabled import rows, tabled

SHORT = hs.Sweep(axis="lat", duration=8.0, trim_time=1.0)
FULL = hs.FlightPlan(**dict(rows(globals(), "FULL")))
PLANS = dict(rows(globals(), "PLANS"))


@pytest.mark.parametrize("name", PLANS)
def test_a_plan_comes_back_from_its_file_and_its_data(tmp_path, name):
    plan = PLANS[name]
    write_plan(plan, tmp_path / "plan.toml")
    through_json = hs.FlightPlan.from_dict(json.loads(json.dumps(plan.to_dict())))
    for again in (read_plan(tmp_path / "plan.toml"), through_json):
        assert again == plan
        assert hash(again) == hash(plan)
        assert again.digest == plan.digest


@pytest.mark.parametrize("name", ["jr700", "blade360"])
def test_a_plan_on_a_vehicle_has_nothing_left_open(name):
    vehicle = load(name)
    plan = hs.FlightPlan(excitation=hs.Sweep(axis="ped")).on(vehicle)
    own = vehicle.parameters
    assert plan.excitation.amplitude == own["sweep.ped_amplitude"]
    assert plan.excitation.band == (own["sweep.ped_w_min"], own["sweep.ped_w_max"])
    assert plan.recorder == hs.Recorder.of(vehicle)
    assert plan.on(vehicle) == plan
    assert hs.FlightPlan.from_dict(tomllib.loads(plan.to_toml())) == plan


def test_a_recorder_keeps_the_vehicles_latencies_and_equal_numbers_make_equal_plans(jr700):
    content = {"excitation": {"kind": "Sweep", "axis": "lat"}, "recorder": {"rate_hz": 200}}
    plan = hs.FlightPlan.from_dict(content)
    assert plan.on(jr700).recorder == replace(hs.Recorder.of(jr700), rate_hz=200.0)
    content["recorder"]["latency"] = {}
    assert hs.FlightPlan.from_dict(content).on(jr700).recorder == hs.Recorder(rate_hz=200.0)
    plan = hs.FlightPlan(excitation=hs.Sweep(axis="lat", duration=90.0, band=(1.0, 20.0)))
    other = hs.FlightPlan(excitation=hs.Sweep(axis="lat", duration=90, band=[1, 20]), faults=[])
    assert (other, hash(other), other.digest) == (plan, hash(plan), plan.digest)
    one, two = (hs.Recorder(rate_hz=rate, noise={"p": 0.0, "q": 1.0}) for rate in (100.0, 100))
    assert (one, hash(one)) == (two, hash(two))


@tabled("text", "says")
def test_a_plan_that_can_not_be_is_refused(tmp_path, text, says):
    path = tmp_path / "plan.toml"
    text = text.replace("@", "excitation = {kind = 'Sweep', axis = 'lat'}\n", 1)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_plan(path)
    assert str(caught.value).startswith(str(path))
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_no_toml_and_a_record_of_others_have_no_plan(tmp_path, jr700):
    (tmp_path / "a.toml").write_text("[excitation", encoding="utf-8")
    for name, says in (("a.toml", "not TOML"), ("b.toml", "no such file")):
        with pytest.raises(StorageError, match=rf"{name}: {says}"):
            read_plan(tmp_path / name)
    (record,) = fly(jr700, SHORT, seed=3, jobs=1)
    with pytest.raises(InputError, match="helisim didn't fly it"):
        hs.FlightPlan.of_record(replace(record, provenance={}))


OPTIONS = ["--axis", "lat", "--duration", "13", "--turbulence", "light", "--wind", "2"]
OPTIONS += ["--wind-from-deg", "90", "--fault", "sampleloss,share=0.1"]


def test_a_printed_plan_flies_the_same(tmp_path, capsys):
    assert main(["fly", *OPTIONS, "--print-plan"]) == 0
    path = tmp_path / "plan.toml"
    path.write_text(capsys.readouterr().out, encoding="utf-8")
    assert main(["fly", "--plan", str(path), "--print-plan"]) == 0
    assert capsys.readouterr().out == path.read_text(encoding="utf-8")
    files = [tmp_path / "options.parquet", tmp_path / "plan.parquet"]
    for asked, out in zip((OPTIONS, ["--plan", str(path)]), files):
        assert main(["fly", *asked, "--quiet", "--out", str(out)]) == 0
    assert files[0].read_bytes() == files[1].read_bytes()
    assert hs.FlightPlan.of_record(read_record(files[1])) == read_plan(path)


NAN, INF = math.nan, math.inf


def four(**settings):
    usual = {"amplitude": (0.03, 0.07, 0.07, 0.01), "band": (0.6, 40.0), "period": 10.0}
    return multisine.Multisine(**{**usual, "duration": 26.0, **settings})


TABLE = Path(__file__).with_name("refused.txt").read_text(encoding="utf-8").splitlines()
"""Each with what is made, and what is said of it."""
NAMES = {**vars(plan), **vars(autopilot), **vars(hs.sim), **globals()}


@pytest.mark.parametrize("line", TABLE)
def test_what_can_not_be_is_one_line(jr700, line):
    make, says = line.split(" => ")
    with pytest.raises(InputError, match=says) as caught:
        eval(make, {**NAMES, "OWN": jr700.parameters})  # the lines of that file
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", [hs.Sweep, hs.Doublet])
@pytest.mark.parametrize("name", ["duration", "trim_time", "amplitude"])
@pytest.mark.parametrize("bad", [-1.0, 0.0, NAN, "1"])
def test_times_and_amplitudes_are_finite_and_fit(kind, name, bad):
    """No trimmed stretch is a stretch of 0 s; it leaves half of the flight at least."""
    if (name, bad) != ("trim_time", 0.0):
        with pytest.raises(InputError, match=name if name == "amplitude" else "duration|trim"):
            kind(axis="lat", **{name: bad})
    with pytest.raises(InputError, match=r"four times the trimmed stretch"):
        kind(axis="lat", duration=3.0, trim_time=1.0)
