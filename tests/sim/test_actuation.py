"""Three swashplate servos and the tail servo in flight: their limits, and what is recorded."""

import copy

import mujoco
import numpy as np
import pytest

from helisim.physics.layout import PARAM
from helisim.physics.native import installed
from helisim.records.channels import IN1, SERVOS
from helisim.sim import Doublet
from helisim.sim.fly import fly
from helisim.sim.plan import FlightPlan
from helisim.sim.recorder import Recorder
from helisim.vehicle.motion import addresses
from plates import H3_120

STEP = 0.002


@pytest.fixture
def commanded(jr700):
    """Return the four servos' positions in free flight, gyro off, after a command, (n, 4)."""

    def fly_it(commands, seconds):
        model = copy.copy(jr700.model)
        where = addresses(model)
        model.actuator_user[where.rotor, PARAM.gyro_on] = 0.0
        data = jr700.hovering()
        data.ctrl[where.control + 4 : where.control + 8] = commands
        positions = []
        with installed():
            for _ in range(round(seconds / STEP)):
                mujoco.mj_step(model, data)
                positions.append(data.sensor("servo_position").data.copy())
        return np.array(positions)

    return fly_it


def test_no_servo_is_faster_than_its_rate_limit(jr700, commanded):
    """Sent from the hover to full travel, all four run at the limit, 10 of unit travel a second."""
    positions = commanded([0.7, -0.7, 0.7, -0.7], 0.2)
    speed = np.abs(np.diff(positions, axis=0)) / STEP
    limit = jr700.parameters["servo.rate_limit"]
    # RK4 samples the limited speed inside a step: rounding only
    assert speed.max(axis=0) == pytest.approx([limit] * 4, rel=1e-9)
    running = np.count_nonzero(speed > 0.999 * limit, axis=0) * STEP
    # of 0.7 / 10 s = 70 ms, what speeding up and settling leave
    assert np.all(running > 0.04)
    assert np.abs(positions[-1]) == pytest.approx([0.7] * 4, abs=1e-3)  # 0.1 s of settling


def test_no_servo_goes_beyond_its_travel(jr700, commanded):
    """Commands beyond the travel, as collective and cyclic together may be, end at it."""
    travel = jr700.parameters["servo.travel"]
    positions = commanded([1.0, -1.0, 0.9, -0.9], 0.4)
    # the swashplate's servos, damping 0.7, overshoot by 4.6 %; the tail servo, 1.0, does not
    assert np.abs(positions[:, :3]).max() < 1.05 * travel
    assert np.abs(positions[:, 3]).max() <= travel * (1.0 + 1e-9)
    assert positions[-1] == pytest.approx(travel * np.array([1, -1, 1, -1]), abs=1e-3)


def test_a_limited_swashplate_moves_less_than_asked(commanded):
    """Full collective and full cyclic at once: the front servo stops, so the swashplate does."""
    asked = H3_120.mix(0.4, 0.5, 0.0)
    assert asked[0] == pytest.approx(0.9)
    positions = commanded([*asked, 0.0], 0.4)
    col, lon, lat = H3_120.unmix(*positions[-1, :3])
    # the front is 0.15 short: a third of it in collective, two thirds in longitudinal
    assert (col, lon, lat) == pytest.approx((0.4 - 0.05, 0.5 - 0.1, 0.0), abs=1e-3)


def test_four_servo_signals_are_recorded_and_give_in1(jr700):
    """Also where limits are met: IN1 is of the commands, as the paper recomputes it."""
    kept = Recorder(latency={}, antialias_hz=49.0)
    record = fly(
        jr700,
        FlightPlan(excitation=Doublet(axis="ped", amplitude=0.3, width=0.2), recorder=kept),
        jobs=1,
    )[0]
    assert set(SERVOS) <= set(record.names)
    front, left, right, tail = record.select(SERVOS).T
    recomputed = np.column_stack([*H3_120.unmix(front, left, right), tail])
    assert record.select(IN1) == pytest.approx(recomputed, abs=1e-15)  # rounding
    assert np.abs(record["ped"]).max() > 0.45  # the gyro's own limit of 0.5, filtered
