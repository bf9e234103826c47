"""Flights: reproducible, complete, and honest about failure."""

import os
import subprocess
import sys

import numpy as np
import pytest

from helisim.base.errors import DivergedError, InputError
from helisim.records.record import CHANNELS, IN1, IN2, OUT, SERVOS
from helisim.sim import Doublet, FlightPlan, Pilot, Sweep, fly
from helisim.sim.flight import fly_each
from helisim.sim.recorder import read_trajectory
from helisim.vehicle import load

SHORT = Sweep(axis="lat", duration=8.0, trim_time=1.0)
NO_REMNANT = Pilot(remnant=0.0)


@pytest.fixture(scope="module")
def three(jr700):
    return fly(jr700, SHORT, count=3, seed=7, jobs=1)


def same(one, other):
    return np.array_equal(one.time, other.time) and np.array_equal(one.values, other.values)


def test_neither_jobs_nor_count_matter_and_flights_come_one_by_one(jr700, three):
    """The first record is there before the others are flown, and flying can stop after it."""
    again = fly(jr700, SHORT, count=3, seed=7, jobs=2)
    assert all(same(one, other) for one, other in zip(three, again))
    assert same(fly(jr700, SHORT, count=1, seed=7, jobs=1)[0], three[0])
    flights = fly_each(jr700, SHORT, range(10**9), seed=7, jobs=1)
    assert same(next(flights), three[0])
    flights.close()


def test_record_is_complete(three):
    record = three[0]
    assert set(record.names) == {*IN1, *IN2, *SERVOS, *OUT}
    assert all(record.unit(name) == CHANNELS[name].unit for name in record.names)
    assert record.time[0] == 0.0
    assert record.sample_time == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parametrize("duration", [8.0, 30.0, 90.0])
def test_record_is_as_long_as_the_flight(jr700, duration):
    excitation = Doublet(axis="ped", duration=duration)
    record = fly(jr700, excitation, jobs=1)[0]
    assert len(record) == round(duration * 100.0) + 1
    assert record.duration == pytest.approx(duration, rel=1e-12)


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


@pytest.mark.parametrize(
    ("name", "bad"), [("count", 0), ("count", -1), ("count", 1.5), ("jobs", 0), ("seed", -1)]
)
def test_bad_arguments_are_refused(jr700, name, bad):
    with pytest.raises(InputError, match=rf"{name} must be an integer of \d or more, got {bad}"):
        fly(jr700, SHORT, **{name: bad})


def test_flight_that_stopped_is_refused(jr700):
    """MuJoCo stops a rollout that diverges; a clock that stands still is noticed."""
    truth = np.zeros((10, jr700.model.nsensordata))
    clock = jr700.model.sensor("clock").adr[0]
    truth[:, clock] = np.minimum(np.arange(10), 5) * 0.002
    truth[:, jr700.model.sensor("imu_attitude").adr[0]] = 1.0
    truth[:, jr700.model.sensor("imu_position").adr[0] + 2] = 10.0
    with pytest.raises(DivergedError, match=r"stopped at 0\.01 s"):
        read_trajectory(jr700, truth)


# A seed gives the same bytes of a record in any process, with any threads, installed anywhere


SCRIPT = """
import sys
import helisim as hs
sweep = hs.Sweep(axis="lat", duration=13.0)
for k, record in enumerate(hs.fly(hs.load(), sweep, count=2, seed=2**40, jobs=int(sys.argv[2]))):
    for suffix in ("parquet", "csv"):
        hs.write_record(record, f"{sys.argv[1]}/{k}.{suffix}")
"""


@pytest.mark.slow
def test_another_process_with_other_threads_writes_the_same_bytes(tmp_path):
    """Neither the process, its hash seed, its locale, its clock nor any number of threads."""
    other = {"PYTHONHASHSEED": "7", "OPENBLAS_NUM_THREADS": "2", "LC_ALL": "C", "TZ": "Asia/Tokyo"}
    written = []
    for jobs, environment in (("1", {}), ("2", other)):
        folder = tmp_path / jobs
        folder.mkdir()
        command = [sys.executable, "-c", SCRIPT, str(folder), jobs]
        subprocess.run(command, env={**os.environ, **environment}, check=True)
        written.append({path.name: path.read_bytes() for path in folder.iterdir()})
    assert written[0] == written[1]
    assert len(written[0]) == 4
