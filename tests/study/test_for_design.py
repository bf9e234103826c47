"""Predictions of the loops from records alone, against the exact sampled linearisation."""

import json
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

import helisim as hs
from command import fails
from helisim.base.errors import InputError, StorageError
from helisim.base.units import RAD_PER_DEG
from helisim.cli import main
from helisim.design.exact import exact_loop
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import StabilityMargins
from helisim.handling.figures import margins, rejection
from helisim.handling.spec import read_specs
from helisim.sim import Recorder
from helisim.study.design_chain import identify_for_design, servos_of
from helisim.study.experiment import fly_sweeps, reproduce, sweeps_of
from helisim.vehicle import load
from made_run import make_flight

BARS = {"crossover": 0.02, "phase margin": np.radians(1.5), "gain margin": 0.3}
"""What a prediction for design may be off by: rad, dB, s, or a fraction."""


@dataclass(frozen=True)
class Exact:
    """A response by names, of a linearisation or of a law faster than it."""

    inputs: tuple
    outputs: tuple
    at: object
    stick_latency: dict = field(default_factory=dict)

    def response(self, frequency):
        return self.at(frequency)


def exact_plant(vehicle):
    linear = vehicle.linearize("IN1")
    system = linear.system
    names = tuple(system.input_labels), tuple(system.output_labels)
    late = {"PED": vehicle.parameters["gyro.ped_latency"]}
    return Exact(*names, linear.response, stick_latency=late)


def shipped_law(vehicle, faster=1.0):
    gyro = vehicle.gyro
    return replace(gyro, c=faster * gyro.c, d=faster * gyro.d, delays={})


@pytest.mark.study
def test_a_rotor_with_dynamic_inflow_gets_a_structure_with_inflow():
    vehicle = load("jr700", parameters={"main_rotor.inflow": "pitt-peters"})
    records = fly_sweeps(vehicle, 4, 3, 2, Recorder.of(vehicle), None, lambda _: None)[0]
    plant = identify_for_design(records)
    assert [fit.structure.name for fit in plant.fits][1] == "rollpitch_speeds_inflow"
    law, exact = shipped_law(vehicle, 1.5), exact_plant(vehicle)
    for axis in ("lat", "lon"):
        cut, found = (margins(ClosedLoop(one, law).broken(axis)) for one in (exact, plant))
        assert abs(found.crossover / cut.crossover - 1.0) < BARS["crossover"]
        assert abs(found.least_phase - cut.least_phase) < BARS["phase margin"]
        assert abs(found.least_gain - cut.least_gain) < BARS["gain margin"]


def test_a_vehicle_without_a_bench_and_flights_that_do_not_suffice(tmp_path):
    vehicle = load("blade360")
    found = servos_of(vehicle)
    assert found["tail_omega"][0] == vehicle.parameters["servo.tail_frequency"]
    assert servos_of(None) is None
    flights = {"lat": [make_flight()], "lon": [make_flight()], "col": [make_flight()]}
    with pytest.raises(InputError, match=r"no sweep of ped.*Fly some"):
        identify_for_design(flights)
    with pytest.raises(InputError, match=r"no sweep of lon.*sweeps of lat\. Fly"):
        identify_for_design({"lat": [make_flight()]}, axes=["roll"])
    with pytest.raises(InputError, match="none of the records says which axis it sweeps"):
        sweeps_of([make_flight()])
    with pytest.raises(StorageError, match="has no flight records"):
        identify_for_design(tmp_path)


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "reproduction"
    reproduce(out=folder, flights=3, seed=1, jobs=2)
    return folder


@pytest.mark.study
def test_the_law_has_on_the_exact_vehicle_what_was_asked_of_it(run_folder, tmp_path, capsys):
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
