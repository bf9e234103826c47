"""Where a manoeuvre is added, what the record shows of it, and the loops that it opens."""

import json

import numpy as np
import pytest

from helisim import Chirp, FlightEnvelope, FlightPlan, History, Pilot, Pulse
from helisim.base.errors import InputError
from helisim.ident import frequency_response
from helisim.physics.layout import INJECTION
from helisim.records.storage import read_record, write_record
from helisim.sim import Recorder, Step, Together, fly, read_plan, write_plan
from helisim.sim.excitation import injection
from helisim.vehicle import load
from tabled import tabled

STEADY = {"pilot": Pilot(remnant=0.0), "envelope": FlightEnvelope.off()}
TRUE = Recorder(noise={}, resolution={}, latency={})


@pytest.mark.parametrize("at", ["servos", "actuators", "sensors"])
@pytest.mark.parametrize("timestep", [0.001, 0.0005])
def test_what_is_added_is_held_between_ticks(at, timestep):
    vehicle = load(timestep=timestep)
    axis = "q" if at == "sensors" else "lon"
    time = np.linspace(0.0, 1.0, 101)
    wave = History.of(time, 0.01 * np.sin(7.0 * time), axis=axis, at=at)
    rows = injection(wave, vehicle)
    each = round(vehicle.parameters["gyro.period"] / timestep)
    blocks = rows[: len(rows) // each * each].reshape(-1, each, len(INJECTION))
    assert np.array_equal(blocks, np.repeat(blocks[:, :1], each, axis=1))
    assert rows.any(axis=0).sum() == (3 if at != "sensors" else 1)


def test_a_record_tells_what_was_added(jr700, tmp_path):
    parts = (
        Pulse(axis="ped", at="servos", amplitude=0.02, duration=4.0),
        Pulse(axis="lon", at="actuators", amplitude=0.01, duration=4.0, width=1.0),
        Pulse(axis="p", at="sensors", amplitude=0.1, duration=4.0),
        Pulse(axis="lat", amplitude=0.01, duration=4.0),
    )
    plan = FlightPlan(excitation=Together(parts=parts), recorder=TRUE, **STEADY)
    (record,) = fly(jr700, plan, seed=1)
    for sum_, first, second, sign in (
        ("ped_gyro", "ped", "ped_added", -1.0),
        ("lon_sum", "lon", "lon_disturbance", 1.0),
    ):
        assert np.array_equal(record[sum_], record[first] + sign * record[second])
    assert record.unit("p_sum") == "rad/s"
    middle = np.isclose(record.time, 2.25)
    assert record["ped_added"][middle] == pytest.approx(0.02, rel=0.01)  # behind the filter
    assert record["lon_disturbance"][middle] == pytest.approx(0.01, rel=0.01)
    assert record["p_disturbance"][middle] == pytest.approx(0.1, rel=0.01)
    own = record["p_sum"] - record["p_disturbance"]
    # the gyro senses at its ticks what the IMU shows; the filter is the same
    assert own == pytest.approx(record["p"], abs=1e-3)
    write_record(record, tmp_path / "record.csv")
    assert np.array_equal(read_record(tmp_path / "record.csv").values, record.values)
    (plain,) = fly(jr700, FlightPlan(excitation=parts[3], recorder=TRUE, **STEADY), seed=1)
    assert not {name for name in plain.names if name.endswith(("_added", "_sum", "_disturbance"))}


ACTUATOR = {"inputs": "ped_sum", "outputs": "ped", "reference": "ped_disturbance"}
SENSOR = {"inputs": "r_disturbance", "outputs": "r_sum"}
COMMAND = {"inputs": "ped", "outputs": "ped_gyro", "reference": "ped_added"}


@tabled("place", "axis", "channels", "exact", "low", "high")
def test_the_yaw_loop_is_measured_wherever_it_is_cut(place, axis, channels, exact, low, high):
    """At the tail servo the exact sampled loop; at the sensor the sensitivity, 1 / (1 - loop).

    From the record alone. 2 %: the quantisation of the servo signals, 0.0005 of 0.05, and what is
    nonlinear. The crossover is inside of the band.
    """
    vehicle = load(parameters={"pilot.k_heading": 0.0})  # one loop, the gyro's
    wave = Chirp(axis=axis, at=place, amplitude=0.05, band=(0.8, 60.0), duration=86.0)
    (record,) = fly(vehicle, FlightPlan(excitation=wave, pilot=Pilot(remnant=0.0)), seed=1)
    found = frequency_response(record, **channels, band=(5.0, 45.0))
    loop = vehicle.loop("ped")
    wanted = exact(np.ravel([loop(np.exp(1j * one * loop.dt)) for one in found.frequency]))
    assert np.abs(found.response[0, 0] / wanted - 1.0).max() < 0.02
    assert np.abs(wanted).min() < low
    assert np.abs(wanted).max() > high


@tabled("excitation")
def test_every_kind_comes_back_from_a_plan_and_from_a_record(jr700, excitation, tmp_path):
    for plan in (FlightPlan(excitation=excitation), FlightPlan(excitation=excitation).on(jr700)):
        write_plan(plan, tmp_path / "plan.toml")
        again = read_plan(tmp_path / "plan.toml")
        assert again == plan
        assert again.digest == plan.digest
        assert FlightPlan.from_dict(json.loads(json.dumps(plan.to_dict()))) == plan
    (flown,) = fly(jr700, excitation, seed=2)
    write_record(flown, tmp_path / "flown.parquet")
    record = read_record(tmp_path / "flown.parquet")
    (again,) = fly(jr700, FlightPlan.of_record(record), seed=2)
    assert np.array_equal(again.values, record.values)
    assert again.names == record.names
    assert again.provenance["sticks_digest"] == record.provenance["sticks_digest"]


# A disturbance of attitude turns what a controller senses: the angle, and the rate with it

FAST = Recorder(noise={}, resolution={}, latency={}, antialias_hz=249.0, rate_hz=500.0)


def oscillation(axis, amplitude, frequency):
    time = 0.002 * np.arange(501)
    return History.of(time, amplitude * np.sin(frequency * time), axis=axis, at="sensors")


@pytest.mark.parametrize(("angle", "rate"), [("phi", "p"), ("theta", "q"), ("psi", "r")])
def test_an_angle_is_added_with_its_rate(jr700, angle, rate):
    amplitude, frequency = 0.02, 40.0
    rows = injection(oscillation(angle, amplitude, frequency), jr700)
    time = 0.002 * np.arange(len(rows))
    wanted = amplitude * np.sin(frequency * time)
    assert rows[:, getattr(INJECTION, f"angle_{angle}")] == pytest.approx(wanted, abs=1e-9)
    # the spline's own error in the interior: (0.08)^4 / 180 = 2e-7 of the rate; at the ends more
    wanted = amplitude * frequency * np.cos(frequency * time)[20:-20]
    found = rows[20:-20, getattr(INJECTION, f"rate_{rate}")]
    assert found == pytest.approx(wanted, abs=1e-6 * amplitude * frequency)
    assert rows.any(axis=0).sum() == 2


def test_the_record_tells_the_disturbance_and_what_was_sensed(jr700):
    """Beside the angle its rate, on top of a disturbance of the rate; a jump is beyond any gyro."""
    parts = (oscillation("phi", 0.02, 20.0), oscillation("p", 0.1, 7.0))
    plan = FlightPlan(excitation=Together(parts=parts), recorder=FAST, **STEADY)
    (record,) = fly(jr700, plan, seed=1)
    time = record.time
    assert record.unit("phi_sum") == "rad"
    # a 2 ms sample is the tick's; the filter's corner is where the samples end
    assert record["phi_disturbance"] == pytest.approx(0.02 * np.sin(20.0 * time), abs=1e-3)
    rate = 0.4 * np.cos(20.0 * time) + 0.1 * np.sin(7.0 * time)
    assert record["p_disturbance"][20:-20] == pytest.approx(rate[20:-20], abs=0.02)
    own = record["phi_sum"] - record["phi_disturbance"]
    assert own == pytest.approx(record["phi"], abs=1e-9)
    (rates,) = fly(jr700, FlightPlan(excitation=parts[1], recorder=FAST, **STEADY), seed=1)
    assert "phi_sum" not in rates
    step = Step(axis="phi", at="sensors", amplitude=0.2)
    with pytest.raises(InputError, match="an attitude's disturbance included"):
        fly(jr700, step, seed=1)
