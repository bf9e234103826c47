"""The recorder: latency, noise, resolution, filter and lever arm, against what truly happened."""

import dataclasses
import math

import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident import frequency_response
from helisim.physics.native import installed
from helisim.records.record import (
    ACCELERATIONS,
    ATTITUDES,
    CHANNELS,
    IN1,
    IN2,
    OUT,
    POSITIONS,
    RATES,
    SERVO_POSITIONS,
    SERVOS,
    VELOCITIES,
    Channel,
    FlightRecord,
)
from helisim.records.storage import read_record, write_record
from helisim.show.recording import write_recording
from helisim.sim import (
    Doublet,
    FlightEnvelope,
    FlightPlan,
    Recorder,
    Sweep,
    Weather,
    fly,
    fly_all,
    recorder,
)
from helisim.sim.flight import simulate
from helisim.sim.recorder import Trajectory, read_trajectory
from helisim.vehicle import load
from helisim.vehicle.trim import Motion, write_motion
from plates import H3_120

STEP = 0.002
WIDE = {"rate_hz": 1000.0, "antialias_hz": 400.0}
"""Twice the simulation's rate and a filter beyond it: every second sample is the truth's own."""
PLAIN = {"latency": {}, "noise": {}, "resolution": {}}
FRD = np.array([1.0, -1.0, -1.0])
OMEGA = 3.0


def wave(width, seconds=10.0):
    """Return sines of 3 rad/s, each column with an amplitude of its own."""
    time = np.arange(round(seconds / STEP) + 1) * STEP
    return np.sin(OMEGA * time)[:, None] * (0.1 + 0.01 * np.arange(width))


def artificial(**changes):
    """Return a made-up flight whose every signal is a known sine."""
    time = np.arange(5001) * STEP
    truth = Trajectory(
        time=time,
        timestep=STEP,
        sticks=wave(4),
        servo_commands=wave(4),
        servo_positions=wave(4),
        flapping=wave(2),
        rotor=wave(5),
        power=wave(4),
        air=wave(6),
        contact=wave(3),
        rates=wave(3),
        attitudes=wave(3),
        velocities=wave(3),
        specific_forces=wave(3),
        positions=wave(3),
        imu_offset=np.zeros(3),
        swashplate=H3_120,
        gyro_rates=wave(3),
    )
    return dataclasses.replace(truth, **changes)


def record(truth, seed=0, **settings):
    return Recorder(**settings).record(truth, np.random.default_rng(seed), {})


@pytest.fixture(scope="module")
def tumbling(jr700):
    """A lively flight: its truth, and the centre of gravity's own motion from the state."""
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


def test_corrected_velocity_is_the_centre_of_gravitys(tumbling):
    """Measured at the IMU and corrected by omega x r, u v w are those of the CG."""
    truth, bodies, velocities, positions = tumbling
    seen = record(truth, **WIDE, **PLAIN)
    wanted = in_body(bodies, velocities)
    # exact kinematics: rounding
    assert seen.select(VELOCITIES)[::2] == pytest.approx(wanted, abs=1e-12)
    assert seen.select(POSITIONS)[::2] == pytest.approx(positions * FRD, abs=1e-12)


def test_corrected_force_is_the_centre_of_gravitys(tumbling):
    """The specific force loses d(omega)/dt x r and omega x (omega x r) on the way to the CG."""
    truth, bodies, velocities, _ = tumbling
    seen = record(truth, **WIDE, **PLAIN).select(ACCELERATIONS)[::2]
    rate = np.gradient(velocities, STEP, axis=0)
    wanted = in_body(bodies, rate + np.array([0.0, 0.0, 9.8015]))
    inner = slice(60, -2)
    # both sides differentiate by central differences: h^2/6 of a third derivative. With modes
    # of 27 rad/s and 3 m/s^2 that is 27^2 x 3 h^2/6 = 1.5e-3
    assert seen[inner] == pytest.approx(wanted[inner], abs=2e-3)


def test_uncorrected_differs_by_omega_cross_r(tumbling):
    """Left at the IMU, velocity and force are larger by exactly the kinematic terms."""
    truth, _, _, _ = tumbling
    at_cg = record(truth, **WIDE, **PLAIN)
    at_imu = record(truth, **WIDE, **PLAIN, lever_arm_corrected=False)
    rates, arm = at_imu.select(RATES), truth.imu_offset
    turning = np.cross(rates, arm)
    # rounding
    assert at_imu.select(VELOCITIES) - at_cg.select(VELOCITIES) == pytest.approx(turning, abs=1e-13)
    spin = np.gradient(rates, at_imu.time, axis=0)
    extra = np.cross(spin, arm) + np.cross(rates, turning)
    shift = at_imu.select(ACCELERATIONS) - at_cg.select(ACCELERATIONS)
    assert shift == pytest.approx(extra, abs=1e-12)
    assert np.abs(turning).max() > 0.05  # it matters
    assert np.array_equal(at_imu.select(ATTITUDES), at_cg.select(ATTITUDES))


def test_a_lever_arm_that_was_measured_is_what_corrects(tumbling):
    """An arm that is off by so much leaves omega x that in the velocity."""
    truth, _, _, _ = tumbling
    off = np.array([0.01, -0.02, 0.03])
    right = record(truth, **WIDE, **PLAIN)
    measured = record(truth, **WIDE, **PLAIN, lever_arm=tuple(truth.imu_offset + off))
    left = np.cross(right.select(RATES), off)
    shift = right.select(VELOCITIES) - measured.select(VELOCITIES)
    assert shift == pytest.approx(left, abs=1e-13)  # rounding
    assert np.abs(left).max() > 0.01
    with pytest.raises(InputError, match=r"lever_arm.* must be a"):
        Recorder(lever_arm=(0.1, np.nan, 0.0))


def test_imu_stands_where_the_mjcf_puts_it(jr700):
    """The site is at (0.08, 0.01, -0.12) forward-left-up: right and down change sign."""
    # the CG is the body's origin to a micrometre
    assert jr700.imu_offset == pytest.approx([0.08, -0.01, 0.12], abs=1e-6)


def test_truth_is_stamped_with_its_own_time(jr700):
    """Sensors belong to the time before the step: clock and attitude start at the start."""
    excitation = Sweep(axis="lat", duration=4.0, trim_time=1.0)
    truth = next(simulate(jr700, excitation, jobs=1))
    assert truth.time[0] == 0.0
    assert truth.time.size == 2001
    assert truth.attitudes[0, 0] == pytest.approx(jr700.trim.phi, abs=1e-12)
    # angles and rates belong together: central difference of phi is p + tan(theta)(...)
    phi_rate = np.gradient(truth.attitudes[:, 0], truth.timestep)
    p, q, r = truth.rates.T
    phi, theta, _ = truth.attitudes.T
    euler = p + (q * np.sin(phi) + r * np.cos(phi)) * np.tan(theta)
    # h^2/6 x 45^2 rad^2/s^2 of a rate of 0.5 rad/s: 7e-4; a step of skew would give 4e-2
    assert phi_rate[1:-1] == pytest.approx(euler[1:-1], abs=2e-3)


@pytest.mark.parametrize("name", [*IN2, *SERVOS, *OUT])
def test_latency_is_the_channels_own(name):
    """A channel is late by its latency, and no other channel is."""
    latency = 0.0405
    seen = record(artificial(), **WIDE, **{**PLAIN, "latency": {name: latency}})
    plain = record(artificial(), **WIDE, **PLAIN)
    late = np.interp(plain.time - latency, plain.time, plain[name])
    settled = plain.time > latency
    # linear interpolation of a sine of 3 rad/s between samples 2 ms apart: h^2/8 w^2 = 5e-6
    assert seen[name][settled] == pytest.approx(late[settled], abs=5e-6)
    assert np.abs(seen[name] - plain[name]).max() > 0.005
    for other in (*IN2, *SERVOS, *OUT):
        if other != name:
            assert np.array_equal(seen[other], plain[other])


def test_default_latencies_are_the_designs():
    """R is 40.5 ms late (design, section 5), and lon late enough to lead its input by 8.3 ms."""
    latency = Recorder.of(load()).latency
    servo_ms, tail_ms = 0.008, 0.010
    assert latency["r"] == pytest.approx(0.0505 - tail_ms, abs=1e-12)  # Table 2, tau_r_base
    tau_lat = servo_ms + latency["p"]
    tau_lon = servo_ms + latency["q"] - latency["lon"]
    assert tau_lat == pytest.approx(0.0115, abs=1e-12)  # Table 3
    assert tau_lon == pytest.approx(-0.0083, abs=1e-12)  # Table 3


def test_default_latencies_reach_the_record():
    """With the default recorder's latencies, p, r and lon are late by their own."""
    plain = record(artificial(), **WIDE, **PLAIN)
    seen = record(artificial(), **WIDE, **PLAIN | {"latency": Recorder.of(load()).latency})
    for name, latency in (("p", 0.0035), ("q", 0.0035), ("r", 0.0405), ("lon", 0.0198)):
        late = np.interp(plain.time - latency, plain.time, plain[name])
        settled = plain.time > latency
        assert seen[name][settled] == pytest.approx(late[settled], abs=5e-6)  # as above
    for name in ("col", "lat", "ped", "COL", "servo_front", "phi", "u"):
        assert np.array_equal(seen[name], plain[name])


def test_in1_is_recomputed_from_the_servos(jr700):
    """IN1 is what the inverse of the mixing makes of the recorded servo signals."""
    flown = fly(
        jr700,
        FlightPlan(
            excitation=Sweep(axis="lat", duration=6.0, trim_time=1.0), recorder=Recorder(latency={})
        ),
        jobs=1,
    )[0]
    front, left, right, tail = flown.select(SERVOS).T
    recomputed = np.column_stack([*H3_120.unmix(front, left, right), tail])
    # to rounding, resolution included
    assert flown.select(IN1) == pytest.approx(recomputed, abs=1e-15)
    assert np.ptp(flown["lat"]) > 0.01


@pytest.mark.parametrize("name", [*IN2, *SERVOS, "p", "phi", "u", "az", "north"])
def test_resolution_makes_steps(name):
    """A channel with a resolution holds whole steps only, within half a step of the signal."""
    step = 0.004
    seen = record(artificial(), **WIDE, **{**PLAIN, "resolution": {name: step}})[name]
    plain = record(artificial(), **WIDE, **PLAIN)[name]
    steps = seen / step
    assert steps == pytest.approx(np.round(steps), abs=1e-9)  # rounding of a quotient of 50
    assert np.abs(seen - plain).max() <= 0.5 * step * (1.0 + 1e-9)


@pytest.mark.parametrize("name", ["p", "phi", "u", "ax", "down", "LAT", "servo_tail"])
def test_noise_has_its_level(name):
    """The noise of a channel has zero mean and the standard deviation asked for."""
    level = 0.03
    seen = record(artificial(), seed=3, **WIDE, **{**PLAIN, "noise": {name: level}})
    plain = record(artificial(), **WIDE, **PLAIN)
    noise = (seen[name] - plain[name])[1:]
    count = noise.size
    # 4.5 standard errors
    assert abs(noise.mean()) < 4.5 * level / math.sqrt(count)
    assert abs(noise.std() / level - 1.0) < 4.5 / math.sqrt(2.0 * count)
    assert abs(np.mean(noise[1:] * noise[:-1])) < 4.5 * level**2 / math.sqrt(count)


def test_servo_noise_is_in_in1():
    """IN1 is recomputed from the recorded servo signals, with the noise that they have."""
    seen = record(artificial(), **WIDE, **{**PLAIN, "noise": dict.fromkeys(SERVOS, 0.01)})
    front, left, right, tail = seen.select(SERVOS).T
    recomputed = np.column_stack([*H3_120.unmix(front, left, right), tail])
    assert np.array_equal(seen.select(IN1), recomputed)


def test_noise_is_independent_and_repeats_with_its_seed():
    """Channels have noise of their own, and a seed gives the same record again."""
    noisy = {**PLAIN, "noise": dict.fromkeys(RATES, 0.01)}
    one, again, other = (record(artificial(), seed=s, **WIDE, **noisy) for s in (1, 1, 2))
    plain = record(artificial(), **WIDE, **PLAIN)
    assert np.array_equal(one.values, again.values)
    noise = one.select(RATES) - plain.select(RATES)
    correlation = np.corrcoef([*noise.T, other["p"] - plain["p"]])
    # 4.5 / sqrt(n)
    assert np.abs(correlation - np.eye(4)).max() < 4.5 / math.sqrt(noise.shape[0])


def test_antialias_filter_is_common_to_all_channels():
    """Every channel passes the same filter, so no channel is skewed against another."""
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


def test_unknown_channel_is_refused():
    """A setting for a channel that does not exist names those that do."""
    with pytest.raises(UnknownNameError, match="unknown channel 'roll'") as refused:
        Recorder(latency={"roll": 0.01})
    assert "servo_front" in refused.value.available


def test_settings_are_read_only():
    """A recorder does not change after it was made, nor with the dict it was made from."""
    given = {"p": 0.01}
    recorder = Recorder(latency=given)
    given["p"] = 1.0
    assert recorder.latency["p"] == 0.01
    with pytest.raises(TypeError):
        recorder.latency["p"] = 1.0
    assert set(recorder.to_dict()["latency"]) <= set(CHANNELS)


def test_rotor_speed_is_recorded_where_it_moves(jr700):
    """A flight computer counts the rotor's turns; an ideal governor leaves it nothing to record."""
    vehicle = load("jr700", parameters={"drive.governor": "motor"})
    doublet = Doublet(axis="col", amplitude=0.05)
    (moved,) = fly(vehicle, doublet, seed=1)
    assert CHANNELS["rotor_speed"] in moved.channels
    off = moved["rotor_speed"] / vehicle.parameters["main_rotor.speed"] - 1.0
    assert abs(off[0]) < 1e-3
    assert 1e-4 < abs(off).max() < 1e-2
    (kept,) = fly(jr700, doublet, seed=1)
    assert "rotor_speed" not in kept


# A sensor channel more: its line among the channels, and its line in the recorder's table


SHORT = Sweep(axis="lon", duration=20.0)
WINDY = Weather(wind=4.0)
QUIET = {"antialias_hz": 400.0, "rate_hz": 1000.0, "latency": {}, "noise": {}, "resolution": {}}
CLOCK = 1e-9
"""MuJoCo's added-up time is 1e-12 s off the recorder's in 20 s, of signals below 100 units/s."""


@pytest.fixture
def pitot(monkeypatch):
    """The two edits of docs/extend/channel.md: a pitot tube that looks ahead."""
    one = Channel("airspeed", "m/s", "OTHER", "forward speed through the air, of a pitot tube")
    monkeypatch.setitem(CHANNELS, "airspeed", one)
    monkeypatch.setitem(
        recorder._MEASURED,
        ("airspeed",),
        lambda flight: flight.velocities[:, :1] - flight.air[:, :1],
    )
    return one


def windy(**settings):
    return FlightPlan(excitation=SHORT, recorder=Recorder(**settings), weather=WINDY)


def test_it_is_recorded_and_leaves_the_others_as_they_are(jr700, pitot, monkeypatch):
    """Every other channel has the same bits, noise included."""
    (with_it,) = fly(jr700, windy(), seed=3)
    monkeypatch.delitem(recorder._MEASURED, ("airspeed",))
    (without,) = fly(jr700, windy(), seed=3)
    assert with_it.names == (*without.names, "airspeed")
    assert np.array_equal(with_it.select(without.names), without.values)
    assert with_it.channels[-1] == pitot
    assert with_it["airspeed"].mean() == pytest.approx(4.0, abs=0.5)  # it sways in the sweep


def test_it_has_its_own_latency_noise_and_resolution(jr700, pitot):
    """Named in the recorder's settings as any other."""
    trajectory = next(simulate(jr700, windy(), seed=3))

    def seen(**settings):
        one = Recorder(**{**QUIET, **settings})
        return one.record(trajectory, np.random.default_rng(1), {})["airspeed"]

    true = (trajectory.velocities - trajectory.air[:, :3])[:, 0]
    assert seen()[::2] == pytest.approx(true, abs=CLOCK)
    late = np.interp(trajectory.time - 0.1, trajectory.time, true)
    assert seen(latency={"airspeed": 0.1})[::2] == pytest.approx(late, abs=CLOCK)
    noise = seen(noise={"airspeed": 0.3}) - seen()
    assert abs(noise.std() / 0.3 - 1.0) < 4.5 / np.sqrt(2.0 * noise.size)  # 4.5 standard errors
    assert set(np.round(seen(resolution={"airspeed": 0.25}) / 0.25, 9) % 1.0) == {0.0}


def test_what_reads_records_takes_it(jr700, pitot, tmp_path):
    """Files, the last second, frequency responses and recordings."""
    (flown,) = fly(jr700, windy(), seed=3)
    for name in ("flown.parquet", "flown.csv"):
        write_record(flown, tmp_path / name)
        assert np.array_equal(read_record(tmp_path / name)["airspeed"], flown["airspeed"])
    asked = {"inputs": "LON", "outputs": "q", "band": (3.0, 20.0)}
    rest = tuple(one for one in flown.channels if one != pitot)
    values = flown.select([one.name for one in rest])
    without = FlightRecord(flown.time, values, rest, flown.provenance)
    found = frequency_response(flown, **asked)
    assert np.array_equal(found.response, frequency_response(without, **asked).response)
    of_it = frequency_response(flown, inputs="LON", outputs="airspeed", band=(3.0, 20.0))
    assert np.isfinite(of_it.response).all()
    path = write_recording(tmp_path / "flown.rrd", {"lon": flown}, model=jr700.model)
    batches = [chunk.to_record_batch() for chunk in RrdReader(path).stream()]
    labels = [
        one.column("SeriesLines:names")
        for one in batches
        if "SeriesLines:names" in one.schema.names
    ]
    assert "airspeed [m/s]" in str(labels)
    tight = dataclasses.replace(windy(), envelope=FlightEnvelope(tilt=0.1))
    last = next(fly_all(jr700, tight, [0], seed=3)).last_second
    assert "airspeed" in last.names


def test_servo_positions_are_recorded_on_request(jr700):
    """What the servos truly did, late on what they were told; beside the rotor's truth."""
    plan = FlightPlan(excitation=SHORT, recorder=Recorder(**QUIET, rotor=True))
    (flown,) = fly(jr700, plan, seed=3)
    truth = next(simulate(jr700, plan, seed=3))
    assert flown.select(SERVO_POSITIONS)[::2] == pytest.approx(truth.servo_positions, abs=CLOCK)
    assert np.abs(truth.servo_positions - truth.servo_commands).max() > 1e-3
    (usual,) = fly(jr700, SHORT, seed=3)
    assert not set(SERVO_POSITIONS) & set(usual.names)
