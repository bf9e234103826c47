"""The recorder: latency, noise, resolution, filter and lever arm, against what truly happened."""

import math

import mujoco
import numpy as np
import pytest

from helisim.physics.native import installed
from helisim.records import record as channels
from helisim.records.record import CHANNELS, IN2, OUT, SERVO_POSITIONS, SERVOS
from helisim.sim import Doublet, FlightPlan, Recorder, Sweep, fly
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


@pytest.mark.parametrize("name", [*IN2, *SERVOS, *OUT])
def test_latency_is_the_channels_own(name):
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
