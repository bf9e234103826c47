"""Flights: reproducible, complete, and honest about failure."""

import mujoco
import numpy as np
import pytest

from helisim.base.errors import DivergedError, InputError
from helisim.physics import pilot as pilot_laws
from helisim.records.channels import CHANNELS, IN1, IN2, OUT, SERVOS
from helisim.sim import Doublet, Sweep
from helisim.sim.flight import simulate
from helisim.sim.fly import fly, fly_each
from helisim.sim.plan import FlightPlan, Pilot
from helisim.sim.trajectory import read_trajectory
from helisim.vehicle import load

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
