"""Flights whose sticks a script moves: what they do, what is recorded, how they end."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from helisim.base.errors import IdentificationError, InputError
from helisim.hand import HandFlight
from helisim.hand.sticks import Deflection, Joystick, Sticks, choose, read_axes
from helisim.hand.window import Cockpit, Inputs, fly_in
from helisim.ident import frequency_response
from helisim.records.storage import read_record, write_record
from helisim.sim import Weather
from helisim.vehicle import Controller, load
from off_screen import Clock


@pytest.fixture(scope="module")
def hovering(jr700):
    return HandFlight(jr700)


def level_speed(flight):
    now = flight.motion
    return math.hypot(now.u, now.v)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["jr700", "blade360"])
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


@pytest.mark.slow
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


# Keys and axes become sticks, which fly, record, crash and leave without a window.


class Window:
    """A window whose pilot presses keys by a script: (from s, to s, key)."""

    def __init__(self, flight, clock, script=(), *, axes=None, closes=1e9):
        self.clock, self.script, self.axes, self.closes = clock, script, axes, closes
        self.panels = []

    def is_running(self):
        return self.clock() < self.closes

    def read(self):
        now = self.clock()
        held = frozenset(key for start, end, key in self.script if start <= now < end)
        return Inputs(held, self.axes(now) if self.axes else None)

    def show(self, legend, readout, message):
        self.panels.append((self.clock(), legend, dict(readout), message))

    def messages(self, start=0.0, end=1e9):
        return [one[3] for one in self.panels if start < one[0] < end]


@pytest.fixture(scope="module")
def flight(jr700):
    return HandFlight(jr700, flown_with="keyboard")


@pytest.fixture
def fly(flight, tmp_path):
    def flown(script=(), *, sticks=None, seconds=1e9, assist="hover", **window):
        flight.reset()
        flight.assist = assist
        clock = Clock()
        seat = Cockpit(flight, sticks or Sticks(), tmp_path / "hand.parquet")
        seen = Window(flight, clock, script, **window)
        fly_in(seen, seat, duration=seconds, clock=clock, sleep=clock.sleep)
        return seat, seen

    return flown


def tap(at, key):
    return (at, at + 0.05, key)


@pytest.mark.slow
def test_keys_fly_and_record(fly, tmp_path):
    script = [tap(0.5, "r"), (1.0, 3.0, "up"), tap(4.0, "r"), tap(5.0, "escape")]
    seat, seen = fly(script, seconds=20.0)
    assert seat.closed
    assert seat.written == [tmp_path / "hand.parquet"]
    record = read_record(tmp_path / "hand.parquet")
    assert record.duration == pytest.approx(3.5, abs=0.1)
    assert record["north"][-1] > 1.0
    assert record["LON"].min() < -0.005
    assert record.provenance["by_hand"]["with"] == "keyboard"
    assert seen.panels[-1][0] < 6.0
    shown = [readout for at, _, readout, _ in seen.panels if 1.5 < at < 2.5]
    assert all(readout["lon"] == "-35 %" for readout in shown)
    assert all(float(readout["recorded"].split()[0]) > 0.9 for readout in shown)
    assert any("written" in text and "hand.parquet" in text for text in seen.messages())


@pytest.mark.slow
def test_every_recording_has_a_file(fly, tmp_path):
    fly([tap(0.1, "r"), tap(0.4, "r"), tap(0.6, "r")], closes=1.0)
    seat, _ = fly([tap(0.1, "r"), tap(1.0, "backspace")], seconds=1.2)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["hand.parquet", "hand_2.parquet", "hand_3.parquet"]
    assert read_record(seat.written[0]).duration == pytest.approx(0.9, abs=0.1)

    def interrupted(now):
        if now > 1.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly([tap(0.1, "r")], axes=interrupted)
    assert read_record(tmp_path / "hand_4.parquet").duration > 0.7


def test_a_crash_is_told_and_recorded_and_a_key_starts_again(fly, flight):
    script = [tap(0.1, "r"), (0.2, 6.0, "s"), tap(7.0, "backspace")]
    seat, seen = fly(script, assist="level", seconds=8.0)
    crashed = seen.messages(6.0, 6.9)
    assert all("hit the ground at" in text and "Backspace" in text for text in crashed)
    assert read_record(seat.written[0]).ended
    assert not flight.crashed
    assert flight.time == pytest.approx(1.0, abs=0.1)
    assert flight.clearance > 1.0


def test_a_key_switches_the_assist_and_too_short_a_recording_says_so(fly, flight, tmp_path):
    _, seen = fly([tap(0.1, "h"), (0.2, 0.22, "r"), (0.25, 0.27, "r")], seconds=0.5)
    assert flight.assist == "level"
    assert any("assist level" in text for text in seen.messages())
    assert "no record" in seen.messages()[-1]
    assert seen.panels[0][1][:2] == (("A D", "yaw"), ("W S", "lift"))
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_joystick_flies_and_may_be_lost(fly, flight):
    sticks = Sticks(Joystick(0, "radio"))

    def axes(now):
        return None if 2.0 < now < 3.0 else (0.0, 0.0, 0.5 if now < 2.0 else 0.0, 0.0)

    _, seen = fly([tap(4.0, "p")], sticks=sticks, axes=axes, seconds=5.0)
    assert flight.time == pytest.approx(3.0, abs=0.2)
    assert set(seen.messages(2.2, 2.8)) == {"radio is gone: plug it in, then press P"}
    assert flight.clearance > 1.8


RADIO, PAD = Joystick(0, "OpenTX Radio"), Joystick(1, "Pad", is_gamepad=True)


def held(sticks, keys, seconds, *, climbs=False, frame=0.02):
    for _ in range(round(seconds / frame)):
        found = sticks.deflection(keys, None, frame, climbs=climbs)
    return found


def test_keys_move_the_cyclic_and_let_it_centre_and_the_collective_stays():
    """0.3 s to the stop, 0.35 of the travel; 0.12 s back. What commands a climb centres."""
    keys = Sticks()
    assert held(keys, {"right"}, 0.16, frame=0.01).lat == pytest.approx(0.35 * 0.16 / 0.3)
    assert held(keys, {"right"}, 1.0).lat == 0.35
    assert held(keys, set(), 0.06).lat == pytest.approx(0.175)
    assert held(keys, set(), 0.12).lat == 0.0
    assert held(keys, {"up"}, 1.0).lon == -0.35
    assert held(keys, {"up", "down"}, 1.0).lon == 0.0
    assert held(keys, {"d", "left"}, 1.0)[2:] == (-0.35, 0.35)
    keys = Sticks()
    keys.collective = 0.2
    assert held(keys, {"w"}, 0.5).col == pytest.approx(0.2 + 0.35 * 2.0 / 2.5, abs=0.02)
    stays = held(keys, set(), 0.5).col
    assert held(keys, set(), 5.0).col == stays
    assert held(keys, {"s"}, 5.0).col == -1.0
    assert held(keys, {"w"}, 1.0, climbs=True).col == 1.0
    assert held(keys, set(), 1.0, climbs=True).col == 0.0


@pytest.mark.parametrize(
    ("mode", "left", "right"), [(1, "lon", "col"), (2, "col", "lon"), (3, "lon", "col")]
)
def test_modes_are_those_of_transmitters(mode, left, right):
    """Modes 1 and 3 have the collective on the right; 1 and 2 roll with the right thumb."""
    pad = Sticks(PAD, mode=mode)
    up = pad.deflection((), (0.0, 1.0, 1.0, 0.0), 0.1, climbs=True)
    assert getattr(up, left) == (-1.0 if left == "lon" else 1.0)  # away from the pilot: nose down
    assert (up.lat, up.ped) == ((1.0, 0.0) if mode in (1, 2) else (0.0, 1.0))
    assert getattr(pad.deflection((), (0.0, 0.0, 0.0, 1.0), 0.1, climbs=True), right) != 0.0


def test_channels_of_a_transmitter_and_a_gamepad_and_how_they_feel():
    radio = Sticks(RADIO, order="taer")
    found = radio.deflection((), (0.7, 0.51, 0.01, -1.0), 1.0, climbs=False)
    assert found == pytest.approx(Deflection(col=0.7, lat=0.7 * 0.5 + 0.3 / 8.0, lon=0.0, ped=-1.0))
    assert radio.deflection((), None, 0.1, climbs=True) is None
    with pytest.raises(InputError, match="needs 4 axes, one each stick; OpenTX Radio has 3"):
        radio.deflection((), (0.0,) * 3, 0.1, climbs=True)
    # half a second at the stop of 2.5 s from stop to stop; let go, it stays
    pad = Sticks(PAD)
    pad.collective = -0.2
    for axes in ((0.0, 1.0, 0.0, 0.0), (0.0,) * 4):
        assert pad.deflection((), axes, 0.5, climbs=False).col == pytest.approx(0.2)


def glfw(*there):
    names = {one.number: one.name for one in there}
    pads = [one.number for one in there if one.is_gamepad]
    state = SimpleNamespace(axes=(0.1, 0.2, 0.3, 0.4, -1.0, -1.0))
    return SimpleNamespace(
        JOYSTICK_1=0,
        JOYSTICK_LAST=15,
        joystick_present=names.__contains__,
        get_joystick_name=lambda n: names[n].encode(),
        joystick_is_gamepad=pads.__contains__,
        get_gamepad_state=lambda n: state if n in pads else None,
        get_joystick_axes=lambda n: ([0.5, -0.5, 9.0], 2) if n in names else ([], 0),
    )


def test_joysticks_are_found_by_number_or_name():
    assert choose(glfw(PAD), "") == PAD
    both = glfw(RADIO, PAD)
    assert choose(both, "1") == PAD
    assert choose(both, "Radio") == RADIO
    for there, wanted, said in (
        (glfw(), "", "no joystick '': there are none; .*plug one in"),
        (both, "2", "no joystick '2': there are 0 'OpenTX Radio', 1 'Pad'"),
        (both, "", "several joysticks fit"),
    ):
        with pytest.raises(InputError, match=said):
            choose(there, wanted)
    assert read_axes(both, RADIO) == (0.5, -0.5)
    assert read_axes(both, PAD) == (0.1, -0.2, 0.3, -0.4)  # up is 1
    assert read_axes(glfw(), RADIO) is None
    assert read_axes(glfw(), PAD) is None
