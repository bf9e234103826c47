"""Flights whose sticks a script moves: what they do, what is recorded, how they end."""

import copy
import math
import pickle

import numpy as np
import pytest

from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.hand import HandFlight, StickFeel
from helisim.ident import frequency_response
from helisim.records.storage import read_record, write_record
from helisim.sim import Weather
from helisim.vehicle import Controller, load

VEHICLES = ("jr700", "blade360")


@pytest.fixture(scope="module", params=VEHICLES)
def vehicle(request):
    return load(request.param)


@pytest.fixture(scope="module")
def hovering(jr700):
    """One flight for tests that reset it."""
    return HandFlight(jr700)


def level_speed(flight):
    now = flight.motion
    return math.hypot(now.u, now.v)


def test_whoever_lets_go_of_the_sticks_hovers(vehicle):
    """Ten seconds without a hand: within a centimetre."""
    flight = HandFlight(vehicle)
    start = flight.data.qpos[:3].copy()
    flight.fly(10.0)
    assert np.linalg.norm(flight.data.qpos[:3] - start) < 0.01
    assert not flight.crashed


def test_hover_assist_commands_velocities(vehicle):
    """Half a stick is half of 6 m/s, forward or to the right; let go, it stops and stays."""
    flight = HandFlight(vehicle)
    flight.fly(5.0, lon=-0.5)
    assert flight.motion.u == pytest.approx(3.0, rel=0.15)  # the position loop lags
    flight.fly(5.0, lat=0.5)
    assert flight.motion.v == pytest.approx(3.0, rel=0.15)
    flight.fly(8.0, col=0.0)
    where = flight.data.qpos[:2].copy()
    assert level_speed(flight) < 0.1
    flight.fly(5.0)
    assert np.linalg.norm(flight.data.qpos[:2] - where) < 0.2


def test_hover_assist_climbs_and_turns(vehicle):
    """Full collective is 2 m/s; the nose goes where the pedals say, and stays there."""
    flight = HandFlight(vehicle)
    flight.fly(3.0, col=1.0)
    assert -flight.motion.w == pytest.approx(2.0, rel=0.3)  # drag on the way up
    flight.fly(4.0, col=0.0)
    height = flight.data.qpos[2]
    flight.fly(1.0, ped=0.5)
    assert flight.motion.psi > 0.5
    flight.fly(3.0, ped=0.0)
    heading = flight.motion.psi
    flight.fly(3.0)
    assert flight.data.qpos[2] == pytest.approx(height, abs=0.1)
    assert flight.motion.psi == pytest.approx(heading, abs=0.02)


def test_level_assist_commands_tilt(vehicle):
    """Half a stick is half of 0.45 rad; let go, it is level again."""
    flight = HandFlight(vehicle, assist="level")
    flight.fly(2.0, lon=-0.5)  # forward: backward the fin would turn it round
    assert flight.motion.theta - vehicle.trim.theta == pytest.approx(-0.225, abs=0.03)
    flight.fly(2.0, lat=-0.5)
    assert flight.motion.phi - vehicle.trim.phi == pytest.approx(-0.225, abs=0.03)
    flight.fly(2.0, col=0.0)
    assert flight.motion.theta == pytest.approx(0.0, abs=0.02)


def test_without_assist_the_sticks_go_to_the_gyro(jr700):
    """What arrives at the gyro is the stick itself, behind its feel; the nose stays where it is."""
    flight = HandFlight(jr700, assist="none", feel=StickFeel(rate=0.5, expo=0.0, deadband=0.0))
    flight.fly(0.3, lat=0.4)
    np.testing.assert_allclose(flight.sticks, [0.0, 0.0, 0.1, 0.0], atol=1e-12)
    assert flight.motion.p == pytest.approx(0.1 * 5.99, rel=0.3)  # the gyro's p_per_lat
    tilt = flight.motion.phi
    flight.fly(0.5, lat=0.0)
    assert flight.motion.phi > tilt  # nothing levels it


def test_the_assist_can_be_changed_in_flight(hovering):
    """No jump of the sticks where they are in the middle; an unknown name says which there are."""
    hovering.reset()
    for name in ("level", "none", "hover"):
        hovering.assist = name
        hovering.fly(0.5, col=0.0)
        assert np.abs(hovering.sticks).max() < 0.02
    with pytest.raises(UnknownNameError, match=r"assist 'autopilot'.*hover, level, none"):
        hovering.assist = "autopilot"


def test_without_gyro_the_sticks_move_the_servos(hovering):
    """The commands are the trim's and the sticks' mixed; with the gyro again it can be flown."""
    hovering.reset()
    hovering.assist, hovering.gyro = "none", False
    hovering.fly(0.02, col=0.1)
    commanded = hovering.vehicle.swashplate.unmix(*hovering.data.ctrl[4:7])
    trim = hovering.vehicle.trim
    assert commanded == pytest.approx([0.05, trim.lon, trim.lat], abs=1e-6)
    hovering.fly(0.1, col=0.0)
    hovering.gyro, hovering.assist = True, "hover"
    hovering.fly(10.0, col=0.0)
    assert not hovering.crashed
    assert level_speed(hovering) < 0.1


def test_a_gentle_descent_lands(vehicle):
    """It stands on its gear, upright, and takes off again."""
    flight = HandFlight(vehicle)
    flight.fly(8.0, col=-0.3)
    assert not flight.crashed
    assert flight.clearance == pytest.approx(0.0, abs=0.01)
    flight.fly(2.0)
    assert level_speed(flight) < 0.02
    flight.fly(3.0, col=0.5)
    assert flight.clearance > 0.5
    assert not flight.crashed


def test_a_hard_landing_is_a_crash(jr700):
    """Bottom collective from three metres; nothing moves after it until the reset."""
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


def test_a_rotor_that_strikes_the_ground_is_a_crash(vehicle):
    """Rolled over on the spot."""
    flight = HandFlight(vehicle, assist="none")
    flight.fly(5.0, lat=1.0)
    assert flight.crashed == "the main rotor struck the ground"


def test_a_recording_is_a_flight_record(hovering, tmp_path):
    """Its time begins at 0, its sticks are those that were flown, and it comes back from a file."""
    hovering.reset()
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
    assert by_hand["switched"][-1][1:] == ["assist", "level"]
    assert by_hand["switched"][-1][0] == pytest.approx(2.0)
    assert "by hand" in record.provenance["made_by"]
    path = write_record(record, tmp_path / "hand.parquet")
    assert read_record(path).provenance == record.provenance


@pytest.mark.slow
def test_a_pedal_sweep_by_hand_is_identified(jr700):
    """A minute of pedals from 0.8 to 16 rad/s: the response of the yaw rate is coherent."""
    flight = HandFlight(jr700, height=10.0)
    flight.start_recording()
    for k in range(3000):
        flight.fly(0.02, ped=0.1 * math.sin(16.0 * math.expm1(k / 1000.0)))
    record = flight.stop_recording()
    assert not record.ended
    found = frequency_response([record], inputs=["PED"], outputs=["r"], band=(3.0, 12.0))
    assert np.median(found.coherence) > 0.9


def test_a_crash_is_in_the_record_and_the_identification_refuses_it(jr700):
    """The record is whole: it goes on to the crash."""
    flight = HandFlight(jr700, assist="none")
    flight.start_recording()
    flight.fly(5.0, lat=1.0)
    record = flight.stop_recording()
    assert record.duration == pytest.approx(flight.time, abs=0.02)
    assert "rolled or pitched beyond 1.2 rad" in record.ended
    with pytest.raises(IdentificationError, match="terminated early"):
        frequency_response([record], inputs=["LAT"], outputs=["p"], band=(3.0, 12.0))


def test_a_landing_is_in_the_record(hovering):
    """What the skids hold is no response to a stick, and the record says from when on."""
    hovering.reset()
    hovering.assist = "hover"
    hovering.start_recording()
    hovering.fly(6.0, col=-0.4)
    assert "touched the ground" in hovering.stop_recording().ended


def test_the_same_hand_flies_the_same_flight(jr700):
    """Recordings of one seed are equal to the bit, in turbulence too."""

    def flown():
        flight = HandFlight(jr700, weather=Weather(turbulence="light"), seed=3)
        flight.start_recording()
        flight.fly(1.0, lat=0.3, ped=-0.2)
        return flight.stop_recording()

    one, other = flown(), flown()
    np.testing.assert_array_equal(one.values, other.values)
    assert one.provenance == other.provenance
    assert one["phi"].std() > 0.0


def test_it_hovers_in_wind(jr700):
    """Trimmed for it, within a centimetre of where it was; in light turbulence near it."""
    for weather, near in ((Weather(wind=5.0), 0.01), (Weather(wind=5.0, turbulence="light"), 1.0)):
        flight = HandFlight(jr700, weather=weather)
        start = flight.data.qpos[:3].copy()
        flight.fly(10.0)
        assert np.linalg.norm(flight.data.qpos[:3] - start) < near
        assert not flight.crashed


def test_what_can_not_be_is_refused(hovering, jr700):
    """In one line each."""
    hovering.reset()
    with pytest.raises(InputError, match="time to fly"):
        hovering.fly(0.0)
    with pytest.raises(InputError, match="no recording runs"):
        hovering.stop_recording()
    hovering.start_recording()
    with pytest.raises(InputError, match="runs already"):
        hovering.start_recording()
    with pytest.raises(InputError, match="no record"):
        hovering.stop_recording()
    for wrong in ({"seed": -1}, {"height": 0.0}, {"assist": "yes"}):
        with pytest.raises(InputError):
            HandFlight(jr700, **wrong)


def test_a_copy_flies_on_by_itself(hovering):
    """The same sticks move it to the same place; the original stays where it is."""
    hovering.reset()
    hovering.assist = "hover"
    hovering.fly(0.5, lat=0.5)
    for again in (copy.deepcopy(hovering), pickle.loads(pickle.dumps(hovering))):
        before = hovering.data.qpos.copy()
        again.assist = "level"
        again.fly(0.5, lat=-0.5)
        np.testing.assert_array_equal(hovering.data.qpos, before)
        assert again.motion.phi < 0.0 < hovering.motion.phi
        assert repr(again) == "HandFlight('jr700', 1.00 s, assist 'level')"


class Late:
    """A yaw law that fails after half a second of flight."""

    def __call__(self, seen, state):
        if seen.time > 0.5:
            raise ValueError("too late")
        return 0.3 * (2.7 * seen.PED - 0.3 * seen.r)


def test_a_controller_of_ones_own_flies_by_hand_and_may_fail(jr700):
    """Where it fails the flight ends and the record says how; a reset starts it anew."""
    flight = HandFlight(jr700.with_controller(Controller(tail=Late())))
    flight.start_recording()
    flight.fly(0.4, ped=0.3)
    turning = flight.motion.r
    assert turning > 0.5
    again = copy.deepcopy(flight)
    flight.fly(2.0)
    assert flight.crashed == "controller 'Late' raised ValueError: too late"
    record = flight.stop_recording()
    assert "too late at 0.50 s" in record.ended
    assert 'raise ValueError("too late")' in record.provenance["ended"]["traceback"]
    flight.reset()
    flight.fly(0.4, ped=0.3)
    assert not flight.crashed
    assert flight.motion.r == turning
    again.fly(0.05)
    assert not again.crashed
