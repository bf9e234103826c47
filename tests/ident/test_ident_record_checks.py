"""Estimates from records with spikes, frozen runs or inputs at their stops say so."""

import numpy as np
import pytest

from helisim.base.errors import IdentificationError
from helisim.ident import RecordQualityWarning, frequency_response
from helisim.logs import screen
from helisim.records.channels import channel
from helisim.records.record import FlightRecord

TIME = np.arange(6001) / 100.0


def flown(seed, spike=False, dead=False, stop=0.0):
    """Return a minute of noise through a lag of 0.2 s, at 100 Hz."""
    rng = np.random.default_rng(seed)
    stick = np.convolve(rng.standard_normal(TIME.size), np.ones(5) / 5.0, mode="same")
    if stop:
        stick = np.clip(0.1 * stick, -0.49, 0.49)
        stick[2000 : 2000 + round(100 * stop)] = -0.5
    rate = np.zeros(TIME.size)
    for k in range(1, TIME.size):
        rate[k] = rate[k - 1] + 0.05 * (stick[k - 1] - rate[k - 1])
    if spike:
        rate[3000] += 5.0
    if dead:
        rate[4000:4100] = rate[4000]
    values = np.column_stack([stick, rate])
    return FlightRecord(TIME, values, (channel("lat"), channel("p")), {})


def estimate(*records):
    return frequency_response(records, inputs="lat", outputs="p", band=(1.0, 20.0))


@pytest.mark.filterwarnings("error")
def test_sound_records_raise_no_flag():
    """No warning, no flag."""
    assert estimate(flown(0), flown(1)).flags == ()


def test_spikes_and_dead_sensors_are_flagged():
    """Which record, which channel, from when, and what to do; and it is warned of."""
    with pytest.warns(RecordQualityWarning, match="helisim.screen"):
        frf = estimate(flown(0), flown(1, spike=True), flown(2, dead=True))
    assert len(frf.flags) == 2
    assert "record 2: 'p' has 1 samples that are spikes, the first at 30 s" in frf.flags[0]
    assert "record 3: 'p' is frozen, in 1 places, first from 40 to 40.99 s" in frf.flags[1]


@pytest.mark.parametrize("stop", [0.9, 4.0])
def test_an_input_that_stays_at_its_stop_is_flagged(stop, recwarn):
    """As the command of a servo that is stuck; less than a second is none of it."""
    flags = estimate(flown(0), flown(1, stop=stop)).flags
    assert len(flags) == len(recwarn) == (stop > 1.0)
    assert all("record 2: 'lat' is at its stop for 4 s, first at 20 s" in flag for flag in flags)


@pytest.mark.filterwarnings("error")
def test_an_input_beyond_half_has_no_stop_that_is_known():
    """Not unitised: half is a number like any other."""
    record = flown(1, stop=4.0)
    values = record.values * [1.0, 1.0]
    values[3000:3200, 0] = 0.6
    assert estimate(FlightRecord(record.time, values, record.channels)).flags == ()


@pytest.mark.filterwarnings("error")
def test_what_was_repaired_is_no_longer_flagged():
    """The flag's own advice answers it, and the estimate is back."""
    good = estimate(flown(1))
    repaired = estimate(screen(flown(1, spike=True), repair="spikes").record)
    assert repaired.flags == ()
    # one of 6000 samples is interpolated
    assert repaired.response == pytest.approx(good.response, rel=0.02)


def test_a_servo_that_rests_is_not_frozen():
    """Only what measures the motion is never still; commands may rest."""
    one = flown(0, dead=True)
    servo = FlightRecord(TIME, one.values, (channel("lat"), channel("servo_tail")), {})
    frf = frequency_response(servo, inputs="lat", outputs="servo_tail", band=(1.0, 20.0))
    assert not any("frozen" in flag for flag in frf.flags)


def test_flights_that_ended_early_are_counted():
    """The first by its number and reason, the others by how many there are."""
    whole = flown(0)
    cut = FlightRecord(
        TIME, whole.values, whole.channels, {"ended": {"at": 3.0, "why": "it tipped over"}}
    )
    with pytest.raises(IdentificationError, match=r"record 2 .*because it tipped over.*;") as one:
        estimate(whole, cut)
    assert "more such" not in str(one.value)
    with pytest.raises(IdentificationError, match=r"record 1 .*, and 2 more such; leave it out"):
        estimate(cut, cut, whole, cut)
