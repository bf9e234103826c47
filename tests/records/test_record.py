"""A record: what it holds, refuses, and hands on as a table."""

import numpy as np
import pandas as pd
import pytest

from helisim.base.errors import RecordError, UnknownNameError
from helisim.records.record import FlightRecord, channel
from made_run import make_flight
from tabled import tabled


def make_record(**changes) -> FlightRecord:
    time = np.arange(5) * 0.01
    fields = {
        "time": time,
        "values": np.column_stack([time, 10.0 * time]),
        "channels": (channel("lat"), channel("p")),
        "provenance": {"seed": 3, "nested": {"list": [1, 2]}},
    }
    return FlightRecord(**(fields | changes))


def test_channels_are_addressed_by_name():
    """(n_time,), or (n_time, n_name) for several; an unknown one lists those that exist."""
    record = make_record()
    np.testing.assert_array_equal(record["p"], 10.0 * record.time)
    np.testing.assert_array_equal(record.select(["p", "lat"]), record.values[:, ::-1])
    assert record.select(["p"]).shape == (5, 1)
    assert record.unit("p") == "rad/s"
    assert "lat" in record
    assert "LAT" not in record
    assert len(record) == 5
    for attempt in (make_record().__getitem__, make_record().unit):
        with pytest.raises(UnknownNameError, match="unknown channel 'LAT'; available: lat, p"):
            attempt("LAT")
    with pytest.raises(UnknownNameError, match="did you mean LAT or lat") as caught:
        channel("LATT")
    assert {"col", "lon", "lat", "ped"} < set(caught.value.available)


def test_a_record_can_not_be_changed_and_its_sample_time_needs_uniform_samples():
    values = np.zeros((5, 2))
    provenance = {"seed": 3}
    record = make_record(values=values, provenance=provenance)
    values[:] = 1.0
    provenance["seed"] = 4
    assert np.all(record.values == 0.0)
    assert record.provenance["seed"] == 3
    for array in (record.time, record.values, record["p"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(TypeError):
        record.provenance["seed"] = 5  # type: ignore[index]
    with pytest.raises(AttributeError):
        record.time = values  # type: ignore[misc]
    assert make_record().sample_time == pytest.approx(0.01, rel=1e-12)  # rounding of a mean
    assert make_record().duration == pytest.approx(0.04, rel=1e-12)
    with pytest.raises(RecordError, match=r"step after row 2 is 0\.02 s"):
        _ = make_record(time=[0.0, 0.01, 0.02, 0.04, 0.05]).sample_time


@tabled("changes", "message")
def test_a_malformed_record_is_refused(changes, message):
    with pytest.raises(RecordError, match=message):
        make_record(**changes)


RECORD = make_flight(("lat", "p", "thrust"), seed=3, vehicle="jr700")


def test_a_dataframe_has_numbers_units_and_origin():
    frame = RECORD.to_pandas()
    assert isinstance(frame, pd.DataFrame)
    assert frame.index.name == "time"
    np.testing.assert_array_equal(frame.index, RECORD.time)
    np.testing.assert_array_equal(frame["p"], RECORD["p"])
    assert frame.attrs["units"] == {"lat": "1", "p": "rad/s", "thrust": "N"}
    assert frame.attrs["provenance"]["vehicle"] == "jr700"
    frame.iloc[0, 0] = 7.0  # it is the user's own
    assert RECORD["lat"][0] != 7.0
