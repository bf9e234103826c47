"""The ground rigs: they hold the vehicle as it is, and their records give its hidden numbers."""

import math

import mujoco
import numpy as np
import pytest

from helisim.base.errors import InputError, RecordError, UnknownNameError
from helisim.physics.layout import ACTUATORS
from helisim.physics.native import installed
from helisim.records import record as channels
from helisim.records.record import CHANNELS, IN2, OUT, SERVO_POSITIONS, SERVOS, FlightRecord
from helisim.sim import Doublet, FlightPlan, Recorder, Sweep, fly, rigs
from helisim.sim.flight import simulate
from helisim.sim.recorder import Trajectory, read_trajectory
from helisim.sim.rigs import bench_test, hang, hold, loop_gains, plumb_line, run_rigs
from helisim.vehicle import load
from helisim.vehicle.assembly import total_inertia
from helisim.vehicle.parameters import models_folder
from helisim.vehicle.trim import Motion, write_motion
from plates import H3_120

RIGS = ("bench", "suspension", "turntable")


@pytest.fixture(scope="module")
def ground(jr700):
    reported = []
    tests = run_rigs(jr700, seed=1, on_progress=reported.append)
    assert reported == [test.rig for test in tests]
    return {test.rig: test for test in tests}


def percent(finding):
    return 100.0 * abs(finding.error / finding.truth)


@pytest.mark.parametrize("rig", RIGS)
def test_a_rig_holds_the_vehicle_as_it_flies_in_stock_mujoco(rig, jr700):
    path = models_folder() / "jr700" / "rigs" / f"{rig}.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    first = min(k for k in range(model.nkey) if model.key(k).name != "hover")
    mujoco.mj_resetDataKeyframe(model, data, first)
    height = data.qpos[2]
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert not [warning.number for warning in data.warning if warning.number]
    # the welds give by well under a tenth of a millimetre under 78 N
    assert data.qpos[2] == pytest.approx(height, abs=1e-4)
    held = hold(jr700, rig).model
    flying = jr700.model
    assert held.body("jr700").subtreemass == pytest.approx(flying.body("jr700").subtreemass)
    # the same parts, summed: rounding of 0.4 kg m^2
    assert total_inertia(held, "jr700") == pytest.approx(total_inertia(flying, "jr700"), abs=1e-12)
    for name in ACTUATORS:
        assert held.actuator(name).user.tolist() == flying.actuator(name).user.tolist()
        assert held.jnt_bodyid[held.actuator(name).trnid[0]] == held.body("jr700").id


@pytest.mark.slow
def test_bench_and_turntable_give_the_controllers_gains(ground):
    found = ground["bench"]
    # 0.4 % measured; the resolution of the recorded servo is 2 % of the smallest jump
    assert percent(found["k_p"]) < 1.0
    # 0.01 % measured: a slope is an average of fifty samples and more
    assert percent(found["k_I"]) < 0.1
    assert percent(found["k_I / k_p"]) < 1.0
    # a twentieth of a sample: the edges of the steps fall between samples
    assert found["delay"].error == pytest.approx(0.0, abs=5e-4)
    found = ground["turntable"]
    assert percent(found["k_a"]) < 0.5  # 0.01 to 0.1 % over seeds 1 to 3
    assert percent(found["k_a by k_p"]) < 2.0  # 0.1 to 0.5 %; with the bench's error of k_p
    # the lead changes the gain by 7 % at the upper edge, of which 1 % of noise is seen
    assert percent(found["lead"]) < 5.0
    # its phase and the recorder's latency look alike: together they are seen ten times as well
    assert found["tau_r"].truth == 0.0405  # parameters.toml, recorder_latency.r
    assert found["tau_r"].error == pytest.approx(0.0, abs=3e-4)
    # a filter sampled every 2 ms answers like a continuous one that is 0.3 ms quicker
    assert found["lead_filter"].error == pytest.approx(0.0, abs=5e-4)
    assert found["lead_filter"].standard_error < 0.1e-3
    both = found["tau_r"].error + found["lead"].error
    assert both == pytest.approx(0.0, abs=2e-4)  # 0.03 to 0.13 ms over seeds 1 to 5


def made_up(gap, gain, ratio, delay, lead, lead_filter):
    time = np.arange(6000) * 0.01
    inside = np.clip((time - 5.0) / 50.0, 0.0, 1.0)
    angle = 2.0 * np.pi * (0.3 * 50.0 * inside + 2.5 * 50.0 * inside**2)
    rate = np.sin(angle) * np.sin(np.pi * inside) ** 2
    omega = 2.0 * np.pi * np.fft.rfftfreq(time.size, 0.01)
    s = 1j * np.where(omega > 0.0, omega, 1.0)
    response = gain * (1.0 + ratio / s) * (1.0 + lead * s / (1.0 + lead_filter * s))
    response = np.where(omega > 0.0, response * np.exp(-s * delay), 0.0)
    servo = np.fft.irfft(response * np.fft.rfft(rate), time.size)
    values = np.column_stack([rate + gap, servo])
    return FlightRecord(time, values, (CHANNELS["r"], CHANNELS["servo_tail"]))


def test_known_gains_come_back():
    record = made_up(0.0, -0.25, 20.0, -0.03, 0.01, 0.0015)
    asked = {"input": "r", "output": "servo_tail", "band": (3.0, 30.0)}
    found = loop_gains(record, **asked, noisy_input=True, lead=True)
    # what the record's ends cut off the loop's memory
    assert found.proportional == pytest.approx(-0.25, rel=1e-3)
    assert found.ratio == pytest.approx(20.0, rel=1e-3)
    assert found.delay == pytest.approx(-0.03, abs=2e-5)
    assert found.lead == pytest.approx(0.01, abs=2e-5)
    assert found.lead_filter == pytest.approx(0.0015, abs=5e-5)


def test_a_band_or_channel_that_tells_nothing_is_refused():
    record = made_up(0.0, -0.25, 20.0, 0.0, 0.0, 0.0)
    for band in ((3.0, 400.0), (3.0, 3.01)):
        with pytest.raises(InputError, match="resolves"):
            loop_gains(record, input="r", output="servo_tail", band=band)
    still = FlightRecord(record.time, record.values * [1.0, 0.0], record.channels)
    with pytest.raises(RecordError, match="'servo_tail' does not move"):
        loop_gains(still, input="r", output="servo_tail", band=(3.0, 30.0))


@pytest.mark.slow
def test_the_suspension_finds_the_centre_of_gravity(jr700):
    found = rigs.suspension_test(jr700, seed=1)
    assert found["cg distance"].value < 1e-3
    for axis in "xyz":
        one = found[f"imu_{axis}"]
        assert abs(one.error) < 1e-3
        assert abs(one.error) < 4.0 * one.standard_error  # over seeds 1 to 4 at most 1.9 of them
        # 2 mrad of white noise over the root of 1000 samples, times 0.6 m: 20 to 40 micrometres
        assert 5e-6 < one.standard_error < 5e-5
    assert found["imu_x"].truth == pytest.approx(0.08)  # jr700.xml: site imu, FRD
    assert found["imu_z"].truth == pytest.approx(0.12)


@pytest.mark.slow
def test_a_centre_of_gravity_elsewhere_is_found_there(jr700):
    held = hold(jr700, "suspension")
    held.model.body_ipos[held.model.body("jr700").id] += [0.02, -0.01, 0.015]
    lines = [plumb_line(hang(held, name), at) for name, at in rigs.suspension_points(held).items()]
    # MuJoCo's left and up are the airframe's minus right and minus down
    assert rigs.centre_of_gravity(lines) == pytest.approx([0.02, 0.01, -0.015], abs=1e-3)


def test_what_a_rig_can_not_measure_is_refused(jr700):
    held = hold(jr700, "suspension")
    record = hang(held, "frame", duration=6.0)
    with pytest.raises(RecordError, match="still moves"):
        plumb_line(record, rigs.suspension_points(held)["frame"])
    line = rigs.PlumbLine(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    beside = rigs.PlumbLine(np.array([0.1, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    with pytest.raises(InputError, match="two plumb lines"):
        rigs.centre_of_gravity([line])
    with pytest.raises(InputError, match="another point"):
        rigs.centre_of_gravity([line, beside])
    with pytest.raises(UnknownNameError, match="point 'tail'; available: mast, frame"):
        hang(held, "tail")
    with pytest.raises(RecordError, match="limit"):
        bench_test(load(parameters={"gyro.k_delta": 10.0}))


def test_a_record_says_where_it_comes_from(jr700):
    held = hold(jr700, "bench")
    moved = {"test": rigs.pedal_steps, "duration": 5.0}
    first, again, other = (rigs.drive(held, "PED", seed=seed, **moved) for seed in (4, 4, 5))
    assert first.provenance["rig"] == "bench"
    assert first.provenance["test"] == {"moves": "PED", "duration": 5.0}
    assert np.array_equal(first.values, again.values)
    assert not np.array_equal(first.values, other.values)
    with pytest.raises(InputError, match="seed"):
        rigs.drive(held, "PED", seed=-1, **moved)


# The recorder: latency, noise, resolution, filter and lever arm, against what truly happened.

STEP = 0.002
WIDE = {"rate_hz": 1000.0, "antialias_hz": 400.0}
"""Twice the simulation's rate and a filter beyond it: every second sample is the truth's own."""
PLAIN = {"latency": {}, "noise": {}, "resolution": {}}
FRD = np.array([1.0, -1.0, -1.0])
OMEGA = 3.0


def wave(width, seconds=10.0):
    time = np.arange(round(seconds / STEP) + 1) * STEP
    return np.sin(OMEGA * time)[:, None] * (0.1 + 0.01 * np.arange(width))


def artificial(**changes):
    time = np.arange(5001) * STEP
    widths = dict.fromkeys(("sticks", "servo_commands", "servo_positions", "power"), 4)
    widths |= {"flapping": 2, "rotor": 5, "air": 6, "contact": 3, "rates": 3, "gyro_rates": 3}
    widths |= dict.fromkeys(("attitudes", "velocities", "specific_forces", "positions"), 3)
    signals = {name: wave(width) for name, width in widths.items()}
    known = {"imu_offset": np.zeros(3), "swashplate": H3_120}
    return Trajectory(time=time, timestep=STEP, **known, **{**signals, **changes})


def record(truth, seed=0, **settings):
    return Recorder(**settings).record(truth, np.random.default_rng(seed), {})


@pytest.fixture(scope="module")
def tumbling(jr700):
    model = jr700.model
    data = jr700.hovering()
    write_motion(model, data, Motion(p=0.8, q=-0.5, r=0.7, u=0.5, phi=jr700.trim.phi, down=-10.0))
    sensors, motion = [], []
    matrix = np.zeros(9)
    with installed():
        for _ in range(1001):
            mujoco.mju_quat2Mat(matrix, data.qpos[3:7])
            body = matrix.reshape(3, 3).copy()
            velocity, position = data.qvel[:3].copy(), data.qpos[:3].copy()
            mujoco.mj_step(model, data)
            sensors.append(data.sensordata.copy())
            motion.append([body, velocity, position])
    truth = read_trajectory(jr700, np.array(sensors))
    bodies, velocities, positions = (np.array(column) for column in zip(*motion))
    return truth, bodies, velocities, positions


def in_body(bodies, vectors):
    return np.einsum("nij,ni->nj", bodies, vectors) * FRD


def test_what_the_imu_measures_is_corrected_to_the_centre_of_gravity(tumbling):
    """Velocities lose omega x r, forces their kin; an arm that is off leaves omega x that."""
    truth, bodies, velocities, positions = tumbling
    right = record(truth, **WIDE, **PLAIN)
    wanted = in_body(bodies, velocities)
    # exact kinematics: rounding
    assert right.select(channels.VELOCITIES)[::2] == pytest.approx(wanted, abs=1e-12)
    assert right.select(channels.POSITIONS)[::2] == pytest.approx(positions * FRD, abs=1e-12)
    seen = right.select(channels.ACCELERATIONS)[::2]
    # the specific force loses d(omega)/dt x r and omega x (omega x r) on the way there
    rate = np.gradient(velocities, STEP, axis=0)
    wanted = in_body(bodies, rate + np.array([0.0, 0.0, 9.8015]))
    inner = slice(60, -2)
    # both sides differentiate by central differences: h^2/6 of a third derivative. With modes
    # of 27 rad/s and 3 m/s^2 that is 27^2 x 3 h^2/6 = 1.5e-3
    assert seen[inner] == pytest.approx(wanted[inner], abs=2e-3)
    off = np.array([0.01, -0.02, 0.03])
    measured = record(truth, **WIDE, **PLAIN, lever_arm=tuple(truth.imu_offset + off))
    left = np.cross(right.select(channels.RATES), off)
    shift = right.select(channels.VELOCITIES) - measured.select(channels.VELOCITIES)
    assert shift == pytest.approx(left, abs=1e-13)  # rounding
    assert np.abs(left).max() > 0.01


@pytest.fixture(scope="module")
def plain():
    return record(artificial(), **WIDE, **PLAIN)


@pytest.mark.parametrize("name", [*IN2, *SERVOS, *OUT])
def test_latency_is_the_channels_own(name, plain):
    latency = 0.0405
    seen = record(artificial(), **WIDE, **{**PLAIN, "latency": {name: latency}})
    late = np.interp(plain.time - latency, plain.time, plain[name])
    settled = plain.time > latency
    # linear interpolation of a sine of 3 rad/s between samples 2 ms apart: h^2/8 w^2 = 5e-6
    assert np.abs(seen[name] - late)[settled].max() < 5e-6
    assert np.abs(seen[name] - plain[name]).max() > 0.005
    for other in (*IN2, *SERVOS, *OUT):
        if other != name:
            assert np.array_equal(seen[other], plain[other])


@pytest.mark.parametrize("name", ["p", "phi", "u", "ax", "down", "LAT", "servo_tail"])
def test_noise_has_its_level(name):
    level = 0.03
    seen = record(artificial(), seed=3, **WIDE, **{**PLAIN, "noise": {name: level}})
    plain = record(artificial(), **WIDE, **PLAIN)
    noise = (seen[name] - plain[name])[1:]
    count = noise.size
    # 4.5 standard errors
    assert abs(noise.mean()) < 4.5 * level / math.sqrt(count)
    assert abs(noise.std() / level - 1.0) < 4.5 / math.sqrt(2.0 * count)
    assert abs(np.mean(noise[1:] * noise[:-1])) < 4.5 * level**2 / math.sqrt(count)


def test_antialias_filter_is_common_to_all_channels():
    seen = record(artificial(), **PLAIN)
    time = seen.time
    settled = time > 1.0
    late = {}
    for name in ("LAT", "servo_tail", "p", "phi", "u", "ax", "down", "ped"):
        basis = np.column_stack([np.sin(OMEGA * time), np.cos(OMEGA * time)])[settled]
        (real, imaginary), *_ = np.linalg.lstsq(basis, seen[name][settled], rcond=None)
        late[name] = -math.atan2(imaginary, real) / OMEGA
    # Butterworth of order four at 40 Hz: 2.613 / (2 pi 40) s, bilinear at 500 Hz a little more
    assert late["p"] == pytest.approx(2.6131 / (2.0 * math.pi * 40.0), rel=0.05)
    assert list(late.values()) == pytest.approx([late["p"]] * len(late), abs=1e-9)


@pytest.mark.slow
def test_rotor_speed_is_recorded_where_it_moves_and_servo_positions_on_request(jr700):
    vehicle = load("jr700", parameters={"drive.governor": "motor"})
    doublet = Doublet(axis="col", amplitude=0.05)
    (moved,) = fly(vehicle, doublet, seed=1)
    assert CHANNELS["rotor_speed"] in moved.channels
    off = moved["rotor_speed"] / vehicle.parameters["main_rotor.speed"] - 1.0
    assert abs(off[0]) < 1e-3
    assert 1e-4 < abs(off).max() < 1e-2
    (kept,) = fly(jr700, doublet, seed=1)
    assert "rotor_speed" not in kept
    plan = FlightPlan(excitation=SHORT, recorder=Recorder(**QUIET, rotor=True))
    (flown,) = fly(jr700, plan, seed=3)
    truth = next(simulate(jr700, plan, seed=3))
    assert flown.select(SERVO_POSITIONS)[::2] == pytest.approx(truth.servo_positions, abs=CLOCK)
    assert np.abs(truth.servo_positions - truth.servo_commands).max() > 1e-3
    (usual,) = fly(jr700, SHORT, seed=3)
    assert not set(SERVO_POSITIONS) & set(usual.names)


# A sensor channel more: its line among the channels, and its line in the recorder's table

SHORT = Sweep(axis="lon", duration=20.0)
QUIET = {"antialias_hz": 400.0, "rate_hz": 1000.0, "latency": {}, "noise": {}, "resolution": {}}
CLOCK = 1e-9
"""MuJoCo's added-up time is 1e-12 s off the recorder's in 20 s, of signals below 100 units/s."""
