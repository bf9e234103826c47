"""What a flight computer does wrong, against the record that it should have written."""

import numpy as np
import pytest

from helisim.base.errors import InputError, UnknownNameError
from helisim.records.channels import channel
from helisim.records.record import FlightRecord
from helisim.sim import Doublet
from helisim.sim.faults import ClockDrift, RecordGap, SampleLoss, SensorDropout, SensorSpikes
from helisim.sim.fly import fly
from helisim.sim.plan import FlightPlan

COUNT = 6001
NAMES = ("p", "r", "LAT")


def made():
    """Return a minute of three smooth channels at 100 Hz."""
    time = np.arange(COUNT) / 100.0
    values = np.column_stack([np.sin(3.0 * time), np.cos(2.0 * time), 0.1 * np.sin(time)])
    return FlightRecord(time, values, tuple(channel(name) for name in NAMES), {"seed": 1})


def faulty(fault, seed=0):
    return fault.apply(made(), np.random.default_rng(seed))


def test_a_dropout_holds_or_reads_zero_for_as_long_as_said():
    """The named channels for the time said, nothing else."""
    good = made()
    for reads, wanted in (("held", good["p"][1999]), ("zero", 0.0)):
        bad = faulty(SensorDropout(channels="p", at=20.0, lasts=0.5, reads=reads))
        out = (good.time >= 20.0) & (good.time < 20.5)
        assert np.count_nonzero(out) == 50
        assert np.all(bad["p"][out] == wanted)
        assert np.array_equal(bad["p"][~out], good["p"][~out])
        assert np.array_equal(bad.select(("r", "LAT")), good.select(("r", "LAT")))


def test_spikes_have_their_size_and_their_rate():
    """Single samples are off by the size either way; as many a minute as said."""
    bad, good = faulty(SensorSpikes(channels=("p", "r"), size=5.0, per_minute=60.0)), made()
    for name in ("p", "r"):
        off = bad[name] - good[name]
        hit = np.abs(off) > 1e-9
        assert np.abs(off[hit]) == pytest.approx(5.0, abs=1e-12)
        assert {-1.0, 1.0} == set(np.sign(off[hit]))
        assert abs(np.count_nonzero(hit) - 60) < 4.5 * np.sqrt(60.0)  # 4.5 standard errors
    assert np.array_equal(bad["LAT"], good["LAT"])
    assert not np.array_equal(bad["p"] - good["p"], bad["r"] - good["r"])


@pytest.mark.parametrize("burst", [1, 5])
def test_samples_are_lost_by_share_and_burst(burst):
    """What is left has its own stamps and values; losses come as bursts at least so long."""
    bad, good = faulty(SampleLoss(share=0.05, burst=burst)), made()
    lost = np.isin(good.time, bad.time, invert=True)
    bursts = 0.05 * COUNT / burst
    # bursts are nearly Poisson: 4.5 of their standard error
    assert abs(np.count_nonzero(lost) - 0.05 * COUNT) < 4.5 * burst * np.sqrt(bursts)
    assert np.array_equal(bad.values, good.values[~lost])
    edges = np.diff(np.concatenate([[0], lost, [0]]).astype(int))
    runs = np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)
    assert runs[:-1].min() >= burst


def test_a_gap_is_where_it_was_said():
    """From its start until its end, and nowhere else."""
    bad = faulty(RecordGap(at=20.0, lasts=0.5))
    assert len(bad) == COUNT - 50
    steps = np.diff(bad.time)
    assert steps.max() == pytest.approx(0.51, abs=1e-9)
    assert bad.time[np.argmax(steps)] == pytest.approx(19.99, abs=1e-9)


def test_a_fast_clock_counts_more():
    """Of the recorder: every stamp; of a second computer: its channels slip against the others."""
    good = made()
    bad = faulty(ClockDrift(ppm=500.0))
    assert bad.duration == pytest.approx(60.0 * 1.0005, rel=1e-12)
    assert np.array_equal(bad.values, good.values)
    slipped = faulty(ClockDrift(ppm=500.0, channels="p"))
    assert np.array_equal(slipped.time, good.time)
    true = np.sin(3.0 * good.time / 1.0005)
    # a cubic spline through a sine of 3 rad/s at 100 Hz: (w h)^4 / 384 = 2e-9
    assert slipped["p"] == pytest.approx(true, abs=1e-8)
    assert np.array_equal(slipped.select(("r", "LAT")), good.select(("r", "LAT")))


def test_a_seed_repeats_them_and_flights_differ(jr700):
    """In flight: the same seed, the same losses; each flight its own; the truth as ever."""
    faults = [SensorSpikes(channels="r", size=3.0, per_minute=30.0), SampleLoss(share=0.02)]
    doublet = Doublet(axis="ped", duration=12.0)
    plain = fly(jr700, doublet, count=2, seed=4, jobs=1)
    bad = fly(jr700, FlightPlan(excitation=doublet, faults=faults), count=2, seed=4, jobs=1)
    again = fly(jr700, FlightPlan(excitation=doublet, faults=faults), count=2, seed=4, jobs=2)
    for one, other, good in zip(bad, again, plain):
        assert np.array_equal(one.time, other.time)
        assert np.array_equal(one.values, other.values)
        kept = np.isin(good.time, one.time)
        assert 0 < np.count_nonzero(~kept) < 100
        assert np.array_equal(one["p"], good["p"][kept])
        assert np.abs(one["r"] - good["r"][kept]).max() == pytest.approx(3.0)
    assert not np.array_equal(bad[0].time, bad[1].time)
    assert [one["kind"] for one in bad[0].provenance["faults"]] == ["SensorSpikes", "SampleLoss"]


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (lambda: SensorDropout(channels="roll", at=1, lasts=1), UnknownNameError, "channel 'roll'"),
        (lambda: SensorDropout(channels=(), at=1, lasts=1), InputError, "at least one name"),
        (lambda: SensorDropout(channels="p", at=1, lasts=1, reads="nan"), InputError, "held, zero"),
        (lambda: SensorDropout(channels="p", at=-1, lasts=1), InputError, "0 or more s"),
        (
            lambda: SensorSpikes(channels="p", size=-1.0),
            InputError,
            "size must be a number",
        ),
        (lambda: SensorSpikes(channels="p", size=1.0, per_minute=0.0), InputError, "per_minute"),
        (lambda: SampleLoss(share=1.0), InputError, "below 1"),
        (lambda: SampleLoss(share=0.1, burst=0), InputError, "an integer 1 or more"),
        (lambda: RecordGap(at=1.0, lasts=0.0), InputError, "above 0"),
        (lambda: ClockDrift(ppm=0.0), InputError, "ppm"),
        (lambda: ClockDrift(ppm=1e6), InputError, "at most 100000"),
    ],
)
def test_a_fault_that_can_not_be_is_refused(make, error, says):
    """In one line that says what can be."""
    with pytest.raises(error, match=says):
        make()


def test_a_fault_needs_its_channels_and_some_samples():
    """A channel that isn't recorded, and a recorder that writes nothing."""
    with pytest.raises(UnknownNameError, match="p, r, LAT"):
        faulty(SensorDropout(channels="q", at=1.0, lasts=1.0))
    with pytest.raises(InputError, match="lose less"):
        faulty(RecordGap(at=0.0, lasts=100.0))
