"""What a design needs of flights and of a run, and says where they lack it."""

import pytest

from command import fails
from helisim.base.errors import InputError, StorageError
from helisim.study.design_chain import identify_for_design, servos_of
from helisim.study.experiment import sweeps_of
from helisim.vehicle import load
from made_run import make_flight


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


def test_without_a_run_it_says_what_makes_one(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = fails(capsys, "design")
    assert "reproduction: no such run" in said
    assert "helisim reproduce --out reproduction" in said
    assert not any(tmp_path.iterdir())
