"""Estimates from damaged records say so."""

import numpy as np
import pytest

from helisim.channels import channel
from helisim.ident import DamagedRecordWarning, frequency_response
from helisim.logs import screen
from helisim.record import FlightRecord

TIME = np.arange(6001) / 100.0


def flown(seed, spike=False, dead=False):
    """Return a minute of noise through a lag of 0.2 s, at 100 Hz."""
    rng = np.random.default_rng(seed)
    stick = np.convolve(rng.standard_normal(TIME.size), np.ones(5) / 5.0, mode="same")
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
    with pytest.warns(DamagedRecordWarning, match="helisim.screen"):
        frf = estimate(flown(0), flown(1, spike=True), flown(2, dead=True))
    assert len(frf.flags) == 2
    assert "record 2: 'p' has 1 samples that are spikes, the first at 30 s" in frf.flags[0]
    assert "record 3: 'p' stands still, in 1 places, first from 40 to 40.99 s" in frf.flags[1]


@pytest.mark.filterwarnings("error")
def test_what_was_repaired_is_no_longer_flagged():
    """The flag's own advice answers it, and the estimate is back."""
    good = estimate(flown(1))
    repaired = estimate(screen(flown(1, spike=True), repair="spikes").record)
    assert repaired.flags == ()
    # one of 6000 samples is interpolated
    assert repaired.response == pytest.approx(good.response, rel=0.02)
