"""With all of tau_r_base inside the yaw gyro's loop the helicopter can't be flown.

Table 2's gains are possible only because most of the 50.5 ms between pedal and recorded yaw rate
is the recorder's. Here the gyro itself sees the rate that late, and has no lead.
"""

import mujoco
import numpy as np
import pytest
from scipy.optimize import least_squares

from helisim.physics.native import installed
from helisim.study.tune import margins
from helisim.vehicle import load

LATE = {"gyro.period": 0.001, "gyro.latency": 0.041, "gyro.lead": 0.0}
"""41 ms in the gyro, 0.5 ms of hold and 9 ms of servo: 50.5 ms."""


@pytest.fixture(scope="module")
def vehicle():
    return load(parameters=LATE, timestep=0.001)


@pytest.fixture(scope="module")
def growth(vehicle):
    """Unstable pole of the exact linear model, rad/s."""
    system = vehicle.linearize("IN2").system
    poles = system.poles()
    inside = np.log(poles[np.abs(poles) > 0.5].astype(complex)) / system.dt
    return max(inside, key=lambda pole: pole.real)


@pytest.fixture(scope="module")
def flight(vehicle):
    """4.5 s of a hover, kicked by a milliradian a second: time, r, tail servo command."""
    data = vehicle.hovering()
    data.qvel[5] += 1e-3
    rows = []
    with installed():
        for _ in range(4500):
            mujoco.mj_step(vehicle.model, data)
            rate, command = data.sensor("imu_gyro").data[2], data.sensor("servo_command").data[3]
            rows.append((data.time, rate, command))
    return np.array(rows).T


def test_the_whole_base_delay_is_in_this_loop(vehicle):
    """Servo, hold and latency are the paper's 50.5 ms, and the phase margin is negative."""
    total = vehicle.servo_delay("ped") + vehicle.parameters["gyro.latency"]
    assert total == pytest.approx(0.0505, abs=1e-12)
    assert margins(vehicle, "ped").phase_deg < -15.0  # as pure delays, by hand: -20


def test_the_linear_model_grows(growth):
    """The pole is that of first-order base, PI and 50.5 ms of delay, +4.1 +- 22.4j."""
    # 5 % of its size: a servo turns less than the delay it is equal to at low frequency
    assert abs(growth - (4.1 + 22.4j)) < 0.05 * 22.8


def test_a_small_disturbance_grows_as_the_pole_says(flight, growth):
    """While it is small, the nonlinear flight swings and grows by the unstable pole."""
    time, rate, command = flight
    small = (time > 0.4) & (time < 1.0)  # other modes have died, and limits are far
    assert np.abs(command[small]).max() < 0.05

    def left(x):
        swing = np.exp(np.outer(time[small], [complex(*x), complex(*x).conjugate()]))
        size, *_ = np.linalg.lstsq(swing, rate[small].astype(complex), rcond=None)
        return rate[small] - (swing @ size).real

    found = least_squares(left, [1.0, 20.0]).x
    # 0.4 % measured: the tail rotor's curvature at 0.06 rad/s
    assert found == pytest.approx([growth.real, growth.imag], rel=0.01)


def test_it_ends_in_a_limit_cycle_between_the_servos_limits(flight, growth):
    """The command runs from limit to limit, the rate stays finite and keeps its size."""
    time, rate, command = flight
    assert np.all(np.isfinite(rate))
    first, second = (np.abs(rate[(time > start) & (time <= start + 1.0)]) for start in (2.5, 3.5))
    assert second.max() == pytest.approx(first.max(), rel=0.02)  # 0.3 % measured
    assert first.max() > 1.5  # rad/s, from a milliradian a second
    last = time > 2.5
    assert command[last].max() == 0.5
    assert command[last].min() == -0.5
    crossings = time[last][np.flatnonzero(np.diff(np.sign(rate[last])) > 0.0)]
    omega = 2.0 * np.pi / np.mean(np.diff(crossings))
    # a saturated loop gains less, so it swings where the phase alone closes it: below the pole
    assert 0.8 * growth.imag < omega < growth.imag
