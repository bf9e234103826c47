import numpy as np
import pytest

from helisim.errors import InputError, StorageError
from helisim.handling.closed_loop import ClosedLoop
from helisim.sim import Recorder
from helisim.study.flights import fly_sweeps
from helisim.study.for_design import identify_for_design, servos_of
from helisim.study.swept import swept
from helisim.vehicle import load
from made_run import make_flight


def test_an_axis_without_sweeps_is_named_with_what_to_do():
    flights = {"lat": [make_flight()], "lon": [make_flight()], "col": [make_flight()]}
    with pytest.raises(InputError, match=r"no sweep of ped.*--axis ped.*axes=\('lat', 'lon', 'col'"):
        identify_for_design(flights)
    with pytest.raises(InputError, match=r"no sweep of lon.*sweeps of lat\. Fly"):
        identify_for_design({"lat": [make_flight()]}, axes=["roll"])


def test_records_that_do_not_say_what_they_sweep_are_refused():
    with pytest.raises(InputError, match="none of the records says which axis it sweeps"):
        swept([make_flight()])


def test_a_folder_without_records_is_refused(tmp_path):
    with pytest.raises(StorageError, match="has no flight records"):
        identify_for_design(tmp_path)


def test_servos_are_known_by_all_four_numbers():
    flights = {axis: [make_flight()] for axis in ("lat", "lon", "ped", "col")}
    with pytest.raises(InputError, match="swash_zeta, tail_omega, tail_zeta; got swash_omega"):
        identify_for_design(flights, servos={"swash_omega": 200.0})
