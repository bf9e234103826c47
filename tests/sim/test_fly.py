"""Flights: reproducible, complete, honest about failure; faults of servos and recorder."""

import os
from dataclasses import dataclass, field

import mujoco
import numpy as np
import pytest

from command import python
from helisim.base.errors import DivergedError, InputError
from helisim.records.record import CHANNELS, IN1, IN2, OUT, SERVOS, FlightRecord, channel
from helisim.records.storage import read_record, write_record
from helisim.show.viewer import prepare_live
from helisim.sim import Doublet, Excitation, FlightPlan, Pilot, Sweep, fly, simulate
from helisim.sim.excitation import EXCITATIONS, step_times
from helisim.sim.flight import fly_each
from helisim.sim.limits import FlightEnvelope
from helisim.sim.plan import RecordGap, SampleLoss, ServoStuck
from helisim.sim.recorder import read_trajectory
from helisim.vehicle import load
from tabled import section, tabled

SHORT = Sweep(axis="lat", duration=8.0, trim_time=1.0)
NO_REMNANT = Pilot(remnant=0.0)


@pytest.fixture(scope="module")
def three(jr700):
    return fly(jr700, SHORT, count=3, seed=7, jobs=1)


def same(one, other):
    return np.array_equal(one.time, other.time) and np.array_equal(one.values, other.values)


def test_records_are_complete_and_come_one_by_one_whatever_jobs_and_count(jr700, three):
    again = fly(jr700, SHORT, count=3, seed=7, jobs=2)
    assert all(same(one, other) for one, other in zip(three, again))
    assert same(fly(jr700, SHORT, count=1, seed=7, jobs=1)[0], three[0])
    flights = fly_each(jr700, SHORT, range(10**9), seed=7, jobs=1)
    assert same(next(flights), three[0])
    flights.close()
    record = three[0]
    assert set(record.names) == {*IN1, *IN2, *SERVOS, *OUT}
    assert all(record.unit(name) == CHANNELS[name].unit for name in record.names)
    assert record.time[0] == 0.0
    assert record.sample_time == pytest.approx(0.01, rel=1e-9)


def test_provenance_repeats_the_flight(jr700, three):
    kept = three[2].provenance
    assert (kept["seed"], kept["flight"], kept["vehicle"]) == (7, 2, "jr700")
    assert kept["excitation"]["kind"] == "Sweep"
    plan = FlightPlan.of_record(three[2])
    assert kept["plan_digest"] == plan.digest
    vehicle = load(kept["vehicle"], parameters=kept["parameters"], timestep=kept["timestep_s"])
    again = fly(vehicle, plan, count=3, seed=kept["seed"])
    assert same(again[2], three[2])
    assert set(kept["versions"]) >= {"mujoco", "numpy", "numba"}


def test_flight_that_stopped_is_refused(jr700):
    truth = np.zeros((10, jr700.model.nsensordata))
    clock = jr700.model.sensor("clock").adr[0]
    truth[:, clock] = np.minimum(np.arange(10), 5) * 0.002
    truth[:, jr700.model.sensor("imu_attitude").adr[0]] = 1.0
    truth[:, jr700.model.sensor("imu_position").adr[0] + 2] = 10.0
    with pytest.raises(DivergedError, match=r"stopped at 0\.01 s"):
        read_trajectory(jr700, truth)


# A seed gives the same bytes of a record in any process, with any threads, installed anywhere

SCRIPT = section(globals(), "SCRIPT")


@pytest.mark.slow
def test_another_process_with_other_threads_writes_the_same_bytes(tmp_path):
    other = {"PYTHONHASHSEED": "7", "OPENBLAS_NUM_THREADS": "2", "LC_ALL": "C", "TZ": "Asia/Tokyo"}
    written = []
    for jobs, environment in (("1", {}), ("2", other)):
        folder = tmp_path / jobs
        folder.mkdir()
        python(SCRIPT, folder, jobs, env={**os.environ, **environment})
        written.append({path.name: path.read_bytes() for path in folder.iterdir()})
    assert written[0] == written[1]
    assert len(written[0]) == 4


QUIET = Doublet(axis="ped", duration=12.0, amplitude=1e-6)
"""As good as no manoeuvre: the pilot keeps the hover."""
AT = 2.0


def hover(vehicle, *faults, pilot=NO_REMNANT, excitation=QUIET):
    watched = {"faults": faults, "envelope": FlightEnvelope.off()}
    return next(
        simulate(vehicle, FlightPlan(excitation=excitation, pilot=pilot, **watched), jobs=1)
    )


def test_nothing_changes_before_a_fault_and_everything_repeats(jr700):
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


@tabled("ask", "says")
def test_what_can_not_be_in_flights_is_refused(jr700, ask, says):
    with pytest.raises(InputError, match=says):
        ask(jr700)


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


# Excitations that are a class with `sticks`: shipped ones, and a user's own from a script.

DOUBLET = {"axis": "lat", "duration": 4.0, "amplitude": 0.05, "width": 0.7, "trim_time": 1.0}


@dataclass(frozen=True, kw_only=True)
class PythonDoublet(Excitation):
    """What `Doublet` is, in numpy."""

    axis: str = "lat"
    duration: float = 4.0
    amplitude: float = 0.05
    width: float = 0.7
    trim_time: float = 1.0

    def sticks(self, time):
        since = time - self.trim_time
        first = (since >= 0.0) & (since < 0.5 * self.width)
        second = (since >= 0.5 * self.width) & (since < self.width)
        return self.on_axis(self.amplitude * (1.0 * first - 1.0 * second))


KINDS = (Doublet, PythonDoublet)


@dataclass(frozen=True, kw_only=True)
class Given(Excitation):
    axis: str = "lat"
    duration: float = 2.0
    number: int = 0

    what = staticmethod(lambda time: np.zeros((time.size, 4)))

    def sticks(self, time):
        return type(self).what(time)


@pytest.fixture
def given(monkeypatch):
    def make(what):
        monkeypatch.setattr(Given, "what", staticmethod(what))
        return Given()

    return make


@tabled("axis", "settings")
def test_a_doublet_in_python_flies_as_the_compiled_one(axis, settings):
    """To the bit: both add +-amplitude to the same sticks at the same steps.

    A product with +-1 has no rounding, and the times of the steps are added up as MuJoCo's.
    """
    vehicle = load(**settings)
    flown = [
        fly(vehicle, kind(**{**DOUBLET, "axis": axis}), count=2, seed=3, jobs=2) for kind in KINDS
    ]
    for compiled, plain in zip(*flown):
        assert np.array_equal(compiled.values, plain.values)
        assert np.ptp(plain[axis.upper()]) > 0.08


@pytest.mark.parametrize("timestep", [0.002, 0.001, 1.0 / 3000.0])
def test_the_times_are_mujocos_own(jr700, timestep):
    """To the last bit over a minute, or an edge would come a step early or late."""
    model = mujoco.MjModel.from_xml_string(f"<mujoco><option timestep='{timestep}'/></mujoco>")
    data, seen = mujoco.MjData(model), []
    for _ in range(round(60.0 / timestep) + 1):
        seen.append(data.time)
        mujoco.mj_step(model, data)
    assert np.array_equal(step_times(60.0, timestep), seen)


@tabled("what", "message")
def test_sticks_that_cannot_be_flown_are_one_clear_error(jr700, given, what, message):
    with pytest.raises(InputError, match=rf"Given\.sticks .*{message}"):
        fly(jr700, given(what), jobs=1)


class NoSticks(Excitation):
    pass


class NoMethod:
    axis, duration = "lat", 3.0


@dataclass(frozen=True, kw_only=True)
class WithArray(PythonDoublet):
    table: object = field(default_factory=lambda: np.zeros(3))


@tabled("make", "message")
def test_a_class_that_cannot_fly_is_one_clear_error(jr700, make, message):
    with pytest.raises(InputError, match=message):
        FlightPlan(excitation=make())
    with pytest.raises(InputError, match=message):
        prepare_live(jr700, make())


def test_a_name_that_is_taken_is_refused():
    """A record of a `Sweep` must mean helisim's; one's own may be defined anew, as notebooks do."""
    with pytest.raises(InputError, match=r"'Sweep' in helisim\.sim\.manoeuvres already"):
        type("Sweep", (Excitation,), {"__module__": "__main__"})
    assert EXCITATIONS["Sweep"].__module__ == "helisim.sim.manoeuvres"
    first = type("Mine", (Excitation,), {"__module__": "__main__"})
    second = type("Mine", (Excitation,), {"__module__": "__main__"})
    assert first is not second
    assert EXCITATIONS["Mine"] is second


def test_a_record_says_what_was_flown(jr700, tmp_path):
    excitation = PythonDoublet(width=0.5)
    (flown,) = fly(jr700, excitation, seed=3, jobs=1)
    write_record(flown, tmp_path / "flown.parquet")
    record = read_record(tmp_path / "flown.parquet")
    said = record.provenance
    assert said["excitation"] == {"kind": "PythonDoublet", **DOUBLET, "width": 0.5}
    assert len(said["sticks_digest"]) == 32
    plan = FlightPlan.of_record(record)
    assert plan == FlightPlan(excitation=excitation).on(jr700)
    (other,) = fly(jr700, PythonDoublet(width=0.6), seed=3, jobs=1)
    assert other.provenance["sticks_digest"] != said["sticks_digest"]
    (compiled,) = fly(jr700, Doublet(**DOUBLET), seed=3, jobs=1)
    assert "sticks_digest" not in compiled.provenance
