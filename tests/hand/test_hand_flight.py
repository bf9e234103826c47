"""Flights whose sticks a script moves: what they do, what is recorded, how they end."""

import math

import numpy as np
import pytest

from helisim.base.errors import IdentificationError, InputError
from helisim.hand import HandFlight
from helisim.ident import frequency_response
from helisim.records.storage import read_record, write_record
from helisim.sim import Weather
from helisim.vehicle import Controller, load


@pytest.fixture(scope="module")
def hovering(jr700):
    """One flight for tests that reset it."""
    return HandFlight(jr700)


def level_speed(flight):
    now = flight.motion
    return math.hypot(now.u, now.v)


@pytest.mark.parametrize("name", ["jr700", pytest.param("blade360", marks=pytest.mark.slow)])
def test_hover_assist_commands_velocities_and_a_turn(name):
    flight = HandFlight(load(name))
    start = flight.data.qpos[:3].copy()
    flight.fly(3.0)
    assert np.linalg.norm(flight.data.qpos[:3] - start) < 0.01
    flight.fly(4.0, lon=-0.5)
    assert flight.motion.u == pytest.approx(3.0, rel=0.15)  # the position loop lags
    flight.fly(4.0, lat=0.5)
    assert flight.motion.v == pytest.approx(3.0, rel=0.15)
    flight.fly(2.0, col=1.0)
    assert -flight.motion.w == pytest.approx(2.0, rel=0.3)  # drag on the way up
    before = flight.motion.psi
    flight.fly(1.0, ped=0.5)
    assert flight.motion.psi > before + 0.5
    flight.fly(5.0, ped=0.0)
    where, heading = flight.data.qpos[:3].copy(), flight.motion.psi
    assert level_speed(flight) < 0.1
    flight.fly(2.0)
    assert np.linalg.norm(flight.data.qpos[:3] - where) < 0.2
    assert flight.motion.psi == pytest.approx(heading, abs=0.02)


@pytest.mark.slow
def test_level_assist_commands_tilt(hovering, jr700):
    hovering.reset()
    hovering.assist = "level"
    hovering.fly(2.0, lon=-0.5)  # forward: backward the fin would turn it round
    assert hovering.motion.theta - jr700.trim.theta == pytest.approx(-0.225, abs=0.03)
    hovering.fly(2.0, lat=-0.5)
    assert hovering.motion.phi - jr700.trim.phi == pytest.approx(-0.225, abs=0.03)
    hovering.fly(2.0, col=0.0)
    assert hovering.motion.theta == pytest.approx(0.0, abs=0.02)


def test_without_assist_the_sticks_go_to_the_gyro(hovering):
    hovering.reset()
    hovering.assist = "none"
    hovering.fly(0.3, lat=0.2)
    np.testing.assert_allclose(hovering.sticks, [0.0, 0.0, 0.1, 0.0], atol=1e-12)
    assert hovering.motion.p == pytest.approx(0.1 * 5.99, rel=0.3)  # the gyro's p_per_lat
    tilt = hovering.motion.phi
    hovering.fly(0.5, lat=0.0)
    assert hovering.motion.phi > tilt


@pytest.mark.slow
def test_a_gentle_descent_lands_and_is_in_the_record(jr700):
    flight = HandFlight(jr700)
    flight.start_recording()
    flight.fly(7.0, col=-0.4)
    assert not flight.crashed
    assert flight.clearance == pytest.approx(0.0, abs=0.01)
    assert "touched the ground" in flight.stop_recording().ended
    flight.fly(2.0, col=0.5)
    assert flight.clearance > 0.5
    assert not flight.crashed


def test_a_hard_landing_is_a_crash_and_the_same_hand_flies_the_same_flight(jr700):
    flight = HandFlight(jr700, assist="level", height=3.0)
    flight.fly(5.0, col=-1.0)
    assert "hit the ground at" in flight.crashed
    end = flight.time
    assert end < 3.0
    flight.fly(1.0)
    assert flight.time == end
    flight.reset()
    flight.fly(1.0, col=0.0)
    assert not flight.crashed

    def flown():
        flight = HandFlight(jr700, weather=Weather(wind=5.0, turbulence="light"), seed=3)
        start = flight.data.qpos[:3].copy()
        flight.start_recording()
        flight.fly(3.0)
        assert np.linalg.norm(flight.data.qpos[:3] - start) < 1.0
        return flight.stop_recording()

    one, other = flown(), flown()
    np.testing.assert_array_equal(one.values, other.values)
    assert one.provenance == other.provenance
    assert one["phi"].std() > 0.0


def test_a_crash_is_in_the_record_and_the_identification_refuses_it(hovering):
    hovering.reset()
    hovering.assist = "none"
    hovering.start_recording()
    hovering.fly(5.0, lat=1.0)
    assert hovering.crashed == "the main rotor struck the ground"
    record = hovering.stop_recording()
    assert record.duration == pytest.approx(hovering.time, abs=0.02)
    assert "rolled or pitched beyond 1.2 rad" in record.ended
    with pytest.raises(IdentificationError, match="terminated early"):
        frequency_response([record], inputs=["LAT"], outputs=["p"], band=(3.0, 12.0))


def test_a_recording_is_a_flight_record(hovering, tmp_path):
    hovering.reset()
    hovering.assist = "hover"
    hovering.fly(1.0, col=0.0)
    hovering.start_recording()
    hovering.fly(2.0, ped=0.2)
    assert hovering.recorded == pytest.approx(2.0)
    hovering.assist = "level"
    hovering.fly(1.0, ped=0.0)
    record = hovering.stop_recording()
    assert hovering.recorded is None
    assert record.time[0] == 0.0
    assert record.duration == pytest.approx(3.0, abs=0.02)
    assert not record.ended
    middle = (record.time > 0.5) & (record.time < 1.9)
    np.testing.assert_allclose(record["PED"][middle], 0.1, atol=1e-3)
    assert np.median(record["r"][middle]) > 0.5
    by_hand = record.provenance["by_hand"]
    assert by_hand["with"] == "a program"
    assert by_hand["from_s"] == pytest.approx(1.0)
    assert by_hand["assist"] == [[0.0, "hover"], [pytest.approx(2.0), "level"]]
    path = write_record(record, tmp_path / "hand.parquet")
    assert read_record(path).provenance == record.provenance


def test_what_can_not_be_is_refused(hovering, jr700):
    hovering.reset()
    for do, says in (
        (lambda: hovering.fly(0.0), "time to fly"),
        (hovering.stop_recording, "no recording runs"),
        (lambda: (hovering.start_recording(), hovering.start_recording()), "runs already"),
        (hovering.stop_recording, "no record"),
    ):
        with pytest.raises(InputError, match=says):
            do()
    for wrong in ({"seed": -1}, {"height": 0.0}, {"assist": "yes"}):
        with pytest.raises(InputError):
            HandFlight(jr700, **wrong)


class Late:
    """A yaw law that fails after half a second of flight."""

    def __call__(self, seen, state):
        if seen.time > 0.5:
            raise ValueError("too late")
        return 0.3 * (2.7 * seen.PED - 0.3 * seen.r)


def test_a_controller_of_ones_own_flies_by_hand_and_may_fail(jr700):
    flight = HandFlight(jr700.with_controller(Controller(tail=Late())))
    flight.start_recording()
    flight.fly(0.4, ped=0.3)
    turning = flight.motion.r
    assert turning > 0.5
    flight.fly(2.0)
    assert flight.crashed == "controller 'Late' raised ValueError: too late"
    record = flight.stop_recording()
    assert "too late at 0.50 s" in record.ended
    assert 'raise ValueError("too late")' in record.provenance["ended"]["traceback"]
    flight.reset()
    flight.fly(0.4, ped=0.3)
    assert not flight.crashed
    assert flight.motion.r == turning
