"""Where a manoeuvre is added, what the record shows of it, and the loops that it opens."""

import json

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.ident import frequency_response
from helisim.physics.layout import INJECTION
from helisim.records.storage import read_record, write_record
from helisim.sim import (
    Chirp,
    Doublet,
    Excitation,
    FlightEnvelope,
    FlightPlan,
    History,
    Manoeuvre,
    Multisine,
    Pilot,
    Pulse,
    Recorder,
    Sequence,
    Step,
    Together,
    fly,
    read_plan,
    simulate,
    write_plan,
)
from helisim.sim.excitation import injection
from helisim.vehicle import load

STEADY = {"pilot": Pilot(remnant=0.0), "envelope": FlightEnvelope.off()}
TRUE = Recorder(noise={}, resolution={}, latency={})


def trajectory(vehicle, excitation):
    plan = FlightPlan(excitation=excitation, **STEADY)
    return next(simulate(vehicle, plan, jobs=1, keep_ended=True))


def still(duration=1.0):
    """Return a manoeuvre that adds nothing."""
    return Manoeuvre(lambda time: 0.0, axis="lat", duration=duration)


@pytest.mark.parametrize(
    ("axis", "column", "expected"),
    [
        ("col", 0, (1.0, 1.0, 1.0, 0.0)),
        ("lon", 1, (1.0, -0.5, -0.5, 0.0)),
        ("lat", 2, (0.0, 0.75**0.5, -(0.75**0.5), 0.0)),
        ("ped", 3, (0.0, 0.0, 0.0, 1.0)),
        ("tail", 3, (0.0, 0.0, 0.0, 1.0)),
        ("left", 1, (0.0, 1.0, 0.0, 0.0)),
    ],
)
def test_a_servo_step_is_mixed_as_a_swashplate_is(jr700, axis, column, expected):
    """On top of the gyro's command, by the 120-degree mixing; single servos as they are."""
    step = Step(axis=axis, at="servos", amplitude=0.02, trim_time=0.1, duration=1.0)
    moved, held = trajectory(jr700, step), trajectory(jr700, still())
    row = 50  # the step's first tick: the gyro hasn't answered yet
    added = moved.servo_commands[row] - held.servo_commands[row]
    # to rounding: 120 degrees are exact to the last bits
    assert added == pytest.approx(0.02 * np.array(expected), abs=1e-15)
    assert np.array_equal(moved.servo_commands[:row], held.servo_commands[:row])
    assert moved.commands_added is not None
    assert moved.actuators_added is None


def test_what_reaches_an_actuator_is_behind_the_command(jr700):
    """The command stays what the gyro gave; the servo goes where the sum is."""
    step = Step(axis="tail", at="actuators", amplitude=0.02, trim_time=0.1, duration=1.0)
    moved, held = trajectory(jr700, step), trajectory(jr700, still())
    assert moved.servo_commands[50, 3] == held.servo_commands[50, 3]
    lag = 1.0 - np.exp(-1.0)  # the tail servo has gone most of its way in 20 ms
    assert moved.servo_positions[60, 3] - held.servo_positions[60, 3] > 0.02 * lag
    # the tail rotor's torque pitches the body, a sixtieth of the yaw in 20 ms; the gyro answers
    assert moved.servo_positions[60, :3] == pytest.approx(held.servo_positions[60, :3], abs=1e-4)


def test_a_rate_is_disturbed_for_the_gyro_alone():
    """The helicopter's own rate is what it was; the gyro counters what it reads."""
    vehicle = no_heading_hold()
    step = Step(axis="r", at="sensors", amplitude=0.05, trim_time=0.1, duration=4.0)
    moved, held = trajectory(vehicle, step), trajectory(vehicle, still(4.0))
    assert np.array_equal(moved.rates[:50], held.rates[:50])
    par = vehicle.parameters
    change = moved.servo_commands[50, 3] - held.servo_commands[50, 3]
    # k_p k_a r, led by (lead + lag) / lag, and the first half period of the integral: the
    # command is to the left, by more than the law has without its lead
    assert change < -0.05 * par["gyro.k_p"] * par["gyro.k_a"]
    # after some seconds the heading lock makes the gyro read nothing: it turns the other way
    assert moved.rates[-1, 2] == pytest.approx(-0.05, rel=0.02)


@pytest.mark.parametrize("at", ["servos", "actuators", "sensors"])
@pytest.mark.parametrize("timestep", [0.001, 0.0005])
def test_what_is_added_is_held_between_ticks(at, timestep):
    """So that a flight doesn't depend on the time step: each value for a whole gyro period."""
    vehicle = load(timestep=timestep)
    axis = "q" if at == "sensors" else "lon"
    wave = Manoeuvre(lambda time: 0.01 * np.sin(7.0 * time), axis=axis, at=at, duration=1.0)
    rows = injection(wave.on(vehicle.parameters), vehicle)
    each = round(vehicle.parameters["gyro.period"] / timestep)
    blocks = rows[: len(rows) // each * each].reshape(-1, each, len(INJECTION))
    assert np.array_equal(blocks, np.repeat(blocks[:, :1], each, axis=1))
    assert rows.any(axis=0).sum() == (3 if at != "sensors" else 1)


def test_a_record_tells_what_was_added(jr700, tmp_path):
    """Channels for what no other shows, and their sums; CSV and Parquet keep them."""
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


def test_the_added_is_as_late_as_what_it_is_added_to(jr700):
    """`lon` is recorded 19.8 ms late; so is its disturbance, and their sum is one instant's."""
    wave = Chirp(axis="lon", at="actuators", amplitude=0.02, band=(5.0, 20.0), duration=12.0)
    (record,) = fly(jr700, FlightPlan(excitation=wave, **STEADY), seed=1)
    late = jr700.parameters["recorder_latency.lon"]
    assert late > 0.01
    filtered = trajectory(jr700, wave)
    lag = np.arange(0.0, 0.1, 0.001)
    truth = wave.on(jr700.parameters)
    seen = record["lon_disturbance"][300:900]
    misfit = [np.std(seen - truth.wave(record.time[300:900] - one)) for one in lag]
    # besides the latency the anti-alias filter's own delay, 2.61 / (2 pi 40 Hz) at low frequency
    expected = late + 2.613 / (2.0 * np.pi * 40.0)
    assert lag[int(np.argmin(misfit))] == pytest.approx(expected, abs=0.0015)
    assert filtered.actuators_added is not None


def test_too_much_together_is_refused(jr700):
    """Each part stays in the travel; what they come to is checked too."""
    parts = tuple(Step(axis="lat", amplitude=0.3) for _ in range(2))
    with pytest.raises(InputError, match=r"adds at sticks comes to 0.6 at 2 s, beyond 0.5"):
        fly(jr700, Together(parts=parts), seed=1)


def no_heading_hold():
    """Return the vehicle with a pilot who leaves the heading alone: one loop, the gyro's."""
    return load(parameters={"pilot.k_heading": 0.0})


ACTUATOR = {"inputs": "ped_sum", "outputs": "ped", "reference": "ped_disturbance"}
SENSOR = {"inputs": "r_disturbance", "outputs": "r_sum"}
COMMAND = {"inputs": "ped", "outputs": "ped_gyro", "reference": "ped_added"}


@pytest.mark.parametrize(
    ("place", "axis", "channels", "exact", "low", "high"),
    [
        ("actuators", "ped", ACTUATOR, lambda loop: loop, 0.7, 10.0),
        ("sensors", "r", SENSOR, lambda loop: 1.0 / (1.0 - loop), 0.1, 1.1),
        ("servos", "tail", COMMAND, lambda loop: loop, 0.7, 10.0),
    ],
)
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


KINDS = [
    Step(axis="lat", amplitude=-0.02),
    Pulse(axis="r", at="sensors", amplitude=0.2),
    Doublet(axis="tail", at="actuators", amplitude=0.05),
    Chirp(axis="ped", band=(1.0, 20.0), spacing="linear", duration=20.0),
    Multisine(axis="lat+ped", period=5.0, duration=12.0),
    History.of([0.0, 1.0, 3.0], [[0.0, 0.0], [0.01, 0.02], [0.0, 0.0]], axis="col+front",
               at="servos", method="hold", source="three points"),
    Sequence(
        parts=(
            Step(axis="lat", duration=3.0),
            Together(parts=(Pulse(axis="ped"), Doublet(axis="lon", at="servos", amplitude=0.03))),
            Sequence(parts=(Pulse(axis="col", duration=3.0), Step(axis="col", duration=4.0))),
        ),
        pause=0.5,
    ),
]  # fmt: skip


@pytest.mark.parametrize("excitation", KINDS, ids=lambda one: type(one).__name__)
def test_every_kind_comes_back_from_a_plan_and_from_a_record(jr700, excitation, tmp_path):
    """TOML, open and complete; a record's provenance, from which it flies again to the bit."""
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


def test_a_function_flies_and_flies_again_without_it(jr700, tmp_path):
    """Bare, for all four sticks; or of one axis and place. The record keeps its samples."""

    def nudge(time):
        return (0.0, 0.0, 0.02 if 2.0 <= time < 3.0 else 0.0, 0.0)

    (bare,) = fly(jr700, nudge, seed=3)
    pulse = Pulse(axis="lat", amplitude=0.02, width=1.0, duration=10.0)
    assert np.array_equal(bare.values, fly(jr700, pulse, seed=3)[0].values)
    assert bare.provenance["excitation"]["source"].endswith("nudge")
    write_record(bare, tmp_path / "bare.csv")
    plan = FlightPlan.of_record(read_record(tmp_path / "bare.csv"))
    assert np.array_equal(fly(jr700, plan, seed=3)[0].values, bare.values)
    open_plan = FlightPlan(excitation=Manoeuvre(nudge))
    assert "nudge" in str(open_plan)
    for write in (open_plan.to_dict, open_plan.to_toml, lambda: open_plan.digest):
        with pytest.raises(InputError, match="can't be written down: the plan's on"):
            write()
    assert "samples" in open_plan.on(jr700).to_toml()
    with pytest.raises(InputError, match=r"gave 0.0, expected 4 numbers, .* say which"):
        fly(jr700, lambda time: 0.0)


def test_no_file_names_a_function(jr700):
    """A plan or a record of someone else's starts no code: a function has to be given."""
    with pytest.raises(InputError, match=r"unknown kind of plan\.excitation 'Manoeuvre'"):
        FlightPlan.from_dict({"excitation": {"kind": "Manoeuvre", "function": "os:abort"}})


def test_a_class_with_a_wave_flies_everywhere(jr700):
    """One method is enough, and where it is added is a setting."""
    from dataclasses import dataclass

    @dataclass(frozen=True, kw_only=True)
    class Bump(Excitation):
        duration: float = 4.0
        height: float = 0.02

        def wave(self, time):
            return self.height * np.exp(-((time - 2.0) ** 2) / 0.02)

    for settings, channel in (
        ({"axis": "lat"}, "LAT"),
        ({"axis": "lat", "at": "actuators"}, "lat_disturbance"),
        ({"axis": "q", "at": "sensors"}, "q_disturbance"),
    ):
        plan = FlightPlan(excitation=Bump(**settings), recorder=TRUE, **STEADY)
        (record,) = fly(jr700, plan, seed=1)
        assert record[channel].max() == pytest.approx(0.02, rel=0.1)
        assert FlightPlan.of_record(record).excitation == plan.excitation


def columns(path, text):
    path.write_text(text)
    return path


def test_a_file_is_a_history(jr700, tmp_path):
    """Columns by their channels' names, units in brackets, times from the first one on."""
    path = columns(
        tmp_path / "steps.csv", "time [ms],LAT,PED [%]\n500,0,0\n1500,0.02,1\n3500,0.02,0\n"
    )
    made = History.read(path)
    assert (made.axis, made.duration, made.source) == ("lat+ped", 3.0, "steps.csv")
    assert made.table[0].tolist() == [0.0, 1.0, 3.0]
    assert made.table[1].tolist() == [[0.0, 0.0], [0.02, 0.01], [0.02, 0.0]]
    path = columns(tmp_path / "rates.csv", "t,p [deg/s]\n0,0\n2,57.29577951308232\n")
    assert History.read(path, at="sensors").table[1][1, 0] == pytest.approx(1.0, rel=1e-12)


def test_a_record_is_flown_again_as_a_history(jr700, tmp_path):
    """The recorded disturbance's columns of another flight, Parquet, of an axis that is named."""
    pulse = Pulse(axis="lat", amplitude=0.02, duration=4.0)
    (record,) = fly(jr700, FlightPlan(excitation=pulse, recorder=TRUE, **STEADY))
    write_record(record, tmp_path / "lat.parquet")
    with pytest.raises(InputError, match="say which are wanted with an axis"):
        History.read(tmp_path / "lat.parquet")
    made = History.read(tmp_path / "lat.parquet", axis="lat")
    assert np.array_equal(made.table[1][:, 0], record["LAT"])


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("LAT,PED\n0,0\n1,0\n", {}, "no column is the time: .*; it has LAT, PED"),
        ("time,LAT\n0,0\n1,0\n", {"axis": "ped"}, "no column PED; it has time, LAT"),
        ("time,LAT\n0,0\n1,0\n", {"axis": "yaw"}, "'yaw'; available: col, lon, lat, ped"),
        ("time,LAT\n0,0\n1,0\n", {"at": "tail"}, "'tail'; available: sticks, servos"),
        ("time,LAT,note\n0,0,1\n1,0,1\n", {}, "of its columns note none is added at sticks"),
        ("time,LAT\n0,0\n1,nan\n", {}, "lat is nan at 1 s"),
        ("time,LAT\n0,0\n0,1\n", {}, "must rise"),
        ("time,LAT [deg]\n0,0\n1,1\n", {}, "csv: channel 'LAT' is in 1, but the unit 'deg'"),
        ("time,LAT\n0,0\n2,0\n", {"duration": 3.0}, "shorter than the flight of 3 s"),
    ],
)
def test_a_file_that_is_no_history_is_one_line(tmp_path, text, options, message):
    """Which file, and what of it."""
    path = columns(tmp_path / "history.csv", text)
    with pytest.raises(InputError, match=message):
        History.read(path, **options)


def test_a_folder_of_flights_goes_on(jr700, tmp_path):
    """Flights of a composite are found again by their provenance; another amplitude is another."""
    from helisim.sim import fly_to

    made = Together(parts=(Step(axis="lat", duration=2.5), Step(axis="ped", duration=2.5)))
    first = fly_to(tmp_path, jr700, made, count=1)
    assert first.paths[0].name == "lat+ped_0001.parquet"
    assert fly_to(tmp_path, jr700, made, count=2).found == 1
    changed = Together(parts=(Step(axis="lat", duration=2.5, amplitude=0.01),
                              Step(axis="ped", duration=2.5)))  # fmt: skip
    with pytest.raises(InputError, match="another configuration"):
        fly_to(tmp_path, jr700, changed, count=1)


# A disturbance of attitude turns what a controller senses: the angle, and the rate with it


FAST = Recorder(noise={}, resolution={}, latency={}, antialias_hz=249.0, rate_hz=500.0)


class Blind:
    """Commands the trim whatever it sees, and remembers it."""

    def __init__(self, vehicle):
        trim = vehicle.trim
        self.commands = (*vehicle.swashplate.mix(trim.col, trim.lon, trim.lat), trim.ped)
        self.seen = []

    def __call__(self, seen):
        self.seen.append(seen)
        return self.commands

    def __deepcopy__(self, memo):
        return self


def seen_by_blind(vehicle, excitation):
    law = Blind(vehicle)
    fly(vehicle.with_controller(law), FlightPlan(excitation=excitation, **STEADY), jobs=1)
    return law.seen


def oscillation(axis, amplitude, frequency):
    return Manoeuvre(
        lambda time: amplitude * np.sin(frequency * time), axis=axis, at="sensors", duration=1.0
    )


@pytest.mark.parametrize(("angle", "rate"), [("phi", "p"), ("theta", "q"), ("psi", "r")])
def test_a_law_sees_the_angle_and_its_rate(jr700, angle, rate):
    """Of a law that answers nothing the flight is the same: what differs is what was added."""
    amplitude, frequency = 0.02, 40.0
    moved = seen_by_blind(jr700, oscillation(angle, amplitude, frequency))
    held = seen_by_blind(jr700, oscillation(angle, 1e-12, frequency))
    time = np.array([one.time for one in held])

    def added(name):
        return np.array([getattr(a, name) - getattr(b, name) for a, b in zip(moved, held)])

    assert added(angle) == pytest.approx(amplitude * np.sin(frequency * time), abs=1e-9)
    # the spline's own error in the interior: (0.08)^4 / 180 = 2e-7 of the rate; at the ends more
    wanted = amplitude * frequency * np.cos(frequency * time)
    assert added(rate)[20:-20] == pytest.approx(wanted[20:-20], abs=1e-6 * amplitude * frequency)
    others = {"p", "q", "r", "phi", "theta", "psi"} - {angle, rate}
    assert all(np.array_equal(added(name), np.zeros(time.size)) for name in others)


def test_a_heading_that_a_law_sees_stays_in_its_range(jr700):
    """In (-pi, pi], disturbed or not."""
    seen = seen_by_blind(jr700, oscillation("psi", 3.1, 9.0))
    psi = np.array([one.psi for one in seen])
    assert np.abs(psi).max() <= np.pi
    assert np.ptp(psi) > 6.0


def test_the_record_tells_the_disturbance_and_what_was_sensed(jr700):
    """Beside the angle the rate that comes of it, on top of a disturbance of the rate itself."""
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


def test_a_jump_of_attitude_is_refused(jr700):
    """Its rate is beyond any gyro's range; the message says where it comes from."""
    step = Step(axis="phi", at="sensors", amplitude=0.2)
    with pytest.raises(InputError, match="a disturbance of an attitude adds its own rate too"):
        fly(jr700, step, seed=1)


@pytest.mark.slow
def test_the_rejection_of_a_turn_is_the_gyros_sensitivity():
    """A gyro without attitude feeds back rates alone: psi_sum over psi_disturbance is 1 / (1 - L).

    Of the exact sampled loop. 0.01: the heading turns by r cos(phi) + q sin(phi), phi = 4 deg in
    the trim, which is 0.0035; the rest is what is nonlinear.
    """
    vehicle = load(parameters={"pilot.k_heading": 0.0})
    wave = Chirp(axis="psi", at="sensors", amplitude=0.002, band=(0.8, 60.0), duration=86.0)
    plan = FlightPlan(excitation=wave, pilot=Pilot(remnant=0.0), recorder=FAST)
    found = frequency_response(
        fly(vehicle, plan, seed=1), inputs="psi_disturbance", outputs="psi_sum", band=(5.0, 45.0)
    )
    loop = vehicle.loop("ped")
    exact = np.array([1.0 / (1.0 - loop(np.exp(1j * w * loop.dt))) for w in found.frequency])
    assert np.abs(found.response[0, 0] - exact).max() < 0.01
    assert np.abs(exact).max() > 1.1
