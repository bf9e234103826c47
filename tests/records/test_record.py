"""A record: what it holds, refuses, and hands on as a table."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.base.errors import RecordError, UnknownNameError
from helisim.records.quality import Run, frozen_runs, spikes
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
        record.provenance["seed"] = 5
    with pytest.raises(AttributeError):
        record.time = values
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


# Spikes and frozen runs: found where they are, and nowhere else.

COUNT = 2000
TIME = np.arange(COUNT) / 100.0
SWEEP = np.sin(2.0 * TIME**2) * (0.2 + 0.02 * TIME)
"""Up to 80 rad/s at 100 Hz: eight samples a period."""


def noise(seed, level=0.01):
    return level * np.random.default_rng(seed).standard_normal(COUNT)


@given(
    at=st.integers(1, COUNT - 3),
    width=st.integers(1, 2),
    size=st.floats(1.0, 1e6),
    up=st.booleans(),
    seed=st.integers(0, 99),
)
def test_a_spike_is_found_where_it_is(at, width, size, up, seed):
    values = SWEEP + noise(seed)
    # 8 usual steps: at the sweep's fastest, 0.6 x 80 rad/s x 10 ms x 0.64 each
    values[at : at + width] += (3.0 if up else -3.0) * size
    found = np.flatnonzero(spikes(values))
    assert found.tolist() == list(range(at, at + width))


@tabled("signal")
def test_a_signal_is_no_spike(signal):
    assert not spikes(signal).any()


@given(first=st.integers(5, COUNT - 60), length=st.integers(10, 55), seed=st.integers(0, 99))
def test_a_dead_sensor_is_found_where_it_is(first, length, seed):
    values = SWEEP + noise(seed)
    values[first : first + length] = values[first]
    assert frozen_runs(values) == (Run(first, first + length - 1),)


def test_rest_is_not_death():
    """At its start a channel may rest; one that is coarse or slow always repeats; nor may less.

    One that repeats each number twenty times is dead after two hundred, not before.
    """
    slow, brief = np.repeat(noise(1)[: COUNT // 20], 20), SWEEP + noise(2)
    brief[500:509] = brief[500]
    barely = np.where(TIME < 3.0, 1e-12 * np.sin(TIME * (TIME > 0.05)), SWEEP)
    resting = np.where(TIME < 3.0, 0.0, SWEEP + noise(0))
    for alive in (resting, barely, slow, brief, np.zeros(COUNT)):
        assert frozen_runs(alive) == ()
    slow[600:780] = slow[600]
    assert frozen_runs(slow) == ()
    slow[600:900] = slow[600]
    assert frozen_runs(slow) == (Run(600, 899),)


@pytest.mark.filterwarnings("error")
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=150, max_size=300))
def test_any_numbers_are_looked_at(values):
    array = np.array(values)
    assert spikes(array).shape == array.shape
    assert all(0 <= one.first <= one.last < array.size for one in frozen_runs(array))
