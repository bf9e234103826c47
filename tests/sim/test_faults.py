"""Faults of servos and recorder: finite, repeatable, and as large as the physics says."""

from dataclasses import replace

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.records.record import SERVOS, FlightRecord, channel
from helisim.sim import Doublet, FlightPlan, Sweep
from helisim.sim.faults import RecordGap, SampleLoss, ServoStuck
from helisim.sim.flight import fly, simulate
from helisim.sim.limits import FlightEnvelope
from helisim.sim.plan import Pilot

NO_REMNANT = Pilot(remnant=0.0)
QUIET = Doublet(axis="ped", duration=12.0, amplitude=1e-6)
"""As good as no manoeuvre: the pilot keeps the hover."""
AT = 2.0


def hover(vehicle, *faults, pilot=NO_REMNANT, excitation=QUIET):
    """Return the truth of a hover with faults, whatever becomes of it."""
    watched = {"faults": faults, "envelope": FlightEnvelope.off()}
    return next(
        simulate(vehicle, FlightPlan(excitation=excitation, pilot=pilot, **watched), jobs=1)
    )


def test_nothing_changes_before_a_fault_and_everything_repeats(jr700):
    """To the bit: until it comes, for the same seed, for any number of threads."""
    sweep = Sweep(axis="lat", duration=8.0, trim_time=1.0)
    fault = ServoStuck(servo="servo_left", at=4.0)
    plan = FlightPlan(excitation=sweep, faults=[fault])
    flown = [
        fly(jr700, one, count=2, seed=3, jobs=n) for one, n in ((sweep, 1), (plan, 1), (plan, 2))
    ]
    for one, other, repeated in zip(*flown):
        assert np.array_equal(other.values, repeated.values)
        # the anti-alias filter looks back only, the lever arm's derivative ahead by a sample
        before = one.time < 4.0 - 0.01
        assert np.array_equal(one.values[before], other.values[before])
        assert np.abs(one["p"] - other["p"]).max() > 0.05


@pytest.mark.parametrize("name", SERVOS)
def test_a_stuck_servo_stays_and_its_command_goes_on(jr700, name):
    """Where it is when it sticks, or where it was said to stick; the other three move."""
    k = SERVOS.index(name)
    sweep = Sweep(axis="ped" if k == 3 else "lat", duration=8.0, trim_time=1.0)
    truth = hover(jr700, ServoStuck(servo=name, at=3.0), excitation=sweep, pilot=Pilot())
    after = truth.time > 3.0 + 0.002
    assert np.ptp(truth.servo_positions[after, k]) == 0.0
    assert np.ptp(truth.servo_positions[~after, k]) > 0.001
    assert np.ptp(truth.servo_commands[after, k]) > 0.001
    for other in set(range(4)) - {k}:
        assert np.ptp(truth.servo_positions[after, other]) > 0.0
    there = hover(jr700, ServoStuck(servo=name, at=AT, position=0.01))
    assert there.servo_positions[there.time > AT + 0.1, k] == pytest.approx(0.01, abs=1e-6)


def test_faults_that_can_not_be_in_one_flight_are_refused(jr700):
    stuck = ServoStuck(servo="servo_tail", at=2.0)
    with pytest.raises(InputError, match="over at 12 s"):
        fly(jr700, FlightPlan(excitation=QUIET, faults=[ServoStuck(servo="servo_tail", at=30.0)]))
    with pytest.raises(InputError, match="one fault of a servo"):
        fly(jr700, FlightPlan(excitation=QUIET, faults=[stuck, replace(stuck, at=3.0)]))


# What a flight computer does wrong, against the record that it should have written


COUNT = 6001
NAMES = ("p", "r", "LAT")


def made():
    time = np.arange(COUNT) / 100.0
    values = np.column_stack([np.sin(3.0 * time), np.cos(2.0 * time), 0.1 * np.sin(time)])
    return FlightRecord(time, values, tuple(channel(name) for name in NAMES), {"seed": 1})


def faulty(fault, seed=0):
    return fault.apply(made(), np.random.default_rng(seed))


@pytest.mark.parametrize("burst", [1, 5])
def test_samples_are_lost_by_share_and_burst(burst):
    bad, good = faulty(SampleLoss(share=0.05, burst=burst)), made()
    lost = np.isin(good.time, bad.time, invert=True)
    bursts = 0.05 * COUNT / burst
    # bursts are nearly Poisson: 4.5 of their standard error
    assert abs(np.count_nonzero(lost) - 0.05 * COUNT) < 4.5 * burst * np.sqrt(bursts)
    assert np.array_equal(bad.values, good.values[~lost])
    edges = np.diff(np.concatenate([[0], lost, [0]]).astype(int))
    runs = np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)
    assert runs[:-1].min() >= burst


def test_a_gap_is_where_it_was_said_and_not_everywhere():
    bad = faulty(RecordGap(at=20.0, lasts=0.5))
    assert len(bad) == COUNT - 50
    steps = np.diff(bad.time)
    assert steps.max() == pytest.approx(0.51, abs=1e-9)
    assert bad.time[np.argmax(steps)] == pytest.approx(19.99, abs=1e-9)
    with pytest.raises(InputError, match="lose less"):
        faulty(RecordGap(at=0.0, lasts=100.0))


def test_a_seed_repeats_them_and_flights_differ(jr700):
    """In flight: the same seed, the same losses; each flight its own; the truth as ever."""
    doublet = Doublet(axis="ped", duration=12.0)
    faults = [RecordGap(at=5.0, lasts=0.1), SampleLoss(share=0.02)]
    plan = FlightPlan(excitation=doublet, faults=faults)
    plain, bad, again = (
        fly(jr700, one, count=2, seed=4, jobs=n) for one, n in ((doublet, 1), (plan, 1), (plan, 2))
    )
    for one, other, good in zip(bad, again, plain):
        assert np.array_equal(one.time, other.time)
        assert np.array_equal(one.values, other.values)
        kept = np.isin(good.time, one.time)
        assert 0 < np.count_nonzero(~kept) < 100
        assert np.array_equal(one["p"], good["p"][kept])
    assert not np.array_equal(bad[0].time, bad[1].time)
    assert [one["kind"] for one in bad[0].provenance["faults"]] == ["RecordGap", "SampleLoss"]
