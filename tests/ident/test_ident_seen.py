"""What a fit has seen: a record, and any part of its flight, is known again; no other is."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.base.errors import InputError
from helisim.ident import Fit, frequency_response, identify, verify
from helisim.ident.frf import flight_span, share_seen
from helisim.ident.structures import transfer_function
from helisim.logs import read_log, screen
from helisim.records.record import FlightRecord, channel
from helisim.records.storage import write_record

FLOWN = {"made_by": "helisim 1, simulation", "seed": 7, "flight": 0, "versions": {"numpy": "2"}}


def flight(seed=0, **provenance):
    random = np.random.default_rng(seed)
    stick = np.cumsum(random.normal(size=4000)) * 0.01
    rate = np.convolve(stick, np.exp(-np.arange(200) / 40.0))[:4000]
    values = np.column_stack([stick, rate])
    return FlightRecord(
        0.02 * np.arange(4000), values, (channel("lat"), channel("p")), {**FLOWN, **provenance}
    )


SEEN = flight()
KNOWN = (flight_span(SEEN),)


def fitted(record):
    frf = frequency_response(record, inputs="lat", outputs="p", band=(1.0, 20.0))
    return identify(frf, transfer_function(zeros=0, poles=1, input="lat", output="p"))


@pytest.fixture(scope="module")
def fit():
    return fitted(SEEN)


@given(
    first=st.tuples(st.floats(0.0, 79.0), st.floats(0.1, 80.0)),
    second=st.tuples(st.floats(0.0, 79.0), st.floats(0.1, 80.0)),
)
def test_time_that_two_parts_share_counts_once(first, second):
    parts = [SEEN.slice(start, start + length) for start, length in (first, second)]
    seen = np.zeros(len(SEEN) - 1, dtype=bool)  # the steps between samples
    for part in parts:
        low, high = np.searchsorted(SEEN.time, part.time[[0, -1]])
        seen[low:high] = True
    share = share_seen(SEEN, [flight_span(part) for part in parts])
    # sums of at most three differences of doubles below 100 s
    assert share == pytest.approx(np.mean(seen), abs=1e-12)


def test_a_flight_is_known_by_what_was_flown():
    assert share_seen(flight(seed=8), KNOWN) == 1.0  # it says that it is the same flight
    assert share_seen(flight(seed=8, flight=1), KNOWN) == 0.0
    for facts in ({"versions": {}}, {"ended": {"at": 3.0}}, {"log": {"digest": "x"}, "part": 0}):
        assert flight_span(flight(**facts)) == KNOWN[0]
    bare = FlightRecord(SEEN.time, SEEN.values, SEEN.channels)
    assert flight_span(bare) is None
    assert share_seen(bare, KNOWN) == 0.0


def test_a_log_whose_clock_was_reset_says_no_part(tmp_path):
    path = tmp_path / "log.csv"
    twice = [*np.arange(300), *np.arange(300)]
    rows = [f"{0.02 * k:.2f},{np.sin(0.1 * k * k):.6f}" for k in twice]
    path.write_text("\n".join(["t [s],p [rad/s]", *rows]))
    first, second = read_log(path, repair=["resets"]).records
    assert flight_span(first) is None
    assert first.digest == second.digest  # the samples are the same here


def test_a_fit_refuses_its_records_and_their_parts(fit, tmp_path):
    path = tmp_path / "flight.parquet"
    write_record(SEEN.slice(5.0, 60.0), path)
    (resampled,) = screen(SEEN, resample_hz=40.0).records
    (rest,) = read_log(path, start=20.0).records
    text = json.dumps(fit.to_dict())
    again = Fit.from_dict(json.loads(text))
    assert again.data.spans == KNOWN
    assert len(json.dumps(fit.to_dict()["data"]["spans"])) < 0.01 * len(text)
    for part in (SEEN, SEEN.slice(10.0, 30.0), resampled, rest):
        for one in (fit, again):
            with pytest.raises(InputError, match=r"used in the fit \(about 100 % of its time\)"):
                verify(one, part)


def test_a_fit_of_a_part_takes_the_rest():
    first = fitted(SEEN.slice(0.0, 60.0))
    assert verify(first, SEEN.slice(60.0, 80.0)).acceptable
    assert verify(first, SEEN.slice(56.0, 80.0)).acceptable  # 4 of 24 s are seen
    with pytest.raises(InputError, match=r"about 33 % of its time"):
        verify(first, SEEN.slice(50.0, 80.0))
