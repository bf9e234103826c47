"""Records as tables of pandas and xarray."""

import json
import sys

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from helisim.base.errors import InputError, RecordError, UnknownNameError
from helisim.records.record import CHANNELS, Channel, FlightRecord
from made_run import make_flight

RECORD = make_flight(("lat", "p", "thrust"), seed=3, vehicle="jr700")


def test_a_dataframe_has_numbers_units_and_origin():
    """Every number, bit for bit."""
    frame = RECORD.to_pandas()
    assert isinstance(frame, pd.DataFrame)
    assert frame.index.name == "time"
    np.testing.assert_array_equal(frame.index, RECORD.time)
    np.testing.assert_array_equal(frame["p"], RECORD["p"])
    assert frame.attrs["units"] == {"lat": "1", "p": "rad/s", "thrust": "N"}
    assert frame.attrs["provenance"]["vehicle"] == "jr700"
    frame.iloc[0, 0] = 7.0  # it is the user's own
    assert RECORD["lat"][0] != 7.0


def test_a_dataframe_comes_back_as_the_record():
    """Channels with names and units of their own too."""
    strange = FlightRecord(
        RECORD.time, RECORD.values, [Channel(n, "K", "OTHER", f"heat {n}") for n in "pxy"]
    )
    for record in (RECORD, strange):
        assert FlightRecord.from_pandas(record.to_pandas()) == record
        assert FlightRecord.from_pandas(record.to_pandas().reset_index()) == record


def test_anyones_dataframe_becomes_a_record():
    """Standard names are in SI, or in the unit that is given; others need one."""
    frame = pd.DataFrame({"time": [0.0, 0.1, 0.3], "p": [0, 90, 180], "lat": 0.1, "heat": 3.0})
    record = FlightRecord.from_pandas(
        frame, units={"p": "deg/s", "heat": "1"}, provenance={"who": "me"}
    )
    np.testing.assert_allclose(record["p"], [0.0, np.pi / 2, np.pi])
    assert record.channels[:2] == (CHANNELS["p"], CHANNELS["lat"])
    assert record.provenance == {"who": "me"}
    np.testing.assert_array_equal(record.time, [0.0, 0.1, 0.3])


@pytest.mark.parametrize(
    ("change", "units", "error", "said"),
    [
        ({"heat": 1.0}, {}, InputError, "column 'heat' has no unit, and no standard channel"),
        ({}, {"q": "deg/s"}, UnknownNameError, "unknown column with a unit 'q'; available: p"),
        ({}, {"p": "m/s"}, InputError, "channel 'p' is in rad/s, but the unit 'm/s'"),
        ({}, {"p": "furlong"}, UnknownNameError, "unknown unit 'furlong'"),
        ({"p": ["a", "b", "c"]}, {}, RecordError, "column 'p' holds .*, expected numbers"),
        ({"p": [0.0, np.nan, 1.0]}, {}, RecordError, "'p' is not finite at row 1"),
        ({"time": [0.0, 0.0, 0.1]}, {}, RecordError, "time must increase: row 1"),
        (
            {"time": pd.to_datetime(["2024-01-01", "2024-01-02", "2024-01-03"])},
            {},
            RecordError,
            "holds datetime64.*; a record's time is seconds",
        ),
    ],
)
def test_a_dataframe_that_is_no_record_is_refused(change, units, error, said):
    """One line, with the column and what to do."""
    frame = pd.DataFrame({"time": [0.0, 0.1, 0.2], "p": 0.0} | change)
    with pytest.raises(error, match=said):
        FlightRecord.from_pandas(frame, units=units)


def test_what_has_no_times_is_refused():
    """Row numbers would else be a second a row; and what is no DataFrame by its type."""
    for frame, error, told in (
        (pd.DataFrame({"p": [0.0, 0.1]}), RecordError, "its index numbers the rows; give it a col"),
        (pd.DataFrame(), RecordError, "has no times"),
        ({"p": [1.0]}, InputError, "takes a DataFrame, got dict"),
    ):
        with pytest.raises(error, match=told):
            FlightRecord.from_pandas(frame)
    seconds = FlightRecord.from_pandas(pd.DataFrame({"p": [0.0, 0.1]}, index=[0.0, 0.5]))
    assert seconds.duration == 0.5


def test_a_dataset_has_numbers_units_and_origin():
    """As netCDF and its tools expect them."""
    data = RECORD.to_xarray()
    assert isinstance(data, xr.Dataset)
    np.testing.assert_array_equal(data["p"], RECORD["p"])
    np.testing.assert_array_equal(data["time"], RECORD.time)
    assert data["p"].attrs == {"units": "rad/s", "long_name": "roll rate", "kind": "OUT"}
    assert data["time"].attrs["units"] == "s"
    assert json.loads(data.attrs["provenance"]) == {"seed": 3, "vehicle": "jr700"}


@pytest.mark.parametrize("package", ["pandas", "xarray"])
def test_without_the_package_it_says_how_to_get_it(package, monkeypatch):
    """Helisim needs neither."""
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=f"needs {package}, .* pip install {package}"):
        getattr(RECORD, f"to_{package}")()
