"""From records to a law: what the identified model promises, the vehicle keeps."""

import json
from dataclasses import replace

import pytest

import helisim as hs
from command import fails
from helisim.base.units import RAD_PER_DEG
from helisim.cli import main
from helisim.design.exact import exact_loop
from helisim.handling.criteria import StabilityMargins
from helisim.handling.figures import rejection
from helisim.handling.spec import read_specs
from helisim.study.experiment import reproduce


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    """A run of three flights an axis."""
    folder = tmp_path_factory.mktemp("run") / "reproduction"
    reproduce(out=folder, flights=3, seed=1, jobs=2)
    return folder


@pytest.mark.study
def test_the_law_has_on_the_exact_vehicle_what_was_asked_of_it(run_folder, tmp_path, capsys):
    """The sampled linearisation, of which nothing was told: 45 deg, 6 dB, 1.3 times the gyro's."""
    out = tmp_path / "design"
    words = ["design", str(run_folder), "--out", str(out), "--no-proof", "--quiet"]
    assert main(words) == 0
    assert "Handling qualities" in (out / "report.html").read_text(encoding="utf-8")
    printed = capsys.readouterr().out
    assert "Level 1 in 100 % of 200 models drawn" in printed
    assert max(map(len, printed.splitlines())) <= 80
    vehicle, law = hs.load("jr700"), hs.read_law(out / "law.toml")
    before, after = exact_loop(vehicle), exact_loop(vehicle.with_controller(law.on(vehicle)))
    assert after.poles.real.max() < 1e-4
    for axis in ("lat", "lon", "ped"):
        margins = StabilityMargins(axis=axis).rate(after).figures
        assert margins["gain_margin"] > 6.0
        assert margins["phase_margin"] > 45.0 * RAD_PER_DEG
    for axis in ("lat", "lon"):
        gained, had = (rejection(one.disturbance(axis)).bandwidth for one in (after, before))
        assert gained > 1.3 * had
    found = json.loads((out / "design.json").read_text(encoding="utf-8"))
    assert found["law"] == law.parameters()
    assert {one.kind for one in read_specs(out / "specs.toml")} >= {"hard", "soft", "objective"}


def test_without_a_run_it_says_what_makes_one(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = fails(capsys, "design")
    assert "reproduction: no such run" in said
    assert "helisim reproduce --out reproduction" in said
    assert not any(tmp_path.iterdir())


@pytest.mark.study
def test_records_of_no_shipped_vehicle_need_one(run_folder, tmp_path, capsys, jr700):
    """Whose records say nothing of what flew: the vehicle is asked for, and taken."""
    from helisim.records.storage import read_record, write_record

    own = tmp_path / "flights"
    own.mkdir()
    for path in sorted((run_folder / "flights").glob("*_0?.parquet")):
        record = read_record(path)
        if (record.provenance.get("excitation") or {}).get("kind") == "Sweep":
            said = {**record.provenance, "vehicle": "mine"}
            write_record(replace(record, provenance=said), own / path.name)
    said = fails(capsys, "design", own, "--out", tmp_path / "a", "--quiet")
    assert "(--vehicle)" in said
    words = ["--vehicle", "jr700", "--no-proof", "--models", "2", "--quiet"]
    out = tmp_path / "b"
    assert main(["design", *map(str, own.glob("*.parquet")), *words, "--out", str(out)]) in (0, 1)
    assert (out / "law.toml").is_file()
