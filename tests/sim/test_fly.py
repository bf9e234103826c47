"""Flights: reproducible, complete, and honest about failure."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

import helisim
from helisim.base.errors import DivergedError, InputError
from helisim.cli import main
from helisim.physics import pilot as pilot_laws
from helisim.records.record import CHANNELS, IN1, IN2, OUT, SERVOS
from helisim.records.storage import read_record, write_record
from helisim.sim import (
    Doublet,
    FlightEnvelope,
    FlightPlan,
    Pilot,
    Recorder,
    Sweep,
    fly,
    fly_to,
    simulate,
)
from helisim.sim.flight import fly_each
from helisim.sim.recorder import read_trajectory
from helisim.vehicle import load
from helisim.vehicle.folder import models_folder

SHORT = Sweep(axis="lat", duration=8.0, trim_time=1.0)
NO_REMNANT = Pilot(remnant=0.0)


@pytest.fixture(scope="module")
def three(jr700):
    return fly(jr700, SHORT, count=3, seed=7, jobs=1)


def same(one, other):
    return np.array_equal(one.time, other.time) and np.array_equal(one.values, other.values)


@pytest.mark.parametrize("jobs", [2, 3, 5])
def test_jobs_do_not_matter(jr700, three, jobs):
    """The same seed gives the same bits for any number of threads."""
    again = fly(jr700, SHORT, count=3, seed=7, jobs=jobs)
    assert all(same(one, other) for one, other in zip(three, again))


def test_count_does_not_matter(jr700, three):
    """Flight k of a seed is the same however many are flown."""
    alone = fly(jr700, SHORT, count=1, seed=7, jobs=1)
    pair = fly(jr700, SHORT, count=2, seed=7, jobs=2)
    assert same(alone[0], three[0])
    assert same(pair[1], three[1])


@pytest.mark.parametrize(("order", "jobs"), [((2, 0, 1), 1), ((1, 2), 2), ((2,), 3)])
def test_the_split_into_batches_does_not_matter(jr700, three, order, jobs):
    """Flight k has the same bits alone, in any company, in any order and any size of batch."""
    records = list(fly_each(jr700, SHORT, order, seed=7, jobs=jobs))
    assert len(records) == len(order)
    assert all(same(record, three[number]) for number, record in zip(order, records))


def test_flights_come_one_by_one(jr700, three):
    """The first record is there before the others are flown, and flying can stop after it."""
    flights = fly_each(jr700, SHORT, range(10**9), seed=7, jobs=1)
    assert same(next(flights), three[0])
    flights.close()


def test_flights_and_seeds_differ(jr700, three):
    """Another flight, and another seed, has another hand and other noise."""
    other = fly(jr700, SHORT, count=1, seed=8, jobs=1)[0]
    for one, two in ((three[0], three[1]), (three[0], other)):
        assert not np.array_equal(one["LAT"], two["LAT"])
        assert not np.array_equal(one["p"], two["p"])


def test_flying_changes_nothing_of_the_vehicle(jr700):
    """The vehicle's own model keeps its parameters and its resting pilot."""
    before = jr700.model.actuator_user.copy()
    fly(jr700, SHORT, jobs=1)
    assert np.array_equal(before, jr700.model.actuator_user)


def test_record_is_complete(three):
    """Every channel of IN1, IN2, SERVO and OUT, with its standard unit and a start at zero."""
    record = three[0]
    assert set(record.names) == {*IN1, *IN2, *SERVOS, *OUT}
    assert all(record.unit(name) == CHANNELS[name].unit for name in record.names)
    assert record.time[0] == 0.0
    assert record.sample_time == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parametrize("duration", [8.0, 30.0, 90.0])
def test_record_is_as_long_as_the_flight(jr700, duration):
    """From 0 to the duration at 100 Hz, both ends included, whatever the clock's rounding."""
    excitation = Doublet(axis="ped", duration=duration)
    record = fly(jr700, excitation, jobs=1)[0]
    assert len(record) == round(duration * 100.0) + 1
    assert record.duration == pytest.approx(duration, rel=1e-12)


def test_provenance_repeats_the_flight(jr700, three):
    """What is kept with the record is enough to fly it again."""
    kept = three[2].provenance
    assert (kept["seed"], kept["flight"], kept["vehicle"]) == (7, 2, "jr700")
    assert kept["excitation"]["kind"] == "Sweep"
    plan = FlightPlan.of_record(three[2])
    assert kept["plan_digest"] == plan.digest
    vehicle = load(kept["vehicle"], parameters=kept["parameters"], timestep=kept["timestep_s"])
    again = fly(vehicle, plan, count=3, seed=kept["seed"])
    assert same(again[2], three[2])
    assert set(kept["versions"]) >= {"mujoco", "numpy", "numba"}


def test_progress_is_reported(jr700):
    """The callback is called once a flight."""
    calls = []
    fly(jr700, SHORT, count=3, jobs=2, on_flight=lambda: calls.append(1))
    assert len(calls) == 3


@pytest.mark.parametrize(
    ("name", "bad"), [("count", 0), ("count", -1), ("count", 1.5), ("jobs", 0), ("seed", -1)]
)
def test_bad_arguments_are_refused(jr700, name, bad):
    """Counts, jobs and seeds out of range are one clear line."""
    with pytest.raises(InputError, match=rf"{name} must be an integer of \d or more, got {bad}"):
        fly(jr700, SHORT, **{name: bad})


def test_absurd_amplitude_diverges_with_advice(jr700):
    """Half the stick on a lateral sweep turns the helicopter over, and the message says so."""
    wild = Sweep(axis="lat", amplitude=0.5, duration=20.0)
    with pytest.raises(DivergedError, match=r"helicopter .* at \d+\.\d+ s; fly a smaller"):
        fly(jr700, wild, jobs=1)


@pytest.mark.parametrize("gains", [{"gyro.kp_lat": -1.0}, {"gyro.k_a": -0.29}])
def test_bad_gains_diverge_with_advice(gains):
    """A gyro with a sign wrong ends in one clear line that names the gyro."""
    with pytest.raises(DivergedError, match="gyro"):
        fly(load(parameters=gains), Sweep(axis="ped", duration=12.0), jobs=1)


def test_flight_without_finite_state_is_refused(jr700):
    """NaN in the simulation's output never becomes a record."""
    sensordata = np.zeros((10, jr700.model.nsensordata))
    sensordata[6:] = np.nan
    with pytest.raises(DivergedError, match=r"no finite state from 0\.01 s"):
        read_trajectory(jr700, sensordata)


def test_flight_that_stopped_is_refused(jr700):
    """MuJoCo stops a rollout that diverges; a clock that stands still is noticed."""
    truth = np.zeros((10, jr700.model.nsensordata))
    clock = jr700.model.sensor("clock").adr[0]
    truth[:, clock] = np.minimum(np.arange(10), 5) * 0.002
    truth[:, jr700.model.sensor("imu_attitude").adr[0]] = 1.0
    truth[:, jr700.model.sensor("imu_position").adr[0] + 2] = 10.0
    with pytest.raises(DivergedError, match=r"stopped at 0\.01 s"):
        read_trajectory(jr700, truth)


@pytest.mark.parametrize(("axis", "rate"), [("lat", "p"), ("lon", "q"), ("ped", "r")])
def test_doublet_turns_its_axis_first_one_way(jr700, axis, rate):
    """A positive doublet rolls right, pitches up or yaws right, and then the other way."""
    record = fly(jr700, FlightPlan(excitation=Doublet(axis=axis), pilot=NO_REMNANT), jobs=1)[0]
    stick = record[axis.upper()]
    first = (record.time > 2.1) & (record.time < 2.5)
    second = (record.time > 2.6) & (record.time < 3.0)
    amplitude = Doublet(axis=axis).on(jr700.parameters).amplitude
    # the pilot, who holds the attitude at about 1 rad/s, works against it meanwhile
    assert stick[first] == pytest.approx(amplitude, abs=0.5 * amplitude)
    assert stick[second] == pytest.approx(-amplitude, abs=0.7 * amplitude)
    assert record[rate][first].mean() > 0.05
    assert record[rate][second].mean() < record[rate][first].mean() - 0.1


def test_collective_doublet_climbs_first(jr700):
    """A positive collective doublet gives upward velocity: w falls."""
    record = fly(jr700, FlightPlan(excitation=Doublet(axis="col"), pilot=NO_REMNANT), jobs=1)[0]
    assert np.interp(2.5, record.time, record["w"]) < -0.3


def test_sweep_is_the_formula_at_the_stick(jr700):
    """With a still, unhurried hand the stick is hold plus amplitude times the sweep's formula."""
    excitation = Sweep(axis="ped", duration=12.0, trim_time=1.0, unsteadiness=0.0, leakage=0.0)
    excitation = excitation.on(jr700.parameters)
    ends = []
    for timestep in (0.002, 0.001):
        truth = next(
            simulate(
                load(timestep=timestep),
                FlightPlan(excitation=excitation, pilot=Pilot(remnant=0.0)),
                jobs=1,
            )
        )
        w_min, w_max = excitation.band
        each = round(0.002 / timestep)  # the hand moves at the gyro's ticks
        ticks = truth.time[::each]
        formula = np.array(
            [pilot_laws.sweep(t - 1.0, 10.0, w_min, w_max, 1.0, 0.0, 0.0) for t in ticks]
        )
        held = truth.sticks[::each, 3] - excitation.amplitude * formula
        heading = 0.035 * truth.attitudes[::each, 2]  # parameters.toml, k_heading
        # MuJoCo's clock adds steps up: 1e-12 s times 30 rad/s
        assert held + heading == pytest.approx(0.0, abs=1e-10)
        ends.append(formula)
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)


def test_pilot_keeps_the_place(jr700):
    """For half a minute, with his own remnant, the pilot stays within a metre or two."""
    record = fly(jr700, Doublet(axis="ped", duration=30.0, amplitude=0.01), jobs=1)[0]
    for name in ("north", "east"):
        assert np.abs(record[name]).max() < 3.0
    assert np.abs(record["down"] - record["down"][0]).max() < 1.5
    assert np.abs(record.select(["phi", "theta"])).max() < 0.3


@pytest.mark.parametrize("jobs", [1, 2])
def test_flights_left_early_leave_nothing_behind(jr700, jobs):
    """Who stops looking gets MuJoCo back as it was."""
    flown = fly_each(jr700, Sweep(axis="lat", duration=12.0), range(6), seed=1, jobs=jobs)
    next(flown)
    del flown
    assert mujoco.get_mjcb_passive() is None


# A folder of flights: complete, kept when interrupted, gone on with, and not mixed up


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def whole(jr700, tmp_path_factory):
    """Three flights, flown without interruption in one thread."""
    folder = tmp_path_factory.mktemp("whole")
    fly_to(folder, jr700, SHORT, count=3, seed=7, jobs=1)
    return contents(folder)


def test_the_folder_holds_what_fly_returns(jr700, tmp_path):
    """One record a flight, with the numbers that `fly` gives."""
    flown = fly_to(tmp_path / "new", jr700, SHORT, count=2, seed=7, jobs=2)
    assert [path.name for path in flown.paths] == ["lat_0001.parquet", "lat_0002.parquet"]
    assert flown.found == 0
    for path, record in zip(flown.paths, fly(jr700, SHORT, count=2, seed=7, jobs=1)):
        kept = read_record(path)
        assert kept.values.tobytes() == record.values.tobytes()
        assert kept.provenance == record.provenance


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_interrupted_run_goes_on_to_the_same_bytes(jr700, tmp_path, whole, jobs):
    """Ctrl-C keeps the finished flights, and the next call flies the rest only."""

    def interrupt():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly_to(tmp_path, jr700, SHORT, count=3, seed=7, jobs=jobs, on_flight=interrupt)
    kept = contents(tmp_path)
    assert kept == {"lat_0001.parquet": whole["lat_0001.parquet"]}
    (first,) = tmp_path.iterdir()
    written = first.stat().st_mtime_ns
    flown = fly_to(tmp_path, jr700, SHORT, count=3, seed=7, jobs=jobs)
    assert flown.found == 1
    assert first.stat().st_mtime_ns == written  # not even written again
    assert contents(tmp_path) == whole


def test_a_damaged_flight_is_flown_again(jr700, tmp_path, whole):
    """A truncated file is not taken for a flight."""
    for name, data in whole.items():
        (tmp_path / name).write_bytes(data)
    (tmp_path / "lat_0002.parquet").write_bytes(whole["lat_0002.parquet"][:1000])
    ticks = []
    flown = fly_to(
        tmp_path, jr700, SHORT, count=3, seed=7, jobs=2, on_flight=lambda: ticks.append(1)
    )
    assert flown.found == 2
    assert len(ticks) == 3
    assert contents(tmp_path) == whole


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"excitation": Sweep(axis="lat", duration=9.0, trim_time=1.0)}, "excitation.duration"),
        ({"seed": 8}, "seed is 7 there and 8 here"),
        ({"pilot": Pilot(remnant=0.001)}, "pilot.remnant"),
        ({"recorder": Recorder(rate_hz=200.0)}, "recorder"),
    ],
)
def test_another_configuration_is_refused(jr700, tmp_path, whole, change, says):
    """Flights of another configuration are neither kept as ours nor overwritten."""
    (tmp_path / "lat_0003.parquet").write_bytes(whole["lat_0003.parquet"])
    seed = change.pop("seed", 7)
    plan = FlightPlan(**{"excitation": SHORT, **change})
    with pytest.raises(InputError, match=says):
        fly_to(tmp_path, jr700, plan, count=3, seed=seed)
    assert contents(tmp_path) == {"lat_0003.parquet": whole["lat_0003.parquet"]}


@pytest.fixture(scope="module")
def tight(jr700):
    """A watch that lets two of the three flights pass: the rate that the wildest one exceeds."""
    fastest = [np.abs(one.rates).max() for one in simulate(jr700, SHORT, count=3, seed=7, jobs=1)]
    return FlightEnvelope(rate=0.5 * sum(sorted(fastest)[1:])), int(np.argmax(fastest))


@pytest.mark.parametrize("jobs", [1, 3])
def test_a_flight_that_is_over_hurts_no_other(jr700, tmp_path, whole, tight, jobs):
    """The others have the numbers that they always have, in one batch too; all is kept."""
    watch, wild = tight
    flown = fly_to(
        tmp_path, jr700, FlightPlan(excitation=SHORT, envelope=watch), count=3, seed=7, jobs=jobs
    )
    assert list(flown.ended) == [flown.paths[wild]]
    (tmp_path / "whole").mkdir()
    for number, path in enumerate(flown.paths):
        kept = read_record(path)
        (tmp_path / "whole" / path.name).write_bytes(whole[path.name])
        healthy = read_record(tmp_path / "whole" / path.name)
        if number != wild:
            assert np.array_equal(kept.values, healthy.values)
            assert not kept.ended
        else:
            assert kept.ended == flown.ended[path]
            assert kept.duration < healthy.duration
    (beside,) = (tmp_path / "last_second").iterdir()
    assert beside.name == flown.paths[wild].name
    # it isn't flown again, and is told again
    again = fly_to(
        tmp_path, jr700, FlightPlan(excitation=SHORT, envelope=watch), count=3, seed=7, jobs=jobs
    )
    assert (again.found, again.ended) == (3, flown.ended)


def test_the_command_goes_on_and_says_so(tmp_path, capsys):
    """`fly --count` fills a folder, and a second call with more flights adds the missing ones."""
    arguments = ["fly", "--axis", "col", "--duration", "13", "--out", str(tmp_path)]
    assert main([*arguments, "--count", "1"]) == 0
    assert "1 flights of 13 s)" in capsys.readouterr().out
    assert main([*arguments, "--count", "2", "--jobs", "1"]) == 0
    assert "2 flights of 13 s, 1 of them there before" in capsys.readouterr().out
    assert main([*arguments, "--count", "2", "--seed", "4"]) == 2
    assert "seed is 1 there and 4 here" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--count", "0", "--out", "new"], "count must be"),
        (["--count", "2", "--out", "new", "--jobs", "0"], "jobs must be"),
        (["--count", "2", "--out", "a.parquet"], "--out is a folder"),
        (["--count", "2", "--out", "new", "--rerun", "a.rrd"], "leave out --count"),
        (["--count", "2", "--out", "file/new"], "file/new"),
    ],
)
def test_bad_input_leaves_nothing(tmp_path, monkeypatch, capsys, arguments, says):
    """A mistake is one line and status 2, and neither folder nor file appears."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    assert main(["fly", "--axis", "lat", "--duration", "13", "--quiet", *arguments]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


# A seed gives the same bytes of a record in any process, with any threads, installed anywhere


SEEDS = (0, 3, 4, 11, 2**40)
FLIGHTS = 2

SCRIPT = """
import sys
import helisim as hs
vehicle = hs.load()
for seed in map(int, sys.argv[2:]):
    records = hs.fly(vehicle, hs.Sweep(axis="lat", duration=13.0), count=2, seed=seed, jobs=2)
    for k, record in enumerate(records):
        hs.write_record(record, f"{seed}_{k}.{sys.argv[1]}")
print(hs.__file__)
"""


@pytest.fixture(scope="module")
def here(jr700, tmp_path_factory) -> dict[str, bytes]:
    """The bytes of the records that this process writes, one thread a flight, by name."""
    folder = tmp_path_factory.mktemp("here")
    for seed in SEEDS:
        flown = fly(jr700, Sweep(axis="lat", duration=13.0), count=FLIGHTS, seed=seed, jobs=1)
        for k, record in enumerate(flown):
            for suffix in ("parquet", "csv"):
                write_record(record, folder / f"{seed}_{k}.{suffix}")
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def flown_by(folder: Path, suffix: str, **environment: str) -> tuple[dict[str, bytes], str]:
    """Fly in another process; return the bytes of its records, and where helisim is."""
    folder.mkdir()
    command = [sys.executable, "-c", SCRIPT, suffix, *map(str, SEEDS)]
    done = subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return {path.name: path.read_bytes() for path in folder.iterdir()}, done.stdout.strip()


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["parquet", "csv"])
def test_another_process_with_other_threads_writes_the_same_bytes(here, tmp_path, suffix):
    """Neither the process, its hash seed, its locale, its clock nor any number of threads."""
    environment = {
        "PYTHONHASHSEED": "7",
        "OPENBLAS_NUM_THREADS": "2",
        "LC_ALL": "C",
        "TZ": "Asia/Tokyo",
    }
    there, _ = flown_by(tmp_path / "there", suffix, **environment)
    assert there == {name: data for name, data in here.items() if name.endswith(suffix)}
    assert len(there) == FLIGHTS * len(SEEDS)


@pytest.mark.slow
def test_another_installation_writes_the_same_bytes(here, tmp_path):
    """Nor the folder that helisim is installed in, whatever its name."""
    site = tmp_path / "Pfad mit Lücken" / "site"
    package = Path(helisim.__file__).parent
    skip = shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc")
    shutil.copytree(package, site / "helisim", ignore=skip)
    if not (site / "helisim" / "models").exists():  # a checkout has them beside the sources
        shutil.copytree(models_folder(), site / "helisim" / "models")
    path = os.pathsep.join((str(site), os.environ.get("PYTHONPATH", "")))
    there, where = flown_by(tmp_path / "there", "parquet", PYTHONPATH=path)
    assert Path(where).parent == site / "helisim"
    assert there == {name: data for name, data in here.items() if name.endswith("parquet")}


def test_seeds_give_different_bytes(here):
    """No two flights of all these are the same."""
    assert len(set(here.values())) == 2 * FLIGHTS * len(SEEDS)


def test_the_model_digest_follows_what_flies(jr700):
    """The same model has the same digest; another parameter or time step has another."""
    assert load().digest == jr700.digest
    others = {
        jr700.digest,
        load(parameters={"main_rotor.hub_stiffness": 100.0}).digest,
        load(timestep=0.001).digest,
        jr700.with_settings({"gyro.k_p": 0.2}).digest,
    }
    assert len(others) == 4
